// The bounds of a scene's objects: what is felt at the same places shares the limit of the loop fairly (fair.h). Only the
// objects that may be felt where the tool may be are looked at.
#pragma once

#include <vector>

#include "budget/limit.h"
#include "field/memory.h"
#include "scene/shared_with.h"

namespace fs {

struct ObjectBounds {
  uint32_t row;
  const Object* object;
  bool is_moving;  // it is somewhere else a little later
  Bounds bounds;   // one that the object does not need is no_bound
  SharedWith shared_with;
};

struct SceneBounds {
  std::vector<ObjectBounds> objects;  // that may be felt where the tool may be
  double clear = never;  // m: the box where the tool may be can grow by this on every side before it reaches another object
  bool has_fading = false;  // something that fades out counts beside the others
  double wanted = never;  // N/m of the loop: the most that its objects want at one place; infinite if this is the only scene
};

// The bounds of the objects that may be felt there, at time `now` (s); those of an object that shares with none are as if it
// were alone. A version that fades out keeps its own bounds. It counts beside the others only where the newest is not felt.
// memory: of the servo, which knows what has faded out; null: what is disabled counts as faded out.
SceneBounds bounds_of(const Snapshot& snapshot, const SceneLimit& limit, double now, const Memory* memory);

}  // namespace fs
