// Files as a whole, and sentences about what is wrong in them.
#pragma once

#include <string>
#include <string_view>

#include <forceserver/base.h>

namespace fs {

// The bytes of a regular file. Throws NOT_FOUND, IO (a directory, a device, or what the system says).
std::string read_whole_file(const std::string& path);

// Throws an Error "where: sentence". where has the file's name, and the line or byte, of any length.
[[noreturn, gnu::format(printf, 3, 4)]]
void fail_at(fs_status status, const std::string& where, const char* format, ...);

// A piece of a file for a sentence: cut after 40 bytes, what is not printable ASCII as \xNN.
std::string printable(std::string_view text);
std::string in_quotes(std::string_view text);

}  // namespace fs
