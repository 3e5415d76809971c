// Files as a whole, and sentences about what is wrong in them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <forceserver/base.h>

namespace fs {

// 64 GiB: more than a mesh of as many triangles as a shape can have.
constexpr uint64_t largest_file = uint64_t{1} << 36;

// The bytes of a regular file of `most` bytes at most. Never waits for another process. Throws NOT_FOUND, IO (a
// directory, a device, a pipe, a socket, a larger file, or what the system says).
std::string read_whole_file(const std::string& path, uint64_t most = largest_file);

// Writes all of text to path through a temporary file beside it, flushed and renamed: either the new file or the old
// one is there, also when the disk is full. Throws IO.
void write_file_atomically(const std::string& path, const std::string& text);

// Throws an Error "where: sentence". where has the file's name, and the line or byte, of any length.
[[noreturn, gnu::format(printf, 3, 4)]]
void fail_at(fs_status status, const std::string& where, const char* format, ...);

}  // namespace fs
