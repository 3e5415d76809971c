// One mass on a spring and a damper, m x'' + b x' + k x = u: an axis of the handle, or of its wrist.
#pragma once

namespace fs {

struct AxisState {
  double x = 0, v = 0;
};

class Axis {
 public:
  // m > 0, b >= 0, k >= 0 in SI units; friction: Coulomb, N; it can stop the axis below stick_speed (m/s); step: s.
  Axis(double m, double b, double k, double friction, double stick_speed, double step);

  // [rt] One exact step with u (N) and the friction constant over the step. Where friction stops the axis, the step
  // ends at rest.
  AxisState advance(AxisState state, double u) const noexcept;

 private:
  double stiffness_, friction_, stick_speed_;
  double xx_, xv_, xu_, vx_, vv_, vu_;  // a step is x = xx x + xv v + xu u, v = vx x + vv v + vu u
};

}  // namespace fs
