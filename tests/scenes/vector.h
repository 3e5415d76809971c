// Operations on the C types for vectors, quaternions and poses, as far as tests need them. They use plain doubles;
// reference.cpp has its own in long double.
#pragma once

#include <cmath>

#include <forceserver/base.h>

namespace scenes {

inline fs_vec3 operator+(fs_vec3 a, fs_vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline fs_vec3 operator-(fs_vec3 a, fs_vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline fs_vec3 operator-(fs_vec3 a) { return {-a.x, -a.y, -a.z}; }
inline fs_vec3 operator*(double s, fs_vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline bool operator==(fs_vec3 a, fs_vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
inline double dot(fs_vec3 a, fs_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline fs_vec3 cross(fs_vec3 a, fs_vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(fs_vec3 a) { return std::sqrt(dot(a, a)); }
inline fs_vec3 unit(fs_vec3 a) { return (1 / norm(a)) * a; }

inline fs_quat operator*(fs_quat a, fs_quat b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
inline fs_quat inverse(fs_quat q) { return {q.w, -q.x, -q.y, -q.z}; }
inline fs_vec3 rotate(fs_quat q, fs_vec3 v) {
  const fs_quat r = q * fs_quat{0, v.x, v.y, v.z} * inverse(q);
  return {r.x, r.y, r.z};
}
inline fs_quat unit(fs_quat q) {
  const double n = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return {q.w / n, q.x / n, q.y / n, q.z / n};
}
// A rotation by `angle` (rad) about axis (any length > 0).
inline fs_quat turn(fs_vec3 axis, double angle) {
  const fs_vec3 a = std::sin(angle / 2) * unit(axis);
  return {std::cos(angle / 2), a.x, a.y, a.z};
}
inline fs_vec3 operator*(const fs_pose& pose, fs_vec3 x) { return pose.position + rotate(pose.orientation, x); }
inline fs_pose operator*(const fs_pose& a, const fs_pose& b) {
  return {a * b.position, unit(a.orientation * b.orientation)};
}
inline fs_pose at(fs_vec3 position) { return {position, {1, 0, 0, 0}}; }
inline fs_pose at(double x, double y, double z) { return at(fs_vec3{x, y, z}); }

inline fs_vec3 operator*(const fs_mat3& m, fs_vec3 v) {
  return {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.yx * v.x + m.yy * v.y + m.yz * v.z,
          m.zx * v.x + m.zy * v.y + m.zz * v.z};
}

}  // namespace scenes
