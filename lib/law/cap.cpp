#include "law/cap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "law/formula.h"

namespace fs {
namespace {

// Samples of a curve that depends on time, to each side of the place where it is evaluated. Those farther away than
// the force there over the slope cannot matter.
constexpr int most_samples = 32;

// Turns the forces of a curve at `knots`, in order of distance, into those of its envelope.
void lower_knots(std::span<Knot> knots, double slope) noexcept {
  // What lies between two knots is not known where it is steep, but mostly not below the lower of the two. Both are lowered
  // to it; a knot between two steep parts counts by its own force for both.
  double before = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < knots.size(); ++i) {
    const double own = knots[i].force;
    if (i > 0 && knots[i - 1].is_steep) knots[i].force = std::fmin(own, before);
    if (i + 1 < knots.size() && knots[i].is_steep) knots[i].force = std::fmin(knots[i].force, knots[i + 1].force);
    before = own;
  }
  for (size_t i = 1; i < knots.size(); ++i) {
    const double width = knots[i].distance - knots[i - 1].distance;
    knots[i].force = std::fmin(knots[i].force, knots[i - 1].force + slope * width);
  }
  for (size_t i = knots.size(); i-- > 1;) {
    const double width = knots[i].distance - knots[i - 1].distance;
    knots[i - 1].force = std::fmin(knots[i - 1].force, knots[i].force + slope * width);
  }
}

// The envelope between its knots; the curve itself where it is below the cones of slope k above the knots, and straight
// where the curve is steep.
void cut_at_knots(Felt<double>& f, std::span<const Knot> knots, double d, double slope) noexcept {
  const auto next =
      std::upper_bound(knots.begin(), knots.end(), d, [](double wanted, const Knot& knot) { return wanted < knot.distance; });
  if (next != knots.begin()) {
    const Knot& before = next[-1];
    if (before.is_steep && next != knots.end()) {
      const double secant = (next->force - before.force) / (next->distance - before.distance);
      return cut(f, true, before.force + secant * (d - before.distance), secant);
    }
    cut(f, true, before.force + slope * (d - before.distance), slope);
  }
  if (next != knots.end()) cut(f, true, next->force + slope * (next->distance - d), -slope);
}

// As above, for a curve that depends on time. All of it counts as steep.
void cut_now(Felt<double>& f, const ScaledCurve& p, Curve::Parser* parser, double d, double t, const Cap& cap) noexcept {
  const double first = std::floor(d / cap.spacing);
  if (!(first < 1e15)) return;  // so far away that multiples of the spacing are rounded
  std::array<Knot, 2 * most_samples + 2> samples;
  size_t count = 0;
  const double aside = std::fmin(std::ceil(f.force / (cap.slope * cap.spacing)), most_samples);
  for (double i = std::fmax(first - aside, 0); i <= first + aside + 1; ++i) {
    const double s = i * cap.spacing;
    samples[count++] = {s, std::fmin(p.gain * p.curve->force(parser, s, t), p.limit), true};
  }
  const std::span<Knot> knots(samples.data(), count);
  lower_knots(knots, cap.slope);
  cut_at_knots(f, knots, d, cap.slope);
}

}  // namespace

void Cap::follow(const ScaledCurve& p, double reach) {
  std::vector<Knot> found = p.curve->knots(slope / p.gain, reach);
  if (found.empty()) return;
  if (p.curve->is_timed()) {
    double most = 0;
    for (double d = 1e-6; d < 100; d *= 1.2) most = std::fmax(most, p.gain * p.curve->greatest_force(d));
    for (const Knot& knot : found) most = std::fmax(most, p.gain * knot.force);
    spacing = std::fmin(most, p.limit) / slope / most_samples;
    return;
  }
  for (Knot& knot : found) knot.force *= p.gain;
  lower_knots(found, slope);
  knots = std::move(found);
}

Intensity Cap::lower(const ScaledCurve& p, Curve::Parser* parser, double d, double t, Intensity raw,
                     double radius) const noexcept {
  if (!(raw.force > 0)) return {};
  Felt<double> f{raw.force, raw.slope, true};
  const double gap = std::fmax(0, d - radius);
  if (spacing > 0) {
    cut_now(f, p, parser, gap, t, *this);
  } else if (!knots.empty()) {
    cut_at_knots(f, knots, gap, slope);
  }
  cut_at_bend(f, true, gap, bend, bend_force, bend_slope);
  cut_at_rise(f, true, gap, rise, slope);
  cut_at_fall(f, true, gap, fall, slope);
  if (d < radius) {  // the object is in the ball: f(0), but not steeper than allowed beside that of a ball which just touches
    const double most = f.force + slope * (radius - d);
    f = {raw.force, 0, true};
    cut(f, true, most, -slope);
  }
  cut_at_rise(f, true, d, std::fmin(across + slope * radius, across_raw), slope);
  if (!(f.force > 0)) return {};
  return {f.force, std::clamp(f.slope, -slope, slope)};
}

}  // namespace fs
