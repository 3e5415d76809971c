// Which nodes of a binary tree become the children of a node with eight children, so that the searches cost least. After Ylitie,
// Karras & Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs" (HPG 2017).
#pragma once

#include "shape/mesh/binary_tree.h"
#include "shape/mesh/wide_node.h"

namespace fs {

// What each subtree costs to search; to be called once. Throws Stopped; bad_alloc: the builder left something out, as it
// does where it has no memory.
void find_costs(const BinaryTree& tree, StopToken& stop);

// The children of the wide node that begins at a node of the binary tree, which is no leaf.
struct WideCut {
  uint32_t count = 0;
  const BinaryTree::Node* children[WideNode::width];
  FloatBox boxes[WideNode::width];

  explicit WideCut(const BinaryTree::Node& top);

 private:
  // Adds a subtree as at most k + 1 children.
  void add(const BinaryTree::Node& node, const FloatBox& box, int k);
  void add_both(const BinaryTree::Node& node, int cut, int k);
};

}  // namespace fs
