// The flight record keeps the newest ticks. The tick writes it, any thread may read it.
#pragma once

#include <atomic>
#include <vector>

#include <forceserver/servo.h>

#include "base/seqlock.h"
#include "servo/locked_memory.h"

namespace fs {

class FlightRecord {
 public:
  explicit FlightRecord(size_t size) : size_(size), slots_(size + spare) {}

  void add(const fs_tick& tick) noexcept;            // [rt]
  size_t read(fs_tick* out, size_t capacity) const;  // oldest first; returns how many there are

  // How many ticks are kept that have a number above `after`; the first tick has number 1.
  size_t count(uint64_t after) const noexcept;
  // Calls f(const fs_recorded_tick&) for each of them, oldest first, for so many at most.
  template <class F>
  void for_each(uint64_t after, size_t most, F&& f) const {
    const uint64_t end = count_.load(std::memory_order_acquire);
    for (uint64_t index = end - count(after, end); index < end && most > 0; ++index) {
      Sample sample;
      if (!read(index, sample)) continue;
      f(fs_recorded_tick{index + 1, sample.tick});
      --most;
    }
  }

  MemoryLock::Range pages() const noexcept { return {slots_.data(), slots_.size() * sizeof(Seqlock<Sample>)}; }

 private:
  struct Sample {
    uint64_t index;  // 0: of the first tick ever added
    fs_tick tick;
  };
  static constexpr size_t spare = 64;  // ticks that may be added during a read

  size_t count(uint64_t after, uint64_t end) const noexcept;
  bool read(uint64_t index, Sample& out) const noexcept;  // false: it was overwritten

  const size_t size_;
  std::vector<Seqlock<Sample>, PageAllocator<Seqlock<Sample>>> slots_;
  std::atomic<uint64_t> count_{0};  // of all ticks ever added
};

}  // namespace fs
