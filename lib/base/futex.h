// Waits, up to a deadline, until another thread changes a number; std::atomic has no such wait. [rt]
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <climits>
#include <cstdint>

#include "base/clock.h"

namespace fs {

// Returns once the number is another one than `present`, at the deadline (s, monotonic clock), or sooner: look again.
inline void wait_for_change(const std::atomic<uint32_t>& number, uint32_t present, double deadline) noexcept {
  const timespec until = to_timespec(deadline);
  syscall(SYS_futex, &number, FUTEX_WAIT_BITSET_PRIVATE, present, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
}

inline void wake_waiters(std::atomic<uint32_t>& number) noexcept {  // after it has changed
  syscall(SYS_futex, &number, FUTEX_WAKE_PRIVATE, INT_MAX, nullptr, nullptr, 0);
}

}  // namespace fs
