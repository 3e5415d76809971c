// Tells a process from its forked child, which has copies of all handles, but not their threads and devices; and tells threads
// from one another.
#pragma once

#include <cstdint>
#include <mutex>

namespace fs {

// [rt] A number that differs in a forked child.
uint32_t this_process() noexcept;

// [rt] A number that no other thread of this process has, or ever had.
uint64_t this_thread() noexcept;

// Guards the lists of what this process has open. It is locked only briefly, and is never locked in a new forked child.
std::mutex& process_mutex() noexcept;

}  // namespace fs
