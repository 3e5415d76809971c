// What a servo's loop renders: worked out from what the options ask and what the device says. The device may measure its delay
// while the servo runs; then all of it follows.
#pragma once

#include <forceserver/servo.h>

#include "law/impact.h"

namespace fs {

struct LoopValues {
  double delay;            // s, for which the others hold
  double damping;          // N s/m, local: also where a remote controller applies it
  double own_damping;      // N s/m, what of it the servo applies
  double object_damping;   // N s/m, of objects together; infinite: no limit
  double max_stiffness;    // N/m, of objects together; infinite: no limit
  double model_stiffness;  // N/m, the most in a local model; 0: the device renders none
  double slew;             // N/s of the whole force; infinite: no limit
  ImpactLimit impact;      // of surfaces, at the device
  double pose_age;         // s: if the pose is older, the device counts as lost
  bool operator==(const LoopValues&) const = default;
};

// The fs_servo_options that concern the loop, after the checks.
struct LoopOptions {
  double rate = 0;           // Hz
  double delay = 0;          // s; 0: the device's
  double damping = 0;        // N s/m; 0: none
  double max_stiffness = 0;  // N/m; infinite: what the loop can render
  bool is_bounded = true;    // false: max_stiffness is none
  double slew = 0;           // N/s; 0: it follows from the stiffness; infinite: none

  // A slew limit that is given bounds the stiffness, too: a stiffer wall would shake the hand. A max_stiffness of 0: nothing damps
  // the device, so nothing can be rendered.
  LoopValues values(const fs_device_info& device) const noexcept;
};

// 3 m/s: a hand that enters the stiffest wall as fast as that is not slowed down by the slew limit.
constexpr double slew_speed = 3;

}  // namespace fs
