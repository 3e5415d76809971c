#include "chatter.h"

#include <algorithm>

namespace {

constexpr double window = 0.5;        // s
constexpr double least_rate = 8;      // Hz: a hand cannot do this by will
constexpr double least_size = 0.2e-3; // m, from end to end: a hand that only trembles stays below it

constexpr double least_share = 0.7;   // of its size that a swing keeps: a hand that bounces at a wall comes to rest

double coordinate(const fs_vec3& v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

}  // namespace

void Chatter::Axis::add(double time, double x) {
  last = x;
  if (rises) {
    high = std::max(high, x);
    if (x > high - least_size) return;
    turns.push_back({time, high});
    low = x;
  } else {
    low = std::min(low, x);
    if (x < low + least_size) return;
    turns.push_back({time, low});
    high = x;
  }
  rises = !rises;
}

std::pair<double, double> Chatter::Axis::ends() const {
  if (turns.empty()) return {last, last};
  const auto [least, most] =
      std::minmax_element(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) { return a.at < b.at; });
  return {least->at, most->at};
}

bool Chatter::Axis::goes_on() const {
  double early = 0, late = 0;
  const std::size_t count = turns.size();
  for (std::size_t i = 1; i < count; ++i) (i <= count / 2 ? early : late) += std::fabs(turns[i].at - turns[i - 1].at);
  return late >= least_share * early;
}

std::optional<Chatter::Swing> Chatter::add(std::span<const fs_tick> ticks) {
  for (const fs_tick& tick : ticks) {
    const fs_vec3& x = tick.state.pose.position;
    const bool follows = newest_ >= 0 && tick.device == FS_OK && tick.state.time - newest_ < 0.1;
    for (int i = 0; i < 3; ++i) {
      if (!follows)
        axes_[i] = {coordinate(x, i), coordinate(x, i), coordinate(x, i), true, {}};  // it jumps when a device comes back
      else axes_[i].add(tick.state.time, coordinate(x, i));
    }
    newest_ = tick.device == FS_OK ? tick.state.time : -1;
    if (length(tick.sent.force) > 0) pushed_ = tick.state.time;
  }
  std::optional<Swing> largest;
  for (Axis& axis : axes_) {
    while (!axis.turns.empty() && axis.turns.front().time < newest_ - window) axis.turns.pop_front();
    const double rate = static_cast<double>(axis.turns.size()) / 2 / window;
    if (rate < least_rate || pushed_ < newest_ - window || !axis.goes_on()) continue;
    const auto [low, high] = axis.ends();
    if (!largest || high - low > largest->size) largest = {rate, high - low, {}};
  }
  if (largest) {
    const auto middle = [&](int i) { return (axes_[i].ends().first + axes_[i].ends().second) / 2; };
    largest->place = {middle(0), middle(1), middle(2)};
  }
  return largest;
}
