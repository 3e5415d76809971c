#include "base/text.h"

#include <algorithm>
#include <cstdio>

#include "base/decimal_point.h"

namespace fs {

std::string formatted(const char* format, va_list arguments) {
  const DecimalPoint point;
  va_list again;
  va_copy(again, arguments);
  const int size = std::vsnprintf(nullptr, 0, format, arguments);
  std::string out(static_cast<size_t>(std::max(size, 0)), 0);
  std::vsnprintf(out.data(), out.size() + 1, format, again);
  va_end(again);
  return out;
}

std::string formatted(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  std::string out = formatted(format, arguments);
  va_end(arguments);
  return out;
}

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
