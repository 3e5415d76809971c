// The parsed options of a "sim:" URI.
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
  bool ideal_encoder = false;         // exact pose and twist, not quantised by the encoders
  bool active_wrist = false;
  int delay_steps = 0;                // from a write to its effect, in substeps
  uint32_t seed = 0;                  // 0: no encoder offset; otherwise it seeds offsets within one count
};

// Throws INVALID, UNSUPPORTED (an option that is planned), and as HandPath::named does.
SimOptions parse_sim_options(const char* address);

}  // namespace fs
