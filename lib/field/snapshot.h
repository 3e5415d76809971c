// The immutable form of a scene that a reader (the servo, a tool) evaluates. Everything in it is data; a reader only looks
// at it. What a reader finds out goes into its own memory (memory.h).
//
// Each object is a row. A name that changes while it is felt, by more than a move, has several rows for a while: one for
// each version (weight.h). Rows stand in chunks of 64: the chunk is what a change copies and what a reader can pass over.
//
// Four counters tell what has changed. Each only grows:
//   version   of a row or a view: another for each version of a name, so that a row that is used again is not taken for what was
//             there before.
//   sequence  of a snapshot: what is posted later has a larger one. Chunks keep that of their last change.
//   revision  of an object, for applications: grows with every change but moves; its motion_revision grows with moves, too.
//   serial    of a shape, a curve or a message of a client: which one it is.
#pragma once

#include <cmath>
#include <vector>

#include "base/bits.h"
#include "base/counted.h"
#include "field/motion.h"
#include "field/object.h"
#include "field/table.h"
#include "field/weight.h"
#include "law/kind.h"

namespace fs {

inline constexpr uint32_t chunk_size = 64;

// A version of an object, but for its motion.
struct Row : Version {
  Ref<const Object> object;
  Ref<const Object> bounded;    // as a servo evaluates it; null: as it is
  double start = 0;             // s, t = 0 of f(d, t)
  uint64_t revision = 0;        // of the last change but moves
  bool is_named = false;        // the newest row of a name that is there
  const Object& as_felt(bool by_servo) const noexcept { return by_servo && bounded ? *bounded : *object; }
};

// Whether a profile can be evaluated several at a time, so that nothing overflows.
inline bool fits_lanes(const Profile& f) noexcept {
  return !f.curve && std::fabs(f.gain) < 1e100 && !(f.cap && f.cap->slope >= 1e100);
}
// The numbers of such profiles, by lane. limit: negative where the sense is attractive.
template <uint32_t count>
struct FormulaLanes {
  double offset[count], gain[count], per_width[count], limit[count], reach[count];

  // Returns the form.
  Form set(uint32_t i, const Profile& profile) noexcept {
    const Formula f(profile);
    offset[i] = f.offset;
    gain[i] = f.gain;
    per_width[i] = f.form == Form::gaussian ? 1 / f.width : 1;
    limit[i] = profile.sense == FS_SENSE_REPULSIVE ? f.limit : -f.limit;
    reach[i] = f.reach;
    return f.form;
  }
};

// The caps of formulas that are evaluated several at a time: see struct Cap.
template <uint32_t count>
struct CapLanes {
  double slope[count], across[count], across_raw[count], own_rise[count], rise[count], fall[count], bend[count],
      bend_force[count], bend_slope[count];

  void set(uint32_t i, const Cap& cap) noexcept {
    slope[i] = cap.slope;
    across[i] = cap.across;
    across_raw[i] = cap.across_raw;
    own_rise[i] = cap.rise;
    rise[i] = std::fmin(cap.rise, cap.across);  // of a point
    fall[i] = cap.fall;
    bend[i] = cap.bend;
    bend_force[i] = cap.bend_force;
    bend_slope[i] = cap.bend_slope;
  }
};
struct RowCaps : LocalCounted<RowCaps>, CapLanes<chunk_size> {
  RowCaps() : CapLanes<chunk_size>{} {}
};

// What moves do not change.
struct Rows : LocalCounted<Rows> {
  Row rows[chunk_size];
  uint64_t forms[form_count] = {};  // by Form, bit i: row i is a point with this formula, in `formulas`
  uint64_t by_closest_point =
      0;  // bit i: row i has formulas but is evaluated from its closest point: a plane, polyline or mesh, or a
                          // point that only some points of the tool feel
  uint64_t solids = 0;    // bit i: row i is solid
  uint64_t bounded = 0;   // bit i: the slope of row i is bounded
  double omitted = 0;     // N: rows are left out where their force is at most this; 0: only where they have none
  FormulaLanes<chunk_size> formulas{};
  uint64_t capped = 0;   // bit i: row i is a point with a formula and a cap,
  uint64_t falling = 0;  // which falls; see RowCaps
  uint64_t bent = 0;     // which is bent
  Ref<RowCaps> caps;                           // null where no row has one

  uint64_t with(Form form) const noexcept { return forms[static_cast<size_t>(form)]; }
  uint64_t points() const noexcept {
    uint64_t out = 0;
    for (const uint64_t rows : forms) out |= rows;
    return out;
  }
  void forget_formulas(uint64_t bit) noexcept {
    for (uint64_t& rows : forms) rows &= ~bit;
    for (uint64_t* const rows : {&by_closest_point, &solids, &capped, &falling, &bent}) *rows &= ~bit;
  }
};

// Four rows as moves change them.
struct Motions : LocalCounted<Motions> {
  static constexpr uint32_t size = 4;
  float reach[size];  // m, it cannot be felt farther from its centre; rounded up; infinite: it may be felt
                      // everywhere; minus infinity: nowhere, or it is one of Chunk::planes
  double x[size] = {}, y[size] = {}, z[size] = {};  // m, the centre of all places where the row is at any time
  Motion motions[size];
  uint64_t revision[size] = {};  // of the last change or move
  Motions();
};

struct Chunk : LocalCounted<Chunk> {
  uint64_t sequence = 0;       // of the last change,
  uint64_t rows_sequence = 0;  // and of the last that was more than a move
  uint64_t used = 0;                           // bit i: row i is in use
  // Bit i: row i has no twist. It stands at its centre (Motions::x, y, z), or an offset from there is still blended.
  uint64_t standing = 0;
  uint64_t blended = 0;  // bit i: the motion of row i has an offset, which may be over (Motion::Offset)
  uint64_t planes = 0;  // bit i: row i is a resting plane that is felt within some distance of it
  Box box;  // where any of its rows but the planes may be felt
  Ref<Rows> rows;
  Ref<Motions> motions[chunk_size / Motions::size];  // null where none of the four has been in use

  const Row& row(uint32_t i) const noexcept { return rows->rows[i]; }
  const Motion& motion(uint32_t i) const noexcept { return motions[i / Motions::size]->motions[i % Motions::size]; }
  uint64_t motion_revision(uint32_t i) const noexcept { return motions[i / Motions::size]->revision[i % Motions::size]; }

  Box box_of(uint32_t i) const noexcept;  // where row i may be felt, at any time; empty: nowhere, or it is one of the planes

  // [rt] Those of `rows` that stand at their centre.
  uint64_t standing_at(uint64_t rows, double t, double blend) const noexcept {
    rows &= standing;
    for_each_bit(blend > 0 ? rows & blended : 0, [&](uint32_t i) {
      if (motion(i).has_offset(t, blend)) rows &= ~bit_of(i);
    });
    return rows;
  }

  // For whoever posts. i: of the row in the chunk.
  void own(uint32_t i);  // may run out of memory; after it edit_row, set, move and drop cannot
  void own_motion(uint32_t i);  // all that move needs
  void own_caps();  // after own, before set of a law with a cap; without it that row is evaluated by itself
  Row& edit_row(uint32_t i) noexcept { return rows->rows[i]; }  // the caller must not change its object: see set
  // The rest of the row is for the caller. bounded: may be null.
  Row& set(uint32_t i, Ref<const Object> object, Ref<const Object> bounded, const Motion& motion, uint64_t revision) noexcept;
  void move(uint32_t i, const Motion& motion, uint64_t revision) noexcept;
  void begin_offset(uint32_t i, double t, double blend) noexcept;  // see Motion
  void drop(uint32_t i) noexcept;
  void omit(double force) noexcept;  // of all its rows, each of which must be owned

 private:
  void place(uint32_t i) noexcept;  // works out centre and reach
  void move_box(const Box& before, const Box& after) noexcept;
};

// Where the rows of a chunk may be felt, close together and in half the room: for a reader that looks at many.
struct Outline {
  Vec3 origin{};  // m
  float x[chunk_size], y[chunk_size], z[chunk_size];  // m from the origin, the centre
  float reach[chunk_size];  // m, rounded so that no row is missed

  void take(const Chunk& chunk) noexcept;  // [rt]
};

using Chunks = Table<Chunk, 4>;  // by row / 64

inline const Chunk* find_chunk(const Chunks& chunks, uint32_t row) noexcept { return chunks.get(row / chunk_size); }

// Where the tool of a scene stands: the frame between scene and device, and the points of the tool. Rows as those of
// objects: another frame or tool is another row.
struct ToolPoints : Counted<ToolPoints> {
  std::vector<Vec3> points{{0, 0, 0}};  // m, scene; frame of the handle
  Vec3 centre{};  // m, of a sphere that holds them,
  double radius = 0;  // and its radius
  double point_radius = 0;  // m, of the ball that each point is

  ToolPoints() = default;
  explicit ToolPoints(std::vector<Vec3> points, double point_radius = 0);
};

struct View : Version {
  fs_frame frame = fs_frame_init();
  Ref<const ToolPoints> tool;
  bool is_held = false;  // clutched: the tool stays where the tick first finds it so
  bool was_held = false;  // or is, since its frame was given: where the clutch has put the frame only the tick knows
  bool has_own_frame = true;  // false: the frame is that of `previous`, as a clutch may have moved it
};

struct Views : LocalCounted<Views> {
  static constexpr uint32_t size = 16;
  View rows[size];
  uint32_t newest = 0;
  const View& now() const noexcept { return rows[newest]; }
};

enum class ClockKind : uint8_t { caller, steady, virtual_time };  // caller: steady until told

struct Snapshot : LocalCounted<Snapshot> {
  uint64_t sequence = 0;
  Chunks chunks;
  Ref<const Views> views;
  ClockKind clock = ClockKind::caller;
  double omitted = 0;  // N, what far objects may give together at most
};

}  // namespace fs
