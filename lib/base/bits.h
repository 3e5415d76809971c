// Sets of up to 64 things as the bits of a number.
#pragma once

#include <bit>
#include <cstdint>

namespace fs {

constexpr uint64_t bit_of(uint32_t i) noexcept { return uint64_t{1} << i; }

// Calls f(i) for each bit i that is set, from the lowest.
template <class F>
constexpr void for_each_bit(uint64_t bits, F&& f) {
  for (; bits; bits &= bits - 1) f(static_cast<uint32_t>(std::countr_zero(bits)));
}

}  // namespace fs
