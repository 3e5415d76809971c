// What is measured of a motion.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "scenes/vector.h"

namespace stability {

// The box around positions; its longest side is the amplitude peak to peak.
class Span {
 public:
  void add(fs_vec3 x) {
    low_ = {std::min(low_.x, x.x), std::min(low_.y, x.y), std::min(low_.z, x.z)};
    high_ = {std::max(high_.x, x.x), std::max(high_.y, x.y), std::max(high_.z, x.z)};
  }
  double length() const {
    return std::max({0.0, high_.x - low_.x, high_.y - low_.y, high_.z - low_.z});
  }

 private:
  fs_vec3 low_{1e300, 1e300, 1e300}, high_{-1e300, -1e300, -1e300};
};

// Whether a hand whose target stands still goes on moving: peak to peak more than 0.1 mm in the late second, and more than
// 0.7 of that in the early one.
class Oscillation {
 public:
  explicit Oscillation(double early = 2.5, double late = 7, double width = 1) : early_(early), late_(late), width_(width) {}

  void add(double time, fs_vec3 x, fs_vec3 rotation = {}) {
    if (time >= early_ && time < early_ + width_) at_early_.add(x), turn_early_.add(rotation);
    if (time >= late_ && time < late_ + width_) at_late_.add(x), turn_late_.add(rotation);
  }
  double end() const { return late_ + width_; }
  double late() const { return at_late_.length(); }            // m
  double late_turn() const { return turn_late_.length(); }     // rad
  bool lasts() const {
    return (late() > 1e-4 && late() > 0.7 * at_early_.length()) ||
           (late_turn() > 2e-3 && late_turn() > 0.7 * turn_early_.length());
  }

 private:
  double early_, late_, width_;
  Span at_early_, at_late_, turn_early_, turn_late_;
};

// The root of the mean square.
class Rms {
 public:
  void add(double value) { sum_ += value * value, ++count_; }
  void add(fs_vec3 v) { sum_ += scenes::dot(v, v), ++count_; }
  double value() const { return count_ ? std::sqrt(sum_ / count_) : 0; }

 private:
  double sum_ = 0;
  double count_ = 0;
};

}  // namespace stability
