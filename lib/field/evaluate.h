// The force of a snapshot's objects on a tool. Pure but for the reader's own memory: the same input gives the same bits.
#pragma once

#include <forceserver/evaluate.h>

#include "field/lanes.h"
#include "field/memory.h"

namespace fs {

// The parsers of a row's custom profiles, of one reader. Made by whoever posts the row; only the reader uses them.
struct Scratch : LocalCounted<Scratch> {
  uint64_t version = 0;
  Law::Parsers parsers;

  static Ref<Scratch> of(const Law& law) {
    Ref<Scratch> out = make_ref<Scratch>();
    out->parsers = law.make_parsers();
    return out;
  }
};
using Scratches = Table<Scratch, 6>;  // by row

// What is posted to a reader.
struct Posting {
  Ref<const Snapshot> snapshot;
  Scratches scratches;  // this reader's own
  friend bool operator==(const Posting& a, const Posting& b) noexcept { return a.snapshot == b.snapshot; }
};

// The points of a tool where they are now, in the scene frame.
struct ToolState {
  Pose pose;
  struct Point {
    Vec3 position, velocity, arm;  // m, m/s, m from the origin of the tool
  };
  std::array<Point, FS_TOOL_POINTS_MAX> points;
  unsigned count;
  double time;                 // s, scene time
  bool is_any_point = false;   // its point feels every object, whatever the object's tool_points

  // state's pose must be one.
  static ToolState at(const fs_state& state, const ToolPoints& points, double time) noexcept;
};

// What one object gives.
struct Share {
  Wrench wrench{};
  Mat3 stiffness{};         // dF/dx, N/m, symmetric
  Vec3 point{};             // the closest point to the nearest tool point, scene frame
  double distance = never;  // m, of that; infinite: out of reach
};

// [rt] False when the object is out of reach of every point that feels it; out is as it was.
bool evaluate_object(const Object& object, const Motion& motion, double start, const ToolState& tool,
                     const Law::Parsers* parsers, Share& out) noexcept;

// [rt] The sum of what can be felt of the snapshot that `memory` has absorbed, each object with its weight, seen through a
// view. `what`: see Memory::look.
fs_response evaluate_near(const Scratches& scratches, Memory& memory, uint32_t view, uint64_t what, const ToolPoints& points,
                          const ToolState& tool) noexcept;

// [rt] A state that can be evaluated: finite, within bounds, a unit orientation (made so in place).
fs_status check_state(fs_state& state) noexcept;

}  // namespace fs
