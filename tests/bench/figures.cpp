#include "figures.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>

#include <forceserver/forceserver.h>

namespace bench {
namespace {

std::FILE* data = nullptr;

void open_data(const std::string& path, const char* mode) {
  data = std::fopen(path.c_str(), mode);
  if (!data) {
    std::perror(path.c_str());
    std::_Exit(1);
  }
}

std::string text_of(double value, Unit unit) {
  char text[40];
  if (!std::isfinite(value)) return "";
  const auto scaled = [&](double scale, const char* name) {
    const double x = value / scale;
    std::snprintf(text, sizeof text, "%.*f %s", x < 9.95 ? 1 : 0, x, name);
  };
  switch (unit) {
    case Unit::time: value < 999.5 ? scaled(1, "ns") : value < 999.5e3 ? scaled(1e3, "us") : scaled(1e6, "ms"); break;
    case Unit::percent: scaled(1, "%"); break;
    case Unit::bytes: value < 1e6 ? scaled(1e3, "kB") : scaled(1e6, "MB"); break;
    case Unit::rate: std::snprintf(text, sizeof text, "%.0f /s", value); break;
    case Unit::ratio: std::snprintf(text, sizeof text, "%.2f", value); break;
  }
  return text;
}

std::string ratio_of(double value, double to) {
  char text[40];
  if (!std::isfinite(value / to)) return "";
  std::snprintf(text, sizeof text, "%.2f", value / to);
  return text;
}

void line(const std::string& name, const std::string& count, const std::string& p50, const std::string& p99,
          const std::string& max, const std::string& ratio50, const std::string& ratio99, const std::string& peer) {
  std::printf("| %-60s | %6s | %9s | %9s | %9s | %5s | %5s | %s |\n", name.c_str(), count.c_str(), p50.c_str(),
              p99.c_str(), max.c_str(), ratio50.c_str(), ratio99.c_str(), peer.c_str());
  std::fflush(stdout);
}

const char* name_of(Unit unit) {
  switch (unit) {
    case Unit::time: return "ns";
    case Unit::percent: return "percent of a core";
    case Unit::bytes: return "bytes";
    case Unit::rate: return "1/s";
    case Unit::ratio: return "ratio";
  }
  return "";
}

}  // namespace

void sleep_until(int64_t time) {
  const timespec t{static_cast<time_t>(time / 1'000'000'000), static_cast<long>(time % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

double Samples::quantile(double part) const {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> sorted = values;
  const auto at = sorted.begin() + static_cast<ptrdiff_t>(part * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

void table_row(const std::string& name, Unit unit, const Samples& samples, const Peer& peer) {
  const double p50 = samples.p50(), p99 = samples.p99();
  const std::string count = std::to_string(samples.values.size());
  line(name, count, text_of(p50, unit), text_of(p99, unit), text_of(samples.max(), unit),
       peer.samples ? ratio_of(p50, peer.samples->p50()) : "", peer.samples ? ratio_of(p99, peer.samples->p99()) : "",
       peer.name);
  for (const double value : samples.values) std::fprintf(data, "\"%s\",%s,%.9g\n", name.c_str(), name_of(unit), value);
  std::fflush(data);
}

void table_row(const std::string& name, Unit unit, double value) {
  line(name, "", text_of(value, unit), "", "", "", "", "");
  std::fprintf(data, "\"%s\",%s,%.9g\n", name.c_str(), name_of(unit), value);
  std::fflush(data);
}

void table_begin(const std::string& path) {
  open_data(path, "w");
  std::fprintf(data, "row,unit,value\n");
  std::fflush(data);
  line("row", "n", "p50", "p99", "max", "p50 x", "p99 x", "of");
  std::printf("|%s|---:|---:|---:|---:|---:|---:|---|\n", std::string(62, '-').c_str());
  std::fflush(stdout);
}

void table_open(const std::string& path) { open_data(path, "a"); }

void print_machine() {
  utsname system{};
  uname(&system);
  std::ifstream file("/proc/cpuinfo");
  std::string line, model = "?", load;
  while (std::getline(file, line)) {
    if (line.starts_with("model name")) model = line.substr(line.find(':') + 2);
  }
  std::getline(std::ifstream("/proc/loadavg"), load);
  std::printf("%s, %ld processors; %s %s; forceserver %s; load before: %s\n", model.c_str(),
              sysconf(_SC_NPROCESSORS_ONLN), system.sysname, system.release, fs_version(), load.c_str());
  std::fflush(stdout);
}

void progress(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  std::vfprintf(stderr, format, arguments);
  va_end(arguments);
  std::fputc('\n', stderr);
}

}  // namespace bench
