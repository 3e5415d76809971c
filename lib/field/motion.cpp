#include "field/motion.h"

#include <string>

#include "base/error.h"
#include "field/object.h"

namespace fs {
namespace {

// The cubic that falls from 1 to 0, and the one that begins at 0 with slope 1 and ends at 0, over u from 0 to 1; with
// their slopes. Both end with slope 0.
struct Decay {
  double way, drift, way_rate, drift_rate;
  explicit Decay(double u) noexcept
      : way((1 - u) * (1 - u) * (1 + 2 * u)), drift(u * (1 - u) * (1 - u)), way_rate(-6 * u * (1 - u)),
        drift_rate((1 - u) * (1 - 3 * u)) {}
};

Decay decay_at(const Motion::Offset& offset, double t, double blend) noexcept {
  return Decay(std::clamp((t - offset.begun) / blend, 0.0, 1.0));
}

constexpr double small_angle = 1e-6;  // rad: below it the series below are cut

// spin_of: the angular velocity of a rotation whose rotation vector v changes at `rate` (the left Jacobian of the rotations);
// rate_of: its inverse. The angle is within pi.
Vec3 spin_of(Vec3 v, Vec3 rate) noexcept {
  const double angle = norm(v);
  if (angle < small_angle) return rate + 0.5 * cross(v, rate);
  const Vec3 axis = (1 / angle) * v;
  const double s = std::sin(angle) / angle;
  return s * rate + ((1 - s) * dot(axis, rate)) * axis + ((1 - std::cos(angle)) / angle) * cross(axis, rate);
}
Vec3 rate_of(Vec3 v, Vec3 spin) noexcept {
  const double angle = norm(v);
  if (angle < small_angle) return spin + -0.5 * cross(v, spin);
  const Vec3 axis = (1 / angle) * v;
  const double half = 0.5 * angle, c = half / std::tan(half);
  return c * spin + ((1 - c) * dot(axis, spin)) * axis + -half * cross(axis, spin);
}

}  // namespace

bool check_motion(Motion& m) noexcept {
  return make_unit_pose(m.pose) && is_in_range(m.twist.linear) && is_in_range(m.twist.angular) && std::isfinite(m.time) &&
         m.horizon >= 0 && m.horizon <= extrapolation_limit;
}

Motion parse_motion(Motion motion, const char* of) {
  if (check_motion(motion)) return motion;
  const auto named = [of](const char* field) { return std::string(of) + field; };
  parse_pose(motion.pose, named("pose").c_str());
  parse_twist(motion.twist, named("twist").c_str());
  parse_finite(motion.time, named("time").c_str());
  fail(FS_ERROR_INVALID, "%shorizon is %.9g, must be within 0..%.9g s", of, motion.horizon, extrapolation_limit);
}

Vec3 Motion::way_at(double t, double blend) const noexcept {
  const Decay now = decay_at(offset, t, blend);
  return now.way * offset.way + now.drift * offset.drift;
}

void Motion::add_offset(double t, double blend, Pose& out) const noexcept {
  const Decay now = decay_at(offset, t, blend);
  out.position += now.way * offset.way + now.drift * offset.drift;
  const Vec3 turn = now.way * offset.turn + now.drift * offset.spin;
  if (!(turn == Vec3{})) out.orientation = normalized(exp_rotation(turn) * out.orientation);
}

Twist Motion::twist_at(double t, double blend) const noexcept {
  const double dt = t - time, round = rounding(blend), over = dt - horizon + round;
  const bool is_used = dt >= 0 && dt < horizon + round;
  const double part = !is_used ? 0 : over > 0 ? 1 - over / (2 * round) : 1;
  Twist out{part * twist.linear, part * twist.angular};
  if (!has_offset(t, blend)) return out;
  const Decay now = decay_at(offset, t, blend);
  const auto rate = [&](Vec3 way, Vec3 drift) { return (1 / blend) * (now.way_rate * way + now.drift_rate * drift); };
  out.linear += rate(offset.way, offset.drift);
  const Vec3 turn = now.way * offset.turn + now.drift * offset.spin;
  out.angular = rotate(exp_rotation(turn), out.angular) + spin_of(turn, rate(offset.turn, offset.spin));
  return out;
}

bool Motion::says_the_same(const Motion& other) const noexcept {
  const auto are_equal = [](const Quat& a, const Quat& b) { return a.w == b.w && a.x == b.x && a.y == b.y && a.z == b.z; };
  return pose.position == other.pose.position && are_equal(pose.orientation, other.pose.orientation) &&
         twist.linear == other.twist.linear && twist.angular == other.twist.angular && time == other.time &&
         horizon == other.horizon;
}

void Motion::go_on_from(const Motion& before, double t, double blend) noexcept {
  if (says_the_same(before)) {
    offset = before.offset;
    return;
  }
  offset = {};
  const Pose from = before.at(t, blend), to = at(t, blend);
  const Twist was = before.twist_at(t, blend), is = twist_at(t, blend);
  const Vec3 turn = log_rotation(from.orientation * conjugate(to.orientation));
  offset.way = from.position - to.position;
  offset.drift = blend * (was.linear - is.linear);
  offset.turn = turn;
  offset.spin = blend * rate_of(turn, was.angular - rotate(exp_rotation(turn), is.angular));
  const Vec3 none{};
  if (offset.way == none && offset.drift == none && offset.turn == none && offset.spin == none) return;
  offset.begun = t;
}

void Motion::begin_offset(double t, double blend) noexcept {
  const double late = std::min((t - offset.begun) / blend, 1.0 / 3);
  if (!(late > 0)) return;
  offset.way += late * offset.drift;
  offset.turn += late * offset.spin;
  offset.begun = t;
}

double Motion::jump_from(const Motion& before, double t, double blend, double lever) const noexcept {
  const Pose from = before.at(t, blend), to = at(t, blend);
  const double angle = norm(log_rotation(from.orientation * conjugate(to.orientation)));
  return norm(from.position - to.position) + (angle > 0 ? lever * angle : 0);
}

}  // namespace fs
