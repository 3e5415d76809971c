// What an application is told of the device: that it is ready, lost, or stopped by a fault. Written by the tick, read by
// the servo's scenes.
#pragma once

#include <array>
#include <atomic>

#include <forceserver/servo.h>

#include "base/seqlock.h"

namespace fs {

class DeviceEvents {
 public:
  // [rt] Once a tick. time: s; status: of the device's read and write; faults: the guard's. Leaves an event when
  // something has begun.
  void note(double time, fs_status status, uint32_t faults) noexcept;
  // [rt] The latched faults were cleared. One that is there again is told again, also in the same tick.
  void forget_faults() noexcept { latched_ = 0; }
  bool is_ready() const noexcept { return is_ready_; }  // [rt] of the last tick

  // Any thread.
  uint64_t count() const noexcept { return written_.load(std::memory_order_acquire); }
  // The event of number `next` or, if that has been overwritten, how many are lost; next goes along. False: none yet.
  // pose_age: s, the servo's, for the text.
  bool take(uint64_t& next, const fs_device_info& device, double pose_age, fs_event& out) const;

 private:
  struct Event {
    uint64_t number;
    double time;
    fs_status status;
    uint32_t faults;   // that came
    uint64_t latched;  // that hold the force at 0
  };
  static constexpr uint64_t capacity = 64;

  void leave(const Event& event) noexcept;

  // The tick's.
  bool is_ready_ = false;
  uint32_t latched_ = 0;

  std::array<Seqlock<Event>, capacity> events_;
  std::atomic<uint64_t> written_{0};
};

}  // namespace fs
