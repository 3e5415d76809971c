// Events about the device for the application: it is ready, it is lost, or a fault stopped the force. The tick writes
// them, the servo's scenes read them.
#pragma once

#include <array>
#include <atomic>
#include <string>

#include <forceserver/servo.h>

#include "base/seqlock.h"
#include "driver/device.h"

namespace fs {

class DeviceEvents {
 public:
  // What a tick knows of the device.
  struct Tick {
    double time;       // s
    fs_status read, write;  // of the device
    uint32_t flags;    // FS_STATE_ bits of the device
    double age;        // s, of its pose
    uint32_t faults;   // the guard's
    uint32_t troubles; // of the device, how many there have been
  };

  // [rt] Called once a tick. Adds an event when the device becomes ready or is lost, when it has another reason for not being
  // ready or for not being there, or when a fault begins.
  void note(const Tick& tick) noexcept;
  // [rt] The latched faults were cleared. A fault that comes again makes a new event, even in the same tick.
  void forget_faults() noexcept { latched_ = 0; }
  bool is_ready() const noexcept { return is_ready_; }  // [rt] of the last tick

  // Any thread.
  uint64_t count() const noexcept { return written_.load(std::memory_order_acquire); }
  // What is said beside what the tick has noted.
  struct Known {
    const fs_device& device;
    double pose_age, speed_limit;  // s, m/s, of the servo
  };
  // Gives the event with number `next`, or if it was overwritten an overflow event that counts the lost ones and has the time of
  // the oldest that is kept, and advances `next`. Returns false when there is no such event yet.
  bool take(uint64_t& next, const Known& known, fs_event& out) const;

 private:
  enum Reason : uint16_t { unread, unsent, not_ready, too_old };
  struct Event {
    uint64_t number;
    double time;
    fs_status status;
    uint32_t faults;   // the faults that began
    uint32_t latched;  // the faults that keep the force at 0
    uint16_t reason;   // of FS_FAULT_DEVICE
    uint16_t flags;    // FS_STATE_ bits that say why the device is not ready
    double age;        // s, of the pose
    uint64_t trouble;  // the number of the device's newest
  };
  static constexpr uint64_t capacity = 1024;

  void leave(const Event& event) noexcept;

  // Only the tick uses these.
  bool has_begun_ = false, is_ready_ = false, is_gone_ = false;  // is_gone_: DISCONNECTED
  uint32_t latched_ = 0, told_ = 0;  // told_: why the device is not ready, FS_STATE_ bits
  uint32_t seen_trouble_ = 0;  // the number of the trouble at the last tick

  std::array<Seqlock<Event>, capacity> events_;
  std::atomic<uint64_t> written_{0};
};

}  // namespace fs
