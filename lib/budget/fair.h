// The fair bounds of all that wants some of one limit at the same places.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "shape/box.h"

namespace fs {

// What somebody wants where the force changes with the place. Beyond its region the force is constant or zero.
struct SlopeWant {
  enum class Region : uint8_t { ball, slab, everywhere };
  Region region = Region::ball;
  Vec3 centre{};        // m; of a slab a point in its middle
  Vec3 normal{};        // unit, of a slab
  double radius = 0;    // m; of a slab half its thickness
  double slope = 0;     // N/m
  uint32_t user = 0;    // who wants it: what a user wants at a place is the sum of its wants there
  uint32_t object = 0;  // the user's: see Neighbours
};

double distance(const SlopeWant& want, const Box& box) noexcept;  // m, of its region; above 0: they do not meet
inline bool meets(const SlopeWant& want, const Box& box) noexcept { return distance(want, box) <= 0; }

// The objects that are felt at the place where a user gets least: how many, and the few of them that want most.
struct Neighbours {
  std::array<uint32_t, 5> objects{};
  uint32_t count = 0;
};

struct FairBounds {
  static constexpr uint32_t none = ~0u;
  std::vector<double> bounds;           // N/m, of each user; infinite: it gets all that it wants
  std::vector<uint32_t> neighbours_of;  // of each user, the number of its neighbours; none: it gets all that it wants
  std::vector<Neighbours> neighbours;
};

// The bound at a place: what each of them gets there at most, so that together they get `limit`; those that want less get
// that. Infinite: together they want no more. Max-min fairness (Bertsekas & Gallager, "Data Networks", 6.5.2).
double fair_bound(std::vector<double>& wants, double limit) noexcept;  // changes the order of wants

// N/m, what the wants add up to at most at one place in the box; never less, and mostly not much more.
double most_wanted(std::span<const SlopeWant> wants, const Box& within);

// For each user the lowest of the bounds (fair_bound) at all places where it wants more than the bound of that place; what is
// returned is never more than that, and mostly not much less. within: only places in this box count.
//
// Then all that is felt at a place adds up to at most `limit`, if each user gets the smaller of its want and its bound. Let B
// be the bound of the place: a user that wants more than B there has a bound of at most B, and the others want at most B.
FairBounds fair_bounds(std::span<const SlopeWant> wants, size_t users, const Box& within, double limit);

}  // namespace fs
