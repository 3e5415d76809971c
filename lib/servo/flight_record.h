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

  void add(const fs_tick& tick) noexcept;                         // [rt]
  size_t read(fs_tick* out, size_t capacity) const;               // oldest first; returns how many there are
  MemoryLock::Range pages() const noexcept { return {slots_.data(), slots_.size() * sizeof(Seqlock<Slot>)}; }

 private:
  struct Slot {
    uint64_t number;
    fs_tick tick;
  };
  static constexpr size_t spare = 64;  // ticks that may be added during a read

  const size_t size_;
  std::vector<Seqlock<Slot>, PageAllocator<Seqlock<Slot>>> slots_;
  std::atomic<uint64_t> count_{0};  // of all ticks ever added
};

}  // namespace fs
