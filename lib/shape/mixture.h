// The mixture of some directions that makes sum(part * cost) + |sum(part * direction)|^2 / 2 least, of parts that are not
// negative and add up to 1: Wolfe, "Finding the nearest point in a polytope" (Math. Programming 11, 1976), with costs.
#pragma once

#include "math/vec3.h"

namespace fs {

struct Mixture {
  static constexpr int most = 8;

  int size = 0;  // of what is mixed
  Vec3 directions[most];
  double costs[most];

  // [rt] Works out the following.
  void mix() noexcept;
  double parts[most] = {};  // at most four are not 0
  Vec3 mean{};              // sum(part * direction)

  int count() const noexcept;   // parts that are not 0
  Mat3 across() const noexcept; // projects on the differences of their directions
};

}  // namespace fs
