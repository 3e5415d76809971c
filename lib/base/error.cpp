#include "base/error.h"

#include <cstdarg>
#include <utility>

#include "base/text.h"

namespace fs {
namespace {

// initial-exec, because the servo's path reads and writes this pointer, and creating a TLS block lazily would allocate.
thread_local const char* last_text __attribute__((tls_model("initial-exec"))) = "";
thread_local std::string last_owned;

}  // namespace

void fail(fs_status status, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  std::string text = formatted(format, arguments);
  va_end(arguments);
  throw Error{status, std::move(text)};
}

fs_status set_last_error(fs_status status, std::string&& text) noexcept {
  for (char& c : text) {  // a name that was asked for may have control characters, which spoil terminals and logs
    if (c == '\n') c = ' ';
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  last_owned = std::move(text);
  last_text = last_owned.c_str();
  return status;
}

fs_status set_last_error(fs_status status, const char* text) noexcept {
  try {
    return set_last_error(status, std::string(text));
  } catch (...) {
    return set_last_error_literal(status, "out of memory for the sentence");
  }
}

fs_status set_last_error_literal(fs_status status, const char* literal) noexcept {
  last_text = literal;
  return status;
}

const char* last_error() noexcept { return last_text; }

void fail_to_start(const char* thread, const char* why) {
  fail(FS_ERROR_IO, "%s could not be started: %s; see what is left of memory (ulimit -v) and of processes (ulimit -u)", thread,
       why);
}

}  // namespace fs
