#include "boundary.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

namespace stability {

namespace {

using Complex = std::complex<double>;

// The loop as seen at the ticks: from a command to the position (P), and from the position to its filtered velocity (D).
class Sampled {
 public:
  explicit Sampled(const LinearLoop& loop) : loop_(loop) {
    const double periods = loop.delay / loop.period;
    whole_ = std::floor(periods + 1e-9);
    const double late = std::max(0.0, periods - whole_) * loop.period;  // the old command acts for this time, then the new
    const auto of = [&](double t) { return transition(loop.mass, loop.damping, loop.stiffness, t); };
    a_ = of(loop.period);
    const Transition rest = of(loop.period - late), first = of(late);
    new_x_ = rest.xu, new_v_ = rest.vu;
    old_x_ = rest.xx * first.xu + rest.xv * first.vu;
    old_v_ = rest.vx * first.xu + rest.vv * first.vu;
    gain_ = loop.cutoff > 0 ? 1 - std::exp(-2 * std::numbers::pi * loop.cutoff * loop.period) : 1;
  }

  Complex position(double theta) const {
    const Complex z = std::polar(1.0, theta), back = 1.0 / z;
    const Complex delay = std::polar(1.0, -theta * whole_);
    const Complex in_x = delay * (new_x_ + old_x_ * back), in_v = delay * (new_v_ + old_v_ * back);
    return ((z - a_.vv) * in_x + a_.xv * in_v) / ((z - a_.xx) * (z - a_.vv) - a_.xv * a_.vx);
  }
  Complex velocity(double theta) const {
    const Complex back = std::polar(1.0, -theta);
    return gain_ / (1.0 - (1 - gain_) * back) * (1.0 - back) / loop_.period;
  }

 private:
  LinearLoop loop_;
  Transition a_;
  double whole_, new_x_, new_v_, old_x_, old_v_, gain_;
};

// The smallest positive real part of f(theta) where its imaginary part is 0, over 0 < theta <= pi; infinity: none.
template <class F>
double smallest_crossing(F&& f, double* where) {
  const double last = std::numbers::pi;
  double smallest = std::numeric_limits<double>::infinity();
  const auto take = [&](double theta, double value) {
    if (!(value > 0 && value < smallest)) return;
    smallest = value;
    if (where) *where = theta;
  };
  double low = 1e-5;
  Complex at_low = f(low);
  while (low < last) {
    const double high = std::min({last, low * 1.002, low + last / 4000});
    const Complex at_high = f(high);
    if (std::imag(at_low) * std::imag(at_high) < 0) {  // also at a pole, but there the value is huge
      double a = low, b = high;
      for (int i = 0; i < 60; ++i) {
        const double middle = (a + b) / 2;
        (std::imag(f(middle)) * std::imag(at_low) > 0 ? a : b) = middle;
      }
      take(a, std::real(f(a)));
    }
    low = high;
    at_low = at_high;
  }
  take(last, std::real(at_low));
  return smallest;
}

}  // namespace

LinearLoop linear_loop(const DeviceModel& device, const HandModel& hand) {
  return {device.mass + hand.mass, device.damping + hand.damping, hand.stiffness, 1 / device.rate, device.delay};
}

double critical_stiffness(const LinearLoop& loop, double* angular) {
  const Sampled sampled(loop);
  const double b = loop.rendered_damping;
  if (b > 0) {  // is the damper alone stable?
    const auto damping = [&](double theta) { return -1.0 / (sampled.position(theta) * sampled.velocity(theta)); };
    if (b >= smallest_crossing(damping, nullptr)) return 0;
  }
  double theta = 0;
  const auto stiffness = [&](double theta) { return -1.0 / sampled.position(theta) - b * sampled.velocity(theta); };
  const double k = smallest_crossing(stiffness, &theta);
  if (angular) *angular = theta / loop.period;
  return k;
}

Budget budget(const DeviceModel& device) {
  const double period = 1 / device.rate, lag = period / 2 + device.delay;
  const double mass = device.mass > 0 ? device.mass : 0.05;
  const double damping = std::min(5.0, 0.7 * mass / lag);
  LinearLoop loop{mass, device.damping, 0, period, device.delay, damping, 100};
  return {damping, std::min((device.damping + damping) / 2 / lag, critical_stiffness(loop) / 2)};
}

}  // namespace stability
