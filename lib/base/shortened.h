// The beginnings of texts. Drivers include this too: it needs no source file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace fs {

// The beginning of a text, of at most so many bytes, that ends with a whole character of UTF-8.
inline std::string_view beginning_of(std::string_view text, size_t most) {
  if (text.size() <= most) return text;
  while (most > 0 && (text[most] & 0xc0) == 0x80) --most;
  return text.substr(0, most);
}

// A text that a caller gave, for an error sentence: a long one is cut after 80 bytes and ends with "...".
inline std::string shortened(std::string_view text) {
  constexpr size_t longest = 80;
  return std::string(beginning_of(text, longest)) + (text.size() > longest ? "..." : "");
}

}  // namespace fs
