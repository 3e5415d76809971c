// The force of one object on a tool.
#pragma once

#include <forceserver/evaluate.h>

#include "field/snapshot.h"
#include "shape/primitive.h"
#include "shape/ridge.h"

namespace fs {

class ImpactBudget;

// The points of a tool where they are now, in the scene frame.
struct ToolState {
  Pose pose;
  struct Point {
    Vec3 position, velocity, arm;  // m, m/s, m from the origin of the tool
  };
  std::array<Point, FS_TOOL_POINTS_MAX> points;
  unsigned count;
  double point_radius = 0;     // m, of the ball that each point is
  double time;                 // s, scene time
  bool is_any_point = false;   // its point feels every object, whatever the object's tool_points
  double blend = 0;            // s, over which a servo spreads moves; 0: they are felt at once
  ImpactBudget* impacts = nullptr;    // of the servo; null: impacts are felt in full
  double scale = 1, force_scale = 1;        // of the frame through which a servo sees the scene

  uint32_t all_points() const noexcept { return count == 32 ? ~0u : (1u << count) - 1; }  // a bit for each

  // state's pose must be one.
  static ToolState at(const fs_state& state, const ToolPoints& points, double time, double blend = 0) noexcept;
};

// What one object gives.
struct ObjectForce {
  Wrench wrench{};
  Mat3 stiffness{};         // dF/dx, N/m, symmetric
  Vec3 point{};             // the closest point to the nearest tool point, scene frame
  double distance = never;  // m, of that; infinite: out of reach
  double error = 0;         // N, a bound of |force - exact force|
};

inline constexpr double no_slope_limit = std::numeric_limits<double>::infinity();

// [rt] The closest point of an object as find_ridge() wants it where the slope is limited; x: in the object's frame.
inline bool find_closest(const Object& object, Vec3 x, double range, double slope, Closest& out, Hint* hint,
                         Effort* effort) noexcept {
  const auto find = slope < no_slope_limit ? closest_point_ahead : closest_point;
  return find(object.primitive, object.shape.get(), x, range, out, hint, effort);
}
// [rt] Whether the force of an object is blended at x, in its frame. outward: N, away from the closest point. error: N, is
// added to where the search ends because its visits are used up; the direction is then that of the point closest to x.
inline bool find_blend(const Object& object, const Closest& closest, double outward, Vec3 x, double slope, Ridge& out, Hint* hint,
                       Effort* effort, double& error) noexcept {
  if (!(outward > 0) || !(slope < no_slope_limit)) return false;
  if (effort) effort->is_ridge_cut = false;
  const bool is_ridge = find_ridge(object.primitive, object.shape.get(), x, closest, outward / slope, out, hint, effort);
  if (effort && effort->is_ridge_cut) error += 2 * outward;
  return is_ridge;
}
// [rt] How a blended force of the size f(d) changes with the place, object frame. Across the ridge it falls by `slope`. Along the
// ridge the profile changes it by `change` (N/m) for each metre along `away`, in which d grows. The result is made symmetric, as
// that of a force with an energy is: half of the second part and half of its transpose.
Mat3 change_at(const Ridge& ridge, Vec3 away, double change, double slope) noexcept;
Mat3 rotated(const Quat& by, const Mat3& m) noexcept;  // [rt]
// [rt] A bound of |force - exact force|, N, on a tool point for which the search was cut: the direction is not
// known, and of the distance only a lower bound.
double error_of(const Object& object, const Effort& effort, double radius = 0) noexcept;

// [rt] Adds the force that an object's profiles give one tool point, times `point_weight`. closest: of the object, in its own frame;
// pose: of the object; t: s, of the profiles; x: the tool point in the object's frame. slope, hint, effort: see evaluate_object.
void add_profile_force(const Object& object, const Closest& closest, const Motion& motion, const Pose& pose, double t,
                       const ToolState::Point& point, const ToolState& tool, const Law::Parsers* parsers, double point_weight,
                       ObjectForce& out, Vec3 x = {}, double slope = no_slope_limit, Hint* hint = nullptr,
                       Effort* effort = nullptr) noexcept;

// [rt] False when the object is out of reach of every point that feels it; out is as it was. parsers: may be null without
// curves. hints: of each point; may be null. effort: null: without end. slope: N/m, the steepest that the object's force may
// have: with it a repulsive force is blended where several places are equally near (ridge.h); no limit: it is not.
bool evaluate_object(const Object& object, const Motion& motion, double start, const ToolState& tool, const Law::Parsers* parsers,
                     ObjectForce& out, Hint* hints = nullptr, Effort* effort = nullptr, double slope = no_slope_limit) noexcept;

}  // namespace fs
