#include "scene/evaluate.h"

#include "base/error.h"
#include "force/primitive.h"

namespace fs {
namespace {

// Derivative of the unit direction from p to x, times d: how much of a sideways motion turns the force.
Mat3 turning(const Closest& closest, Vec3 direction, Vec3 tangent) {
  Mat3 m = identity() + -1.0 * outer(direction, direction);
  if (closest.feature == Feature::edge) m += -1.0 * outer(tangent, tangent);
  return m;
}

// The force of one side's profile on one tool point.
void add_profile(const Profile& profile, const Object& object, const Closest& closest, const Motion& motion,
                 const Pose& pose, double t, const ToolState::Point& point, const ToolState& tool, double share,
                 Share& out) noexcept {
  const Intensity intensity = evaluate(profile, tool.reader, closest.distance, t);
  if (!(intensity.force > 0) && intensity.slope == 0) return;
  if (closest.direction == Vec3{}) return;  // on a point or polyline there is none

  const Vec3 direction = rotate(pose.orientation, closest.direction);
  const Vec3 tangent = rotate(pose.orientation, closest.tangent);
  const double sign = profile.sense == FS_SENSE_REPULSIVE ? 1 : -1;
  Vec3 force = sign * intensity.force * direction;
  if (object.damping > 0 && intensity.force > 0) {
    const Vec3 velocity = point.velocity - motion.velocity(point.position, pose, tool.time);
    force += -object.damping * velocity;
    const double magnitude = norm(force);
    if (magnitude > profile.limit) force = (profile.limit / magnitude) * force;
  }
  out.wrench.force += share * force;
  out.wrench.torque += share * cross(point.arm, force);
  out.stiffness += (share * sign * intensity.slope) * outer(direction, direction);
  if (closest.feature != Feature::face && closest.distance > 0) {
    out.stiffness += (share * sign * intensity.force / closest.distance) * turning(closest, direction, tangent);
  }
}

}  // namespace

ToolState ToolState::at(const fs_state& state, const Vec3* points, size_t count, double time,
                        unsigned reader) noexcept {
  ToolState tool;
  tool.pose = state.pose;
  tool.count = static_cast<unsigned>(count);
  tool.time = time;
  tool.reader = reader;
  for (size_t i = 0; i < count; ++i) {
    const Vec3 arm = rotate(state.pose.orientation, points[i]);
    tool.points[i] = {state.pose.position + arm, state.twist.linear + cross(state.twist.angular, arm), arm};
  }
  return tool;
}

bool evaluate_object(const Object& object, const Motion& motion, double start, const ToolState& tool,
                     Share& out) noexcept {
  const uint32_t all = tool.count == 32 ? ~0u : (1u << tool.count) - 1;
  const uint32_t mask = tool.is_any_point ? all : object.point_mask() & all;
  if (mask == 0 || !(object.support >= 0)) return false;
  const double share = 1.0 / std::popcount(mask);
  const Vec3 origin = motion.position_at(tool.time);
  Pose pose;
  bool has_pose = false, is_near = false;
  for (uint32_t rest = mask; rest; rest &= rest - 1) {
    const ToolState::Point& point = tool.points[static_cast<size_t>(std::countr_zero(rest))];
    const Vec3 offset = point.position - origin;
    if (norm(offset) - object.radius > object.support) continue;
    if (!has_pose) pose = motion.at(tool.time);  // what is far, as most is, needs no orientation
    has_pose = true;
    const Vec3 local = rotate(conjugate(pose.orientation), offset);
    Closest closest;
    if (!closest_point(object.primitive, object.shape.get(), local, object.support, closest)) continue;
    if (!is_near) out = {};
    is_near = true;
    if (closest.distance < out.distance) {
      out.distance = closest.distance;
      out.point = pose * closest.point;
    }
    add_profile(closest.side == Side::front ? object.front : object.back, object, closest, motion, pose,
                tool.time - start, point, tool, share, out);
  }
  return is_near;
}

void add_share(fs_response& sum, const Share& share, double weight) noexcept {
  const bool is_felt = !(share.wrench.force == Vec3{});
  sum.wrench.force += weight * share.wrench.force;
  sum.wrench.torque += weight * share.wrench.torque;
  sum.stiffness += weight * share.stiffness;
  sum.felt_count += is_felt && weight > 0;
  if (is_felt && weight > 0 && weight < 1) sum.flags |= FS_RESPONSE_FADING;
}

fs_response evaluate_scene(const Snapshot& snapshot, const ToolState& tool) noexcept {
  fs_response sum{};
  sum.proxy = tool.pose;
  Share share;
  snapshot.objects.for_each([&](uint32_t, const Entry& entry) {
    if (!entry.is_present(tool.time)) return;
    if (evaluate_object(*entry.object, entry.motion, entry.start, tool, share)) add_share(sum, share, 1);
  });
  return sum;
}

fs_status check_state(fs_state& state) noexcept {
  if (!is_in_range(state.pose.position)) {
    return set_last_error_literal(FS_ERROR_INVALID, "state.pose.position must be finite and within 1e15 m");
  }
  if (!make_unit_pose(state.pose)) {
    return set_last_error_literal(FS_ERROR_INVALID, "state.pose.orientation must be within 1e-3 of length 1, or all 0");
  }
  if (!is_in_range(state.twist.linear) || !is_in_range(state.twist.angular)) {
    return set_last_error_literal(FS_ERROR_INVALID, "state.twist must be finite and within 1e15 m/s, rad/s");
  }
  if (!(std::fabs(state.time) <= coordinate_limit)) {
    return set_last_error_literal(FS_ERROR_INVALID, "state.time must be finite and within 1e15 s");
  }
  for (const double reserved : state.reserved) {
    if (reserved != 0) return set_last_error_literal(FS_ERROR_INVALID, "state.reserved must be 0");
  }
  return FS_OK;
}

}  // namespace fs
