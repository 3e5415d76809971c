// The force of a scene's objects on a tool. Pure: the same input gives the same bits.
#pragma once

#include "scene/snapshot.h"

namespace fs {

// The points of a tool where they are now, in the scene frame.
struct ToolState {
  Pose pose;
  struct Point {
    Vec3 position, velocity, arm;  // m, m/s, m from the origin of the tool
  };
  std::array<Point, FS_TOOL_POINTS_MAX> points;
  unsigned count;
  double time;      // s, scene time
  unsigned reader;  // of the thread that evaluates
  bool is_any_point = false;  // it feels what any point of a tool would, whichever the object is meant for

  // points: m, frame of the handle. state's pose must be one.
  static ToolState at(const fs_state& state, const Vec3* points, size_t count, double time, unsigned reader) noexcept;
};

// What one object gives.
struct Share {
  Wrench wrench{};
  Mat3 stiffness{};      // dF/dx, N/m
  Vec3 point{};          // the closest point to the nearest tool point, scene frame
  double distance = never;  // m, of that; infinite: out of reach
};

// [rt] False when the object is out of reach of every point that feels it; out is as it was.
bool evaluate_object(const Object& object, const Motion& motion, double start, const ToolState& tool,
                     Share& out) noexcept;

// [rt] Everything that is present, in full: as a tool of one's own feels it, without frame, fade or guard.
fs_response evaluate_scene(const Snapshot& snapshot, const ToolState& tool) noexcept;

// [rt] Adds one object's share to the sum, weighted.
void add_share(fs_response& sum, const Share& share, double weight) noexcept;

// [rt] A state that can be evaluated: finite, within bounds, a unit orientation (made so in place).
fs_status check_state(fs_state& state) noexcept;

}  // namespace fs
