#include "device/kinematics/fidel.h"

#include <algorithm>
#include <cmath>

namespace fs::fidel {

double encoded(double angle, double counts, double phase) {
  const double count = count_angle(counts);
  return (std::round(angle / count + phase) - phase) * count;
}

Vec3 scaled_together(Vec3 torques, double limit) {
  const double most = largest_coordinate(torques);
  return most > limit ? (limit / most) * torques : torques;
}

Vec3 motor_force(Vec3 force, Vec3 p) {
  if (norm(force) <= force_max) return force;
  const Vec3 position = to_delta(p);
  const auto angles = delta_inverse(geometry, position);
  const auto jacobian = angles ? delta_jacobian(geometry, position, *angles) : std::nullopt;
  if (!jacobian) return {0, 0, 0};  // cannot happen within the stops
  const Vec3 unit = normalized(force);
  const Vec3 torque = joint_torques(jacobian->jacobian, unit);  // N m for 1 N
  return std::min(norm(force), motor_torque_max / largest_coordinate(torque)) * unit;
}

Mat3 rotation_jacobian(Vec3 r) {
  const double angle2 = dot(r, r), angle = std::sqrt(angle2);
  const bool small = angle < 1e-3;
  const double a = small ? 0.5 - angle2 / 24 : (1 - std::cos(angle)) / angle2;
  const double b = small ? 1.0 / 6 - angle2 / 120 : (angle - std::sin(angle)) / (angle2 * angle);
  const Mat3 across{0, -r.z, r.y, r.z, 0, -r.x, -r.y, r.x, 0};
  return identity() + a * across + b * (across * across);
}

}  // namespace fs::fidel
