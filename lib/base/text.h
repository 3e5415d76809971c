// Names and sentences in fields of a fixed size, as the C contract and the wire have them.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

namespace fs {

// The text of a field, which may come from another process: it is cut where it has no end.
template <size_t n>
std::string text_of(const char (&field)[n]) {
  return std::string(field, strnlen(field, n));
}

// Puts text into a field, cut where it is too long; the rest of the field is 0.
template <size_t n>
void put_text(char (&field)[n], std::string_view text) {
  std::memset(field, 0, n);
  text.copy(field, n - 1);
}

}  // namespace fs
