// A number of the tick that goes to a new value in even steps, one a tick.
#pragma once

#include <algorithm>
#include <cmath>

namespace fs {

class Blend {
 public:
  explicit Blend(double value) : value_(value), target_(value) {}

  // [rt] ticks: in which it gets there; below 1: at once.
  void go_to(double target, double ticks) noexcept {
    target_ = target;
    step_ = std::fabs(target - value_) / ticks;
    if (ticks < 1 || !std::isfinite(step_)) value_ = target;
  }
  double next() noexcept {  // [rt] once a tick
    if (value_ != target_) value_ = value_ < target_ ? std::min(target_, value_ + step_) : std::max(target_, value_ - step_);
    return value_;
  }

 private:
  double value_, target_, step_ = 0;
};

}  // namespace fs
