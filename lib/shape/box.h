// An axis-aligned box, m; empty at first.
#pragma once

#include <algorithm>
#include <limits>

#include "math/vec3.h"

namespace fs {

struct Box {
  Vec3 lower{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
             std::numeric_limits<double>::infinity()};
  Vec3 upper = -lower;

  void add(Vec3 p) noexcept {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
  }
  void add(const Box& b) noexcept {
    lower = {std::min(lower.x, b.lower.x), std::min(lower.y, b.lower.y), std::min(lower.z, b.lower.z)};
    upper = {std::max(upper.x, b.upper.x), std::max(upper.y, b.upper.y), std::max(upper.z, b.upper.z)};
  }
  bool is_empty() const noexcept { return !(lower.x <= upper.x); }
  // m, by which one of them can grow to each side until they meet; 0 or less: they do.
  double gap(const Box& b) const noexcept {
    return std::max({lower.x - b.upper.x, lower.y - b.upper.y, lower.z - b.upper.z, b.lower.x - upper.x, b.lower.y - upper.y,
                     b.lower.z - upper.z});
  }
  // Without touching it.
  bool is_inside(const Box& b) const noexcept {
    return lower.x > b.lower.x && lower.y > b.lower.y && lower.z > b.lower.z && upper.x < b.upper.x && upper.y < b.upper.y &&
           upper.z < b.upper.z;
  }
  // m; infinite of an empty box.
  double distance(Vec3 from) const noexcept {
    const auto beyond = [](double x, double low, double high) { return std::max(0.0, std::max(low - x, x - high)); };
    return norm(Vec3{beyond(from.x, lower.x, upper.x), beyond(from.y, lower.y, upper.y), beyond(from.z, lower.z, upper.z)});
  }
};

}  // namespace fs
