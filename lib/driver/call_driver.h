// Calls of a driver's functions, whatever these do.
#pragma once

#include <string>
#include <utility>

#include <forceserver/driver.h>

#include "base/error.h"

namespace fs {

// A driver may return any number. Each is a value of fs_status to C++, as the type has negative values and is 32 bits wide.
inline fs_status known_status(fs_status status) noexcept {
  const int value = static_cast<int>(status);
  return value <= FS_OK && value >= FS_ERROR_INTERNAL ? status : FS_ERROR_IO;
}

// [rt] Calls f, which calls a function of a driver. A driver that throws has an error inside.
template <class F>
fs_status call_safely(F&& f) noexcept {
  try {
    return known_status(f());
  } catch (...) {
    return FS_ERROR_IO;
  }
}

// The same; what the driver says by fs_fail goes to `sentence`, and the thread's last error stays as it was.
template <class F>
fs_status call_driver(F&& f, std::string& sentence) {
  std::string before = last_error();
  set_last_error_literal(FS_OK, "");
  fs_status status;
  try {
    status = known_status(f());
    sentence = last_error();
  } catch (Error& error) {  // of the library itself
    set_last_error(FS_OK, std::move(before));
    throw;
  } catch (...) {
    status = FS_ERROR_IO;
    sentence = "the driver has thrown a C++ exception";
  }
  set_last_error(FS_OK, std::move(before));
  return status;
}

// The same of the function with this name; a failure is thrown with the driver's sentence, or else with a general one.
template <class F>
void ask_driver(const fs_driver& driver, const char* function, F&& f) {
  std::string sentence;
  int returned = 0;  // it may be no fs_status
  const auto call = [&] {
    const fs_status status = f();
    returned = static_cast<int>(status);
    return status;
  };
  const fs_status status = call_driver(call, sentence);
  if (status == FS_OK) return;
  if (!sentence.empty()) throw Error{status, std::move(sentence)};
  fail(status, "driver '%s': %s failed with status %d and gave no reason", driver.scheme, function, returned);
}

}  // namespace fs
