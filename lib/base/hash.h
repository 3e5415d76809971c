// A hash of bytes: different bytes most probably have different hashes. It is not cryptographic: bytes with a given
// hash can be found.
#pragma once

#include <cstdint>
#include <string_view>

namespace fs {

// FNV-1a, 64 bits (Fowler, Noll, Vo).
inline uint64_t hash_of(std::string_view bytes) noexcept {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

}  // namespace fs
