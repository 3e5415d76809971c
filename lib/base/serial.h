// Serial numbers, from 1 on. None is used twice in a process, so they identify objects even after those are gone.
#pragma once

#include <atomic>
#include <cstdint>

namespace fs {

inline uint64_t next_serial() noexcept {
  static std::atomic<uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

}  // namespace fs
