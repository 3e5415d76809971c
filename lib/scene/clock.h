// The clock of a scene: monotonic, what the caller says, or a servo's virtual time. Any thread.
#pragma once

#include <atomic>
#include <cmath>
#include <limits>

#include "base/clock.h"
#include "field/servo_output.h"
#include "field/snapshot.h"

namespace fs {

class Clock {
 public:
  Clock(const ServoOutput& output, ClockKind kind) : output_(output), kind_(kind) {}

  ClockKind kind() const noexcept { return kind_.load(std::memory_order_relaxed); }  // [rt]
  double now() const noexcept { return now(kind()); }                                // [rt] s
  double now(ClockKind kind) const noexcept {                                        // [rt] s
    if (kind == ClockKind::virtual_time) return output_.time.load(std::memory_order_acquire);
    const double told = told_.load(std::memory_order_acquire);
    return kind == ClockKind::caller && !std::isnan(told) ? told : steady_now();
  }
  void tell(double time) noexcept { told_.store(time, std::memory_order_release); }  // [rt] of kind `caller`

  // Switches to another clock; returns the new time minus the old, s.
  struct Before {
    ClockKind kind;
    double told;
  };
  double switch_to(ClockKind kind, Before& before) noexcept {
    const double time = now();
    before = {kind_.exchange(kind), told_.exchange(std::numeric_limits<double>::quiet_NaN())};
    const bool is_same = (before.kind == ClockKind::virtual_time) == (kind == ClockKind::virtual_time) && std::isnan(before.told);
    return is_same ? 0 : now() - time;
  }
  void switch_back(const Before& before) noexcept {
    kind_.store(before.kind);
    told_.store(before.told);
  }

 private:
  const ServoOutput& output_;
  std::atomic<ClockKind> kind_;
  std::atomic<double> told_{std::numeric_limits<double>::quiet_NaN()};
};

}  // namespace fs
