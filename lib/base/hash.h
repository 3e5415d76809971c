// A hash of bytes: different bytes most probably have different hashes. It is not cryptographic: bytes with a given
// hash can be found.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string_view>

namespace fs {

// FNV-1a, 64 bits (Fowler, Noll, Vo).
inline uint64_t hash_of(std::string_view bytes) noexcept {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

// Of numbers of 64 bits, 128 bits wide; the same on every machine. It never changes, as programs store such hashes and
// compare them with those of others. Each of the two lanes takes in each number by steps that can be undone, so two sequences
// that differ in one number only always differ in both lanes.
class ContentHash {
 public:
  void add(uint64_t number) noexcept {
    a_ = std::rotl(a_ ^ number, 29) * 0x9e3779b97f4a7c15;
    b_ = std::rotl(b_ + number, 41) * 0xbf58476d1ce4e5b9;
  }
  std::array<uint64_t, 2> get() const noexcept {
    const uint64_t b = mixed(b_), a = mixed(a_ + b);
    return {a, b ^ mixed(a + 0x9e3779b97f4a7c15)};
  }

 private:
  // The end of SplitMix64 (Steele, Lea & Flood, "Fast splittable pseudorandom number generators", 2014).
  static uint64_t mixed(uint64_t z) noexcept {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  uint64_t a_ = 0x243f6a8885a308d3, b_ = 0x13198a2e03707344;  // digits of pi
};

}  // namespace fs
