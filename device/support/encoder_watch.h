// Finds encoders that tell what a hand cannot do: of three joints that move together, as those of a DELTA.
#pragma once

#include <array>
#include <cstdint>

namespace fs {

class EncoderWatch {
 public:
  using Counts = std::array<int32_t, 3>;
  enum Verdict { good, jumped, stuck };
  static const char* words(Verdict verdict) noexcept;  // a part of a sentence

  struct Limits {
    double counts_per_second = 0;  // no hand moves a joint faster
    double counts_at_once = 0;     // beyond that, in one report: the noise of encoders and clocks
    double stuck_range = 0;        // counts that another joint moves while a stuck one stands still
  };
  explicit EncoderWatch(const Limits& limits) noexcept : limits_(limits) {}

  // The device has been homed, or is not: whatever it tells next is believed.
  void forget() noexcept { *this = EncoderWatch(limits_); }

  // The counts of a report; dt: s since the report before.
  //
  // A jump lasts until the encoder has jumped back by as much as it had jumped, and ten reports have followed without a jump.
  // A joint is stuck if it does not change by a single count while another one moves by stuck_range: where a joint turns back, it
  // moves by many counts. That lasts until forget, as counts may be lost.
  Verdict judge(const Counts& counts, double dt) noexcept;

 private:
  double most(double time) const noexcept { return limits_.counts_at_once + limits_.counts_per_second * time; }
  bool has_jumped(const Counts& counts, double dt) noexcept;
  bool is_stuck(const Counts& counts) noexcept;

  Limits limits_;
  Verdict verdict_ = good;
  bool has_begun_ = false;
  int good_in_a_row_ = 0;
  Counts last_{};
  std::array<double, 3> away_{};  // counts, by which each has jumped in all
  struct Still {                  // since the last change of a joint, the least and largest count of each
    Counts least{}, largest{};
  };
  std::array<Still, 3> still_{};
};

}  // namespace fs
