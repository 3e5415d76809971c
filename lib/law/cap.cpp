#include "law/cap.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "law/profile.h"

namespace fs {
namespace {

// Samples of a curve that depends on time, to each side of the place where it is evaluated. Those farther away than
// the force there over the slope cannot matter.
constexpr int most_samples = 32;

void cut(Intensity& f, double force, double slope) noexcept {
  if (force < f.force) f = {force, slope};
}

// The envelope between its knots; the curve itself where it is below the cones of slope k above the knots, and straight
// where the curve is steep.
void cut(Intensity& f, std::span<const Knot> knots, double d, double slope) noexcept {
  const auto next = std::upper_bound(knots.begin(), knots.end(), d,
                                     [](double wanted, const Knot& knot) { return wanted < knot.distance; });
  if (next != knots.begin()) {
    const Knot& before = next[-1];
    if (before.is_steep && next != knots.end()) {
      const double secant = (next->force - before.force) / (next->distance - before.distance);
      return cut(f, before.force + secant * (d - before.distance), secant);
    }
    cut(f, before.force + slope * (d - before.distance), slope);
  }
  if (next != knots.end()) cut(f, next->force + slope * (next->distance - d), -slope);
}

// As above, for a curve that depends on time. All of it counts as steep.
void cut_now(Intensity& f, const Profile& p, Curve::Parser* parser, double d, double t, const Cap& cap) noexcept {
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
  cut(f, knots, d, cap.slope);
}

// The distance beyond d = width where a Gaussian has become as flat as `slope`, m.
double flat_from(const Profile& p, double slope) {
  // With y = (d / width)^2 the slope is -gain / width sqrt(y) exp(-y / 2), so y - ln(y) = flatness. Newton's method goes
  // down to the larger root.
  const double flatness = 2 * (std::log(p.gain) - std::log(slope) - std::log(p.width));
  if (!(flatness > 1)) return p.width;
  double y = 2 * flatness;
  for (int k = 0; k < 100; ++k) {
    const double next = y - (y - std::log(y) - flatness) / (1 - 1 / y);
    if (!(next < y && next > 1)) break;
    y = next;
  }
  return std::sqrt(y) * p.width;
}

void set_bend(Cap& cap, double at, double force, double slope) {
  cap.bend = at;
  cap.bend_force = force - slope * at;
  cap.bend_slope = slope;
}

void add_formula(const Profile& p, Cap& cap) {
  const double k = cap.slope;
  // The formula, clamped at 0 only.
  const auto force_at = [&](double d) {
    Profile unlimited = p;
    unlimited.limit = std::numeric_limits<double>::max();
    unlimited.reach = 0;
    unlimited.cap = nullptr;
    return evaluate(unlimited, nullptr, d, 0).force;
  };
  switch (p.kind) {
    case FS_PROFILE_LINEAR_INCREASING:
      if (p.gain > k) cap.rise = p.offset < 0 ? -k * (-p.offset / p.gain) : p.offset;
      return;
    case FS_PROFILE_LINEAR_DECREASING:
      if (-p.gain > k) cap.fall = std::fmin(cap.fall, k * (p.offset / -p.gain));
      return;
    case FS_PROFILE_GAUSSIAN: {
      const double steepest = p.gain / p.width * std::exp(-0.5);
      if (!(steepest > k)) return;
      const double bend = flat_from(p, k);
      return set_bend(cap, bend, force_at(bend), -k);
    }
    case FS_PROFILE_QUADRATIC: {
      const double zero = p.offset / p.gain < 0 ? std::sqrt(p.offset / -p.gain) : 0;
      if (p.gain > 0) {
        // It is steep from its zero on. The line begins there with 0, as the formula is rounded to the digits of the offset.
        if (2 * p.gain * zero > k) {
          cap.rise = -k * zero;
          return;
        }
        const double bend = k / (2 * p.gain);
        return set_bend(cap, bend, force_at(bend), k);
      }
      // Its arch is concave, so what is steep of it ends at 0.
      if (2 * -p.gain * zero > k) cap.fall = std::fmin(cap.fall, k * zero);
      return;
    }
    case FS_PROFILE_INVERSE: {
      const double zero = p.offset < 0 ? p.gain / -p.offset : std::numeric_limits<double>::infinity();
      const double bend = std::sqrt(p.gain / k);
      if (bend < zero) return set_bend(cap, bend, force_at(bend), -k);
      cap.fall = std::fmin(cap.fall, k * zero);
      return;
    }
    default:
      return;
  }
}

void add_curve(const Profile& p, Cap& cap) {
  const double reach = p.reach > 0 ? p.reach : std::numeric_limits<double>::infinity();
  std::vector<Knot> knots = p.curve->knots(cap.slope / p.gain, reach);
  if (knots.empty()) return;
  if (p.curve->is_timed()) {
    double most = 0;
    for (double d = 1e-6; d < 100; d *= 1.2) most = std::fmax(most, p.gain * p.curve->greatest_force(d));
    for (const Knot& knot : knots) most = std::fmax(most, p.gain * knot.force);
    cap.spacing = std::fmin(most, p.limit) / cap.slope / most_samples;
    return;
  }
  for (Knot& knot : knots) knot.force *= p.gain;
  lower_knots(knots, cap.slope);
  cap.knots = std::move(knots);
}

}  // namespace

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

Intensity Cap::lower(const Profile& p, Curve::Parser* parser, double d, double t, Intensity raw) const noexcept {
  if (!(raw.force > 0)) return {};
  Intensity f = raw;
  if (spacing > 0) {
    cut_now(f, p, parser, d, t, *this);
  } else if (!knots.empty()) {
    cut(f, knots, d, slope);
  }
  if ((d - bend) * bend_slope > 0) cut(f, bend_force + bend_slope * d, bend_slope);
  cut(f, rise + slope * d, slope);
  cut(f, fall - slope * d, -slope);
  if (!(f.force > 0)) return {};
  return {f.force, std::clamp(f.slope, -slope, slope)};
}

Ref<Cap> make_cap(const Profile& p, double slope) {
  Ref<Cap> cap = make_ref<Cap>();
  cap->slope = slope;
  if (p.reach > 0) cap->fall = slope * p.reach;
  if (p.gain == 0) return cap;
  if (p.kind == FS_PROFILE_CUSTOM) {
    add_curve(p, *cap);
  } else {
    add_formula(p, *cap);
  }
  return cap;
}

}  // namespace fs
