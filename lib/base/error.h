// Errors inside the library. Outside the servo's path they are thrown as Error and become an fs_status in the C
// functions; on the servo's path a function returns an fs_status with a literal sentence, and nothing is thrown.
#pragma once

#include <string>

#include <forceserver/base.h>

namespace fs {

struct Error {
  fs_status status;
  std::string text;  // a sentence with field, value and bound
};

// Throws an Error with a printf-formatted sentence.
[[noreturn, gnu::format(printf, 2, 3)]] void fail(fs_status status, const char* format, ...);
[[noreturn]] void fail_to_start(const char* thread, const char* why);

// Makes text, or a copy of it, the thread's last error; returns status. May allocate; if memory runs out, the last
// error says so.
fs_status set_last_error(fs_status status, std::string&& text) noexcept;
fs_status set_last_error(fs_status status, const char* text) noexcept;

// [rt] Makes a literal the thread's last error; returns status.
fs_status set_last_error_literal(fs_status status, const char* literal) noexcept;

const char* last_error() noexcept;

}  // namespace fs
