// The limit of a servo's loop, as it holds for one scene: at the device, and in units of the scene.
#pragma once

#include "field/snapshot.h"

namespace fs {

// What the loop leaves to one scene, at the device.
struct DeviceLimit {
  double stiffness = never;  // N/m
  double whole = never;      // N/m, what it leaves to all scenes together
  double damping = never;    // N s/m
  double lever = never;      // m: a torque about the handle counts as a force on a point so far from it
  double radius = 0, height = 0;  // m, of the device's workspace, a cylinder about z; 0: not known
  double speed = never;      // m/s, the fastest that the hand can be
  ImpactLimit impact;        // of surfaces, of all scenes together
  bool operator==(const DeviceLimit&) const = default;
};

// The same in scene units, for the frames and tools through which the scene may be felt.
struct SceneLimit {
  double stiffness, damping;  // N/m, N s/m, of the scene
  double whole;               // N/m: what the scene could have if it were alone
  bool is_split;              // other scenes have a part of what the loop can render
  double blend;               // s, over which a move of an object is spread
  double ahead;               // s, for which the bounds must hold from now on
  double to_device;           // a slope of the scene times this is one at the device; 0: nothing is felt
  double to_loop;             // the same, as the loop can render it: with torques it is harder
  unsigned points;            // of the tool
  double arm;                 // m, how far its points are from the handle
  Box within;                 // m, where the tool may be; empty: anywhere
};
// max_stiffness: N/m at the device, what the scene itself allows; 0: no such bound. blend, ahead: see SceneLimit.
SceneLimit scene_limit(const Views& views, const DeviceLimit& limit, double max_stiffness, double blend, double ahead);

// The bounds of a new object, as if it were alone in the scene.
Bounds bounds_alone(const SceneLimit& limit) noexcept;

}  // namespace fs
