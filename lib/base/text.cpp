#include "base/text.h"

#include <cstdio>

namespace fs {

std::string printable(std::string_view text) {
  constexpr size_t longest = 40;
  std::string out;
  for (const char c : text.substr(0, longest)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      out += c;
    } else {
      char hex[8];
      std::snprintf(hex, sizeof hex, "\\x%02x", byte);
      out += hex;
    }
  }
  return out + (text.size() > longest ? "..." : "");
}

std::string in_quotes(std::string_view text) { return "\"" + printable(text) + "\""; }

}  // namespace fs
