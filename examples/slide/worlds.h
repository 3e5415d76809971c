// The two worlds of the example, and how they should fit together.
//
// The arm's world is in metres; its origin is the shoulder of the arm. The terrain's world is a model of the place, ten
// times smaller. The rover with the arm stands at `base` in it, and looks 30 degrees to the left of the model's x axis.
#pragma once

#include <forceserver/forceserver.h>
#include <cmath>
#include <cstdio>
#include <cstdlib>

inline void check(fs_status status) {
  if (status >= 0) return;
  std::fprintf(stderr, "%s\n", fs_last_error());
  std::exit(1);
}

inline constexpr double model = 0.1;                          // metres of the terrain's world per metre of the arm's
inline constexpr double arm_scale = 6;                        // metres of the arm's world per metre of the hand
inline constexpr fs_vec3 base = {2.4, 1.7, 0.12};             // m, the shoulder in the terrain's world
inline constexpr fs_vec3 centre = {0.8, 0, -0.1};             // m, where the arm's tip is for a hand at the device's origin
inline const double heading_cos = std::cos(M_PI / 6), heading_sin = std::sin(M_PI / 6);

inline fs_vec3 turned(const fs_vec3& v, double sign) {  // by the rover's heading, or back
  return {heading_cos * v.x - sign * heading_sin * v.y, sign * heading_sin * v.x + heading_cos * v.y, v.z};
}

// The same place in the other world, as it should be.
inline fs_vec3 in_terrain(const fs_vec3& arm) {
  const fs_vec3 v = turned(arm, 1);
  return {base.x + model * v.x, base.y + model * v.y, base.z + model * v.z};
}
inline fs_vec3 in_arm(const fs_vec3& terrain) {
  return turned({(terrain.x - base.x) / model, (terrain.y - base.y) / model, (terrain.z - base.z) / model}, -1);
}

// The frames with which the worlds agree: each point of the device is the same place in both.
inline fs_frame arm_frame() {
  fs_frame frame = fs_frame_init();
  frame.scale = arm_scale;
  frame.pose.position = {-centre.x / arm_scale, -centre.y / arm_scale, -centre.z / arm_scale};
  return frame;
}
inline fs_frame terrain_frame() {
  fs_frame frame = fs_frame_init();
  frame.scale = arm_scale * model;
  frame.pose.orientation = {std::cos(M_PI / 12), 0, 0, -std::sin(M_PI / 12)};
  const fs_vec3 origin = in_arm({0, 0, 0});  // of the terrain's world
  frame.pose.position = {(origin.x - centre.x) / arm_scale, (origin.y - centre.y) / arm_scale, (origin.z - centre.z) / arm_scale};
  return frame;
}

// The point of the device that a point of a world is seen at.
inline fs_vec3 on_device(const fs_frame& frame, const fs_vec3& v) {
  fs_pose pose = {v, {1, 0, 0, 0}};
  check(fs_frame_to_device(&frame, &pose, &pose));
  return pose.position;
}
