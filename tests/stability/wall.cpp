#include "wall.h"

namespace stability {

Oscillation pushed_wall(const DeviceModel& device, double stiffness) {
  Plant plant(device, nominal, device.rate);
  plant.target = {0, 0, -0.032};
  Oscillation motion;
  const int ticks = static_cast<int>(motion.end() * device.rate);
  for (int n = 1; n <= ticks; ++n) {
    const double t = n / device.rate;
    plant.advance(t);
    plant.command({0, 0, -stiffness * std::min(0.0, plant.measured().z)});
    motion.add(t, plant.position());
  }
  return motion;
}

double critical_delay(double stiffness, double friction) {
  double low = 0, high = 0.05;
  for (int i = 0; i < 12; ++i) {
    DeviceModel device;
    device.friction = friction;
    device.delay = (low + high) / 2;
    (pushed_wall(device, stiffness).lasts() ? high : low) = device.delay;
  }
  return low;
}

}  // namespace stability
