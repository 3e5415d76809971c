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

// How far something goes to and fro along any axis: the smaller of its longest way up and its longest way down, so that a slow
// slide to a place of rest counts as nothing.
class Swing {
 public:
  void add(fs_vec3 x) {
    const double coordinates[] = {x.x, x.y, x.z};
    for (int i = 0; i < 3; ++i) axes_[i].add(coordinates[i]);
  }
  double length() const {
    double out = 0;
    for (const Axis& axis : axes_) out = std::max(out, std::min(axis.up, axis.down));
    return out;
  }

 private:
  struct Axis {
    double low = 1e300, high = -1e300, up = 0, down = 0;
    void add(double x) {
      low = std::min(low, x), high = std::max(high, x);
      up = std::max(up, x - low), down = std::max(down, high - x);
    }
  };
  Axis axes_[3];
};

// Whether a hand whose target stands still goes on moving to and fro: by more than 0.1 mm in the late second, and by more than
// 0.7 of that in the early one.
class Oscillation {
 public:
  explicit Oscillation(double early = 2.5, double late = 7, double width = 1) : early_(early), late_(late), width_(width) {}

  void add(double time, fs_vec3 x, fs_vec3 rotation = {}) {
    if (time >= early_ && time < early_ + width_) at_early_.add(x), turn_early_.add(rotation);
    if (time >= late_ && time < late_ + width_) add_late(x, rotation);
  }
  double end() const { return late_ + width_; }
  double late() const { return at_late_.length(); }            // m
  double late_turn() const { return turn_late_.length(); }     // rad
  bool moves() const { return span_late_.length() > 1e-4 || span_turn_late_.length() > 2e-3; }  // to and fro, or slowly on its way
  bool lasts() const {
    return (late() > 1e-4 && late() > 0.7 * at_early_.length()) ||
           (late_turn() > 2e-3 && late_turn() > 0.7 * turn_early_.length());
  }

 private:
  void add_late(fs_vec3 x, fs_vec3 rotation) {
    at_late_.add(x), turn_late_.add(rotation);
    span_late_.add(x), span_turn_late_.add(rotation);
  }

  double early_, late_, width_;
  Swing at_early_, at_late_, turn_early_, turn_late_;
  Span span_late_, span_turn_late_;
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
