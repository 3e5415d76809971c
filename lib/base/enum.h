// Enums of the C contract as they come from a caller.
#pragma once

#include <cstdint>
#include <cstring>

namespace fs {

// The number in an enum that a C program may have set to anything: in C++ its mere value would be undefined then.
template <class Enum>
int32_t raw_value(const Enum& value) {
  static_assert(sizeof(Enum) == sizeof(int32_t));
  int32_t raw;
  std::memcpy(&raw, &value, sizeof raw);
  return raw;
}

}  // namespace fs
