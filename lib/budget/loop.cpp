#include "budget/loop.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <numbers>

#include "math/filters.h"

namespace fs {
namespace {

using Complex = std::complex<double>;
constexpr double infinite = std::numeric_limits<double>::infinity();

// What a time h does to a mass with viscous damping: x += speed_to_x * v + force_to_x * f,
// v += force_to_v * f - lost * v.
struct MassMotion {
  double speed_to_x, lost, force_to_x, force_to_v;
};

MassMotion motion_of_mass(const Loop& loop, double h) noexcept {
  const double a = loop.damping * h / loop.mass, lost = -std::expm1(-a);
  const bool is_small = a < 1e-3;  // the series avoid cancellation; they are exact to 1e-11
  const double first = is_small ? 1 - a / 2 + a * a / 6 - a * a * a / 24 : lost / a;
  const double second = is_small ? 0.5 - a / 6 + a * a / 24 - a * a * a / 120 : (1 - first) / a;
  return {h * first, lost, h * h * second / loop.mass, h * first / loop.mass};
}

// The sampled loop as a function of frequency: theta is the angle per period, and z = exp(i theta).
class Response {
 public:
  explicit Response(const Loop& loop)
      : period_(loop.period), whole_(motion_of_mass(loop, loop.period)),
        gain_(-std::expm1(-2 * std::numbers::pi * VelocityEstimator::usual_cutoff * loop.period)) {
    const double periods = loop.delay / loop.period;
    delay_ = std::floor(periods + 1e-9);
    // Of each period, the older force acts during the first part, the newer one during the rest.
    const double part = std::max(0.0, periods - delay_) * loop.period;
    const MassMotion first = motion_of_mass(loop, part), rest = motion_of_mass(loop, loop.period - part);
    newer_[0] = rest.force_to_x;
    newer_[1] = rest.force_to_v;
    older_[0] = first.force_to_x + rest.speed_to_x * first.force_to_v;
    older_[1] = (1 - rest.lost) * first.force_to_v;
  }

  // Force per displacement: the inverse of how far the device moves per force.
  Complex force(double theta) const noexcept {
    const Complex back = std::polar(1.0, -theta), step = difference(theta);
    const Complex x = newer_[0] + older_[0] * back, v = newer_[1] + older_[1] * back;
    return step * (step + whole_.lost) / (x * (step + whole_.lost) + whole_.speed_to_x * v) * std::polar(1.0, theta * delay_);
  }
  // Filtered velocity per displacement: VelocityEstimator.
  Complex velocity(double theta) const noexcept {
    const Complex back = std::polar(1.0, -theta);
    return gain_ / period_ * back * difference(theta) / (1.0 - (1 - gain_) * back);
  }

 private:
  static Complex difference(double theta) noexcept {  // z - 1, without cancellation
    return Complex(0, 2 * std::sin(theta / 2)) * std::polar(1.0, theta / 2);
  }

  double period_, delay_;
  MassMotion whole_;
  double gain_, newer_[2], older_[2];
};

}  // namespace

// At the boundary of stability z lies on the unit circle, where the loop's equation gives the stiffness as a function
// of the frequency. The boundary is where that is real and positive.
double critical_stiffness(const Loop& loop, double local_damping, double most) noexcept {
  const Response response(loop);
  const auto stiffness = [&](double theta) { return -response.force(theta) - local_damping * response.velocity(theta); };
  const double step = std::min(2e-3, 0.02 / (loop.delay / loop.period + 1));
  double best = infinite, theta = step * 1e-3;
  for (Complex here = stiffness(theta); theta < std::numbers::pi;) {
    const double next = std::min(theta + step, std::numbers::pi);
    const Complex there = stiffness(next);
    if ((here.imag() < 0) != (there.imag() < 0)) {
      double low = theta, high = next;
      for (int i = 0; i < 50; ++i) {
        const double middle = (low + high) / 2;
        ((stiffness(middle).imag() < 0) == (here.imag() < 0) ? low : high) = middle;
      }
      const double found = stiffness(low).real();
      if (found > 0) best = std::min(best, found);
    }
    theta = next;
    here = there;
    // The force of the mass grows faster with the frequency than that of the damping: no lower boundary is left.
    const double bound = std::min(best, most) + local_damping * std::abs(response.velocity(theta));
    if (std::abs(response.force(theta)) > bound) return best < most ? best : infinite;
  }
  const double last = stiffness(std::numbers::pi).real();  // the loop swings from sample to sample
  if (last > 0) best = std::min(best, last);
  return best < most ? best : infinite;
}

LoopLimit limit_of(const Loop& loop, double wanted_damping) noexcept {
  const double lag = loop.period / 2 + loop.delay;
  assert(lag > 0 && loop.mass >= 0 && wanted_damping >= 0);
  const double renderable = 0.7 * loop.mass / lag;  // N s/m: more damping, local or of objects, shakes a light device
  LoopLimit out{};
  out.damping = std::min(wanted_damping, renderable);
  out.object_damping = renderable - out.damping;
  const double passive = (loop.damping + out.damping) / 2 / lag;
  out.max_stiffness = passive;
  for (const double damping : {out.damping, renderable}) {  // in between the critical stiffness is higher
    const double critical = critical_stiffness(loop, damping, 2 * out.max_stiffness);
    out.max_stiffness = std::min(out.max_stiffness, critical / 2);
  }
  return out;
}

// Measured on the simulator for delays of 2 to 50 ms and 20 to 500 models a second (tests/device/test_link.cpp): walls,
// points that pull with a limited force, and corners shake a light hand or a released device from a stiffness of
// 5 damping/(delay + period) on. Half of that is allowed.
double model_stiffness(double delay, double period, double damping) noexcept { return 2.5 * damping / (delay + period); }

}  // namespace fs
