// What is done for many rows of a chunk at once, four lanes wide: with AVX2 where the processor has it, else with SSE2.
// Both give the same bits. Each row has its lane, its number modulo 4, so sums do not depend on what is passed over.
#pragma once

#include "field/snapshot.h"

namespace fs {

inline constexpr uint32_t lane_count = 4;

// A sum of wrenches and stiffnesses, in lanes.
struct LaneSum {
  using Lanes = double[lane_count];
  Lanes fx{}, fy{}, fz{}, tx{}, ty{}, tz{};           // N, N m
  Lanes xx{}, xy{}, xz{}, yy{}, yz{}, zz{};           // N/m, symmetric

  static double folded(const Lanes& l) noexcept { return (l[0] + l[1]) + (l[2] + l[3]); }
  Wrench wrench() const noexcept {
    return {{folded(fx), folded(fy), folded(fz)}, {folded(tx), folded(ty), folded(tz)}};
  }
  Mat3 stiffness() const noexcept {
    const double a = folded(xy), b = folded(xz), c = folded(yz);
    return {folded(xx), a, b, a, folded(yy), c, b, c, folded(zz)};
  }
};

// [rt] For each row a lower bound of the distance from `from` to where it may be felt, m; below 0 it may be felt there.
void find_gaps(const Outline& outline, Vec3 from, float (&gaps)[chunk_size]) noexcept;

// [rt] Adds the forces of the rows in `mask`, all of them standing points with a formula, on a tool point at `position` with `arm`
// from the tool's origin; each times its weight (of all 64 rows; null: 1) times `share`. Returns the rows felt there.
uint64_t add_points(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                    LaneSum& sum) noexcept;

// For tests, which show that it makes no difference: whether AVX2 is used where the processor has it.
void allow_wide_lanes(bool are_allowed) noexcept;

}  // namespace fs
