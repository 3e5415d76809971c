// The monotonic clock of this machine.
#pragma once

#include <cstdint>
#include <ctime>

namespace fs::udp {

inline int64_t now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * int64_t{1'000'000'000} + now.tv_nsec;
}
inline double to_seconds(int64_t ns) noexcept { return 1e-9 * static_cast<double>(ns); }
inline double now() noexcept { return to_seconds(now_ns()); }  // s

}  // namespace fs::udp
