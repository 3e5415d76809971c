#include "servo/local_model.h"

#include <numbers>

namespace fs {

// The closed form for the eigenvalues of a symmetric 3x3 matrix (O. K. Smith, 1961).
double spectral_norm(const Mat3& m) noexcept {
  const double mean = (m.xx + m.yy + m.zz) / 3;
  const double off = m.xy * m.xy + m.xz * m.xz + m.yz * m.yz;
  const Mat3 rest = m + -mean * identity();
  const double p = std::sqrt((rest.xx * rest.xx + rest.yy * rest.yy + rest.zz * rest.zz + 2 * off) / 6);
  if (!(p > 0)) return std::fabs(mean);
  const Mat3 b = (1 / p) * rest;
  const double determinant = dot(Vec3{b.xx, b.xy, b.xz}, cross(Vec3{b.yx, b.yy, b.yz}, Vec3{b.zx, b.zy, b.zz}));
  const double angle = std::acos(std::clamp(determinant / 2, -1.0, 1.0)) / 3;
  const double highest = mean + 2 * p * std::cos(angle);
  const double lowest = mean + 2 * p * std::cos(angle + 2 * std::numbers::pi / 3);
  return std::fmax(std::fabs(highest), std::fabs(lowest));
}

Mat3 local_model(const Mat3& stiffness, double most) noexcept {
  const Mat3 symmetric = 0.5 * (stiffness + transposed(stiffness));
  if (!is_finite(symmetric)) return {};
  const double size = spectral_norm(symmetric);
  if (!std::isfinite(size)) return {};
  return size > most ? (most / size) * symmetric : symmetric;
}

}  // namespace fs
