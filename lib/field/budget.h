// How the stiffness that a loop can render is shared out among objects that are felt at the same places.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "force/box.h"

namespace fs {

// What an object wants where the force changes with the place. Beyond its region the force is constant or zero.
struct Claim {
  enum class Region : uint8_t { ball, slab, everywhere };
  Region region = Region::ball;
  Vec3 centre{};      // m; of a slab a point in its middle
  Vec3 normal{};      // unit, of a slab
  double radius = 0;  // m; of a slab half its thickness
  double slope = 0;   // N/m
};

// For each claim the greatest sum of slopes at any place of its region, its own included: never less, and mostly not much
// more. Sums up to `enough` are not told apart. within: only places in this box count.
//
// So if each object gets slope * enough / sum where that is less than its slope, the slopes at a place x add up to at most
// `enough`: each object there has a sum that is at least S, the sum at x, and the slopes of all of them add up to S.
std::vector<double> greatest_sums(std::span<const Claim> claims, const Box& within, double enough);

}  // namespace fs
