// Reads and writes whole files, and throws errors that name a place in a file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <forceserver/base.h>

namespace fs {

// 64 GiB: more than the largest mesh that a shape can have.
constexpr uint64_t largest_file = uint64_t{1} << 36;

// Returns the bytes of a regular file of at most `most` bytes. Never waits for another process. Throws NOT_FOUND, IO (a
// directory, a device, a pipe, a socket, a larger file, or a system error).
std::string read_whole_file(const std::string& path, uint64_t most = largest_file);

// Writes text to a temporary file beside path, flushes it and renames it to path: even if the disk is full, either the
// old file or the complete new one is there. Throws IO.
void write_file_atomically(const std::string& path, const std::string& text);

// Throws an Error "where: sentence". `where` names the file and the line or byte, and may be of any length.
[[noreturn, gnu::format(printf, 3, 4)]]
void fail_at(fs_status status, const std::string& where, const char* format, ...);

}  // namespace fs
