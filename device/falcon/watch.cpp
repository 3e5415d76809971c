#include "device/falcon/watch.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace fs::falcon {
namespace {

// About 7 m/s at the handle, and what a coarse clock adds. A count is 0.6 mrad of an arm, about 0.04 mm.
constexpr double counts_per_second = 2e5;
constexpr double counts_at_once = 32;
constexpr double longest_gap = 0.02;   // s: in a longer one the hand may have gone anywhere
constexpr double usual_gap = 0.001;    // s
constexpr double may_return = 0.1;     // s
// An arm of a hand that moves does not keep its count exactly while both others turn by 15 degrees.
constexpr int stuck_range = 400;

}  // namespace

void EncoderWatch::reset() noexcept { *this = {}; }

EncoderWatch::Verdict EncoderWatch::update(const Counts& counts, double time) noexcept {
  if (!knows_) {
    knows_ = true;
    last_ = counts;
    time_ = time;
    for (Stand& stand : stands_) stand = {counts, counts};
    return good;
  }
  const double gap = has_jumped_ ? usual_gap : std::clamp(time - time_, 0.0, longest_gap);
  const double most = counts_at_once + counts_per_second * gap;
  bool is_far = false;
  for (size_t i = 0; i < counts.size(); ++i) is_far = is_far || std::abs(counts[i] - last_[i]) > most;
  has_jumped_ = is_far || (has_jumped_ && time - time_ > may_return);
  if (has_jumped_) return jumped;
  const bool stands = is_stuck(counts);
  last_ = counts;
  time_ = time;
  return stands ? stuck : good;
}

bool EncoderWatch::is_stuck(const Counts& counts) noexcept {
  bool any = false;
  for (size_t i = 0; i < counts.size(); ++i) {
    Stand& stand = stands_[i];
    if (counts[i] != last_[i]) {
      stand = {counts, counts};
      continue;
    }
    bool others_moved = true;
    for (size_t k = 0; k < counts.size(); ++k) {
      stand.low[k] = std::min(stand.low[k], counts[k]);
      stand.high[k] = std::max(stand.high[k], counts[k]);
      if (k != i) others_moved = others_moved && stand.high[k] - stand.low[k] > stuck_range;
    }
    any = any || others_moved;
  }
  return any;
}

}  // namespace fs::falcon
