// Small texts: fields of a fixed size, as the C contract and the wire have them; numbers; pieces of text for sentences.
#pragma once

#include <charconv>
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

// Reads a text that is a number as a whole, whatever the locale is. False: it is none, or out of range.
template <class Number>
bool read_number(std::string_view text, Number& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc() && end == text.data() + text.size();
}

// A piece of text for a sentence: cut after 40 bytes; what is not printable ASCII becomes \xNN.
std::string printable(std::string_view text);
std::string in_quotes(std::string_view text);

}  // namespace fs
