// Finds joint encoders that tell what a hand cannot do.
#pragma once

#include <array>
#include <cstdint>

namespace fs::fidel_usb {

class EncoderWatch {
 public:
  enum Verdict { plausible, jumped, stuck };
  static const char* words(Verdict verdict) noexcept;  // a part of a sentence

  EncoderWatch() = default;
  // joint_counts: a revolution. joint_speed: rad/s, at which the device switches its motors off; 1.25 times that is a jump.
  EncoderWatch(double joint_counts, double joint_speed) noexcept;

  // The device has been homed, or is not: whatever it tells next is believed.
  void forget() noexcept { *this = EncoderWatch(joint_counts_, joint_speed_); }

  // The counts of a report; dt: s of the device's clock since the report before.
  //
  // A jump lasts until the encoder has jumped back by as much as it had jumped, and ten reports have followed without a jump.
  // A joint is stuck if it does not change by a single count while another one moves by 5 degrees: where a joint turns back, it
  // moves by ten times as much. That lasts until forget.
  Verdict judge(const std::array<int32_t, 3>& counts, double dt) noexcept;

 private:
  double limit(double time) const noexcept;  // counts
  bool has_jumped(const std::array<int32_t, 3>& counts, double dt) noexcept;
  bool is_stuck(const std::array<int32_t, 3>& counts) noexcept;

  double joint_counts_ = 80000, joint_speed_ = 10;
  Verdict verdict_ = plausible;
  bool has_begun_ = false;
  int good_in_a_row_ = 0;
  std::array<int32_t, 3> last_{};
  std::array<double, 3> away_{};   // counts, by which each has jumped in all
  struct Still {                   // since the last change of a joint, the least and largest count of each
    std::array<int32_t, 3> least{}, largest{};
  };
  std::array<Still, 3> still_{};
};

}  // namespace fs::fidel_usb
