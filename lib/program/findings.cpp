#include "findings.h"

#include <cstdarg>
#include <cstdio>

#include "program.h"

void Findings::add(const std::string& name, const char* format, ...) {
  std::printf("  odd: %s%s", name.c_str(), name.empty() ? "" : ": ");
  va_list arguments;
  va_start(arguments, format);
  std::vprintf(format, arguments);
  va_end(arguments);
  std::printf("\n");
  ++count_;
}

int Findings::finish() const {
  if (count_ == 0) std::printf("nothing odd\n");
  else std::printf("%d odd %s\n", count_, count_ == 1 ? "thing" : "things");
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
