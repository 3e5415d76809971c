// The limit of a servo's sampled loop: what it can render without shaking a device that nobody holds. The hand only helps, so it
// is left out.
#pragma once

#include <limits>

namespace fs {

// A device in its loop: a mass with viscous damping. Its position is sampled once a period; the force that answers it
// begins `delay` later and is held for a period.
struct Loop {
  double mass;     // kg
  double damping;  // N s/m, physical
  double period;   // s
  double delay;    // s
};

// The smallest stiffness at which this loop begins to shake, N/m: exact for the linear loop, whose local damping is
// that of the guard. Infinite if there is none below `most`.
double critical_stiffness(const Loop& loop, double local_damping, double most = std::numeric_limits<double>::infinity()) noexcept;

struct LoopLimit {
  double damping;         // N s/m, local: as wanted, or less where the loop cannot render that
  double object_damping;  // N s/m, what the damping of objects and contacts may add to it
  double max_stiffness;   // N/m, of all that is felt together
};
LoopLimit limit_of(const Loop& loop, double wanted_damping) noexcept;

// The largest stiffness of a local model (driver.h), N/m, for a link with this delay (s) and this time from one model
// to the next (s). damping: N s/m, of the device and of its controller.
double model_stiffness(double delay, double period, double damping) noexcept;

}  // namespace fs
