// The monotonic clock, which never jumps.
#pragma once

#include <cerrno>
#include <cmath>
#include <ctime>

namespace fs {

inline double steady_now() noexcept {  // [rt] s
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

inline timespec to_timespec(double time) noexcept {  // [rt] s, at least 0
  const double whole = std::floor(time);
  return {static_cast<time_t>(whole), static_cast<long>((time - whole) * 1e9)};
}

// [rt] Lets threads of any priority run meanwhile.
inline void sleep_until(double time) noexcept {  // s
  const timespec until = to_timespec(time);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace fs
