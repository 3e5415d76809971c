// What each object of a scene may have of the stiffness and damping that a servo's loop can render: all that is felt at the
// same places shares it fairly (budget.h). Only the objects that may be felt where the tool may be are looked at.
#pragma once

#include <string>
#include <vector>

#include "field/memory.h"
#include "field/snapshot.h"

namespace fs {

// What the loop leaves to one scene, at the device.
struct LoopShare {
  double stiffness = never;  // N/m
  double whole = never;      // N/m, what it leaves to all scenes together
  double damping = never;    // N s/m
  double lever = never;      // m: a torque about the handle counts as a force on a point so far from it
  double radius = 0, height = 0;  // m, of the device's workspace, a cylinder about z; 0: not known
  double speed = never;      // m/s, faster the hand is never
  bool operator==(const LoopShare&) const = default;
};

// The others that are felt where an object gets less than it wants.
struct SharedWith {
  std::vector<std::string> names;  // some of them, first those that want most
  size_t count = 0;                // of all
  bool has_clients = false;        // other clients have a part of what the loop can render
  std::string text(size_t room) const;  // of `room` bytes at most: the names that fit, such as "a, b and 17 more"
};

struct Admitted {
  uint32_t row;
  const Object* object;
  bool is_moving;  // it is somewhere else a little later
  Bounds bounds;   // one that the object does not need is no_bound
  SharedWith shared_with;
};

// The share in scene units, for the frames and tools through which the scene may be felt. most: N/m at the device, what the
// scene itself allows; 0: no such bound.
struct SceneShare {
  double stiffness, damping;  // N/m, N s/m, of the scene
  double whole;               // N/m: how much of it the scene could have if it were alone
  double blend, ahead;        // s: over which moves are spread; for how long the shares must hold
  double to_device;           // a slope of the scene times this is one at the device; 0: nothing is felt
  double to_loop;             // the same, as the loop can render it: with torques it is harder
  unsigned points;            // of the tool
  double arm;                 // m, how far its points are from the handle
  Box within;                 // m, where the tool may be; empty: anywhere
};
// ahead: see SceneShare.
SceneShare share_of(const Views& views, const LoopShare& share, double most, double blend, double ahead);

// The bounds of a new object, as if it were alone in the scene.
Bounds bounds_alone(const SceneShare& share) noexcept;

struct Admission {
  std::vector<Admitted> objects;  // that may be felt where the tool may be
  double clear = never;           // m: where it may be can grow by so much to each side before more objects are felt there
  bool has_fading = false;        // something that fades out has a share of its own
  double wanted = never;          // N/m of the loop: what its objects want together at most; worked out beside other scenes
};

// The bounds of the objects that may be felt there, at time `now` (s); those of an object that shares with none are as if it
// were alone. A version that fades out keeps its own bounds. It has a share of its own only where the newest is not felt.
// memory: of the servo, which knows what has faded out; null: all that is disabled has.
Admission admit(const Snapshot& snapshot, const SceneShare& share, double now, const Memory* memory);

}  // namespace fs
