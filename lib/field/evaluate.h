// The force of a snapshot's objects on a tool. Pure but for the reader's own memory: the same input gives the same bits.
#pragma once

#include <forceserver/evaluate.h>

#include "field/lanes.h"
#include "field/memory.h"
#include "shape/primitive.h"

namespace fs {

// What a reader needs to evaluate a row: the parsers of its custom profiles, and hints for each point of a tool. Made by
// whoever posts the row; only the reader uses it.
struct Scratch : LocalCounted<Scratch> {
  uint64_t version = 0;
  Law::Parsers parsers;
  std::unique_ptr<Hint[]> hints;  // of a mesh that is not small; else null

  static bool is_needed(const Object& object) { return object.law.has_curves() || has_hints(object); }
  // Null where none is needed.
  static Ref<Scratch> of(const Object& object) {
    if (!is_needed(object)) return nullptr;
    Ref<Scratch> out = make_ref<Scratch>();
    out->parsers = object.law.make_parsers();
    if (has_hints(object)) out->hints = std::make_unique<Hint[]>(FS_TOOL_POINTS_MAX);
    return out;
  }

 private:
  static bool has_hints(const Object& object) {
    constexpr size_t small = 64;  // triangles
    return object.primitive == FS_PRIMITIVE_MESH && object.shape->triangles.size() > 3 * small;
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
  double blend = 0;            // s, over which a servo spreads moves; 0: they are felt at once

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
bool find_closest(const Object& object, Vec3 x, double range, double slope, Closest& out, Hint* hint, Effort* effort) noexcept;
// [rt] A bound of |force - exact force|, N, on a tool point for which the search was cut: the direction is not
// known, and of the distance only a lower bound.
double error_of(const Object& object, const Effort& effort) noexcept;

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

// [rt] The sum of what can be felt of the snapshot that `memory` has absorbed, each object with its weight, seen through a
// view. `what`: see Memory::look. effort: null: searches are not cut short.
fs_response evaluate_near(const Scratches& scratches, Memory& memory, uint32_t view, uint64_t what, const ToolPoints& points,
                          const ToolState& tool, Effort* effort = nullptr) noexcept;

// [rt] A state that can be evaluated: finite, within bounds, a unit orientation (made so in place).
fs_status check_state(fs_state& state) noexcept;

}  // namespace fs
