// Up to eight triangles, in single precision on a grid of their own: to tell which of them may be nearest.
#pragma once

#include "force/triangle.h"
#include "force/wide_tree.h"

namespace fs {

// 192 bytes, three lines of the cache.
struct alignas(64) Packet {
  static constexpr uint32_t width = WideTree::width;
  static constexpr uint32_t none = UINT32_MAX;

  // All triangles lie in a disc: within `radius` of the line through the centre along the normal, and within `height` of the
  // plane through the centre. The normal is hardly shorter than 1.
  float centre[3], normal[3], radius, height;  // local frame
  float lower[3];             // the corner of the grid
  float per_unit;             // grid steps a local unit; 0: the triangles are too small for a grid
  uint32_t triangle[width];   // none: an empty lane
  uint32_t corners[3][width]; // of a, b and c: x, y and z in steps, in 10 bits each, from the lowest
  static constexpr int most_steps = 1023;

  struct Triangle {
    Vec3 corners[3];  // local frame
  };
  Packet(const uint32_t* triangles, const Triangle* places, uint32_t count);
};

}  // namespace fs
