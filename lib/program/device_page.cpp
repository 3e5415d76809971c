#include "device_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "words.h"

namespace {

const char* word(Verdict verdict) {
  switch (verdict) {
    case Verdict::passed: return "passed";
    case Verdict::odd: return "odd";
    case Verdict::failed: break;
  }
  return "FAILED";
}

}  // namespace

double Durations::quantile(double part) const {
  if (all_.empty()) return 0;
  std::vector<double> sorted(all_);
  std::sort(sorted.begin(), sorted.end());
  return sorted[static_cast<std::size_t>(std::ceil(part * static_cast<double>(sorted.size() - 1)))];
}

std::string Durations::text() const {
  return format("p50 %.3f, p99 %.3f, max %.3f ms", quantile(0.5) * 1e3, quantile(0.99) * 1e3, longest() * 1e3);
}

void DevicePage::title(const std::string& text) { std::printf("# %s\n", text.c_str()); }

void DevicePage::heading(const std::string& text) {
  std::printf("\n## %s\n\n", text.c_str());
  std::fflush(stdout);
}

void DevicePage::figure(const char* label, const std::string& text) {
  std::printf("    %-12s%s\n", label, text.c_str());
  std::fflush(stdout);
}

void DevicePage::expect(bool holds, Verdict otherwise, const std::string& sentence) {
  note(holds ? Verdict::passed : otherwise, sentence);
}

void DevicePage::note(Verdict verdict, const std::string& sentence) {
  std::printf("%-6s  %s\n", word(verdict), sentence.c_str());
  std::fflush(stdout);
  noted_.push_back({verdict, sentence});
}

bool DevicePage::has(Verdict verdict) const {
  return std::any_of(noted_.begin(), noted_.end(), [&](const Noted& noted) { return noted.verdict == verdict; });
}

void DevicePage::finish() const {
  const auto count = [&](Verdict verdict) {
    return std::count_if(noted_.begin(), noted_.end(), [&](const Noted& noted) { return noted.verdict == verdict; });
  };
  std::printf("\n## Result\n\n%td passed, %td odd, %td failed\n", count(Verdict::passed), count(Verdict::odd),
              count(Verdict::failed));
  for (const Noted& noted : noted_) {
    if (noted.verdict != Verdict::passed) std::printf("%-6s  %s\n", word(noted.verdict), noted.sentence.c_str());
  }
}
