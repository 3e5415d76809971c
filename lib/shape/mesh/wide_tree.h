// A tree of boxes with up to eight children a node, which finds what is near a point: the segments of a polyline or the
// triangles of a mesh. It only says what may be near; exact tests by the caller decide. All distances that are compared with a
// bound are rounded down by more than their error, so nothing is missed.
//
// boxes -> binary_tree.h (Embree's builder) -> wide_cut.h (which of its nodes stay) -> wide_node.h (how they are written) ->
// here; wide_search.h searches, and wide_children.h reads a node for it.
#pragma once

#include <cstdint>
#include <vector>

#include "base/stop_token.h"
#include "shape/box.h"
#include "shape/mesh/wide_node.h"

namespace fs {

class WideTree {
 public:
  static constexpr uint32_t most_depth = 60;
  static constexpr uint32_t root = 0;

  // Leaf i of the tree: items()[begin] to items()[end - 1].
  struct Leaf {
    uint32_t begin, end;
  };

  WideTree() = default;
  // boxes: of the items, in coordinates of a LocalFrame. Up to WideNode::width items are one leaf. Throws Stopped,
  // bad_alloc.
  WideTree(std::vector<Box> boxes, StopToken& stop);

  const std::vector<Leaf>& leaves() const { return leaves_; }
  const std::vector<uint32_t>& items() const { return items_; }  // leaf by leaf
  // Makes the discs. corners: three of each item, in the order of items(), in coordinates of the frame. Throws Stopped.
  void add_discs(const std::vector<Vec3>& corners, StopToken& stop);
  void forget_items();  // for a caller that has taken them over
  size_t size() const { return nodes_.size() * sizeof(WideNode) + discs_.size() * sizeof(WideDiscs); }  // bytes

  const WideNode* nodes() const noexcept { return nodes_.empty() ? nullptr : nodes_.data(); }  // null: there is one leaf
  const WideDiscs* discs() const noexcept { return discs_.empty() ? nullptr : discs_.data(); }  // of each node; null: none

 private:
  std::vector<WideNode> nodes_;
  std::vector<WideDiscs> discs_;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> items_;
};

}  // namespace fs
