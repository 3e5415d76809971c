#include "findings.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

#include "program.h"
#include "words.h"

namespace {

constexpr std::size_t told_in_full = 3;

}  // namespace

void Findings::add(const std::string& name, const char* format, ...) {
  ++count_;
  std::vector<std::string>& names = names_[format];
  names.push_back(name);
  if (names.size() > told_in_full) return;
  std::printf("  odd: %s%s", name.c_str(), name.empty() ? "" : ": ");
  va_list arguments;
  va_start(arguments, format);
  std::vprintf(format, arguments);
  va_end(arguments);
  std::printf("\n");
}

int Findings::finish() const {
  for (const auto& [sentence, names] : names_) {
    if (names.size() <= told_in_full) continue;
    std::string others;
    constexpr std::size_t most = 8;
    for (std::size_t i = told_in_full; i < std::min(names.size(), told_in_full + most); ++i) {
      others += (others.empty() ? "" : ", ") + names[i];
    }
    const std::size_t left = names.size() - std::min(names.size(), told_in_full + most);
    if (left > 0) others += " and " + std::to_string(left) + " more";
    std::printf("odd as %s, %s and %s: %s\n", names[0].c_str(), names[1].c_str(), names[2].c_str(), others.c_str());
  }
  if (count_ == 0) std::printf("nothing odd\n");
  else std::printf("%d odd %s\n", count_, count_ == 1 ? "thing" : "things");
  write_out();
  return count_ == 0 ? exit_fine : exit_odd;
}

std::string metres(double value) {
  char text[32];
  const double size = std::abs(value);
  if (size >= 1000) std::snprintf(text, sizeof text, "%.4g km", value / 1000);
  else if (size >= 1 || size == 0) std::snprintf(text, sizeof text, "%.4g m", value);
  else if (size >= 1e-3) std::snprintf(text, sizeof text, "%.4g mm", value * 1e3);
  else std::snprintf(text, sizeof text, "%.4g um", value * 1e6);
  return text;
}
