// Numbers that never come twice in a process, for what must be told apart also after it is gone. From 1 on.
#pragma once

#include <atomic>
#include <cstdint>

namespace fs {

inline uint64_t next_serial() noexcept {
  static std::atomic<uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

}  // namespace fs
