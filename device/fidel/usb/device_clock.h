// The clock of a FIDEL on the USB.
#pragma once

#include <cstdint>

namespace fs::fidel_usb {

// Maps it (us, modulo 2^32) to the monotonic clock of this computer: what came fastest lately is taken to have come at once. Used by
// one thread.
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

}  // namespace fs::fidel_usb
