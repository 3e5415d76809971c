// fs_servo_options, checked and with the device's values for what was left 0.
#pragma once

#include <forceserver/servo.h>

#include "servo/guard.h"

namespace fs {

struct ServoSettings {
  fs_servo_mode mode;
  double rate;               // Hz
  Guard::Limits limits;
  double pose_age;           // s: an older pose is a lost device
  double fade;               // s; 0: none
  int priority, cpu;         // negative: ordinary; negative: any
  uint32_t protections_off;  // FS_OFF_ bits
};

ServoSettings parse_options(const fs_servo_options& options, const fs_device_info& device);  // INVALID, UNSUPPORTED

}  // namespace fs
