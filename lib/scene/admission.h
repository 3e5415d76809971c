// What each object of a scene may have of the stiffness and damping that a servo's loop can render: all that wants it at the
// same places shares it, in proportion to what is wanted (budget.h).
#pragma once

#include <vector>

#include "field/snapshot.h"

namespace fs {

// What the loop leaves to one scene, at the device.
struct LoopShare {
  double stiffness = never;  // N/m
  double damping = never;    // N s/m
  double lever = never;      // m: a torque about the handle counts as a force on a point so far from it
  double radius = 0, height = 0;  // m, of the device's workspace, a cylinder about z; 0: not known
  double ahead = 0.1;        // s, until it is looked at again at the latest
  bool operator==(const LoopShare&) const = default;
};

struct Admitted {
  uint32_t row;
  const Object* object;
  bool is_moving;  // it is somewhere else a little later
  Bounds bounds;   // one that the object does not need is no_bound
};

// The share in scene units, for the frames and tools through which the scene may be felt. most: N/m at the device, what the
// scene itself allows; 0: no such bound.
struct SceneShare {
  double stiffness, damping;  // N/m, N s/m, of the scene
  double blend, ahead;        // s: over which moves are spread; for how long the shares must hold
  double to_device;           // a slope of the scene times this is one at the device; 0: nothing is felt
  unsigned points;            // of the tool
  Box within;                 // m, where the tool may be; empty: anywhere
};
SceneShare share_of(const Views& views, const LoopShare& share, double most, double blend);

// The bounds of a new object, as if it were alone in the scene.
Bounds bounds_alone(const SceneShare& share) noexcept;

// The bounds of the objects that may be felt, at time `now` (s); those of an object that shares with none are as if it were
// alone. A version that fades out keeps its own bounds. It has a share of its own only where the newest is not felt.
std::vector<Admitted> admit(const Snapshot& snapshot, const SceneShare& share, double now);

}  // namespace fs
