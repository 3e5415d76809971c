// Several numbers at a time, as vectors of the compiler (gcc, clang): on a processor without registers so wide a vector takes
// several, and gives the same bits. A comparison gives all bits of a lane, or none. The last part runs code that is compiled
// for the processor at hand.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "base/processor.h"

#define FS_INLINE inline __attribute__((always_inline))

namespace fs {

typedef float Floats4 __attribute__((vector_size(16)));
typedef float Floats8 __attribute__((vector_size(32)));
typedef double Doubles4 __attribute__((vector_size(32)));
typedef double Doubles8 __attribute__((vector_size(64)));
typedef int32_t Ints8 __attribute__((vector_size(32)));
typedef uint32_t Words8 __attribute__((vector_size(32)));
typedef int64_t Longs4 __attribute__((vector_size(32)));
typedef int64_t Longs8 __attribute__((vector_size(64)));

namespace lanes {

// all() and load() make vectors of 32 bytes: eight floats or integers, four doubles.
FS_INLINE Floats8 all(float value) { return Floats8{value, value, value, value, value, value, value, value}; }
FS_INLINE Doubles4 all(double value) { return Doubles4{value, value, value, value}; }

template <class Lanes, class Real>
FS_INLINE Lanes load_as(const Real* from) {
  Lanes out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
FS_INLINE Floats8 load(const float* from) { return load_as<Floats8>(from); }
FS_INLINE Doubles4 load(const double* from) { return load_as<Doubles4>(from); }
FS_INLINE Ints8 load(const uint32_t* from) { return load_as<Ints8>(from); }

// As one store: gcc 12 makes several of a memcpy, and waits for them when the vector is read again.
template <class Real, class Lanes>
FS_INLINE void store(Real* to, Lanes lanes) {
  typedef Lanes Unaligned __attribute__((aligned(4), may_alias));
  *reinterpret_cast<Unaligned*>(to) = lanes;
}

// Also of one number.
template <class Real>
FS_INLINE Real most(Real a, Real b) {
  return a > b ? a : b;
}
template <class Real>
FS_INLINE Real least(Real a, Real b) {
  return a < b ? a : b;
}

FS_INLINE Floats8 magnitude(Floats8 a) { return (Floats8)((Ints8)a & 0x7fffffff); }
FS_INLINE Doubles4 magnitude(Doubles4 a) { return (Doubles4)((Longs4)a & 0x7fffffffffffffff); }
FS_INLINE Doubles8 magnitude(Doubles8 a) { return (Doubles8)((Longs8)a & 0x7fffffffffffffff); }
// The value where `sign` is not negative, else -value.
FS_INLINE Doubles4 signed_as(Doubles4 value, Doubles4 sign) { return (Doubles4)((Longs4)value ^ ((Longs4)sign & INT64_MIN)); }

FS_INLINE Doubles4 root(Doubles4 v) { return Doubles4{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])}; }
template <class Lanes>
FS_INLINE Lanes root(Lanes squares) {
  Lanes out;
  for (int i = 0; i < 8; ++i) out[i] = std::sqrt(squares[i]);
  return out;
}

// e^-u for u >= 0, within 2 units in the last place: 2^n e^r with |r| <= ln(2)/2, the latter by its Taylor series. Our
// own, because the exp of the system gives other bits for another width.
FS_INLINE Doubles4 exp_minus(Doubles4 u) {
  const Doubles4 magic = all(0x1.8p52);  // a number added to it is rounded to an integer, which stands in its last bits
  const Doubles4 limited = least(u, all(760.0));
  const Doubles4 n = limited * all(-1.4426950408889634) + magic - magic;
  const Doubles4 r = -limited - n * all(0x1.62e42fefa38p-1) - n * all(0x1.ef35793c7673p-45);
  Doubles4 sum = all(1.0 / 6227020800);
  for (const double c : {1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880, 1.0 / 40320, 1.0 / 5040, 1.0 / 720,
                         1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0, 1.0}) {
    sum = sum * r + all(c);
  }
  // In two steps, because 2^n may be too small for a double.
  const Doubles4 half = n * all(0.5) + magic, rest = n - (half - magic) + magic;
  const Longs4 one = (Longs4)all(1.0);
  return sum * (Doubles4)(one + ((Longs4)half << 52)) * (Doubles4)(one + ((Longs4)rest << 52));
}
// Of one number: by the system.
FS_INLINE double exp_minus(double u) { return std::exp(-u); }

// The value in the lanes of a mask, else 0.
FS_INLINE Doubles4 where(Longs4 mask, Doubles4 value) { return (Doubles4)(mask & (Longs4)value); }
FS_INLINE double where(bool is_wanted, double value) { return is_wanted ? value : 0; }

// The mask of the lanes whose bit is set; of one number: whether bit 0 is.
template <class Real>
FS_INLINE auto lanes_of(uint64_t bits) {
  if constexpr (sizeof(Real) == sizeof(double)) {
    return bits != 0;
  } else {
    static_assert(sizeof(Real) == sizeof(Doubles4));
    static constexpr auto masks = [] {
      std::array<std::array<int64_t, 4>, 16> out{};
      for (unsigned b = 0; b < 16; ++b) {
        for (unsigned k = 0; k < 4; ++k) out[b][k] = b >> k & 1 ? -1 : 0;
      }
      return out;
    }();
    return load_as<Longs4>(masks[bits].data());
  }
}
// All bits that any lane has.
FS_INLINE uint64_t any_of(Longs4 lanes) { return static_cast<uint64_t>(lanes[0] | lanes[1] | lanes[2] | lanes[3]); }

// Bit i: lane i of a comparison is true.
FS_INLINE uint32_t bits(Ints8 mask) {
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
FS_INLINE uint32_t bits(Longs8 mask) { return bits(__builtin_convertvector(mask, Ints8)); }

// A field of some bits in each lane, of integers that are not negative.
FS_INLINE Floats8 field(Ints8 words, int first, int size) {
  const int beyond = 32 - first - size;
  Words8 w = (Words8)words >> first;
  if (beyond > 0) w &= (1u << size) - 1;
  return __builtin_convertvector((Ints8)w, Floats8);
}

// Calls function(args...), which must be FS_INLINE, as are all that it calls with vectors: it is compiled for every processor
// and for one with AVX2, and the one that fits runs.
#ifdef __x86_64__
template <auto function, class... Args>
__attribute__((target("avx2"))) auto run_with_avx2(Args&&... args) {
  return function(args...);
}
template <auto function, class... Args>
FS_INLINE auto run(Args&&... args) {
  return has_avx2 ? run_with_avx2<function>(args...) : function(args...);
}
#else
template <auto function, class... Args>
FS_INLINE auto run(Args&&... args) {
  return function(args...);
}
#endif

}  // namespace lanes

}  // namespace fs
