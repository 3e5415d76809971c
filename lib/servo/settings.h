// The settings of a servo: fs_servo_options after the checks, with defaults in place of zeros.
#pragma once

#include <forceserver/servo.h>

#include "budget/loop.h"
#include "field/weight.h"
#include "servo/guard.h"

namespace fs {

constexpr double assumed_mass = 0.05;  // kg, of a device that does not tell its own: as light as any

struct ServoSettings {
  fs_servo_mode mode;
  double rate;               // Hz
  Guard::Limits limits;
  double pose_age;           // s: if the pose is older, the device counts as lost
  Spread spread;             // of changes
  LoopLimit loop;            // max_stiffness and object_damping infinite: none; damping: also where a remote
                             // controller applies it
  double model_stiffness;    // N/m, the most in a local model; 0: the device renders none
  int priority, cpu;         // negative: ordinary priority; negative: any processor
  uint32_t protections_off;  // FS_OFF_ bits
};

ServoSettings parse_options(const fs_servo_options& options, const fs_device_info& device);  // INVALID, UNSUPPORTED

}  // namespace fs
