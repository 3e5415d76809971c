// Shared memory: a memory file that one process makes and seals, so that nobody can change its size, and hands to another
// as a descriptor.
#pragma once

#include <cstddef>
#include <memory>

#include "base/descriptor.h"

namespace fs {

// The end of a sentence that says with which errno a memory file was not made: what may be the cause, or "".
const char* memory_file_hint(int error) noexcept;

// A memory file of so many bytes, all 0, that nobody can make longer or shorter. IO, FULL.
Descriptor make_region(const char* label, size_t bytes);
// Makes the seals final. against_writing: from now on only what is mapped already can write to it. IO.
void seal_region(const Descriptor& region, bool against_writing);
// Maps the whole of it into this process, as long as the pointer lives. Checks its size, and that nobody can make it
// shorter, which would raise SIGBUS. IO, INVALID.
std::shared_ptr<void> map_region(const Descriptor& region, size_t bytes, bool may_write);

}  // namespace fs
