// The last stage before the device, which no force bypasses. It adds the local damping, lets only finite forces
// through, limits their size but not their direction, ramps the force up after a stop, limits how fast it changes, and
// makes it zero on a fault.
#pragma once

#include <cstdint>

#include <forceserver/servo.h>

#include "math/filters.h"
#include "math/pose.h"
#include "servo/blend.h"

namespace fs {

// The stiffness of a force that is shortened from `whole` to `limit`: of a small change, the part along the force is
// lost, and the part across it turns the shortened force less.
Mat3 shortened(const Mat3& stiffness, Vec3 whole, double limit) noexcept;  // [rt]

class Guard {
 public:
  struct Limits {
    double force, torque;  // N, N m
    double speed;          // m/s; infinite: none
    double ramp;           // s; 0: none
    double period;         // s, of the servo
    double damping;        // N s/m, local; 0: none; at the start
    double slew;           // N/s of the whole force; infinite: none; at the start
    uint32_t force_axes = 3, torque_axes = 3;  // the number of axes on which the device acts
    double resolution = 0;                     // m, of the positions; 0: exact
    double blend = 0;                          // s, over which another damping comes in; 0: at once
  };
  explicit Guard(const Limits& limits)
      : limits_(limits), velocity_(limits.resolution, VelocityEstimator::local_rest), damping_(limits.damping),
        slew_(limits.slew) {}

  // What a tick knows of the hand.
  struct Hand {
    const fs_state& state;
    bool is_ready;  // reading and writing succeeded, the device says READY, and the pose is not too old
    double late;    // s, of this tick
  };

  // What the device gets.
  struct GuardedForce {
    Wrench wrench;
    Mat3 stiffness;  // dF/dx, N/m, without the damping; along a force that is limited it is 0
  };

  // [rt] wanted: what the scenes give, device frame.
  GuardedForce apply(const Hand& hand, const fs_response& wanted) noexcept;

  // [rt] The loop renders others now. A lower slew limit takes a second to come, so that it does not hold back the forces of
  // objects that are stiffer until they have lower bounds, too.
  void follow(double damping, double slew) noexcept;

  // [rt] false: no force. true: the force returns through the ramp, also after a latched fault.
  void set_enabled(bool enabled) noexcept;

  uint32_t faults() const noexcept { return faults_; }      // fs_fault bits
  bool is_latched() const noexcept { return faults_ & ~static_cast<uint32_t>(FS_FAULT_DEVICE); }
  // Whether the last wrench was changed: by a limit, by a fault, or because the servo is not enabled.
  bool has_guarded() const noexcept { return guarded_; }
  // J that the device gave to the hand, less what it took: each wrench times the way until the next tick. It only
  // reports.
  double energy() const noexcept { return energy_; }

 private:
  void note_faults(const Hand& hand, const Wrench& wanted) noexcept;
  void observe(const Hand& hand, bool is_damped) noexcept;

  Limits limits_;
  bool enabled_ = true, guarded_ = false;
  uint32_t faults_ = 0;
  int late_in_a_row_ = 0;
  double ramp_ = 0;  // 0..1
  VelocityEstimator velocity_;
  Blend damping_, slew_;
  Vec3 speed_{};     // m/s, filtered
  Wrench sent_{};    // by the last tick
  Pose pose_{};      // at the last tick
  bool has_pose_ = false;
  double energy_ = 0;
};

}  // namespace fs
