// Samples, their percentiles, the rows of the table they make, and the file that keeps all of them.
#pragma once

#include <ctime>

#include <cstdint>
#include <string>
#include <vector>

namespace bench {

// The clock of scenes and devices: CLOCK_MONOTONIC, ns.
inline int64_t now_ns() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return int64_t{1'000'000'000} * t.tv_sec + t.tv_nsec;
}
void sleep_until(int64_t time);  // ns
inline void sleep_for(double seconds) { sleep_until(now_ns() + static_cast<int64_t>(1e9 * seconds)); }

struct Samples {
  std::vector<double> values;

  void add(double value) { values.push_back(value); }
  void add(const Samples& more) { values.insert(values.end(), more.values.begin(), more.values.end()); }
  double quantile(double part) const;  // NaN: there are no samples
  double p50() const { return quantile(0.5); }
  double p99() const { return quantile(0.99); }
  double max() const { return quantile(1); }
};

enum class Unit { time, percent, bytes, rate, ratio };  // ns, of a core, of memory, a second, none

// What a row is compared with.
struct Peer {
  std::string name;
  const Samples* samples;  // null: nothing
};

// One line on standard output, a row of the table of README.md: percentiles, and their ratios to those of the peer. All
// samples go to the file of figures.
void table_row(const std::string& name, Unit unit, const Samples& samples, const Peer& peer = {"", nullptr});
void table_row(const std::string& name, Unit unit, double value);  // one figure
void table_begin(const std::string& data_file);                    // heading; the file is made anew
void table_open(const std::string& data_file);                     // continues the file, in another process

// The machine, its system and its load: a line on standard output.
void print_machine();

// Prints to standard error.
[[gnu::format(printf, 1, 2)]] void progress(const char* format, ...);

}  // namespace bench
