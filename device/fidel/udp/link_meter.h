// What a host measures of its link to the controller, over the last second.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>

#include <forceserver/driver.h>

namespace fs::udp {

class LinkMeter {
 public:
  // Called by the thread that receives. time: s, when the state came.
  // number: of the newest state; came: how many different states have come; command, commands_came: the same of the commands
  // at the controller, as that state tells them.
  void note_state(double time, uint32_t number, uint32_t came, uint32_t command, uint32_t commands_came) noexcept;
  void note_delay(double delay) noexcept;  // s, from a pose to the command that answers it, on the controller's clock
  void publish(double time) noexcept;      // does so 25 times a second

  // Any thread. False: nothing has been measured yet.
  bool tell(fs_link& out) const noexcept;

 private:
  struct Counts {
    double time = 0;
    uint32_t number = 0, came = 0, command = 0, commands_came = 0;
  };
  static constexpr double interval = 0.04;  // s
  static constexpr size_t least_delays = 20;

  fs_link measured(const Counts& from) noexcept;

  std::array<float, 1024> delays_{}, sorted_{};  // s
  size_t delay_count_ = 0;
  std::array<Counts, 25> past_{};  // one an interval
  size_t past_count_ = 0;
  Counts newest_;
  double published_at_ = -1e300;

  mutable std::mutex mutex_;  // of the next two; the receiving thread never waits for it
  fs_link link_{};
  bool has_link_ = false;
};

}  // namespace fs::udp
