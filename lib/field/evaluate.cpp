#include "field/evaluate.h"

#include <bit>
#include <cmath>

#include "base/error.h"
#include "field/lanes.h"
#include "field/proxies.h"

namespace fs {
namespace {

// The closest point of an object with formulas to a tool point. False: out of reach, or there is no direction. stiffness: N/m,
// gets what `out` cannot tell of it.
bool find_entry(const Object& object, const Pose& pose, Vec3 position, double radius, double weight, double slope,
                ClosestPoints::Entry& out, Mat3& stiffness, Hint* hint, Effort* effort, double& error) noexcept {
  out.weight = weight;
  const Vec3 offset = position - pose.position;
  const double support = object.law.support + radius;
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    const Vec3 normal = rotate(pose.orientation, {0, 0, 1});
    const double s = dot(normal, offset);
    if (!(std::fabs(s) <= support)) return false;
    out.direction = s < 0 ? -normal : normal;
    out.tangent = {};
    out.distance = std::fabs(s);
    out.is_turning = false;
    out.law = s < 0 ? &object.law.back : &object.law.front;
    return true;
  }
  if (object.primitive == FS_PRIMITIVE_POINT) {  // by the same arithmetic as the lanes of standing points
    out.distance = norm(offset);
    if (!(out.distance > least_distance && out.distance <= support)) return false;
    out.direction = (1 / out.distance) * offset;
    out.tangent = {};
    out.is_turning = true;
    out.law = &object.law.front;
    return true;
  }
  if (norm(offset) - object.radius > support) return false;
  Closest closest;
  const Vec3 local = rotate(conjugate(pose.orientation), offset);
  const bool is_found = find_closest(object, local, support, slope, closest, hint, effort);
  if (effort && effort->is_cut) error += weight * error_of(object, *effort, radius);
  if (!is_found || closest.direction == Vec3{}) return false;
  out.tangent = closest.feature == Feature::edge ? rotate(pose.orientation, closest.tangent) : Vec3{};
  out.distance = closest.distance;
  out.is_turning = closest.feature != Feature::face;
  out.law = closest.side == Side::back ? &object.law.back : &object.law.front;
  const Intensity f = slope < no_slope_limit && out.law->sense == FS_SENSE_REPULSIVE
                          ? evaluate(*out.law, nullptr, closest.distance, 0, radius)
                          : Intensity{};
  Ridge ridge;
  double ridge_error = 0;
  const bool is_ridge = find_blend(object, closest, f.force, local, slope, ridge, hint, effort, ridge_error);
  error += weight * ridge_error;
  if (!is_ridge) {
    out.direction = rotate(pose.orientation, closest.direction);
    return true;
  }
  const double size = norm(ridge.direction);
  const Vec3 mean = normalized(ridge.direction);
  // The lanes add the slope along the mean direction later, so it is left out here.
  stiffness += weight * rotated(pose.orientation,
                                change_at(ridge, closest.direction, f.slope, slope) + (-size * f.slope) * outer(mean, mean));
  out.direction = rotate(pose.orientation, mean);
  out.weight = weight * size;
  out.is_turning = false;
  return true;
}

void add_stiffness(const Mat3& stiffness, double weight, uint32_t lane, LaneSum& sum) noexcept {
  sum.xx[lane] += weight * stiffness.xx;
  sum.xy[lane] += weight * stiffness.xy;
  sum.xz[lane] += weight * stiffness.xz;
  sum.yy[lane] += weight * stiffness.yy;
  sum.yz[lane] += weight * stiffness.yz;
  sum.zz[lane] += weight * stiffness.zz;
}

// Adds the closest points of a row with formulas to `closest_points`. Where a lane is full, those that wait there are evaluated first;
// returns which of their rows gave a force.
uint64_t add_closest_points(const Object& object, const Motion& motion, uint32_t row, double weight, const ToolState& tool,
                            Hint* hints, Effort* effort, double slope, double& error, ClosestPoints& closest_points,
                            LaneSum& sum) noexcept {
  const uint32_t all = tool.all_points(), mask = tool.is_any_point ? all : object.point_mask() & all;
  if (mask == 0 || !(object.law.support >= 0)) return 0;
  const bool is_moved = motion.horizon > 0 || motion.has_offset(tool.time, tool.blend);
  const Pose moved = is_moved ? motion.at(tool.time, tool.blend) : Pose{};
  const Pose& pose = is_moved ? moved : motion.pose;
  uint64_t felt = 0;
  ClosestPoints::Entry entry;
  const bool is_one_point = (mask & (mask - 1)) == 0;  // as mostly
  const double each = is_one_point ? weight : weight * (1.0 / std::popcount(mask));
  Mat3 stiffness{};
  for_each_bit(mask, [&](uint32_t k) {
    const ToolState::Point& point = tool.points[k];
    if (!find_entry(object, pose, point.position, tool.point_radius, each, slope, entry, stiffness, hints ? hints + k : nullptr,
                    effort, error)) {
      return;
    }
    entry.arm = point.arm;
    if (!closest_points.has_room(row)) felt |= closest_points.take(tool.point_radius, sum);
    closest_points.add(row, entry);
  });
  add_stiffness(stiffness, 1, row % lane_count, sum);
  return felt;
}

void add_force(const ObjectForce& force, double weight, uint32_t lane, LaneSum& sum) noexcept {
  sum.fx[lane] += weight * force.wrench.force.x;
  sum.fy[lane] += weight * force.wrench.force.y;
  sum.fz[lane] += weight * force.wrench.force.z;
  sum.tx[lane] += weight * force.wrench.torque.x;
  sum.ty[lane] += weight * force.wrench.torque.y;
  sum.tz[lane] += weight * force.wrench.torque.z;
  add_stiffness(force.stiffness, weight, lane, sum);
}

}  // namespace

fs_response evaluate_near(const Scratches& scratches, Memory& memory, uint32_t view, uint64_t what, const ToolPoints& points,
                          const ToolState& tool, Effort* effort) noexcept {
  Proxies* const proxies = memory.proxies();
  const double reach = proxies ? proxies->reach(view, what) : 0;  // a proxy may be that far from its point
  memory.look(view, what, tool.pose * points.centre, points.radius + tool.point_radius + reach, tool.time);
  LaneSum sum;
  ClosestPoints closest_points;
  fs_response out{};
  out.error_bound = memory.omitted();
  const double point_weight = 1.0 / tool.count;
  memory.for_each_near(view, tool.time, [&](uint32_t number, const Chunk& chunk, uint64_t near, const Weight* given) {
    const uint64_t points_near = chunk.standing_at(near & chunk.rows->points(), tool.time, tool.blend);
    uint64_t felt = 0;
    for (unsigned k = 0; points_near && k < tool.count; ++k) {
      felt |= add_points(chunk, points_near, tool.points[k].position, tool.point_radius, tool.points[k].arm, given, point_weight,
                         sum);
    }
    const uint64_t solids_near = proxies ? near & chunk.rows->solids : 0;
    for_each_bit(solids_near, [&](uint32_t i) {
      const Row& row = chunk.row(i);
      const Scratch* const scratch = scratches.get(number * chunk_size + i);
      const double weight = given ? given[i].value() : 1;
      proxies->collect(view, what,
                       {.row = number * chunk_size + i,
                        .version = row.version,
                        .takes_over = row.takes_over,
                        .object = &row.as_felt(given),
                        .motion = &chunk.motion(i),
                        .weight = weight,
                        .begin = weight < 1 ? memory.newer_weight(row, tool.time) : 0,
                        .replaces = row.previous != no_row,
                        .parsers = scratch ? &scratch->parsers : nullptr,
                        .hints = scratch ? scratch->hints.get() : nullptr,
                        .start = row.start,
                        .is_bounded = given && (chunk.rows->bounded & bit_of(i))});
    });
    near &= ~solids_near;
    const uint64_t rows_near = near & ~points_near & (chunk.rows->by_closest_point | chunk.rows->points());
    for_each_bit(rows_near, [&](uint32_t i) {
      const Object& object = chunk.row(i).as_felt(given);
      const Scratch* const scratch = object.shape ? scratches.get(number * chunk_size + i) : nullptr;
      felt |= add_closest_points(object, chunk.motion(i), i, given ? given[i].value() : 1, tool,
                                 scratch ? scratch->hints.get() : nullptr, effort, object.bounds.slope, out.error_bound,
                                 closest_points, sum);
    });
    if (rows_near) felt |= closest_points.take(tool.point_radius, sum);
    for_each_bit(near & ~points_near & ~rows_near, [&](uint32_t i) {
      const Row& row = chunk.row(i);
      const Scratch* const scratch = scratches.get(number * chunk_size + i);
      ObjectForce got;
      const Object& object = row.as_felt(given);
      if (!evaluate_object(object, chunk.motion(i), row.start, tool, scratch ? &scratch->parsers : nullptr, got,
                           scratch ? scratch->hints.get() : nullptr, effort, object.bounds.slope)) {
        return;
      }
      const double weight = given ? given[i].value() : 1;
      add_force(got, weight, i % lane_count, sum);
      out.error_bound += weight * got.error;
      if (!(got.wrench.force == Vec3{})) felt |= bit_of(i);
    });
    out.felt_count += static_cast<uint32_t>(std::popcount(felt));
    if (given && (felt & chunk.rows->bounded)) out.flags |= FS_RESPONSE_CAPPED;
    for_each_bit(given ? felt : 0, [&](uint32_t i) {
      if (given[i].value() < 1) out.flags |= FS_RESPONSE_FADING;
    });
  });
  out.wrench = sum.wrench();
  out.stiffness = sum.stiffness();
  out.proxy = tool.pose;
  if (proxies) proxies->feel(view, what, tool, effort, out);
  return out;
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
