// Eight lanes at a time, with vectors of the compiler (gcc, clang): on a processor without registers so wide it takes several,
// and they give the same bits. To be included where its inlined code is compiled for each processor.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace fs {

typedef float Floats __attribute__((vector_size(32)));
typedef double Doubles __attribute__((vector_size(64)));
typedef int32_t Ints __attribute__((vector_size(32)));
typedef int64_t Longs __attribute__((vector_size(64)));

#define FS_INLINE inline __attribute__((always_inline))

namespace wide {

FS_INLINE Floats all(float value) { return Floats{value, value, value, value, value, value, value, value}; }
FS_INLINE Ints load(const uint32_t* from) {
  Ints out;
  std::memcpy(&out, from, sizeof out);
  return out;
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
FS_INLINE Doubles magnitude(Doubles a) { return (Doubles)((Longs)a & 0x7fffffffffffffff); }
FS_INLINE Floats most(Floats a, Floats b) { return a > b ? a : b; }
FS_INLINE Floats least(Floats a, Floats b) { return a < b ? a : b; }
template <class Lanes>
FS_INLINE Lanes roots(Lanes squares) {
  Lanes out;
  for (int i = 0; i < 8; ++i) out[i] = std::sqrt(squares[i]);
  return out;
}
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

}  // namespace wide

}  // namespace fs
