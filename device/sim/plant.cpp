#include "device/sim/plant.h"

#include <cmath>

#include "math/vec3.h"

namespace fs {
namespace {

// e^m by scaling and squaring. For a norm of 1/4 the Taylor series is cut off below 1e-20.
Mat3 exponential(const Mat3& m) {
  const double size = std::fabs(m.xx) + std::fabs(m.xy) + std::fabs(m.xz) + std::fabs(m.yx) + std::fabs(m.yy) + std::fabs(m.yz) +
                      std::fabs(m.zx) + std::fabs(m.zy) + std::fabs(m.zz);
  int halvings = 0;
  while (std::ldexp(size, -halvings) > 0.25) ++halvings;
  const Mat3 small = std::ldexp(1, -halvings) * m;
  Mat3 term = identity(), sum = identity();
  for (int i = 1; i <= 14; ++i) {
    term = (1.0 / i) * (term * small);
    sum += term;
  }
  for (int i = 0; i < halvings; ++i) sum = sum * sum;
  return sum;
}

}  // namespace

Axis::Axis(double m, double b, double k, double friction, double stick_speed, double step)
    : stiffness_(k), friction_(friction), stick_speed_(stick_speed) {
  // (x, v, u)' = M (x, v, u) with u constant. The exponential of M step gives the coefficients of a step.
  const Mat3 e = exponential(step * Mat3{0, 1, 0, -k / m, -b / m, 1 / m, 0, 0, 0});
  xx_ = e.xx, xv_ = e.xy, xu_ = e.xz;
  vx_ = e.yx, vv_ = e.yy, vu_ = e.yz;
}

AxisState Axis::advance(AxisState s, double u) const noexcept {
  const double load = u - stiffness_ * s.x;  // the force that friction must balance to stop the axis
  const bool can_hold = std::fabs(load) <= friction_;
  if (friction_ > 0 && std::fabs(s.v) < stick_speed_) {
    if (can_hold) return {s.x, 0};
    u -= std::copysign(friction_, load);
  } else if (friction_ > 0) {
    u -= std::copysign(friction_, s.v);
  }
  AxisState next{xx_ * s.x + xv_ * s.v + xu_ * u, vx_ * s.x + vv_ * s.v + vu_ * u};
  if (friction_ > 0 && can_hold && next.v * s.v < 0) next.v = 0;
  return next;
}

}  // namespace fs
