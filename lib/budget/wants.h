// What the objects of a scene want of the stiffness and damping that the loop can render, and where.
#pragma once

#include <vector>

#include "budget/fair.h"
#include "budget/limit.h"
#include "field/memory.h"
#include "field/snapshot.h"

namespace fs {

// What one row wants, in scene units.
struct ObjectWant {
  uint32_t row;
  const Object* object;
  bool is_moving;  // it is somewhere else a little later
  bool is_named;
  unsigned points;  // of the tool, that feel it
  double law = 0, contact = 0;  // N/m, of the contact on all points together
  double damping = 0;           // N s/m
  const Motion* motion;
};

// Those of all objects that may be felt where the tool may be. memory: see bounds_of. clear: lowered to the gap, m, between
// where the tool may be and the others.
std::vector<ObjectWant> object_wants(const Snapshot& snapshot, const SceneLimit& limit, double now, const Memory* memory,
                                     double& clear);

// The distances from an object up to which something of it is felt, m; below 0: nowhere.
struct Reach {
  double front, back;  // of a plane; else only the greater counts
};

// A contact of this stiffness, N/m: as deep as it can be; infinite for 0.
Reach contact_reach(const ObjectWant& want, double stiffness);
// The whole object, with a contact of this stiffness.
Reach felt_reach(const ObjectWant& want, double stiffness);

// What all of them want, place by place.
struct SlopeWants {
  const SceneLimit& limit;
  double now;  // s
  std::vector<SlopeWant> all{};

  // number: of the want. user: see SlopeWant. slope: N/m, or N s/m of damping.
  void add(const ObjectWant& want, size_t number, size_t user, Reach reach, double slope);
  // Adds the steep part of a force that has this bound, N/m, and what is left of its slope farther away.
  void add_law(const ObjectWant& want, size_t number, size_t user, double bound);

  FairBounds bounds(size_t users, double most) const;  // most: what they may have together at one place
  double most_wanted() const;                          // together at one place
  void lower_to_gap(double& clear) const;              // clear: to the gap, m, between where the tool may be and any of them
};

}  // namespace fs
