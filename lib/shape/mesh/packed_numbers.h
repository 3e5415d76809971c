// A list of numbers that takes no more bits for each than the largest of them needs. Built once, then immutable.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/stop_token.h"

namespace fs {

class PackedNumbers {
 public:
  PackedNumbers() = default;
  // largest: no number is larger. Throws Stopped.
  PackedNumbers(std::span<const uint32_t> numbers, uint32_t largest, StopToken& stop)
      : bits_(static_cast<uint32_t>(std::bit_width(largest | 1u))), words_(numbers.size() * bits_ / 64 + 2) {
    for (size_t i = 0; i < numbers.size(); ++i) {
      stop.check();
      const size_t bit = i * bits_;
      words_[bit / 64] |= uint64_t{numbers[i]} << bit % 64;
      words_[bit / 64 + 1] |= uint64_t{numbers[i]} >> 1 >> (63 - bit % 64);
    }
  }

  bool empty() const noexcept { return words_.empty(); }
  // [rt]
  uint32_t operator[](size_t i) const noexcept {
    const size_t bit = i * bits_;
    const uint64_t found = words_[bit / 64] >> bit % 64 | words_[bit / 64 + 1] << 1 << (63 - bit % 64);
    return static_cast<uint32_t>(found & ((uint64_t{1} << bits_) - 1));
  }
  size_t size() const noexcept { return words_.size() * sizeof(uint64_t); }  // bytes

 private:
  uint32_t bits_ = 0;  // of a number
  std::vector<uint64_t> words_;
};

}  // namespace fs
