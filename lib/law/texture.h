// The heights of a surface: a smooth function through a grid of heights, which is a uniform bicubic spline (Unser, "Splines: a
// perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6), 1999). So the force on it is continuous,
// and so is the stiffness, but at the border of a grid that does not repeat.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <forceserver/object.h>

#include "math/vec3.h"

namespace fs {

inline constexpr double deepest_height = 1;  // m, below the surface

class Texture {
 public:
  // Checks the fields of a surface's settings that are of its texture. Throws INVALID.
  static void check(const fs_surface_settings& settings);
  // Throws INVALID.
  Texture(const fs_surface_settings& settings, std::span<const double> heights);

  struct Sample {
    double height = 0;   // m, at most 0
    Vec3 slope{};        // m/m, along the axes of the object
    Mat3 curvature{};    // 1/m
  };
  // [rt] place: m, object frame, within coordinate_limit.
  Sample at(Vec3 place) const noexcept;

  // Bounds, which are never too low: of the length of the slope; of the largest curvature in any direction, 1/m; of -height, m.
  double steepest() const noexcept { return steepest_; }
  double most_curved() const noexcept { return most_curved_; }
  double deepest() const noexcept { return deepest_; }

  const std::vector<double>& heights() const noexcept { return heights_; }  // as given

 private:
  // Along the columns and the rows.
  struct Direction {
    size_t count;      // of heights
    double width;      // m, from one to the next
    double begin;      // m, place of the first
    bool repeats;
    unsigned axis;     // 0 to 2, of the object frame

    // How many coefficients there are: one before the first height, one for each height, and after the last one two if the grid
    // repeats, else one.
    size_t padded() const noexcept { return count + (repeats ? 3 : 2); }
    size_t cells() const noexcept { return padded() - 3; }
    std::vector<double> coefficients(const std::vector<double>& heights) const;
    // The cell of a place, where it is in that cell, 0 to 1, and whether it is beyond the border, where the height stays.
    size_t cell(double place, double& within, bool& is_beyond) const noexcept;
  };
  double coefficient(size_t column, size_t row) const noexcept { return coefficients_[row * columns_.padded() + column]; }
  void find_bounds();

  std::vector<double> heights_, coefficients_;
  Direction columns_, rows_;
  double steepest_ = 0, most_curved_ = 0, deepest_ = 0;
};

// The heights that an expression in x, y and z (m, object frame) gives at the places of the grid, where the coordinate along its axis
// is 0. Throws INVALID, PARSE; UNSUPPORTED: built without expressions.
std::vector<double> heights_of(const fs_surface_settings& settings, const char* expression);

}  // namespace fs
