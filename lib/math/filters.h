// Small filters for the servo loop. They do not allocate.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/pose.h"

namespace fs {

// Tells motion from the steps of an encoder, by the farthest that the hand has lately been from where it is on average: up to
// two steps it may be at rest, from three on it moves. Three encoders that step to and fro together stay within two.
class StepGate {
 public:
  explicit StepGate(double step) : step_(step) {}  // m or rad; 0: exact, so that all is motion

  // 0: it may be at rest; 1: it moves. way: m or rad, since the last call, dt s ago.
  double open(Vec3 way, double dt) noexcept {
    if (!(step_ > 0)) return 1;
    const double kept = std::exp(-dt / memory);
    from_average_ = kept * (from_average_ + way);
    farthest_ = std::fmax(norm(from_average_), kept * farthest_);
    return std::clamp(farthest_ / step_ - 2, 0.0, 1.0);
  }

  void reset() noexcept { *this = StepGate(step_); }

 private:
  static constexpr double memory = 0.05;  // s
  double step_, farthest_ = 0;
  Vec3 from_average_{};
};

// Estimates the twist of a device that reports only poses: a backward difference, then a first-order low-pass. A cutoff
// of 100 Hz lowers the force noise of a 20 um encoder at 20 N s/m from .172 to .066 N rms.
//
// Of each step of an encoder, damping makes a force of 2 pi cutoff * damping * step, and that shakes a hand that would rest. So
// the estimate is 0, or the part `rest`, as long as the motion may be nothing but such steps. It is made smaller then, but never turned or delayed:
// damping takes less energy from the hand, and gives it none. From 1.2 mm/s on, with steps of 20 um, it is whole.
class VelocityEstimator {
 public:
  static constexpr double usual_cutoff = 100;  // Hz
  // The part of the local damping that stays at rest: without any, a stiff wall would shake the handle by some steps.
  static constexpr double local_rest = 0.4;
  // resolution: m, of the positions; 0: exact. A device does not tell that of the orientations: they are taken to be as fine, at
  // 50 mm from the handle's origin. rest: the part of the estimate that is left at rest. cutoff: Hz.
  explicit VelocityEstimator(double resolution, double rest = 0, double cutoff = usual_cutoff)
      : cutoff_(cutoff), rest_(rest), moves_(resolution), turns_(resolution / 0.05) {}

  Twist update(const Pose& pose, double time) noexcept {
    const double dt = time - time_;
    if (!started_ || !(dt >= 0 && dt < 0.1)) {  // the first pose, or the first after a gap, counts as at rest
      twist_ = out_ = {};
      moves_.reset();
      turns_.reset();
    } else if (dt > 1e-6) {
      const double gain = 1 - std::exp(-2 * std::numbers::pi * cutoff_ * dt);
      const Vec3 way = pose.position - pose_.position;
      const Vec3 turn = log_rotation(pose.orientation * conjugate(pose_.orientation));
      twist_.linear += gain * ((1 / dt) * way - twist_.linear);
      twist_.angular += gain * ((1 / dt) * turn - twist_.angular);
      out_.linear = (rest_ + (1 - rest_) * moves_.open(way, dt)) * twist_.linear;
      out_.angular = (rest_ + (1 - rest_) * turns_.open(turn, dt)) * twist_.angular;
    } else {
      return out_;  // the same sample again
    }
    pose_ = pose;
    time_ = time;
    started_ = true;
    return out_;
  }

  void reset() noexcept { started_ = false; }

 private:
  double cutoff_, rest_;
  StepGate moves_, turns_;
  bool started_ = false;
  double time_ = 0;
  Pose pose_ = identity_pose();
  Twist twist_{}, out_{};
};

}  // namespace fs
