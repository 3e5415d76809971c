// A tree of boxes with two children a node, as Embree's builder makes it. A WideTree is made of it, which then forgets it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/stop_token.h"
#include "shape/box.h"
#include "shape/mesh/float_box.h"

namespace fs {

class BinaryTree {
 public:
  static constexpr uint32_t leaf_size = 8;  // items of a leaf: at most

  struct Node {
    uint32_t count;  // items; 0: it is no leaf
    uint32_t items[leaf_size];
    Node* children[2];
    FloatBox boxes[2];  // of the children
    // Room for wide_cut.h.
    float costs[leaf_size];
    uint8_t cuts[leaf_size];
  };

  // boxes: of the items, more than a leaf has. Throws Stopped, bad_alloc.
  BinaryTree(std::vector<Box> boxes, StopToken& stop);
  BinaryTree(const BinaryTree&) = delete;

  Node& top() const { return *top_; }
  size_t item_count() const { return item_count_; }

  // Of its nodes. It is our own: after Embree's allocator has run out of memory, a later build may use nodes that were freed.
  class Memory {
   public:
    Node* make(size_t count) noexcept;  // null: there is no memory
    void clear();

   private:
    static constexpr size_t block_size = 1000;
    std::vector<std::unique_ptr<Node[]>> blocks_;
    size_t left_ = 0;  // in the last block
  };

 private:
  Memory memory_;
  Node* top_;
  size_t item_count_;
};

}  // namespace fs
