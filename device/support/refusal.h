// Errors inside a driver: thrown as a Refusal, and handed to the library by answer_of, which stands around each function of
// a driver's table that may fail. On the path of receive, send, read and write nothing is thrown.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include <forceserver/driver.h>

#include "base/decimal_point.h"
#include "base/shortened.h"  // for texts that a sentence quotes

namespace fs {

struct Refusal {
  fs_status status;
  std::string text;  // a sentence with field, value and bound
};

// Throws a Refusal with a printf-formatted sentence, of at most 1000 bytes.
[[noreturn, gnu::format(printf, 2, 3)]] inline void refuse(fs_status status, const char* format, ...) {
  char text[1000];
  const DecimalPoint point;
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  throw Refusal{status, text};
}

// Calls f, which may throw, and returns OK or what it threw as a status with its sentence.
template <class Function>
fs_status answer_of(Function f) noexcept {
  try {
    f();
    return FS_OK;
  } catch (const Refusal& refusal) {
    return fs_fail(refusal.status, refusal.text.c_str());
  } catch (const std::bad_alloc&) {
    return fs_fail(FS_ERROR_MEMORY, "no memory for the device");
  } catch (const std::exception& error) {
    return fs_fail(FS_ERROR_INTERNAL, error.what());
  }
}

}  // namespace fs
