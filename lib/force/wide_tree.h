// A tree of boxes with up to eight children a node, which finds what is near a point: the segments of a polyline or the
// triangles of a mesh. It only says what may be near; exact tests by the caller decide.
//
// A node takes 128 bytes, two lines of the cache: the boxes of its children stand in it with 8 bits a coordinate, rounded
// outwards. All distances that are compared with a bound are rounded down by more than their error, so nothing is missed. On a
// processor with other vectors the same comparisons give the same bits.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
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
  WideTree(const std::vector<Box>& boxes, Wanted& wanted);

  const std::vector<Leaf>& leaves() const { return leaves_; }
  const std::vector<uint32_t>& items() const { return items_; }  // leaf by leaf
  void forget_items() { leaves_ = {}, items_ = {}; }             // for a caller that has taken them over
  size_t size() const { return nodes_.size() * sizeof(Node); }   // bytes

  struct alignas(64) Node {
    float origin[3], step[3];             // the boxes stand in these units
    uint8_t lower[3][width], upper[3][width];
    uint32_t child[width];                // leaf_bit and a leaf, or a node
    uint32_t count;                       // children
  };
  static constexpr uint32_t leaf_bit = 0x80000000u;
  static constexpr uint32_t root = 0;

  const Node* nodes() const noexcept { return nodes_.empty() ? nullptr : nodes_.data(); }  // null: there is one leaf

 private:
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> items_;
};

// ------------------------------------------------------------------------------------------------------------ the search

// Vectors of the compiler (gcc, clang): on a processor without registers so wide it takes several.
typedef float Floats __attribute__((vector_size(32)));
typedef int32_t Ints __attribute__((vector_size(32)));
typedef uint8_t Bytes __attribute__((vector_size(8)));
typedef uint16_t Shorts __attribute__((vector_size(16)));

#define FS_INLINE inline __attribute__((always_inline))

namespace wide {

FS_INLINE Floats all(float value) { return Floats{value, value, value, value, value, value, value, value}; }
FS_INLINE Floats load(const uint8_t* from) {
  Bytes bytes;
  std::memcpy(&bytes, from, sizeof bytes);
  return __builtin_convertvector(bytes, Floats);
}
FS_INLINE Floats load(const uint16_t* from) {
  Shorts shorts;
  std::memcpy(&shorts, from, sizeof shorts);
  return __builtin_convertvector(shorts, Floats);
}
FS_INLINE Floats most(Floats a, Floats b) { return a > b ? a : b; }
FS_INLINE Floats least(Floats a, Floats b) { return a < b ? a : b; }
// Bit i: lane i of a comparison is true.
FS_INLINE uint32_t bits(Ints mask) {
  const Ints weights = {1, 2, 4, 8, 16, 32, 64, 128};
  const Ints m = mask & weights;
  return static_cast<uint32_t>(m[0] | m[1] | m[2] | m[3] | m[4] | m[5] | m[6] | m[7]);
}

// A point from which is looked, in the local frame: each coordinate is between lower and upper. Far away from the shape
// single precision would tell nothing apart, so there are two kinds.
template <class Number, class NumberLanes, int roundings>
struct FromPoint {
  using Real = Number;
  using Lanes = NumberLanes;
  Real lower[3], upper[3];

  explicit FromPoint(Vec3 local) {
    const double p[3] = {local.x, local.y, local.z};
    for (int k = 0; k < 3; ++k) {
      const double margin = 0x1p-53 * roundings * std::fabs(p[k]);
      lower[k] = static_cast<Real>(p[k] - margin);
      upper[k] = static_cast<Real>(p[k] + margin);
    }
  }
  // A bound that is compared with computed squares of distances, rounded up by more than their error.
  static Real rounded_up(double squared) noexcept {
    const double up = squared * (1 + 0x1p-50 * roundings) + std::numeric_limits<Real>::min();
    return up <= std::numeric_limits<Real>::max() ? static_cast<Real>(up) : std::numeric_limits<Real>::infinity();
  }
};
typedef double Doubles __attribute__((vector_size(64)));
using Near = FromPoint<float, Floats, 1 << 30>;
using Far = FromPoint<double, Doubles, 4>;
inline constexpr double far = 64;  // a coordinate beyond this is far

// Lower bounds of the squared distances from a point to the children of a node.
template <class From>
FS_INLINE typename From::Lanes squared_to_children(const WideTree::Node& node, const From& from) {
  using Lanes = typename From::Lanes;
  const Lanes zero{};
  Lanes sum{};
  for (int k = 0; k < 3; ++k) {
    const Floats origin = all(node.origin[k]), step = all(node.step[k]);
    const Lanes lower = __builtin_convertvector(origin + step * load(node.lower[k]), Lanes);
    const Lanes upper = __builtin_convertvector(origin + step * load(node.upper[k]), Lanes);
    const Lanes below = lower - from.upper[k], above = from.lower[k] - upper;
    Lanes d = below > above ? below : above;
    d = d > zero ? d : zero;
    sum += d * d;
  }
  return sum;
}

// Asks the processor to fetch memory that will be read soon.
template <class T>
FS_INLINE void prefetch(const T* what) noexcept {
  for (size_t i = 0; i < sizeof(T); i += 64) __builtin_prefetch(reinterpret_cast<const char*>(what) + i);
}

// Calls test(leaf, bound) for each leaf that may hold something at a squared distance of at most `bound` (local units) from
// the point; test lowers the bound when it has found something nearer. Near leaves come first. Each node and leaf takes one
// of `visits`; when there are none left the search ends. Returns a lower bound of the squared distance to what was not
// visited; infinite: there is nothing within the bound. expect(leaf): it will probably be tested soon.
template <class From, class Test, class Expect>
FS_INLINE double search(const WideTree& tree, const From& from, typename From::Real bound, uint32_t& visits, Test&& test,
                        Expect&& expect) {
  using Real = typename From::Real;
  struct Entry {
    Real squared;
    uint32_t child;
  };
  Entry stack[WideTree::most_depth * (WideTree::width - 1) + 1];
  uint32_t size = 0;
  const WideTree::Node* const nodes = tree.nodes();
  Entry now{0, nodes ? WideTree::root : WideTree::leaf_bit};
  for (;;) {
    if (visits == 0) {
      Real least = now.squared;
      for (uint32_t i = 0; i < size; ++i) least = std::min(least, stack[i].squared);
      return static_cast<double>(least) * (1 - 0x1p-50 * (sizeof(Real) == 4 ? 1 << 30 : 4));
    }
    --visits;
    if (now.child & WideTree::leaf_bit) {
      test(now.child & ~WideTree::leaf_bit, bound);
    } else {
      const WideTree::Node& node = nodes[now.child];
      const auto squared = squared_to_children(node, from);
      const uint32_t first = size;
      for (uint32_t i = 0; i < node.count; ++i) {
        if (squared[i] > bound) continue;
        if (node.child[i] & WideTree::leaf_bit) {
          expect(node.child[i] & ~WideTree::leaf_bit);
        } else {
          prefetch(nodes + node.child[i]);
        }
        uint32_t place = size++;  // the farthest child lies deepest in the stack
        for (; place > first && stack[place - 1].squared < squared[i]; --place) stack[place] = stack[place - 1];
        stack[place] = {squared[i], node.child[i]};
      }
    }
    do {
      if (size == 0) return std::numeric_limits<double>::infinity();
      now = stack[--size];
    } while (now.squared > bound);
  }
}

}  // namespace wide

}  // namespace fs
