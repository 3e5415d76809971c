// A hash of bytes. It is not cryptographic: bytes with a given hash can be found.
#pragma once

#include <cstddef>
#include <cstdint>

namespace bridge {

// FNV-1a, 64 bits (Fowler, Noll, Vo). begin: another one gives another hash.
inline uint64_t hash_of(const void* data, size_t size, uint64_t begin = 0xcbf29ce484222325) noexcept {
  const auto* const bytes = static_cast<const unsigned char*>(data);
  uint64_t hash = begin;
  for (size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001b3;
  return hash;
}

}  // namespace bridge
