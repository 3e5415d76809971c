// The search of a WideTree from a point, eight children at a time. To be included where its inlined code is compiled for each
// processor.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "force/wide_tree.h"

namespace fs {

// Vectors of the compiler (gcc, clang): on a processor without registers so wide it takes several.
typedef float Floats __attribute__((vector_size(32)));
typedef int32_t Ints __attribute__((vector_size(32)));
typedef uint16_t Shorts __attribute__((vector_size(16)));
typedef int64_t Longs __attribute__((vector_size(64)));

#define FS_INLINE inline __attribute__((always_inline))

namespace wide {

FS_INLINE Floats all(float value) { return Floats{value, value, value, value, value, value, value, value}; }
FS_INLINE Ints load(const uint32_t* from) {
  Ints out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
FS_INLINE Floats load(const uint16_t* from) {
  Shorts out;
  std::memcpy(&out, from, sizeof out);
  return __builtin_convertvector(out, Floats);
}
// A field of some bits in each lane, of integers that are not negative.
FS_INLINE Floats field(Ints words, int first, int size) {
  const int beyond = 32 - first - size;
  typedef uint32_t Words __attribute__((vector_size(32)));
  Words w = (Words)words >> first;
  if (beyond > 0) w &= (1u << size) - 1;
  return __builtin_convertvector((Ints)w, Floats);
}
// As one store: gcc 12 makes several of a memcpy, and waits for them when the vector is read again.
template <class Real, class Lanes>
FS_INLINE void store(Real* to, Lanes lanes) {
  typedef Lanes Unaligned __attribute__((aligned(4), may_alias));
  *reinterpret_cast<Unaligned*>(to) = lanes;
}
FS_INLINE Floats magnitude(Floats a) { return (Floats)((Ints)a & 0x7fffffff); }
FS_INLINE Floats most(Floats a, Floats b) { return a > b ? a : b; }
FS_INLINE Floats least(Floats a, Floats b) { return a < b ? a : b; }
// Bit i: lane i of a comparison is true.
FS_INLINE uint32_t bits(Ints mask) {
#ifdef __SSE2__
  __m128 half[2];
  std::memcpy(half, &mask, sizeof half);
  return static_cast<uint32_t>(_mm_movemask_ps(half[0]) | _mm_movemask_ps(half[1]) << 4);
#else
  uint32_t out = 0;
  for (int i = 0; i < 8; ++i) out |= (mask[i] & 1u) << i;
  return out;
#endif
}
FS_INLINE uint32_t bits(Longs mask) { return bits(__builtin_convertvector(mask, Ints)); }

// A point from which is looked, in the local frame. Far away from the shape single precision would tell nothing apart, so
// there are two kinds. `rounding` is more than the relative error of what is worked out with it.
struct Near {
  using Real = float;
  using Lanes = Floats;
  static constexpr double rounding = 0x1p-20;
  Vec3 at;
};
typedef double Doubles __attribute__((vector_size(64)));
FS_INLINE Doubles magnitude(Doubles a) { return (Doubles)((Longs)a & 0x7fffffffffffffff); }
struct Far {
  using Real = double;
  using Lanes = Doubles;
  static constexpr double rounding = 0x1p-48;
  Vec3 at;
};
inline constexpr double far = 64;  // a coordinate beyond this is far

// A bound for squares of distances that are worked out with From.
template <class From>
typename From::Real rounded_up(double squared) noexcept {
  using Real = typename From::Real;
  const double up = squared * (1 + From::rounding) + std::numeric_limits<Real>::min();
  return up <= std::numeric_limits<Real>::max() ? static_cast<Real>(up) : std::numeric_limits<Real>::infinity();
}

template <class Lanes>
FS_INLINE Lanes roots(Lanes squares) {
  Lanes out;
  for (int i = 0; i < 8; ++i) out[i] = std::sqrt(squares[i]);
  return out;
}

// Lower bounds of the squared distances from a point to the children of a node. discs: null: there are none.
template <class From>
FS_INLINE typename From::Lanes squared_to_children(const WideTree::Node& node, const WideTree::Discs* discs,
                                                   const From& from) {
  using Real = typename From::Real;
  using Lanes = typename From::Lanes;
  const Lanes zero{};
  const Ints low = load(node.lower), high = load(node.upper);
  const double at[3] = {from.at.x, from.at.y, from.at.z};
  const Real per_step = sizeof(Real) == sizeof node.steps ? Real{node.steps} : 1 / Real{node.step};
  Lanes sum{}, from_middle[3];
  Real margins = 0;
  for (int k = 0; k < 3; ++k) {
    const Real t = static_cast<Real>(at[k] - node.origin[k]) * per_step;  // in steps
    const Real margin = std::fabs(t) * static_cast<Real>(From::rounding / 2);
    const Lanes lower = __builtin_convertvector(field(low, 8 * k, 8), Lanes);
    const Lanes upper = __builtin_convertvector(field(high, 8 * k, 8), Lanes);
    const Lanes below = lower - (t + margin), above = (t - margin) - upper;
    Lanes d = below > above ? below : above;
    d = d > zero ? d : zero;
    sum += d * d;
    from_middle[k] = t - (lower + upper) / 2;
    margins += margin;
  }
  if (discs) {
    using Discs = WideTree::Discs;
    const Ints x_y = load(discs->x_y), sizes = load(discs->sizes);
    const auto lanes = [](Floats f) __attribute__((always_inline)) { return __builtin_convertvector(f, Lanes); };
    constexpr Real unit = Discs::unit;
    const Lanes x = lanes(field(x_y, 0, 16)) - unit, y = lanes(field(x_y, 16, 16)) - unit;
    const Lanes z = unit - magnitude(x) - magnitude(y);
    const Lanes per_length = 1 / roots(x * x + y * y + z * z);
    const Lanes offset = (lanes(field(sizes, 0, 16)) - Real{Discs::zero_offset}) * (Real{1} / Discs::offsets_a_step);
    const Lanes radius = lanes(field(sizes, 16, 8));
    const Lanes height = lanes((Floats)(((sizes >> 24 & 255) << Discs::height_shift) +
                                        static_cast<int32_t>(Discs::smallest_height)));
    const Lanes along = (x * from_middle[0] + y * from_middle[1] + z * from_middle[2]) * per_length;
    const Lanes squared = from_middle[0] * from_middle[0] + from_middle[1] * from_middle[1] + from_middle[2] * from_middle[2];
    const Lanes beyond = along - offset;
    constexpr auto less = static_cast<Real>(1 - 4 * From::rounding);
    margins = 4 * margins + static_cast<Real>(4 * From::rounding * WideTree::grid);  // more than rounding makes
    Lanes up = magnitude(beyond) - (height + margins);
    const Lanes across = squared * less - along * along;
    Lanes beside = roots(across > zero ? across : zero) - (radius + margins);
    up = up > zero ? up : zero;
    beside = beside > zero ? beside : zero;
    const Lanes to_disc = (up * up + beside * beside) * less;
    sum = to_disc > sum ? to_disc : sum;
  }
  return sum * (Real{node.step} * Real{node.step});
}

// Asks the processor to fetch memory that will be read soon.
template <class T>
FS_INLINE void prefetch(const T* what) noexcept {
  for (size_t i = 0; i < sizeof(T); i += 64) __builtin_prefetch(reinterpret_cast<const char*>(what) + i);
}

// Calls test(leaf, bound) for each leaf that may hold something at a squared distance of at most `bound` (local units) from
// the point; test lowers the bound when it has found something nearer. Near leaves come first. Each node and leaf takes one
// of `visits`; when there are none left the search ends. Returns a lower bound of the squared distance to what was not
// visited; infinite: there is nothing within the bound. expect_leaf(leaf): it will probably be tested soon.
template <class From, class Test, class Expect>
FS_INLINE double search(const WideTree& tree, const From& from, typename From::Real bound, uint32_t& visits, Test&& test,
                        Expect&& expect_leaf) {
  using Real = typename From::Real;
  struct Entry {
    Real squared;
    uint32_t child;
  };
  Entry stack[WideTree::most_depth * (WideTree::width - 1) + 1];
  uint32_t size = 0;
  const WideTree::Node* const nodes = tree.nodes();
  const WideTree::Discs* const discs = tree.discs();
  const auto expect = [&](uint32_t child) __attribute__((always_inline)) {
    if (child & WideTree::leaf_bit) {
      expect_leaf(child & ~WideTree::leaf_bit);
    } else {
      prefetch(nodes + child);
      if (discs) prefetch(discs + child);
    }
  };
  Entry now{0, nodes ? WideTree::root : WideTree::leaf_bit};
  for (;;) {
    if (visits == 0) {
      Real least = now.squared;
      for (uint32_t i = 0; i < size; ++i) least = std::min(least, stack[i].squared);
      return static_cast<double>(least) * (1 - From::rounding);
    }
    --visits;
    if (now.child & WideTree::leaf_bit) {
      test(now.child & ~WideTree::leaf_bit, bound);
    } else {
      const WideTree::Node& node = nodes[now.child];
      const auto distances = squared_to_children(node, node.has_discs ? discs + now.child : nullptr, from);
      Real squared[WideTree::width];
      store(squared, distances);
      uint32_t near = bits(distances <= bound) & node.filled;
      if (near) {
        // The nearest child is taken next, the others wait.
        auto next = static_cast<uint32_t>(std::countr_zero(near));
        expect(node.child[next]);
        for (near &= near - 1; near; near &= near - 1) {
          auto i = static_cast<uint32_t>(std::countr_zero(near));
          expect(node.child[i]);
          if (squared[i] < squared[next]) std::swap(i, next);
          stack[size++] = {squared[i], node.child[i]};
        }
        now = {squared[next], node.child[next]};
        continue;
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
