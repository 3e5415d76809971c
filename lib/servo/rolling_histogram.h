// Percentiles of the last 10 s at a constant cost per tick: one histogram for each second; a query merges all ten.
// Bins are 1/32 of an octave wide (as in G. Tene's HdrHistogram), so a percentile is at most 3.2 % too high; the maximum
// is exact.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

namespace fs {

class RollingHistogram {
 public:
  struct Percentiles {
    double p50 = 0, p99 = 0, max = 0;  // s
    uint64_t count = 0;
    double since = 0;  // s, the beginning of the oldest second that is counted
  };

  // [rt] Only one thread may call it. value: s, >= 0; now: s, never less than before.
  void add(double value, double now) noexcept {
    const int64_t second = static_cast<int64_t>(std::floor(now));
    Second& bucket = seconds_[static_cast<size_t>(((second % kept) + kept) % kept)];
    if (bucket.second.load(std::memory_order_relaxed) != second) {
      for (auto& bin : bucket.bins) bin.store(0, std::memory_order_relaxed);
      bucket.max.store(0, std::memory_order_relaxed);
      bucket.second.store(second, std::memory_order_release);
    }
    const double limited = std::fmin(value * 1e9, 0x1p40 - 1);
    const size_t bin = to_bin(static_cast<uint64_t>(limited));
    bucket.bins[bin].store(bucket.bins[bin].load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (value > bucket.max.load(std::memory_order_relaxed)) bucket.max.store(value, std::memory_order_relaxed);
    newest_.store(second, std::memory_order_release);
  }

  // Any thread. A value that is being added at the same time may be counted in part only.
  Percentiles percentiles() const noexcept {
    const int64_t newest = newest_.load(std::memory_order_acquire);
    std::array<uint64_t, bin_count> sum{};
    Percentiles out;
    uint64_t& count = out.count;
    out.since = static_cast<double>(newest - kept + 1);
    for (const Second& bucket : seconds_) {
      const int64_t second = bucket.second.load(std::memory_order_acquire);
      if (second > newest || second <= newest - kept) continue;
      for (size_t i = 0; i < bin_count; ++i) {
        sum[i] += bucket.bins[i].load(std::memory_order_relaxed);
        count += bucket.bins[i].load(std::memory_order_relaxed);
      }
      out.max = std::fmax(out.max, bucket.max.load(std::memory_order_relaxed));
    }
    const auto at = [&](double fraction) {
      uint64_t rest = static_cast<uint64_t>(std::ceil(fraction * static_cast<double>(count)));
      for (size_t i = 0; i < bin_count; ++i) {
        if (rest <= sum[i]) return std::fmin(1e-9 * upper_edge(i), out.max);
        rest -= sum[i];
      }
      return out.max;
    };
    if (count) {
      out.p50 = at(.5);
      out.p99 = at(.99);
    }
    return out;
  }

 private:
  static constexpr int64_t kept = 10;
  static constexpr size_t bin_count = 35 * 32 + 64;

  static size_t to_bin(uint64_t ns) noexcept {
    const int shift = std::max(0, static_cast<int>(std::bit_width(ns)) - 6);
    return static_cast<size_t>(shift) * 32 + static_cast<size_t>(ns >> shift);
  }
  static double upper_edge(size_t bin) noexcept {
    const size_t shift = bin < 64 ? 0 : bin / 32 - 1;
    return std::ldexp(static_cast<double>(bin - shift * 32 + 1), static_cast<int>(shift));
  }

  struct Second {
    std::atomic<int64_t> second{INT64_MIN};
    std::atomic<double> max{0};
    std::array<std::atomic<uint32_t>, bin_count> bins{};
  };
  std::array<Second, kept> seconds_;
  std::atomic<int64_t> newest_{INT64_MIN + kept};
};

}  // namespace fs
