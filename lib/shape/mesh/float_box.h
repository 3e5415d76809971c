// A box in single precision, for coordinates of a local frame.
#pragma once

#include <cmath>
#include <limits>

#include "shape/box.h"

namespace fs {

// Rounded outwards.
inline float rounded_below(double v) {
  const float f = static_cast<float>(v);
  return f <= v ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
inline float rounded_above(double v) { return -rounded_below(-v); }

struct FloatBox {
  float lower[3], upper[3];

  float half_area() const {
    const float x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
    return x * y + y * z + z * x;
  }
};

}  // namespace fs
