// Reads enums of the C contract that a caller has set.
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

}  // namespace fs
