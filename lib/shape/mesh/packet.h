// Up to eight triangles, in single precision on a grid of their own: to tell which of them may be nearest.
#pragma once

#include "shape/mesh/wide_node.h"
#include "shape/triangle.h"

namespace fs {

// 144 bytes, which always lie in three lines of the cache.
struct alignas(16) Packet {
  static constexpr uint32_t width = WideNode::width;
  static constexpr uint32_t none = UINT32_MAX;

  float lower[3];             // the corner of the grid, local frame
  float per_unit;             // grid steps a local unit; 0: the triangles are too small for a grid
  uint32_t triangle[width];   // none: an empty lane
  uint32_t corners[3][width]; // of a, b and c: x, y and z in steps, in 10 bits each, from the lowest
  static constexpr int most_steps = 1023;

  // places: of the corners, three for each triangle, in the local frame.
  Packet(const uint32_t* triangles, const Vec3* places, uint32_t count);
};

}  // namespace fs
