// What is known of a part of a curve without evaluating it.
#pragma once

#include <cstddef>
#include <limits>

namespace fs {

// A part of a curve, from `begin` (m) to the beginning of the next piece.
struct CurvePiece {
  double begin = 0;
  double low = 0, high = 0;  // N, bounds of the force
  double steepest = 0;       // N/m, the largest |slope|
};
inline constexpr size_t most_curve_pieces = 256;
inline constexpr double largest_slope = std::numeric_limits<double>::max();  // N/m; what is steeper counts as this

}  // namespace fs
