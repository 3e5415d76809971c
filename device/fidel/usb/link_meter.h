// Measures the way to a device and back: commands are numbered, and a report tells the newest that has come.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include <forceserver/driver.h>

#include "device/fidel/usb/protocol.h"

namespace fs::fidel_usb {

// The clock of the device (us, modulo 2^32) as the monotonic clock of this computer: what came fastest lately is taken to have
// come at once. Used by one thread.
class DeviceClock {
 public:
  // The time (s) of a report that came at `now` (s); never later than that.
  double time_of(uint32_t device_time, double now) noexcept;
  double last_step() const noexcept { return step_; }  // s from the report before to this one, by the device's clock

 private:
  bool has_begun_ = false;
  uint32_t last_ = 0;
  double device_ = 0, offset_ = 0, step_ = 0;  // s
};

// sent and came are called by one thread at a time; get may be called by another at the same time.
class LinkMeter {
 public:
  void sent(uint16_t number, double now) noexcept;
  void came(const Report& report, uint32_t lost_before, double now) noexcept;  // lost_before: reports missing before it
  void damaged() noexcept { damaged_.fetch_add(1, std::memory_order_relaxed); }
  fs_status get(fs_link& out) const noexcept;  // UNSUPPORTED: too little has been measured yet

  uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  uint64_t damaged_count() const noexcept { return damaged_.load(std::memory_order_relaxed); }
  uint64_t reports() const noexcept { return reports_.load(std::memory_order_relaxed); }

 private:
  static constexpr uint32_t trips_kept = 1024, numbers_kept = 256;

  std::array<double, numbers_kept> sent_{};  // s, by the number of the command; 0: none, or it has been answered
  std::array<std::atomic<float>, trips_kept> trips_{};  // s
  std::atomic<uint32_t> trip_count_{0};
  std::atomic<uint64_t> reports_{0}, lost_{0}, damaged_{0};
  std::atomic<double> rate_{0}, loss_{0};
  double second_began_ = 0;  // s
  uint64_t reports_before_ = 0, bad_before_ = 0;
};

}  // namespace fs::fidel_usb
