// Tells a process from its forked child. The child has copies of all handles, but not their threads and devices.
#pragma once

#include <cstdint>
#include <mutex>

namespace fs {

// [rt] A number that differs in a forked child.
uint32_t this_process() noexcept;

// Guards the lists of what this process has open. It is locked only briefly, and is never locked in a new forked child.
std::mutex& process_mutex() noexcept;

}  // namespace fs
