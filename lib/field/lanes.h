// What is done for many rows of a chunk at once, four lanes wide: with AVX2 where the processor has it, else with SSE2.
// Both give the same bits. Each row has its lane, its number modulo 4, so skipping far rows does not change the rounding of a sum.
#pragma once

#include "field/snapshot.h"

namespace fs {

inline constexpr uint32_t lane_count = 4;
inline constexpr double least_distance = 1e-150;  // m: nearer than this to a point there is no direction

// A sum of wrenches and stiffnesses, in lanes.
struct LaneSum {
  using Lanes = double[lane_count];
  Lanes fx{}, fy{}, fz{}, tx{}, ty{}, tz{};  // N, N m
  Lanes xx{}, xy{}, xz{}, yy{}, yz{}, zz{};  // N/m, symmetric

  static double folded(const Lanes& l) noexcept { return (l[0] + l[1]) + (l[2] + l[3]); }
  Wrench wrench() const noexcept { return {{folded(fx), folded(fy), folded(fz)}, {folded(tx), folded(ty), folded(tz)}}; }
  Mat3 stiffness() const noexcept {
    const double a = folded(xy), b = folded(xz), c = folded(yz);
    return {folded(xx), a, b, a, folded(yy), c, b, c, folded(zz)};
  }
};

// Closest points that wait for their forces on a tool point, of rows of one chunk: those of row i wait in lane i % 4, in
// the order in which they were added. Their laws are formulas (Rows::formulas).
class ClosestPoints {
 public:
  struct Entry {
    Vec3 direction;  // unit, from the closest point to the tool point, scene frame
    Vec3 tangent;  // unit, of an edge; else 0
    double distance;  // m
    bool is_turning;  // direction changes when the tool point moves sideways: it is not on a face
    const Profile* law;  // of the side where the tool point is
    double weight;
    Vec3 arm;  // m, of the tool point
  };
  // [rt] The lane must have room.
  void add(uint32_t row, const Entry& contact) noexcept;
  bool has_room(uint32_t row) const noexcept { return counts_[row % lane_count] < depth; }

  // [rt] Adds the forces of all of them, which then wait no longer. Returns the rows felt. radius: m, of the tool point.
  uint64_t take(double radius, LaneSum& sum) noexcept;

  // Four entries, one in each lane.
  struct Four {
    using Lanes = double[lane_count];
    uint32_t used, turning;  // bit k: lane k is
    uint32_t forms[form_count];  // by Form, bit k: lane k has this formula
    uint8_t rows[lane_count];
    Lanes ux, uy, uz, tx, ty, tz, distance, weight, arm_x, arm_y, arm_z;
    FormulaLanes<lane_count> formulas;
    uint32_t capped;  // bit k: lane k has a cap, in `caps`
  };
  using Caps = CapLanes<lane_count>;

 private:
  static constexpr uint32_t depth = 16;
  uint32_t counts_[lane_count] = {};  // that wait in a lane,
  uint32_t four_count_ = 0;  // and the most of these
  Four fours_[depth];  // all 0 where nothing has been added
  Caps caps_[depth];  // of each four, only where a lane has one
};

// [rt] For each row a lower bound of the distance from `from` to where it may be felt, m; below 0 it may be felt there.
using Gaps = float[chunk_size];
void find_gaps(const Outline& outline, Vec3 from, Gaps& gaps) noexcept;

// [rt] The rows whose gap is at most `most`, and the least gap of the others.
struct Within {
  uint64_t rows;
  float least_beyond;
};
Within rows_within(const Gaps& gaps, float most) noexcept;

// [rt] Which of the 64 chunks of a block are due when the tool has travelled so far, and when the next one is.
struct Awake {
  uint64_t mask;
  double wakes_next;
};
Awake find_awake(const double (&wake_at)[64], double travelled) noexcept;

// [rt] Adds the forces of the rows in `mask`, all of them standing points with a formula, on a tool point at `position` with `arm`
// from the tool's origin; each times its weight (of all 64 rows; null: 1, and without its cap) times `point_weight`. Returns the rows
// felt there. radius: m, of the tool point.
uint64_t add_points(const Chunk& chunk, uint64_t mask, Vec3 position, double radius, Vec3 arm, const Weight* weights,
                    double point_weight, LaneSum& sum) noexcept;

}  // namespace fs
