// Small texts: fields of fixed size, as in the C contract and on the wire; numbers; pieces of text for error sentences.
#pragma once

#include <charconv>
#include <cstdarg>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

#include "base/shortened.h"

namespace fs {

// The text of a field. A field from another process may lack its terminating 0; then the text is the whole field.
template <size_t n>
std::string text_of(const char (&field)[n]) {
  return std::string(field, strnlen(field, n));
}

// Puts text into a field, cut if it is too long; the rest of the field is 0.
template <size_t n>
void put_text(char (&field)[n], std::string_view text) {
  std::memset(field, 0, n);
  beginning_of(text, n - 1).copy(field, n - 1);
}

// Reads a number, independent of the locale. False when the whole text is not one number, or it is out of range.
template <class Number>
bool read_number(std::string_view text, Number& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc() && end == text.data() + text.size();
}

// What printf would print, of any length; numbers have a decimal point, whatever the locale.
[[gnu::format(printf, 1, 0)]] std::string formatted(const char* format, va_list arguments);
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

// A piece of text for an error sentence: cut after 40 bytes; bytes that are not printable ASCII become \xNN.
std::string printable(std::string_view text);
std::string in_quotes(std::string_view text);

}  // namespace fs
