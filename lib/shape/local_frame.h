// Where the tree of a shape keeps its coordinates: relative to the middle of the shape and scaled by a power of two to about
// 1. There single precision suffices to look for what may be near, however large, small or far from the origin the shape is.
#pragma once

#include <cmath>

#include "shape/box.h"

namespace fs {

struct LocalFrame {
  Vec3 middle{};     // m
  double scale = 1;  // local units a metre; a power of two

  LocalFrame() = default;
  explicit LocalFrame(const Box& box)
      : middle{0.5 * box.lower.x + 0.5 * box.upper.x, 0.5 * box.lower.y + 0.5 * box.upper.y,
               0.5 * box.lower.z + 0.5 * box.upper.z} {
    const double size = largest_coordinate(box.upper - box.lower);
    int exponent = 0;
    if (size > 0) std::frexp(size, &exponent);
    scale = std::ldexp(1.0, -std::clamp(exponent, -1000, 1000));
  }

  // Rounded: the error is some units in the last place of |p - middle|.
  Vec3 local(Vec3 p) const noexcept { return scale * (p - middle); }
};

}  // namespace fs
