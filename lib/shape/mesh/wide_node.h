// What a node of a WideTree keeps of its up to eight children, and how it is written. wide_children.h reads it.
//
// A node takes 128 bytes, two lines of the cache: the boxes of its children stand in it with 8 bits a coordinate, rounded
// outwards. Another line of the cache can tell of a flat disc about each child: where a surface is sloped, that is much
// smaller than the box.
#pragma once

#include <cstdint>
#include <span>

#include "math/vec3.h"
#include "shape/mesh/float_box.h"

namespace fs {

struct alignas(64) WideNode {
  static constexpr uint32_t width = 8;  // children: at most
  static constexpr int grid = 255;      // steps, of the boxes
  static constexpr uint32_t leaf_bit = 0x80000000u;

  float origin[3], step, steps;         // of the grid on which the children's boxes stand; steps a local unit
  uint32_t lower[width], upper[width];  // of a box: x, y and z in steps, in a byte each, from the lowest
  uint32_t child[width];                // leaf_bit and a leaf, or a node
  uint32_t filled;                      // bit i: there is a child i
  bool has_discs;

  // Puts the boxes of the first children on the grid, never smaller than they are. What is written to is 0 before.
  void set_boxes(std::span<const FloatBox> boxes);
  Vec3 middle(uint32_t i) const;  // of the box of child i
};

// A child lies within a radius of the line through the middle of its box along a normal n, and where n * p is within `height` of
// `offset`; p is a place relative to the middle. n is scaled to |x| + |y| + |z| = unit / scale, so that its coordinates are
// exact and no root is needed to read them.
struct alignas(64) WideDiscs {
  uint32_t x_y[WideNode::width];    // x and y of the normal, 16 bits each; its z >= 0
  uint32_t sizes[WideNode::width];  // from the lowest: the offset in 16 bits, the radius in 8, the height in 8
  static constexpr int unit = 32767, scale = 32768;  // of a coordinate of the normal; 0 stands as `unit`
  static constexpr int offsets_a_step = 1024, zero_offset = 32768;
  // The bits of a height are the upper ones of a float, from a smallest one on, in steps.
  static constexpr int height_shift = 20;
  static constexpr uint32_t smallest_height = 103u << 23;  // the bits of 2^-24

  // Makes the disc of child i of `node`, never smaller than the triangles in it. areas: the sum of their normals, each as
  // long as twice its area; corners: three of each.
  void set(uint32_t i, const WideNode& node, Vec3 areas, std::span<const Vec3> corners);
};

}  // namespace fs
