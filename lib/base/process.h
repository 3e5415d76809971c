// Which process this is. A forked child has copies of all handles, but neither the threads nor the devices behind them.
#pragma once

#include <cstdint>
#include <mutex>

namespace fs {

// [rt] A number that is another one in a forked child.
uint32_t this_process() noexcept;

// Guards the lists of what this process has open; never for long. It is free in a forked child.
std::mutex& process_mutex() noexcept;

}  // namespace fs
