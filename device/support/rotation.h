// Orientations that a maker's interface gives as matrices.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>

#include <forceserver/base.h>

namespace fs {

// The rotation matrix m, by rows, as a quaternion. Of four times the squares of w, x, y and z the largest gives the root, so that
// nothing is divided by a small number (S. W. Shepperd, "Quaternion from rotation matrix", 1978). In another frame with axes of its own the
// same rotation has the vector part (x, y, z) turned as any vector is.
inline fs_quat quaternion_of(const double (&m)[3][3]) noexcept {
  const double squares[4] = {1 + m[0][0] + m[1][1] + m[2][2], 1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2],
                             1 - m[0][0] - m[1][1] + m[2][2]};
  const auto largest = std::max_element(std::begin(squares), std::end(squares)) - std::begin(squares);
  const double root = std::sqrt(squares[largest]), f = 0.5 / root;
  const double wx = f * (m[2][1] - m[1][2]), wy = f * (m[0][2] - m[2][0]), wz = f * (m[1][0] - m[0][1]);
  const double xy = f * (m[0][1] + m[1][0]), xz = f * (m[0][2] + m[2][0]), yz = f * (m[1][2] + m[2][1]);
  switch (largest) {
    case 0: return {root / 2, wx, wy, wz};
    case 1: return {wx, root / 2, xy, xz};
    case 2: return {wy, xy, root / 2, yz};
    default: return {wz, xz, yz, root / 2};
  }
}

// Whether a matrix was a rotation, by its quaternion: NaN and matrices of zeros are none.
inline bool is_rotation(fs_quat q) noexcept { return std::fabs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) < 1e-3; }

}  // namespace fs
