// The monotonic clock, which never jumps.
#pragma once

#include <ctime>

namespace fs {

inline double steady_now() noexcept {  // [rt] s
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace fs
