#include "device/falcon/kinematics.h"

#include <algorithm>

namespace fs::falcon {
namespace {

// m. a: arm on the base; b: forearm; c, r, s: where it meets platform and base; d, e: offsets at the ends of a forearm; f: sideways.
constexpr double a = 0.060, b = 0.1025, c = 0.01443, d = 0.01125, e = 0.01125, f = -0.025, r = 0.0400, s = -0.02309;
constexpr double degree = std::numbers::pi / 180;
constexpr double legs[3] = {105 * degree, -15 * degree, -135 * degree};

struct Leg {
  double angle;   // rad
  Vec3 gradient;  // rad/m, of the angle
};

// The arm's end is at distance `a` from its axis, and at distance `length` from the platform, in the plane in which the arm turns:
// (forward - a cos angle)^2 + (z - a sin angle)^2 = length^2. The gradient is that of this equation.
std::optional<Leg> leg_at(Vec3 position, double direction) noexcept {
  const double cosine = std::cos(direction), sine = std::sin(direction);
  const double u = cosine * position.x + sine * position.y - r, v = cosine * position.y - sine * position.x - s, w = position.z;
  const double sideways = (v + f) / b;
  if (!(std::fabs(sideways) < 1)) return std::nullopt;
  const double rise = std::sqrt(1 - sideways * sideways);
  const double length = d + e + b * rise, forward = u + c, distance = std::hypot(forward, w);
  const double bend = (distance * distance + a * a - length * length) / (2 * a * distance);
  if (!(std::fabs(bend) < 1)) return std::nullopt;
  const double angle = std::atan2(w, forward) - std::acos(bend);
  const double cos_angle = std::cos(angle), sin_angle = std::sin(angle);
  const double lever = a * (forward * sin_angle - w * cos_angle);
  if (std::fabs(lever) < 1e-9) return std::nullopt;  // the leg is straight
  const double by_u = -(forward - a * cos_angle) / lever;
  const double by_v = -length * sideways / rise / lever;
  const double by_w = -(w - a * sin_angle) / lever;
  return Leg{angle, {by_u * cosine - by_v * sine, by_u * sine + by_v * cosine, by_w}};
}

struct Legs {
  Vec3 angles;
  Mat3 gradients;  // a row for each leg
};

std::optional<Legs> legs_at(Vec3 position) noexcept {
  const auto one = leg_at(position, legs[0]), two = leg_at(position, legs[1]), three = leg_at(position, legs[2]);
  if (!one || !two || !three) return std::nullopt;
  const Vec3 x = one->gradient, y = two->gradient, z = three->gradient;
  return Legs{{one->angle, two->angle, three->angle}, {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z}};
}

std::optional<Mat3> inverse(const Mat3& m) noexcept {
  const Vec3 x{m.xx, m.xy, m.xz}, y{m.yx, m.yy, m.yz}, z{m.zx, m.zy, m.zz};
  const Vec3 p = cross(y, z), q = cross(z, x), t = cross(x, y);
  const double determinant = dot(x, p);
  if (!(std::fabs(determinant) > 1e-9 * norm(x) * norm(y) * norm(z))) return std::nullopt;
  return (1 / determinant) * Mat3{p.x, q.x, t.x, p.y, q.y, t.y, p.z, q.z, t.z};
}

}  // namespace

std::optional<Vec3> angles_at(Vec3 position) noexcept {
  const auto legs = legs_at(position);
  return legs ? std::optional(legs->angles) : std::nullopt;
}

std::optional<Mat3> jacobian_at(Vec3 position) noexcept {
  const auto legs = legs_at(position);
  return legs ? inverse(legs->gradients) : std::nullopt;
}

std::optional<Pose> pose_from(Vec3 angles, Vec3 start) noexcept {
  constexpr int most_steps = 30, most_halvings = 12;
  constexpr double close_enough = 1e-10;  // rad; an encoder's step is 6e-4
  constexpr double longest_step = 0.02;   // m
  constexpr double useful = 1e-4;         // rad
  Vec3 position = start;
  auto legs = legs_at(position);
  for (int i = 0; legs; ++i) {
    const Vec3 rest = angles - legs->angles;
    const double error = largest_coordinate(rest);
    const auto jacobian = inverse(legs->gradients);
    if (!jacobian) return std::nullopt;
    if (error < close_enough || i == most_steps) {
      return error < useful ? std::optional(Pose{position, *jacobian, error}) : std::nullopt;
    }
    Vec3 step = *jacobian * rest;
    if (const double length = norm(step); length > longest_step) step = (longest_step / length) * step;
    bool is_better = false;
    for (int k = 0; k < most_halvings && !is_better; ++k, step = 0.5 * step) {
      const auto next = legs_at(position + step);
      is_better = next && norm(angles - next->angles) < norm(rest);
      if (!is_better) continue;
      position += step;
      legs = next;
    }
    if (!is_better) return error < useful ? std::optional(Pose{position, *jacobian, error}) : std::nullopt;
  }
  return std::nullopt;
}

std::optional<Pose> pose_at(Vec3 angles) noexcept {
  constexpr double aside = 0.035;  // m
  constexpr Vec3 starts[] = {{0, 0, 0},      {0, 0, aside}, {0, 0, -aside}, {aside, 0, 0},
                             {-aside, 0, 0}, {0, aside, 0}, {0, -aside, 0}};
  for (const Vec3 start : starts) {
    if (const auto pose = pose_from(angles, centre + start)) return pose;
  }
  return std::nullopt;
}

Vec3 angles_of(const std::array<int16_t, 3>& encoders) noexcept {
  const auto angle = [](int16_t count) { return angle_at_zero + radians_per_count * count; };
  return {angle(encoders[0]), angle(encoders[1]), angle(encoders[2])};
}

std::array<int16_t, 3> commands_of(Vec3 torques, double constant) noexcept {
  const Vec3 wanted = -constant * torques;
  if (!is_finite(wanted)) return {};
  const double largest = largest_coordinate(wanted);
  const double scale = largest > largest_command ? largest_command / largest : 1;
  const auto command = [&](double value) { return static_cast<int16_t>(std::lround(scale * value)); };
  return {command(wanted.x), command(wanted.y), command(wanted.z)};
}

double longest_lever() noexcept {
  constexpr int around = 48, layers = 8, rings = 4;
  double longest = 0;
  for (int i = 0; i <= layers; ++i) {
    for (int j = 0; j <= rings; ++j) {
      for (int k = 0; k < around; ++k) {
        const double y = workspace_height * (static_cast<double>(i) / layers - 0.5), radius = workspace_radius * j / rings;
        const double angle = 360 * degree * k / around;
        const auto m = jacobian_at(centre + Vec3{radius * std::cos(angle), y, radius * std::sin(angle)});
        if (!m) continue;
        longest = std::max({longest, norm({m->xx, m->yx, m->zx}), norm({m->xy, m->yy, m->zy}), norm({m->xz, m->yz, m->zz})});
      }
    }
  }
  return longest;
}

}  // namespace fs::falcon
