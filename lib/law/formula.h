// The formulas of the profiles and of their caps, written once for one double and for four at a time (Real = double, Doubles4).
// Their bits are not the same in both: one double divides, and takes the system's exp; the lanes multiply by 1/x, which they
// have already, and take an exp that gives the same bits on each processor. To be included where its inlined code is compiled
// for each processor.
#pragma once

#include "law/form.h"
#include "math/lanes.h"

namespace fs {

// Divides by x as the lanes do.
template <class Real>
struct Reciprocal {
  Real value;  // 1 / x
};
template <class Real>
FS_INLINE Real operator/(Real a, Reciprocal<Real> by) {
  return a * by.value;
}

template <class Real>
struct Felt {
  using Mask = decltype(Real{} < Real{});
  Real force, slope;  // N, N/m, where it is felt
  Mask is_felt;
};

// Cut off at 0 and at the limit. The slope is that of `raw`.
template <class Real>
FS_INLINE Felt<Real> clamped(Real raw, Real slope, Real limit) {
  return {lanes::least(raw, limit), lanes::where(raw < limit, slope), raw > Real{}};
}

// f(d), clamped, without regard to reach and cap. What `of` has to tell: gain(), offset() and limit(), which are Reals; what can
// be divided by: width() and distance(), which is d; which(Form): bit i: lane i has this formula.
template <class Real, class Terms>
FS_INLINE Felt<Real> formula(const Terms& of, Real d) {
  const Real gain = of.gain(), offset = of.offset();
  Real raw = gain * d + offset, slope = gain;
  if (const uint64_t which = of.which(Form::quadratic)) {
    const auto mine = lanes::lanes_of<Real>(which);
    raw = mine ? gain * d * d + offset : raw;
    slope = mine ? 2.0 * (gain * d) : slope;
  }
  if (const uint64_t which = of.which(Form::inverse)) {
    const auto mine = lanes::lanes_of<Real>(which);
    const auto distance = of.distance();
    const Real force = gain / distance;
    raw = mine ? force + offset : raw;
    slope = mine ? -force / distance : slope;
  }
  if (const uint64_t which = of.which(Form::gaussian)) {
    const auto mine = lanes::lanes_of<Real>(which);
    const auto width = of.width();
    const Real q = d / width, force = gain * lanes::exp_minus(0.5 * q * q);
    raw = mine ? force : raw;
    slope = mine ? -(force * q) / width : slope;
  }
  return clamped(raw, slope, of.limit());
}

// The same of one profile, at one distance d >= 0, m, which may be infinite. Numbers: see Formula.
template <class Numbers>
Felt<double> formula_at(const Numbers& numbers, double d) {
  struct Terms {
    const Numbers& f;
    double d;
    double gain() const { return f.gain; }
    double offset() const { return f.offset; }
    double limit() const { return f.limit; }
    double width() const { return f.width; }
    double distance() const { return d; }
    uint64_t which(Form form) const { return f.form == form; }
  };
  return formula(Terms{numbers, d}, numbers.gain == 0 ? 0 : d);
}

// The cap (cap.h) of the lanes in `mine`: f is lowered to a line where it is above it.
template <class Real, class Mask>
FS_INLINE void cut(Felt<Real>& f, Mask mine, Real force, Real slope) {
  mine = mine & (force < f.force);
  f.force = mine ? force : f.force;
  f.slope = mine ? slope : f.slope;
}
template <class Real, class Mask>
FS_INLINE void cut_at_bend(Felt<Real>& f, Mask mine, Real d, Real bend, Real bend_force, Real bend_slope) {
  mine = mine & ((d - bend) * bend_slope > Real{});
  cut(f, mine, bend_force + bend_slope * d, bend_slope);
}
template <class Real, class Mask>
FS_INLINE void cut_at_rise(Felt<Real>& f, Mask mine, Real d, Real rise, Real slope) {
  cut(f, mine, rise + slope * d, slope);
}
template <class Real, class Mask>
FS_INLINE void cut_at_fall(Felt<Real>& f, Mask mine, Real d, Real fall, Real slope) {
  cut(f, mine, fall - slope * d, -slope);
}

}  // namespace fs
