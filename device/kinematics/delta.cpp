#include "device/kinematics/delta.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fs {
namespace {

struct Direction {  // of a leg, seen from above
  double cosine, sine;
};
constexpr double half_sqrt3 = std::numbers::sqrt3 / 2;
constexpr Direction legs[3] = {{1, 0}, {-0.5, half_sqrt3}, {-0.5, -half_sqrt3}};

// Only the difference of the radii of base and platform matters.
double offset(const DeltaGeometry& g) { return g.base_radius - g.platform_radius; }

// The beginning of the forearm, moved so that the forearm ends at the platform's centre.
Vec3 elbow(const DeltaGeometry& g, Direction leg, double angle) {
  const double reach = offset(g) + g.upper_arm * std::cos(angle);
  return {reach * leg.cosine, reach * leg.sine, g.upper_arm * std::sin(angle)};
}

}  // namespace

std::optional<Vec3> delta_inverse(const DeltaGeometry& g, Vec3 p) {
  double angles[3];
  for (int i = 0; i < 3; ++i) {
    // Coordinates of the leg: u outwards from the arm's axis, z away from the base, v perpendicular to the leg's plane.
    const double u = legs[i].cosine * p.x + legs[i].sine * p.y - offset(g);
    const double v = -legs[i].sine * p.x + legs[i].cosine * p.y;
    const double forearm2 = g.forearm * g.forearm - v * v;
    const double distance2 = u * u + p.z * p.z;
    const double cosine = (distance2 + g.upper_arm * g.upper_arm - forearm2) / (2 * g.upper_arm * std::sqrt(distance2));
    if (!(forearm2 > 0 && std::fabs(cosine) <= 1)) return std::nullopt;
    angles[i] = std::atan2(p.z, u) - std::acos(cosine);
  }
  return Vec3{angles[0], angles[1], angles[2]};
}

std::optional<Vec3> delta_forward(const DeltaGeometry& g, Vec3 angles) {
  // The point one forearm's length from each elbow lies above the circumcentre of their triangle.
  const Vec3 first = elbow(g, legs[0], angles.x);
  const Vec3 a = elbow(g, legs[1], angles.y) - first, b = elbow(g, legs[2], angles.z) - first;
  const Vec3 normal = cross(a, b);
  const double normal2 = dot(normal, normal);
  const Vec3 centre = (1 / (2 * normal2)) * cross(dot(a, a) * b - dot(b, b) * a, normal);
  const double height2 = g.forearm * g.forearm - dot(centre, centre);
  if (!(height2 >= 0)) return std::nullopt;  // elbows too far apart, or in one line (height2 is NaN)
  const double side = normal.z < 0 ? -1 : 1;
  return first + centre + (side * std::sqrt(height2 / normal2)) * normal;
}

std::optional<DeltaJacobian> delta_jacobian(const DeltaGeometry& g, Vec3 p, Vec3 angles) {
  // Forearm lengths are constant: s_i . dp = (s_i . t_i) dangle_i, with s_i along the forearm and t_i the motion of its
  // elbow per rad.
  const double angle[3] = {angles.x, angles.y, angles.z};
  Vec3 s[3];
  double lever[3];
  for (int i = 0; i < 3; ++i) {
    s[i] = (1 / g.forearm) * (p - elbow(g, legs[i], angle[i]));
    const Vec3 t{-std::sin(angle[i]) * legs[i].cosine, -std::sin(angle[i]) * legs[i].sine, std::cos(angle[i])};
    lever[i] = g.upper_arm * dot(s[i], t);
  }
  const double determinant = dot(s[0], cross(s[1], s[2]));
  if (!(std::fabs(determinant) >= 1e-6)) return std::nullopt;
  const Vec3 x = (lever[0] / determinant) * cross(s[1], s[2]);
  const Vec3 y = (lever[1] / determinant) * cross(s[2], s[0]);
  const Vec3 z = (lever[2] / determinant) * cross(s[0], s[1]);
  const double smallest = std::min({std::fabs(lever[0]), std::fabs(lever[1]), std::fabs(lever[2])});
  return DeltaJacobian{{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}, std::fabs(determinant), smallest / g.upper_arm};
}

}  // namespace fs
