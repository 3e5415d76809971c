// What the ticks of a servo have been like, as fs_servo_stats tells it. The servo's thread writes, any thread reads.
#pragma once

#include <atomic>

#include <forceserver/servo.h>

#include "servo/rolling_histogram.h"

namespace fs {

class Statistics {
 public:
  struct Tick {
    uint64_t number;       // from 1
    double time;           // s
    double late, compute;  // s
    bool has_error, is_guarded, is_approximated;
    uint32_t faults;       // of the guard
    double energy;         // J, of the guard
  };
  void note(const Tick& tick) noexcept;  // [rt]
  void note_missed(uint64_t ticks) noexcept { misses_.fetch_add(ticks, std::memory_order_relaxed); }  // [rt] that were skipped

  double time() const noexcept { return newest_time_.load(std::memory_order_relaxed); }  // s, of the newest tick
  void tell(fs_servo_stats& out) const noexcept;  // what it knows of it

 private:
  std::atomic<uint64_t> ticks_{0}, misses_{0}, device_errors_{0}, guarded_{0}, approximated_{0};
  std::atomic<uint32_t> faults_{0};
  std::atomic<double> energy_{0};
  std::atomic<double> first_time_{0}, newest_time_{0};
  RollingHistogram late_, compute_;
};

}  // namespace fs
