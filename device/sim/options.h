// What stands behind "sim:", parsed.
#pragma once

#include <cstdint>

#include "device/sim/parameters.h"
#include "device/sim/path.h"

namespace fs {

struct SimOptions {
  fidel::Hand hand = fidel::nominal_hand;
  HandPath path = HandPath::hold({0, 0, 0});
  double mass = fidel::mass;          // kg, of the device
  double friction = fidel::friction;  // N
  bool ideal_encoder = false;         // exact pose and twist, instead of what joint encoders see
  bool active_wrist = false;
  int delay_steps = 0;                // from a write to its force, in substeps
  uint32_t seed = 0;                  // 0: all encoders are 0 in the middle of a count; else each elsewhere in it
};

// Throws INVALID, UNSUPPORTED (what is not built yet), and what the path's file gives.
SimOptions parse_sim_options(const char* address);

}  // namespace fs
