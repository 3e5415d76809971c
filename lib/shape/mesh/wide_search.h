// The search of a WideTree from a point. To be included where its inlined code is compiled for each processor.
#pragma once

#include <bit>
#include <cassert>
#include <utility>

#include "shape/mesh/wide_children.h"
#include "shape/mesh/wide_tree.h"

namespace fs::wide {

// Asks the processor to fetch memory that will be read soon.
template <class T>
FS_INLINE void prefetch(const T* what) noexcept {
  for (size_t i = 0; i < sizeof(T); i += 64) __builtin_prefetch(reinterpret_cast<const char*>(what) + i);
}

// Calls test(leaf, range) for each leaf that may hold something at a squared distance of at most `range` (local units) from
// the point; test lowers the range when it has found something nearer. Near leaves come first. Each node and leaf takes one
// of `visits`; when there are none left the search ends. Returns a lower bound of the squared distance to what was not
// visited; infinite: there is nothing within the range. expect_leaf(leaf): it will probably be tested soon.
//
// A node is a long chain of operations each of which waits for the one before. So, once something is found, a node that waits on
// top of the stack is worked out beside the one whose turn it is: the processor does both at once. A hint mostly is near
// enough that both have to be looked at anyway.
template <class From, class Test, class Expect>
FS_INLINE double search(const WideTree& tree, const From& from, typename From::Real range, uint32_t& visits, Test&& test,
                        Expect&& expect_leaf) {
  using Real = typename From::Real;
  using Lanes = typename From::Lanes;
  struct Entry {
    Real squared;
    uint32_t child;
  };
  // No entry on the stack is deeper than one above it. So entries of one level come from one turn, which leaves at most 7 children of
  // the node and 8 of the one beside it.
  Entry stack[WideTree::most_depth * (2 * WideNode::width - 1)];
  uint32_t size = 0;
  const WideNode* const nodes = tree.nodes();
  const WideDiscs* const discs = tree.discs();
  const auto expect = [&](uint32_t child) __attribute__((always_inline)) {
    if (child & WideNode::leaf_bit) {
      expect_leaf(child & ~WideNode::leaf_bit);
    } else {
      prefetch(nodes + child);
      if (discs) prefetch(discs + child);
    }
  };
  const auto distances_of = [&](uint32_t child) __attribute__((always_inline)) {
    const WideNode& node = nodes[child];
    return squared_to_children(node, node.has_discs ? discs + child : nullptr, from);
  };
  Entry now{0, nodes ? WideTree::root : WideNode::leaf_bit};
  for (;;) {
    if (visits == 0) {
      Real least = now.squared;
      for (uint32_t i = 0; i < size; ++i) least = std::min(least, stack[i].squared);
      return static_cast<double>(least) * (1 - From::rounding);
    }
    --visits;
    if (now.child & WideNode::leaf_bit) {
      test(now.child & ~WideNode::leaf_bit, range);
    } else {
      const WideNode& node = nodes[now.child];
      const Lanes distances = distances_of(now.child);
      Real squared[WideNode::width];
      store(squared, distances);
      uint32_t near = bits(distances <= range) & node.filled;
      if (size > 0 && !(stack[size - 1].child & WideNode::leaf_bit) && visits > 0 &&
          range < std::numeric_limits<Real>::infinity()) {
        const Entry other = stack[--size];
        if (other.squared <= range) {
          --visits;
          const WideNode& node_beside = nodes[other.child];
          const Lanes distances_beside = distances_of(other.child);
          Real squared_beside[WideNode::width];
          store(squared_beside, distances_beside);
          for (uint32_t rest = bits(distances_beside <= range) & node_beside.filled; rest; rest &= rest - 1) {
            const auto i = static_cast<uint32_t>(std::countr_zero(rest));
            expect(node_beside.child[i]);
            assert(size < std::size(stack));
            stack[size++] = {squared_beside[i], node_beside.child[i]};
          }
        }
      }
      if (near) {
        // The nearest child is taken next, the others wait.
        auto next = static_cast<uint32_t>(std::countr_zero(near));
        expect(node.child[next]);
        for (near &= near - 1; near; near &= near - 1) {
          auto i = static_cast<uint32_t>(std::countr_zero(near));
          expect(node.child[i]);
          if (squared[i] < squared[next]) std::swap(i, next);
          assert(size < std::size(stack));
          stack[size++] = {squared[i], node.child[i]};
        }
        now = {squared[next], node.child[next]};
        continue;
      }
    }
    do {
      if (size == 0) return std::numeric_limits<double>::infinity();
      now = stack[--size];
    } while (now.squared > range);
  }
}

}  // namespace fs::wide
