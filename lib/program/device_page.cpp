#include "device_page.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <stdexcept>

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

void DevicePage::write_report(const std::string& path) {
  report_.reset(std::fopen(path.c_str(), "wx"));
  path_ = path;
  if (!report_) throw std::runtime_error("cannot write the report " + path + ": " + std::strerror(errno));
}

void DevicePage::print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
  if (!report_ || (std::fputs(text.c_str(), report_.get()) >= 0 && std::fflush(report_.get()) == 0)) return;
  throw std::runtime_error("cannot write the report " + path_ + ": " + std::strerror(errno));
}

void DevicePage::title(const std::string& text) { print("# " + text + "\n"); }

void DevicePage::heading(const std::string& text) { print("\n## " + text + "\n\n"); }

void DevicePage::figure(const char* label, const std::string& text) { print(format("    %-12s", label) + text + "\n"); }

void DevicePage::text(const std::string& paragraph) { print("\n" + paragraph + "\n"); }

void DevicePage::expect(bool holds, Verdict otherwise, const std::string& sentence) {
  note(holds ? Verdict::passed : otherwise, sentence);
}

void DevicePage::note(Verdict verdict, const std::string& sentence) {
  print(format("%-6s  ", word(verdict)) + sentence + "\n");
  noted_.push_back({verdict, sentence});
}

bool DevicePage::has(Verdict verdict) const {
  return std::any_of(noted_.begin(), noted_.end(), [&](const Noted& noted) { return noted.verdict == verdict; });
}

void DevicePage::leave_out(const char* label, const std::string& why) {
  figure(label, why);
  ++left_out_;
}

void DevicePage::finish() {
  const auto count = [&](Verdict verdict) {
    return std::count_if(noted_.begin(), noted_.end(), [&](const Noted& noted) { return noted.verdict == verdict; });
  };
  print(format("\n## Result\n\n%td passed, %td odd, %td failed", count(Verdict::passed), count(Verdict::odd),
               count(Verdict::failed)) +
        (left_out_ ? format("; steps that were left out: %d\n", left_out_) : "\n"));
  for (const Noted& noted : noted_) {
    if (noted.verdict != Verdict::passed) print(format("%-6s  ", word(noted.verdict)) + noted.sentence + "\n");
  }
}
