// What a node of a WideTree tells of its children, eight at a time: how far from a point they are at least, and which of them
// meet a box. To be included where its inlined code is compiled for each processor.
#pragma once

#include <algorithm>
#include <limits>

#include "math/lanes.h"
#include "shape/mesh/wide_node.h"

namespace fs::wide {

using namespace lanes;

// A point from which is looked, in the local frame. Far away from the shape single precision would tell nothing apart, so
// there are two kinds. `rounding` is more than the relative error of what is worked out with it.
struct Near {
  using Real = float;
  using Lanes = Floats8;
  static constexpr double rounding = 0x1p-20;
  Vec3 at;
};
struct Far {
  using Real = double;
  using Lanes = Doubles8;
  static constexpr double rounding = 0x1p-48;
  Vec3 at;
};
inline constexpr double far = 64;  // a coordinate beyond this is far

// A range for squares of distances that are worked out with From.
template <class From>
typename From::Real rounded_up(double squared) noexcept {
  using Real = typename From::Real;
  const double up = squared * (1 + From::rounding) + std::numeric_limits<Real>::min();
  return up <= std::numeric_limits<Real>::max() ? static_cast<Real>(up) : std::numeric_limits<Real>::infinity();
}

// Lower bounds of the squared distances from a point to the children of a node. discs: null: there are none.
template <class From>
FS_INLINE typename From::Lanes squared_to_children(const WideNode& node, const WideDiscs* discs, const From& from) {
  using Real = typename From::Real;
  using Lanes = typename From::Lanes;
  const Lanes zero{};
  const Ints8 low = load(node.lower), high = load(node.upper);
  const double at[3] = {from.at.x, from.at.y, from.at.z};
  const Real per_step = sizeof(Real) == sizeof node.steps ? Real{node.steps} : 1 / Real{node.step};
  Lanes sum{}, from_middle[3];
  Real margins = 0;
  for (int k = 0; k < 3; ++k) {
    const Real t = static_cast<Real>(at[k] - node.origin[k]) * per_step;  // in steps
    const Real margin = std::fabs(t) * static_cast<Real>(From::rounding / 2);
    const Lanes lower = __builtin_convertvector(field(low, 8 * k, 8), Lanes);
    const Lanes upper = __builtin_convertvector(field(high, 8 * k, 8), Lanes);
    const Lanes below = lower - (t + margin), above = (t - margin) - upper;
    Lanes d = below > above ? below : above;
    d = d > zero ? d : zero;
    sum += d * d;
    from_middle[k] = t - (lower + upper) / 2;
    margins += margin;
  }
  if (discs) {
    const Ints8 x_y = load(discs->x_y), sizes = load(discs->sizes);
    const auto wide = [](Floats8 f) __attribute__((always_inline)) { return __builtin_convertvector(f, Lanes); };
    constexpr Real scale = Real{1} / WideDiscs::scale, unit = WideDiscs::unit * scale;
    const Lanes x = wide(field(x_y, 0, 16)) * scale - unit, y = wide(field(x_y, 16, 16)) * scale - unit;
    const Lanes z = unit - magnitude(x) - magnitude(y);
    const Lanes per_squared = 1 / (x * x + y * y + z * z);
    const Lanes offset = (wide(field(sizes, 0, 16)) - Real{WideDiscs::zero_offset}) * (Real{1} / WideDiscs::offsets_a_step);
    const Lanes radius = wide(field(sizes, 16, 8));
    const Lanes height =
        wide((Floats8)(((sizes >> 24 & 255) << WideDiscs::height_shift) + static_cast<int32_t>(WideDiscs::smallest_height)));
    const Lanes along = x * from_middle[0] + y * from_middle[1] + z * from_middle[2];
    const Lanes squared = from_middle[0] * from_middle[0] + from_middle[1] * from_middle[1] + from_middle[2] * from_middle[2];
    const Lanes beyond = along - offset;
    constexpr auto less = static_cast<Real>(1 - 4 * From::rounding);
    margins = 4 * margins + static_cast<Real>(4 * From::rounding * WideNode::grid);  // more than rounding makes
    Lanes up = magnitude(beyond) - (height + margins);
    const Lanes across = squared * less - along * along * per_squared;
    Lanes beside = root(across > zero ? across : zero) - (radius + margins);
    up = up > zero ? up : zero;
    beside = beside > zero ? beside : zero;
    const Lanes to_disc = (up * up * per_squared + beside * beside) * less;
    sum = to_disc > sum ? to_disc : sum;
  }
  return sum * (Real{node.step} * Real{node.step});
}

// A box in the local frame, rounded outwards as far as single precision asks for.
struct Span {
  double lower[3], upper[3];

  Span(Vec3 a, Vec3 b) {
    const double p[3] = {a.x, a.y, a.z}, q[3] = {b.x, b.y, b.z};
    for (int k = 0; k < 3; ++k) {
      const double margin = 1e-6 * (std::fabs(p[k]) + std::fabs(q[k])) + 1e-12;
      lower[k] = std::min(p[k], q[k]) - margin;
      upper[k] = std::max(p[k], q[k]) + margin;
    }
  }
};

// Bit i: the box of child i meets the span.
FS_INLINE uint32_t children_in(const WideNode& node, const Span& span) {
  const Ints8 low = load(node.lower), high = load(node.upper);
  const float per_step = 1 / node.step;
  Ints8 meets = {-1, -1, -1, -1, -1, -1, -1, -1};
  for (int k = 0; k < 3; ++k) {
    // Within what a byte can say, so that nothing large is rounded.
    const double lower = (span.lower[k] - node.origin[k]) * per_step, upper = (span.upper[k] - node.origin[k]) * per_step;
    meets &= (field(low, 8 * k, 8) <= all(static_cast<float>(std::min(upper, 300.0) + 0.01))) &
             (field(high, 8 * k, 8) >= all(static_cast<float>(std::max(lower, -300.0) - 0.01)));
  }
  return bits(meets) & node.filled;
}

}  // namespace fs::wide
