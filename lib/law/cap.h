// The cap of a profile's slope: what is left of f when nothing that the hand feels may be steeper than k. It is the largest
// function that is nowhere above f and nowhere steeper than k (the Lipschitz regularization of f, also known as its
// Pasch-Hausdorff envelope: Rockafellar & Wets, "Variational Analysis", example 9.11):
//
//     f_k(d) = min over s >= 0 of f(s) + k |d - s|
//
// The formulas have closed forms: f cut off by straight lines of slope k or -k. So has a table, interval by interval.
// An expression is sampled, so its cap is an estimate.
#pragma once

#include <limits>
#include <vector>

#include "base/counted.h"
#include "law/curve.h"

namespace fs {

// The force of a custom profile, min(gain * curve(d, t), limit).
struct ScaledCurve {
  const Curve* curve;  // null: of a formula
  double gain, limit;
};

struct Cap : Counted<Cap> {
  double slope = 0;  // k, N/m
  // N: f(d) <= across + slope*d, because of the force on the other side of d = 0, which is across with its cap and
  //      across_raw without it;
  //    f(d) <= rise + slope*d, because of a steep increase;
  //    f(d) <= fall - slope*d, because of the reach or of a steep decrease.
  double across = std::numeric_limits<double>::infinity(), across_raw = across, rise = across, fall = across;
  // f(d) <= bend_force + bend_slope*d where the formula is steeper than this tangent: below `bend` (m) where bend_slope is
  // -k, beyond it where it is k. bend_slope 0: there is no tangent.
  double bend = 0, bend_force = 0, bend_slope = 0;
  // Of a custom profile: the knots of its envelope, in newtons of f. None: f is nowhere steep.
  std::vector<Knot> knots;
  // m, above 0: the curve depends on time, so each evaluation samples it anew, at multiples of this distance.
  double spacing = 0;

  // Sets the knots, or the spacing. reach: m, may be infinite.
  void follow(const ScaledCurve& custom, double reach);

  // [rt] f_k(d) and its slope, from `raw`, which is f(d). parser: made by the curve. radius: m, of a ball that feels it:
  // then it is that of the function f(max(0, d - radius)), and so is `raw`.
  Intensity lower(const ScaledCurve& custom, Curve::Parser* parser, double d, double t, Intensity raw,
                  double radius = 0) const noexcept;
};

}  // namespace fs
