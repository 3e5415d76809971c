// The monotonic clock of this computer, on which the times of states are.
#pragma once

#include <cmath>
#include <cstdint>
#include <ctime>

#include "base/clock.h"

namespace fs {

inline int64_t steady_now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * int64_t{1'000'000'000} + now.tv_nsec;
}
inline double to_seconds(int64_t ns) noexcept { return 1e-9 * static_cast<double>(ns); }

inline void pause(double time) noexcept {  // s
  const double whole = std::floor(time);
  const timespec wait{static_cast<time_t>(whole), static_cast<long>(1e9 * (time - whole))};
  nanosleep(&wait, nullptr);
}

}  // namespace fs
