// Numbers in the bytes of a file, of either byte order and at any address.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>

namespace fs {

template <class T, std::endian order>
T load(const char* bytes) {
  char copy[sizeof(T)];
  std::memcpy(copy, bytes, sizeof copy);
  if constexpr (order != std::endian::native) std::reverse(copy, copy + sizeof copy);
  T value;
  std::memcpy(&value, copy, sizeof value);
  return value;
}

// Appends value to out, little-endian.
template <class T>
void store(std::string& out, T value) {
  char copy[sizeof(T)];
  std::memcpy(copy, &value, sizeof copy);
  if constexpr (std::endian::native == std::endian::big) std::reverse(copy, copy + sizeof copy);
  out.append(copy, sizeof copy);
}

}  // namespace fs
