// A persistent array: copies share what they have in common, and changing one element copies only the path to it
// (Driscoll et al. 1989, "Making data structures persistent"). So a snapshot of 100,000 objects costs one reference, and
// moving one of them a handful of small nodes. Reference counts are not atomic: taking, changing and letting go of tables
// is for the scene's lock; readers only look.
#pragma once

#include <array>
#include <bit>

#include "base/counted.h"

namespace fs {

template <class T>
class Table {
  static constexpr uint32_t bits = 4, width = 1u << bits, depth = 5;

  template <class Child>
  struct Node : LocalCounted<Node<Child>> {
    uint32_t used = 0;  // bit i: child i is there
    std::array<Ref<Child>, width> children;
  };
  template <uint32_t level>
  struct Level {
    using Child = typename Level<level - 1>::Type;
    using Type = Node<Child>;
  };
  template <uint32_t level>
    requires(level == 0)
  struct Level<level> {
    using Type = Node<const T>;
  };
  using Root = typename Level<depth - 1>::Type;

 public:
  static constexpr uint32_t capacity = 1u << (bits * depth);  // 1,048,576

  // A null value takes the slot out.
  void set(uint32_t slot, Ref<const T> value) { put<depth - 1>(root_, slot, std::move(value)); }

  const T* get(uint32_t slot) const noexcept {
    return root_ ? find<depth - 1>(*root_, slot) : nullptr;
  }

  // Calls f(slot, const T&) for every slot in use, in order.
  template <class F>
  void for_each(F&& f) const {
    if (root_) visit<depth - 1>(*root_, 0, f);
  }

 private:
  template <uint32_t level, class Child>
  static void put(Ref<Node<Child>>& node, uint32_t slot, Ref<const T> value) {
    if (!node) {
      if (!value) return;
      node = make_ref<Node<Child>>();
    } else if (!node->is_unique()) {
      node = make_ref<Node<Child>>(*node);
    }
    const uint32_t i = (slot >> (level * bits)) & (width - 1);
    if constexpr (level == 0) {
      node->children[i] = std::move(value);
    } else {
      put<level - 1>(node->children[i], slot, std::move(value));
    }
    node->used = node->children[i] ? node->used | 1u << i : node->used & ~(1u << i);
    if (node->used == 0) node = nullptr;
  }

  template <uint32_t level, class Child>
  static const T* find(const Node<Child>& node, uint32_t slot) noexcept {
    const Ref<Child>& child = node.children[(slot >> (level * bits)) & (width - 1)];
    if constexpr (level == 0) {
      return child.get();
    } else {
      return child ? find<level - 1>(*child, slot) : nullptr;
    }
  }

  template <uint32_t level, class Child, class F>
  static void visit(const Node<Child>& node, uint32_t first, F& f) {
    for (uint32_t rest = node.used; rest; rest &= rest - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(rest));
      const uint32_t slot = first + (i << (level * bits));
      if (const uint32_t later = rest & (rest - 1)) {
        __builtin_prefetch(node.children[static_cast<uint32_t>(std::countr_zero(later))].get());
      }
      if constexpr (level == 0) {
        f(slot, *node.children[i]);
      } else {
        visit<level - 1>(*node.children[i], slot, f);
      }
    }
  }

  Ref<Root> root_;
};

}  // namespace fs
