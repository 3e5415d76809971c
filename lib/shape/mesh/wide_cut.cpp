#include "shape/mesh/wide_cut.h"

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

namespace fs {
namespace {

constexpr int most_children = WideNode::width;
constexpr float infinite_cost = std::numeric_limits<float>::infinity();
static_assert(BinaryTree::leaf_size == WideNode::width);  // a node has room for the costs

// What a subtree costs to search if it stands under a wide node as at most k + 1 children: costs[k], in areas. cuts[k]: how
// many of those k + 1 the first child gets, the second the others; 0: the subtree is not split.
void find_costs_of(BinaryTree::Node& node, float area, StopToken& stop) {
  stop.check();
  if (node.count > 0) {
    std::fill_n(node.costs, most_children, area);
    std::fill_n(node.cuts, most_children, uint8_t{0});
    return;
  }
  const BinaryTree::Node &first = *node.children[0], &second = *node.children[1];
  for (int k = most_children - 1; k >= 0; --k) node.costs[k] = infinite_cost;
  for (int k = 1; k < most_children; ++k) {
    for (int i = 1; i <= k; ++i) {
      const float cost = first.costs[i - 1] + second.costs[k - i];
      if (cost < node.costs[k]) {
        node.costs[k] = cost;
        node.cuts[k] = static_cast<uint8_t>(i);
      }
    }
  }
  const float alone = area + node.costs[most_children - 1];
  node.costs[0] = alone;
  node.cuts[0] = 0;
  for (int k = 1; k < most_children; ++k) {
    if (alone < node.costs[k]) {
      node.costs[k] = alone;
      node.cuts[k] = 0;
    }
  }
}

// How a wide node shares its eight children out.
int top_cut(const BinaryTree::Node& node) {
  int best = 1;
  float least = infinite_cost;
  for (int i = 1; i < most_children; ++i) {
    const float cost = node.children[0]->costs[i - 1] + node.children[1]->costs[most_children - 1 - i];
    if (cost < least) {
      least = cost;
      best = i;
    }
  }
  return best;
}

}  // namespace

void find_costs(const BinaryTree& tree, StopToken& stop) {
  // From the leaves up.
  std::vector<std::pair<BinaryTree::Node*, float>> order{{&tree.top(), 0.0f}};
  size_t found = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    BinaryTree::Node& node = *order[i].first;
    found += node.count;
    for (int c = 0; c < 2 && node.count == 0; ++c) {
      if (!node.children[c]) throw std::bad_alloc();
      order.emplace_back(node.children[c], node.boxes[c].half_area());
    }
  }
  if (found != tree.item_count()) throw std::bad_alloc();
  for (size_t i = order.size(); i-- > 0;) find_costs_of(*order[i].first, order[i].second, stop);
}

WideCut::WideCut(const BinaryTree::Node& top) { add_both(top, top_cut(top), most_children - 1); }

void WideCut::add(const BinaryTree::Node& node, const FloatBox& box, int k) {
  if (node.cuts[k] > 0) return add_both(node, node.cuts[k], k);
  children[count] = &node;
  boxes[count++] = box;
}

void WideCut::add_both(const BinaryTree::Node& node, int cut, int k) {
  add(*node.children[0], node.boxes[0], cut - 1);
  add(*node.children[1], node.boxes[1], k - cut);
}

}  // namespace fs
