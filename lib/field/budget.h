// How the stiffness that a loop can render is shared out among what is felt at the same places.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "shape/box.h"

namespace fs {

// What somebody wants where the force changes with the place. Beyond its region the force is constant or zero.
struct Claim {
  enum class Region : uint8_t { ball, slab, everywhere };
  Region region = Region::ball;
  Vec3 centre{};        // m; of a slab a point in its middle
  Vec3 normal{};        // unit, of a slab
  double radius = 0;    // m; of a slab half its thickness
  double slope = 0;     // N/m
  uint32_t user = 0;    // who wants it: what a user wants at a place is the sum of its claims there
  uint32_t object = 0;  // the user's: see Crowd
};

double distance(const Claim& claim, const Box& box) noexcept;  // m, of its region; above 0: they do not meet
inline bool meets(const Claim& claim, const Box& box) noexcept { return distance(claim, box) <= 0; }

// The objects that are felt at the place where a user gets least: how many, and the few of them that want most.
struct Crowd {
  std::array<uint32_t, 5> objects{};
  uint32_t count = 0;
};

struct Shares {
  static constexpr uint32_t none = ~0u;
  std::vector<double> levels;    // N/m, of each user; infinite: it gets all that it wants
  std::vector<uint32_t> crowd;   // of each user, the number of its crowd; none: it gets all that it wants
  std::vector<Crowd> crowds;
};

// The level of a place: what each of them gets there at most, so that together they get `total`; those that want less get
// that. Infinite: together they want no more. Max-min fairness (Bertsekas & Gallager, "Data Networks", 6.5.2).
double level_of(std::vector<double>& wants, double total) noexcept;  // changes the order of wants

// N/m, what the claims add up to at most at one place in the box; never less, and mostly not much more.
double most_wanted(std::span<const Claim> claims, const Box& within);

// For each user the lowest level of all places where it wants more than that: never more, and mostly not much less.
// within: only places in this box count.
//
// So if each user gets the smaller of what it wants and its level, all that is felt at a place x adds up to at most `total`:
// whoever wants more than the level of x there has a level that is no higher, and the others get what they want.
Shares fair_shares(std::span<const Claim> claims, size_t users, const Box& within, double total);

}  // namespace fs
