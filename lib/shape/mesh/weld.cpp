#include "shape/mesh/weld.h"

#include <algorithm>
#include <bit>

namespace fs {
namespace {

uint64_t hash_of(Vec3 position) noexcept {
  uint64_t hash = 0;
  for (const double coordinate : {position.x, position.y, position.z}) {
    hash = (hash ^ std::bit_cast<uint64_t>(coordinate + 0.0)) * 0x9e3779b97f4a7c15;  // + 0.0: of -0 and 0 the same
    hash ^= hash >> 32;
  }
  return hash;
}

// Most meshes have no two points at one place, which a table of hashes shows sooner than sorting does. False: it is so. True: two
// hashes are equal, or a place in the table was not found in a few looks, as with hashes that were chosen to collide.
bool may_be_equal(std::span<const Vec3> points, std::span<const uint32_t> those, StopToken& stop) {
  constexpr size_t most_looks = 32;
  constexpr uint32_t none = 0;
  std::vector<uint32_t> table(std::bit_ceil(2 * those.size() + 1), none);
  for (const uint32_t point : those) {
    stop.check();
    const uint64_t hash = hash_of(points[point]);
    const uint32_t tag = static_cast<uint32_t>(hash >> 32) | 1;
    size_t place = static_cast<uint32_t>(hash), looks = 0;
    while (table[place &= table.size() - 1] != none) {
      if (table[place] == tag || ++looks == most_looks) return true;
      ++place;
    }
    table[place] = tag;
  }
  return false;
}

}  // namespace

// Sorts, because n points then never take more than n log n steps, however they were chosen.
bool join_equal_places(std::span<const Vec3> points, std::span<const uint32_t> those, std::vector<uint32_t>& of_point,
                       StopToken& stop) {
  if (!may_be_equal(points, those, stop)) return false;
  struct Place {
    Vec3 position;
    uint32_t point;
  };
  std::vector<Place> places;
  places.reserve(those.size());
  for (const uint32_t point : those) {
    stop.check();
    places.push_back({points[point], point});
  }
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) {
    stop.check();
    if (a.position.x != b.position.x) return a.position.x < b.position.x;
    if (a.position.y != b.position.y) return a.position.y < b.position.y;
    if (a.position.z != b.position.z) return a.position.z < b.position.z;
    return a.point < b.point;
  });
  bool is_any_joined = false;
  uint32_t lowest = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    if (i > 0 && places[i].position == places[i - 1].position) {
      of_point[places[i].point] = lowest;
      is_any_joined = true;
    } else {
      lowest = places[i].point;
    }
  }
  return is_any_joined;
}

}  // namespace fs
