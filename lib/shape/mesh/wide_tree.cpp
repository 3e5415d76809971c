#include "shape/mesh/wide_tree.h"

#include "base/error.h"
#include "shape/mesh/wide_cut.h"

namespace fs {

WideTree::WideTree(std::vector<Box> boxes, StopToken& stop) {
  const size_t count = boxes.size();
  if (count <= WideNode::width) {
    for (uint32_t i = 0; i < count; ++i) items_.push_back(i);
    leaves_.push_back({0, static_cast<uint32_t>(count)});
    return;
  }
  const BinaryTree binary(std::move(boxes), stop);
  stop.begin_part(0.55, 0.5 * static_cast<double>(count));
  find_costs(binary, stop);
  items_.reserve(count);
  struct Task {
    const BinaryTree::Node* built;
    uint32_t parent, child;  // where its number goes
    uint32_t depth;
  };
  std::vector<Task> tasks{{&binary.top(), 0, 0, 0}};
  while (!tasks.empty()) {
    stop.check();
    const Task task = tasks.back();
    tasks.pop_back();
    const BinaryTree::Node& built = *task.built;
    uint32_t number;
    if (built.count > 0) {
      number = WideNode::leaf_bit | static_cast<uint32_t>(leaves_.size());
      const auto begin = static_cast<uint32_t>(items_.size());
      items_.insert(items_.end(), built.items, built.items + built.count);
      leaves_.push_back({begin, static_cast<uint32_t>(items_.size())});
    } else {
      if (task.depth >= most_depth) fail(FS_ERROR_INTERNAL, "the tree of a shape is deeper than %u", most_depth);
      number = static_cast<uint32_t>(nodes_.size());
      const WideCut cut(built);
      nodes_.emplace_back().set_boxes({cut.boxes, cut.count});
      // The first child is taken next, so it stands beside its parent.
      for (uint32_t i = cut.count; i-- > 0;) tasks.push_back({cut.children[i], number, i, task.depth + 1});
    }
    if (task.depth > 0) nodes_[task.parent].child[task.child] = number;
  }
  nodes_.shrink_to_fit();
}

void WideTree::add_discs(const std::vector<Vec3>& corners, StopToken& stop) {
  constexpr uint32_t most_items = 1 << 14;  // what is larger is hardly flat
  discs_.resize(nodes_.size());
  std::vector<Leaf> ranges(nodes_.size());  // the items below a node
  const auto range_of = [&](uint32_t child) {
    return child & WideNode::leaf_bit ? leaves_[child & ~WideNode::leaf_bit] : ranges[child];
  };
  for (size_t i = nodes_.size(); i-- > 0;) {
    WideNode& node = nodes_[i];
    for (uint32_t c = 0; node.filled >> c & 1; ++c) {
      const Leaf range = range_of(node.child[c]);
      if (c == 0) ranges[i].begin = range.begin;
      ranges[i].end = range.end;
    }
    node.has_discs = ranges[i].end - ranges[i].begin <= most_items;
    for (uint32_t c = 0; node.has_discs && node.filled >> c & 1; ++c) {
      const Leaf range = range_of(node.child[c]);
      const auto below = std::span(corners).subspan(size_t{3} * range.begin, size_t{3} * (range.end - range.begin));
      Vec3 areas{};
      for (size_t k = 0; k < below.size(); k += 3) {
        stop.check();
        areas += cross(below[k + 1] - below[k], below[k + 2] - below[k]);
      }
      discs_[i].set(c, node, areas, below);
    }
  }
}

void WideTree::forget_items() {
  // An assignment of {} would keep the memory.
  std::vector<Leaf>().swap(leaves_);
  std::vector<uint32_t>().swap(items_);
}

}  // namespace fs
