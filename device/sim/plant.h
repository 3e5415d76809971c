// One mass on a spring and a damper, m x'' + b x' + k x = u: an axis of the handle, or of its wrist.
#pragma once

namespace fs {

struct AxisState {
  double x = 0, v = 0;
};

class Axis {
 public:
  // m > 0, b >= 0, k >= 0 in SI; friction: N, Coulomb, which can hold below stick_speed (m/s); step: s.
  Axis(double m, double b, double k, double friction, double stick_speed, double step);

  // [rt] One step with u (N) held: exact, the friction held over the step too. It ends at rest where friction stops it.
  AxisState advance(AxisState state, double u) const noexcept;

 private:
  double stiffness_, friction_, stick_speed_;
  double xx_, xv_, xu_, vx_, vv_, vu_;  // the step: x = xx x + xv v + xu u, v = vx x + vv v + vu u
};

}  // namespace fs
