// A tree of boxes with up to eight children a node, which finds what is near a point: the segments of a polyline or the
// triangles of a mesh. It only says what may be near; exact tests by the caller decide.
//
// A node takes 128 bytes, two lines of the cache: the boxes of its children stand in it with 8 bits a coordinate, rounded
// outwards. Another line of the cache can tell of a flat disc about each child: where a surface is sloped, that is much
// smaller than the box. All distances that are compared with a bound are rounded down by more than their error, so nothing
// is missed. On a processor with other vectors the same comparisons give the same bits.
#pragma once

#include <cstdint>
#include <vector>

#include "base/wanted.h"
#include "force/local_frame.h"

namespace fs {

class WideTree {
 public:
  static constexpr uint32_t width = 8;      // children of a node, items of a leaf: at most
  static constexpr uint32_t most_depth = 60;
  static constexpr int grid = 255;          // steps, of the boxes in a node

  // Leaf i of the tree: items()[begin] to items()[end - 1].
  struct Leaf {
    uint32_t begin, end;
  };

  WideTree() = default;
  // boxes: of the items, in coordinates of `frame`. Built by Embree's builder; up to `width` items are one leaf. Throws
  // Abandoned, bad_alloc.
  WideTree(std::vector<Box> boxes, Wanted& wanted);

  const std::vector<Leaf>& leaves() const { return leaves_; }
  const std::vector<uint32_t>& items() const { return items_; }  // leaf by leaf
  // Makes the discs. corners: three of each item, in the order of items(), in coordinates of the frame. Throws Abandoned.
  void add_discs(const std::vector<Vec3>& corners, Wanted& wanted);
  void forget_items();  // for a caller that has taken them over
  size_t size() const { return nodes_.size() * sizeof(Node) + discs_.size() * sizeof(Discs); }  // bytes

  // use(memory, bytes): of each array that is searched.
  template <class Use>
  void for_each_array(Use&& use) const {
    use(nodes_.data(), nodes_.size() * sizeof(Node));
    use(discs_.data(), discs_.size() * sizeof(Discs));
  }

  struct alignas(64) Node {
    float origin[3], step, steps;         // of the grid on which the children's boxes stand; steps a local unit
    uint32_t lower[width], upper[width];  // of a box: x, y and z in steps, in a byte each, from the lowest
    uint32_t child[width];                // leaf_bit and a leaf, or a node
    uint32_t filled;                      // bit i: there is a child i
    bool has_discs;
  };
  // A child lies within a radius of the line through the middle of its box along a normal, and within `height` of the plane
  // across this line at `offset` from the middle.
  struct alignas(64) Discs {
    uint32_t x_y[width];   // x and y of the normal, 16 bits each, when it is as long as makes |x| + |y| + |z| = 1, z >= 0
    uint32_t sizes[width]; // from the lowest: the offset in 16 bits, the radius in 8, the height in 8
    static constexpr int unit = 32767;         // of a coordinate of the normal; 0 stands as this, too
    static constexpr int offsets_a_step = 1024, zero_offset = 32768;
    // The bits of a height are the upper ones of a float, from a smallest one on, in steps.
    static constexpr int height_shift = 20;
    static constexpr uint32_t smallest_height = 103u << 23;  // the bits of 2^-24
  };
  static constexpr uint32_t leaf_bit = 0x80000000u;
  static constexpr uint32_t root = 0;

  const Node* nodes() const noexcept { return nodes_.empty() ? nullptr : nodes_.data(); }  // null: there is one leaf
  const Discs* discs() const noexcept { return discs_.empty() ? nullptr : discs_.data(); }  // of each node; null: none

 private:
  std::vector<Node> nodes_;
  std::vector<Discs> discs_;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> items_;
};

}  // namespace fs
