#include "device/support/encoder_watch.h"

#include <algorithm>
#include <cmath>

namespace fs {
namespace {

constexpr double period = 1e-3;   // s, of reports
constexpr int good_reports = 10;  // after a jump

}  // namespace

const char* EncoderWatch::words(Verdict verdict) noexcept {
  switch (verdict) {
    case good: return "the encoders tell what a hand can do";
    case jumped: return "an encoder has jumped by more than a hand can move";
    case stuck: return "an encoder stands still while the others move";
  }
  return "";
}

bool EncoderWatch::has_jumped(const Counts& counts, double dt) noexcept {
  bool has_jumped = false;
  for (size_t i = 0; i < 3; ++i) {
    const double way = static_cast<double>(counts[i]) - last_[i];
    if (std::fabs(way) <= most(dt)) continue;
    away_[i] += way;
    has_jumped = true;
  }
  return has_jumped;
}

bool EncoderWatch::is_stuck(const Counts& counts) noexcept {
  for (size_t i = 0; i < 3; ++i) {
    Still& still = still_[i];
    if (counts[i] != still.least[i]) {
      still.least = still.largest = counts;
      continue;
    }
    for (size_t j = 0; j < 3; ++j) {
      still.least[j] = std::min(still.least[j], counts[j]);
      still.largest[j] = std::max(still.largest[j], counts[j]);
      if (static_cast<double>(still.largest[j]) - still.least[j] > limits_.stuck_range) return true;
    }
  }
  return false;
}

EncoderWatch::Verdict EncoderWatch::judge(const Counts& counts, double dt) noexcept {
  if (!has_begun_) {
    has_begun_ = true;
    last_ = counts;
    for (Still& still : still_) still.least = still.largest = counts;
    return verdict_;
  }
  if (verdict_ == stuck) return stuck;
  const bool is_jump = has_jumped(counts, dt);
  last_ = counts;
  // The hand has moved, too, while the encoder jumped away and back.
  const bool is_back = std::all_of(away_.begin(), away_.end(), [&](double way) { return std::fabs(way) <= most(period); });
  if (is_jump || !is_back) {
    good_in_a_row_ = 0;
    return verdict_ = jumped;
  }
  if (verdict_ == jumped && ++good_in_a_row_ < good_reports) return jumped;
  away_ = {};
  verdict_ = is_stuck(counts) ? stuck : good;
  return verdict_;
}

}  // namespace fs
