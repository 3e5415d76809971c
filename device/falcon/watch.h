// Whether the encoders can be believed: a count that jumps farther than a hand can move it, or that stands still while both others
// move far, is no position to make a force from.
#pragma once

#include <array>
#include <cstdint>

namespace fs::falcon {

using Counts = std::array<int16_t, 3>;

class EncoderWatch {
 public:
  enum Verdict { good, jumped, stuck };

  void reset() noexcept;  // the next report is believed: the origin has changed, or reports come again after a gap

  // For each report; time: s. After a jump each report is `jumped`, until the counts are back where they were before, within 0.1 s,
  // or until reset: an encoder that has lost counts shows a wrong position from then on. A stuck one is `stuck` until it moves.
  Verdict update(const Counts& counts, double time) noexcept;

 private:
  bool is_stuck(const Counts& counts) noexcept;

  bool knows_ = false, has_jumped_ = false;
  Counts last_{};  // that were believed
  double time_ = 0;  // s, of those
  // Since the count of this encoder changed last, what the others did.
  struct Stand {
    std::array<int16_t, 3> low{}, high{};
  };
  std::array<Stand, 3> stands_{};
};

}  // namespace fs::falcon
