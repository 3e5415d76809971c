// A persistent array: copies share what they have in common, and changing one element copies only the path to it
// (Driscoll et al. 1989, "Making data structures persistent"). A snapshot of a scene costs one reference. Reference counts
// are not atomic: taking, changing and letting go of tables belongs under the scene's lock; readers only look.
//
// Every change has a sequence, a number that grows. Elements and the nodes above them keep that of their last change, so a
// reader that remembers which it saw last finds what has changed since then without comparing the rest.
#pragma once

#include <array>
#include <cassert>

#include "base/counted.h"

namespace fs {

// T is LocalCounted, has a default and a copy constructor and a member `uint64_t sequence`.
template <class T, uint32_t depth>
class Table {
  static constexpr uint32_t bits = 4, width = 1u << bits;

  template <class Child>
  struct Node : LocalCounted<Node<Child>> {
    uint64_t sequence = 0;
    uint32_t size = 0;  // children beyond it are null
    std::array<Ref<Child>, width> children;

    Node() = default;
    Node(const Node& other) : LocalCounted<Node>(other), sequence(other.sequence), size(other.size) {
      for (uint32_t i = 0; i < size; ++i) children[i] = other.children[i];
    }
  };
  template <uint32_t level>
  struct Level {
    using Type = Node<typename Level<level - 1>::Type>;
  };
  template <uint32_t level>
    requires(level == 0)
  struct Level<level> {
    using Type = Node<T>;
  };
  using Root = typename Level<depth - 1>::Type;

 public:
  static constexpr uint32_t capacity = 1u << (bits * depth);

  // The element, to be changed: made where there is none, copied where another table has it too.
  T& edit(uint32_t i, uint64_t sequence) {
    assert(i < capacity);
    Ref<T>& place = find_place<depth - 1>(root_, i, sequence);
    if (!place) {
      place = make_ref<T>();
    } else if (!place->is_unique()) {
      place = make_ref<T>(*place);
    }
    place->sequence = sequence;
    return *place;
  }

  // Puts an element in, or with null takes it out.
  void set(uint32_t i, Ref<T> value, uint64_t sequence) {
    if (!value && !get(i)) return;
    Ref<T>& place = find_place<depth - 1>(root_, i, sequence);
    place = std::move(value);
    if (place) place->sequence = sequence;
  }

  // So that the next set of i with this sequence cannot fail.
  void own(uint32_t i, uint64_t sequence) { find_place<depth - 1>(root_, i, sequence); }

  const T* get(uint32_t i) const noexcept { return root_ ? find<depth - 1>(*root_, i) : nullptr; }

  // Calls f(i, const T&) for every element, in order.
  template <class F>
  void for_each(F&& f) const {
    if (root_) visit<depth - 1>(*root_, 0, f);
  }

  // Calls f(i, const T*) for every element that has changed after `sequence`; null: for one that is not there, or no more.
  template <class F>
  void for_each_changed(uint64_t sequence, F&& f) const {
    if (root_) visit_changed<depth - 1>(*root_, 0, sequence, f);
  }

 private:
  template <uint32_t level, class Child>
  static Ref<T>& find_place(Ref<Node<Child>>& node, uint32_t i, uint64_t sequence) {
    if (!node) {
      node = make_ref<Node<Child>>();
    } else if (!node->is_unique()) {
      node = make_ref<Node<Child>>(*node);
    }
    node->sequence = sequence;
    const uint32_t k = (i >> (level * bits)) & (width - 1);
    if (node->size <= k) node->size = k + 1;
    if constexpr (level == 0) {
      return node->children[k];
    } else {
      return find_place<level - 1>(node->children[k], i, sequence);
    }
  }

  template <uint32_t level, class Child>
  static const T* find(const Node<Child>& node, uint32_t i) noexcept {
    const Ref<Child>& child = node.children[(i >> (level * bits)) & (width - 1)];
    if constexpr (level == 0) {
      return child.get();
    } else {
      return child ? find<level - 1>(*child, i) : nullptr;
    }
  }

  template <uint32_t level, class Child, class F>
  static void visit(const Node<Child>& node, uint32_t first, F& f) {
    for (uint32_t k = 0; k < node.size; ++k) {
      if (!node.children[k]) continue;
      if constexpr (level == 0) {
        f(first + k, const_cast<const T&>(*node.children[k]));
      } else {
        visit<level - 1>(*node.children[k], first + (k << (level * bits)), f);
      }
    }
  }

  template <uint32_t level, class Child, class F>
  static void visit_changed(const Node<Child>& node, uint32_t first, uint64_t sequence, F& f) {
    if (node.sequence <= sequence) return;
    for (uint32_t k = 0; k < node.size; ++k) {
      const Child* const child = node.children[k].get();
      if (k + 1 < node.size) __builtin_prefetch(node.children[k + 1].get());
      if constexpr (level == 0) {
        if (!child || child->sequence > sequence) f(first + k, static_cast<const T*>(child));
      } else {
        if (child) visit_changed<level - 1>(*child, first + (k << (level * bits)), sequence, f);
      }
    }
  }

  Ref<Root> root_;
};

}  // namespace fs
