// What a driver measures of the way to its device and back, over about the last second. One thread uses it: that of receive, send and
// get_link.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <forceserver/driver.h>

namespace fs {

class LinkMeter {
 public:
  // Of all that crossed the link since the device was opened, modulo 2^32.
  struct Totals {
    uint32_t states = 0;  // that have come
    uint32_t sent = 0, came = 0;  // states and commands: how many were sent, and how many of those have come
  };

  // A state was measured at `time`, s; wanted is one each `period`, s. The servo counts half a period for the mean age of a state. Where
  // states come further apart, half of the difference is added to the delays that are noted from then on.
  void note_state(double time, double period) noexcept;
  void note_delay(double delay) noexcept;  // s, from a state to the force that answers it, or a round trip

  // What get_link answers, called 25 times a second. now: s. UNSUPPORTED: too little has been measured yet.
  fs_status tell(double now, const Totals& totals, fs_link& out) noexcept;

 private:
  struct Past {
    double time = 0;  // s
    Totals totals;
  };

  std::array<float, 1024> delays_{}, sorted_{};  // s
  size_t delay_count_ = 0;
  double state_time_ = 0, extra_age_ = 0;  // s
  std::array<Past, 25> past_{};  // a second
  size_t past_count_ = 0;
};

}  // namespace fs
