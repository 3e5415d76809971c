// Quaternions (w, x, y, z), poses and twists. A pose maps child coordinates to the parent's.
#pragma once

#include <forceserver/base.h>

#include "math/vec3.h"

namespace fs {

using Quat = fs_quat;
using Pose = fs_pose;
using Twist = fs_twist;
using Wrench = fs_wrench;

constexpr Wrench operator+(const Wrench& a, const Wrench& b) { return {a.force + b.force, a.torque + b.torque}; }
constexpr Wrench operator*(double s, const Wrench& w) { return {s * w.force, s * w.torque}; }

constexpr Quat identity_quat() { return {1, 0, 0, 0}; }
constexpr Pose identity_pose() { return {{0, 0, 0}, {1, 0, 0, 0}}; }
constexpr Quat conjugate(Quat q) { return {q.w, -q.x, -q.y, -q.z}; }
constexpr Quat operator*(Quat a, Quat b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
constexpr double dot(Quat a, Quat b) { return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z; }
inline double norm(Quat q) { return std::sqrt(dot(q, q)); }
inline Quat normalized(Quat q) {
  const double n = norm(q);
  return {q.w / n, q.x / n, q.y / n, q.z / n};
}
inline bool is_finite(Quat q) { return std::isfinite(q.w) && std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z); }
constexpr Vec3 rotate(Quat q, Vec3 v) {
  const Vec3 u{q.x, q.y, q.z};
  const Vec3 t = 2 * cross(u, v);
  return v + q.w * t + cross(u, t);
}
constexpr Mat3 to_matrix(Quat q) {
  const Vec3 x = rotate(q, {1, 0, 0}), y = rotate(q, {0, 1, 0}), z = rotate(q, {0, 0, 1});
  return {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z};
}

// Converts a rotation vector (axis times angle, rad) to a rotation, and back to a vector with its angle within [0, pi].
inline Quat exp_rotation(Vec3 v) {
  const double angle = norm(v);
  if (angle < 1e-9) return normalized(Quat{1, v.x / 2, v.y / 2, v.z / 2});
  const double s = std::sin(angle / 2) / angle;
  return {std::cos(angle / 2), s * v.x, s * v.y, s * v.z};
}
inline Vec3 log_rotation(Quat q) {
  const double sign = q.w < 0 ? -1 : 1;
  const Vec3 v{sign * q.x, sign * q.y, sign * q.z};
  const double s = norm(v);
  if (s < 1e-9) return 2 * v;
  return (2 * std::atan2(s, sign * q.w) / s) * v;
}

constexpr Vec3 operator*(const Pose& pose, Vec3 v) { return pose.position + rotate(pose.orientation, v); }
constexpr Pose operator*(const Pose& a, const Pose& b) { return {a * b.position, a.orientation * b.orientation}; }
constexpr Vec3 to_local(const Pose& pose, Vec3 v) { return rotate(conjugate(pose.orientation), v - pose.position); }
inline bool is_finite(const Pose& p) { return is_finite(p.position) && is_finite(p.orientation); }
inline bool is_finite(const Twist& t) { return is_finite(t.linear) && is_finite(t.angular); }
inline bool is_finite(const Wrench& w) { return is_finite(w.force) && is_finite(w.torque); }

// The pose reached from `pose` by a constant twist (along the parent's axes) after dt seconds.
inline Pose advanced(const Pose& pose, const Twist& twist, double dt) {
  return {pose.position + dt * twist.linear, exp_rotation(dt * twist.angular) * pose.orientation};
}

}  // namespace fs
