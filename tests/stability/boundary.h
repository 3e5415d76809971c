// The exact boundary of stability of a sampled loop: a spring of stiffness K and a damper B are rendered on a mass m with
// damping b and a spring k, with period T and delay td.
#pragma once

#include "plant/plant.h"

namespace stability {

struct LinearLoop {
  double mass, damping, stiffness;  // kg, N s/m, N/m: of device and hand together
  double period, delay;             // s
  double rendered_damping = 0;      // N s/m, B, from the difference of two positions,
  double cutoff = 0;                // Hz, low-passed; 0: not
};

LinearLoop linear_loop(const DeviceModel& device, const HandModel& hand);

// The stiffness (N/m) at which an eigenvalue of the loop reaches the unit circle; 0 when it is unstable already without
// stiffness. angular: if not null, becomes the frequency there, rad/s.
double critical_stiffness(const LinearLoop& loop, double* angular = nullptr);

// What a servo should render by default (facts 5.3 and 7): the damping, and the bound of the stiffness.
struct Budget {
  double damping, stiffness;  // N s/m, N/m
};
Budget budget(const DeviceModel& device);

}  // namespace stability
