// The settings of a servo: fs_servo_options after the checks, with defaults in place of zeros.
#pragma once

#include <forceserver/servo.h>

#include "field/weight.h"
#include "servo/guard.h"
#include "servo/loop_values.h"

namespace fs {

struct ServoSettings {
  fs_servo_mode mode;
  double rate;               // Hz
  Guard::Limits limits;      // without those of the loop
  Spread spread;             // of changes
  LoopOptions loop;
  LoopValues first;          // of the loop at the start
  int priority, cpu;         // negative: ordinary priority; negative: any processor
  uint32_t protections_off;  // FS_OFF_ bits
};

ServoSettings parse_options(const fs_servo_options& options, const fs_device_info& device);  // INVALID

}  // namespace fs
