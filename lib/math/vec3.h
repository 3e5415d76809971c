// Vectors and 3x3 matrices, right-handed. The vector type is that of the C contract, so it needs no conversion.
#pragma once

#include <algorithm>
#include <cmath>

#include <forceserver/base.h>

namespace fs {

using Vec3 = fs_vec3;
using Mat3 = fs_mat3;

constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
constexpr Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
constexpr Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
constexpr Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
constexpr bool operator==(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
constexpr double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
constexpr Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }
inline bool is_finite(Vec3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

inline double largest_coordinate(Vec3 a) noexcept { return std::max(std::max(std::fabs(a.x), std::fabs(a.y)), std::fabs(a.z)); }

inline constexpr double coordinate_limit = 1e15;  // m: its square is still 278 decades below the largest double
inline bool is_in_range(Vec3 v) noexcept {
  return std::fabs(v.x) <= coordinate_limit && std::fabs(v.y) <= coordinate_limit && std::fabs(v.z) <= coordinate_limit;
}

// The unit vector along a, even when the squares of its components would overflow or underflow; {0, 0, 0} for 0.
inline Vec3 normalized(Vec3 a) {
  const double squared = dot(a, a);
  if (squared > 1e-200 && squared < 1e200) {
    const double length = std::sqrt(squared);
    return {a.x / length, a.y / length, a.z / length};
  }
  const double largest = largest_coordinate(a);
  if (!(largest > 0)) return {0, 0, 0};
  const Vec3 scaled{a.x / largest, a.y / largest, a.z / largest};
  return (1 / norm(scaled)) * scaled;
}

constexpr bool operator==(const Mat3& a, const Mat3& b) {
  return a.xx == b.xx && a.xy == b.xy && a.xz == b.xz && a.yx == b.yx && a.yy == b.yy && a.yz == b.yz && a.zx == b.zx &&
         a.zy == b.zy && a.zz == b.zz;
}
inline bool is_finite(const Mat3& m) {
  return is_finite(Vec3{m.xx, m.xy, m.xz}) && is_finite(Vec3{m.yx, m.yy, m.yz}) && is_finite(Vec3{m.zx, m.zy, m.zz});
}
constexpr Mat3 operator+(const Mat3& a, const Mat3& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yx + b.yx, a.yy + b.yy, a.yz + b.yz, a.zx + b.zx, a.zy + b.zy, a.zz + b.zz};
}
constexpr Mat3 operator*(double s, const Mat3& a) {
  return {s * a.xx, s * a.xy, s * a.xz, s * a.yx, s * a.yy, s * a.yz, s * a.zx, s * a.zy, s * a.zz};
}
constexpr Mat3& operator+=(Mat3& a, const Mat3& b) { return a = a + b; }
constexpr Vec3 operator*(const Mat3& m, Vec3 v) {
  return {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.yx * v.x + m.yy * v.y + m.yz * v.z, m.zx * v.x + m.zy * v.y + m.zz * v.z};
}
constexpr Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {
      a.xx * b.xx + a.xy * b.yx + a.xz * b.zx, a.xx * b.xy + a.xy * b.yy + a.xz * b.zy, a.xx * b.xz + a.xy * b.yz + a.xz * b.zz,
      a.yx * b.xx + a.yy * b.yx + a.yz * b.zx, a.yx * b.xy + a.yy * b.yy + a.yz * b.zy, a.yx * b.xz + a.yy * b.yz + a.yz * b.zz,
      a.zx * b.xx + a.zy * b.yx + a.zz * b.zx, a.zx * b.xy + a.zy * b.yy + a.zz * b.zy, a.zx * b.xz + a.zy * b.yz + a.zz * b.zz};
}
constexpr Mat3 transposed(const Mat3& a) { return {a.xx, a.yx, a.zx, a.xy, a.yy, a.zy, a.xz, a.yz, a.zz}; }
constexpr Mat3 outer(Vec3 a, Vec3 b) {  // a b^T
  return {a.x * b.x, a.x * b.y, a.x * b.z, a.y * b.x, a.y * b.y, a.y * b.z, a.z * b.x, a.z * b.y, a.z * b.z};
}
constexpr Mat3 identity() { return {1, 0, 0, 0, 1, 0, 0, 0, 1}; }

}  // namespace fs
