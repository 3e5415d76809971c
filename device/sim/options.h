// The parsed options of a "sim:" URI.
#pragma once

#include <cstdint>

#include "device/sim/parameters.h"
#include "device/sim/path.h"

namespace fs {

enum class SimLink { NONE, FORCE, MODEL };

struct SimOptions {
  fidel::Hand hand = fidel::nominal_hand;
  HandPath path = HandPath::hold({0, 0, 0});
  double mass = fidel::mass;          // kg, of the device
  double friction = fidel::friction;  // N
  bool ideal_encoder = false;         // exact pose and twist, not quantised by the encoders
  bool active_wrist = false;
  int delay_steps = 0;                // from a write to its effect, in substeps
  SimLink link = SimLink::NONE;
  int link_delay_steps = 0;           // from a pose to the force that answers it, in substeps
  int link_period_steps = 0;          // from one pose to the next, in substeps
  uint32_t seed = 0;                  // 0: no encoder offset; otherwise it seeds offsets within one count
};

// Throws a Refusal INVALID, and as HandPath::named does.
SimOptions parse_sim_options(const char* text);

}  // namespace fs
