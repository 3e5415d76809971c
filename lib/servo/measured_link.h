// What a device measures of its link while a servo runs, and the delay that counts for the servo's loop.
#pragma once

#include <array>
#include <string>

#include "driver/device.h"

namespace fs {

class MeasuredLink {
 public:
  static constexpr double interval = 0.04;  // s, from one look to the next

  explicit MeasuredLink(double delay) : delay_(delay) { recent_.fill(delay); }  // s, as the device says

  // Asks the device, unless it did so less than an interval before `now` (s). False: it did not, or nothing came of it. One thread
  // at a time; not [rt]. It allocates only for a refusal.
  bool look(Device& device, double now);

  // s: the longest of the last three looks, or a little more.
  double delay() const noexcept { return delay_; }
  const fs_link& newest() const noexcept { return newest_; }  // zeros before the first
  // Why the driver's figures were refused, once for all that follow one another, and once a second at most; empty: they were not.
  const std::string& refusal() const noexcept { return refusal_; }

 private:
  double delay_;
  std::array<double, 3> recent_;  // s
  size_t looks_ = 0;
  fs_link newest_{};
  double looked_at_ = -1e300, refused_at_ = -1e300;  // s
  bool was_refused_ = false;
  std::string refusal_;
};

}  // namespace fs
