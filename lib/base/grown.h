// How structs of the contract change. Those that grow begin with struct_size, which says how much of the struct the caller was built
// with. Here is the only place where such a struct of a caller is read or written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace fs {

// In bytes.
struct StructSizes {
  const char* type;
  uint32_t first;  // of the first version
  uint32_t known;  // as this library knows it
};

template <class Struct>
const StructSizes& sizes_of() noexcept;  // struct_sizes.cpp

namespace grown {
inline constexpr uint32_t largest = 4096;  // no version of a struct is larger: a larger struct_size is garbage

void check_size(uint32_t struct_size, const StructSizes& sizes);
void read(const void* given, const StructSizes& sizes, void* out);
void write(const void* ours, const StructSizes& sizes, void* out);
void require_zeros(const double* reserved, size_t count, const char* owner);
}  // namespace grown

// Throws VERSION if the caller's struct is larger than any can be, and INVALID if it is smaller than the first version.
template <class Struct>
void check_grown(const Struct* given) {
  grown::check_size(given->struct_size, sizes_of<Struct>());
}

// A copy of the caller's struct, in which the fields that the caller does not know are 0, and struct_size says how far the
// caller and this library both know it. INVALID; VERSION: a field that this library does not know is not 0.
template <class Struct>
Struct read_grown(const Struct* given) {
  Struct out{};
  grown::read(given, sizes_of<Struct>(), &out);
  return out;
}

// Fills the caller's struct, no further than its struct_size, which stays. Fields that this library does not know become 0.
// INVALID, VERSION.
template <class Struct>
void write_grown(const Struct& ours, Struct* out) {
  grown::write(&ours, sizes_of<Struct>(), out);
}

// The reserved numbers of a frozen struct, which the sentence calls `owner`, must be 0: a later version may give them a
// meaning. INVALID.
template <size_t count>
void check_reserved(const double (&reserved)[count], const char* owner) {
  grown::require_zeros(reserved, count, owner);
}

// Whether the caller knows this field of a struct that read_grown gave.
template <class Struct, class Field>
bool knows(const Struct& given, const Field& field) noexcept {
  const auto* const begin = reinterpret_cast<const std::byte*>(&given);
  return reinterpret_cast<const std::byte*>(&field + 1) <= begin + given.struct_size;
}

}  // namespace fs
