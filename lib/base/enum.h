// Reads and writes enums of the C contract, whatever number a caller has set them to.
#pragma once

#include <cstdint>
#include <cstring>

namespace fs {

// Reads the bits of an enum that a C program may have set to any number: reading an out-of-range value as the enum is
// undefined in C++.
template <class Enum>
int32_t raw_value(const Enum& value) {
  static_assert(sizeof(Enum) == sizeof(int32_t));
  int32_t raw;
  std::memcpy(&raw, &value, sizeof raw);
  return raw;
}

// Sets an enum to any number: it is checked where it is used.
template <class Enum>
void set_raw_value(Enum& out, int32_t raw) {
  static_assert(sizeof(Enum) == sizeof(int32_t));
  std::memcpy(&out, &raw, sizeof out);
}

}  // namespace fs
