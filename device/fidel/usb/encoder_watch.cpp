#include "device/fidel/usb/encoder_watch.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fs::fidel_usb {
namespace {

constexpr double slack = 16;        // counts
constexpr double too_fast = 1.25;   // times the speed at which the device switches its motors off
constexpr double period = 1e-3;     // s, of reports
constexpr int good_reports = 10;    // after a jump
constexpr double still_part = 72;   // of a revolution: 5 degrees

}  // namespace

const char* EncoderWatch::words(Verdict verdict) noexcept {
  switch (verdict) {
    case plausible: return "the encoders are plausible";
    case jumped: return "an encoder has jumped by more than a hand can move";
    case stuck: return "an encoder stands still while the others move";
  }
  return "";
}

EncoderWatch::EncoderWatch(double joint_counts, double joint_speed) noexcept
    : joint_counts_(joint_counts), joint_speed_(joint_speed) {}

// As far as a hand moves a joint in this time (s).
double EncoderWatch::limit(double time) const noexcept {
  return slack + too_fast * joint_speed_ * joint_counts_ / (2 * std::numbers::pi) * time;
}

bool EncoderWatch::has_jumped(const std::array<int32_t, 3>& counts, double dt) noexcept {
  bool has_jumped = false;
  for (size_t i = 0; i < 3; ++i) {
    const double way = static_cast<double>(counts[i]) - last_[i];
    if (std::fabs(way) <= limit(dt)) continue;
    away_[i] += way;
    has_jumped = true;
  }
  return has_jumped;
}

bool EncoderWatch::is_stuck(const std::array<int32_t, 3>& counts) noexcept {
  for (size_t i = 0; i < 3; ++i) {
    Still& still = still_[i];
    if (counts[i] != still.least[i]) {
      still.least = still.largest = counts;
      continue;
    }
    for (size_t j = 0; j < 3; ++j) {
      still.least[j] = std::min(still.least[j], counts[j]);
      still.largest[j] = std::max(still.largest[j], counts[j]);
      const double range = static_cast<double>(still.largest[j]) - still.least[j];
      if (range > joint_counts_ / still_part) return true;
    }
  }
  return false;
}

EncoderWatch::Verdict EncoderWatch::judge(const std::array<int32_t, 3>& counts, double dt) noexcept {
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
  const bool is_back = std::all_of(away_.begin(), away_.end(), [&](double way) { return std::fabs(way) <= 2 * limit(period); });
  if (is_jump || !is_back) {
    good_in_a_row_ = 0;
    return verdict_ = jumped;
  }
  if (verdict_ == jumped && ++good_in_a_row_ < good_reports) return jumped;
  away_ = {};
  verdict_ = is_stuck(counts) ? stuck : plausible;
  return verdict_;
}

}  // namespace fs::fidel_usb
