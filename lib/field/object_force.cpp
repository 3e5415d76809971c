#include "field/object_force.h"

#include <bit>
#include <cmath>

namespace fs {
namespace {

// Derivative of the unit direction from p to x, times d: how much of a sideways motion turns the force.
Mat3 turning(const Closest& closest, Vec3 direction, Vec3 tangent) {
  Mat3 m = identity() + -1.0 * outer(direction, direction);
  if (closest.feature == Feature::edge) m += -1.0 * outer(tangent, tangent);
  return m;
}

// The contact of a point without memory: a closed mesh or a plane pushes it to the nearest place of its surface. False: the
// point is on the side that is kept; what its profiles give is not included.
bool add_resting_contact(const Object& object, const Closest& closest, const Pose& pose, const ToolState::Point& point,
                         ObjectForce& out) noexcept {
  const fs_keep keep = object.contact.keep;
  if (keep == FS_KEEP_EITHER || closest.side == (keep == FS_KEEP_BACK ? Side::back : Side::front)) return false;
  if (object.primitive == FS_PRIMITIVE_MESH && !object.shape->closed) return false;
  const Vec3 direction = rotate(pose.orientation, closest.direction);  // away from the surface
  const Vec3 force = -std::min(stiffness_of(object.contact) * closest.distance, object.contact.limit) * direction;
  out.wrench.force += force;
  out.wrench.torque += cross(point.arm, force);
  return true;
}

}  // namespace

ToolState ToolState::at(const fs_state& state, const ToolPoints& points, double time, double blend) noexcept {
  ToolState tool;
  tool.pose = state.pose;
  tool.count = static_cast<unsigned>(points.points.size());
  tool.time = time;
  tool.blend = blend;
  tool.point_radius = points.point_radius;
  for (size_t i = 0; i < tool.count; ++i) {
    const Vec3 arm = rotate(state.pose.orientation, points.points[i]);
    tool.points[i] = {state.pose.position + arm, state.twist.linear + cross(state.twist.angular, arm), arm};
  }
  return tool;
}

Mat3 rotated(const Quat& by, const Mat3& m) noexcept {
  const Mat3 r = to_matrix(by);
  return r * m * transposed(r);
}

Mat3 change_at(const Ridge& ridge, Vec3 away, double change, double slope) noexcept {
  const Vec3 along = ridge.direction - ridge.across * ridge.direction;
  return (0.5 * change) * (outer(along, away) + outer(away, along)) + -slope * ridge.across;
}

double error_of(const Object& object, const Effort& effort, double radius) noexcept {
  const double least = std::max(0.0, effort.least - radius);
  const double most = std::max(most_between(object.law.front, least, object.law.support),
                               most_between(object.law.back, least, object.law.support));
  return 2 * (object.damping > 0 && most > 0 ? std::max(object.law.front.limit, object.law.back.limit) : most);
}

void add_profile_force(const Object& object, const Closest& closest, const Motion& motion, const Pose& pose, double t,
                       const ToolState::Point& point, const ToolState& tool, const Law::Parsers* parsers, double point_weight,
                       ObjectForce& out, Vec3 x, double slope, Hint* hint, Effort* effort) noexcept {
  if (closest.direction == Vec3{}) return;  // on a point or polyline there is none
  const double s = closest.side == Side::back ? -closest.distance : closest.distance;
  const Intensity g = object.law.at(s, t, parsers, tool.point_radius);
  if (g.force == 0 && g.slope == 0) return;

  const double outward = closest.side == Side::back ? -g.force : g.force;
  Ridge ridge;
  double error = 0;
  const bool is_ridge = find_blend(object, closest, outward, x, slope, ridge, hint, effort, error);
  out.error += point_weight * error;
  // Away from the closest point.
  const Vec3 direction = rotate(pose.orientation, is_ridge ? ridge.direction : closest.direction);
  Vec3 force = outward * direction;
  if (object.damping > 0 && g.force != 0) {
    const Vec3 velocity = point.velocity - motion.velocity(point.position, pose, tool.time, tool.blend);
    force += -object.damping * velocity;
    const double magnitude = norm(force), limit = object.law.limit(s);
    if (magnitude > limit) force = (limit / magnitude) * force;
  }
  out.wrench.force += point_weight * force;
  out.wrench.torque += point_weight * cross(point.arm, force);
  if (is_ridge) {
    out.stiffness += point_weight * rotated(pose.orientation, change_at(ridge, closest.direction, g.slope, slope));
    return;
  }
  out.stiffness += (point_weight * g.slope) * outer(direction, direction);
  if (closest.feature != Feature::face && closest.distance > 0) {
    const Vec3 tangent = rotate(pose.orientation, closest.tangent);
    out.stiffness += (point_weight * outward / closest.distance) * turning(closest, direction, tangent);
  }
}

bool evaluate_object(const Object& object, const Motion& motion, double start, const ToolState& tool, const Law::Parsers* parsers,
                     ObjectForce& out, Hint* hints, Effort* effort, double slope) noexcept {
  const uint32_t all = tool.all_points();
  const uint32_t mask = tool.is_any_point ? all : object.point_mask() & all;
  const double own_support = object.support(), support = own_support + tool.point_radius;
  if (mask == 0 || !(own_support >= 0)) return false;
  const double point_weight = 1.0 / std::popcount(mask);
  const Vec3 origin = motion.position_at(tool.time, tool.blend);
  Pose pose;
  bool has_pose = false, is_near = false;
  for_each_bit(mask, [&](uint32_t k) {
    const ToolState::Point& point = tool.points[k];
    const Vec3 offset = point.position - origin;
    if (norm(offset) - object.radius > support) return;
    if (!has_pose) pose = motion.at(tool.time, tool.blend);  // what is far, as most is, needs no orientation
    has_pose = true;
    const Vec3 local = rotate(conjugate(pose.orientation), offset);
    Closest closest;
    const bool is_found = find_closest(object, local, support, slope, closest, hints ? hints + k : nullptr, effort);
    const bool is_cut = effort && effort->is_cut;
    if (!is_found && !is_cut) return;
    if (!is_near) out = {};
    is_near = true;
    if (is_cut) out.error += point_weight * error_of(object, *effort, tool.point_radius);
    if (!is_found) return;
    if (const double gap = std::max(0.0, closest.distance - tool.point_radius); gap < out.distance) {
      out.distance = gap;
      out.point = pose * closest.point;
    }
    if (object.is_solid() && add_resting_contact(object, closest, pose, point, out)) return;
    add_profile_force(object, closest, motion, pose, tool.time - start, point, tool, parsers, point_weight, out, local, slope,
                      hints ? hints + k : nullptr, effort);
  });
  return is_near;
}

}  // namespace fs
