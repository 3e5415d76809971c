// A tree of boxes with up to eight children a node, which finds what is near a point: the segments of a polyline or the
// triangles of a mesh. It only says what may be near; exact tests by the caller decide.
//
// A node takes 128 bytes, two lines of the cache: the boxes of its children stand in it with 8 bits a coordinate, rounded
// outwards. All distances that are compared with a bound are rounded down by more than their error, so nothing is missed. On a
// processor with other vectors the same comparisons give the same bits.
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
  void forget_items();                                           // for a caller that has taken them over
  size_t size() const { return nodes_.size() * sizeof(Node); }   // bytes

  struct alignas(64) Node {
    float origin[3], step;                // of the grid on which the children's boxes stand
    uint32_t lower[width], upper[width];  // of a box: x, y and z in steps, in a byte each, from the lowest
    uint32_t child[width];                // leaf_bit and a leaf, or a node
    uint32_t filled;                      // bit i: there is a child i
  };
  static constexpr uint32_t leaf_bit = 0x80000000u;
  static constexpr uint32_t root = 0;

  const Node* nodes() const noexcept { return nodes_.empty() ? nullptr : nodes_.data(); }  // null: there is one leaf

 private:
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> items_;
};

}  // namespace fs
