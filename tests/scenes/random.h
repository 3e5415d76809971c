// SplitMix64 (Steele, Lea & Flood 2014): the same numbers on every machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "scenes/sanitizer.h"
#include "scenes/vector.h"

namespace scenes {

// How often a test does what it does at random, or without end: a few times, or `all` times with tests/run --all. A sanitizer
// sees in a few runs what it would see in all of them.
inline int times(int few, int all) { return std::getenv("FORCESERVER_ALL_TESTS") && !is_sanitized ? all : few; }
// The same, but without a sanitizer and without --all a tenth of all times, if that is more than a few.
inline int sanitized_times(int few, int all) { return times(is_sanitized || few > all / 10 ? few : all / 10, all); }

class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}

  uint64_t bits() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  uint64_t below(uint64_t n) { return bits() % n; }
  bool coin(double chance = 0.5) { return unit_interval() < chance; }
  double unit_interval() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * unit_interval(); }
  // The same chance for each decade.
  double log_between(double low, double high) { return low * std::exp(std::log(high / low) * unit_interval()); }

  fs_vec3 in_box(double half) {
    const double x = between(-half, half), y = between(-half, half);
    return {x, y, between(-half, half)};
  }
  fs_vec3 direction() {
    for (;;) {
      const fs_vec3 v = in_box(1);
      if (dot(v, v) > 1e-4 && dot(v, v) < 1) return unit(v);
    }
  }
  fs_quat orientation() {
    const fs_vec3 axis = direction();
    return turn(axis, between(-3, 3));
  }
  fs_pose pose(double half) {
    const fs_vec3 position = in_box(half);
    return {position, orientation()};
  }

 private:
  uint64_t state_;
};

}  // namespace scenes
