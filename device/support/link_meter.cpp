#include "device/support/link_meter.h"

#include <algorithm>

namespace fs {
namespace {

constexpr size_t fewest_delays = 20;
constexpr double longest_age = 0.02;  // s, that is added to a delay
constexpr double longest_pause = 0.5;  // s between two calls of tell: what was before counts no more

}  // namespace

void LinkMeter::note_state(double time, double period) noexcept {
  extra_age_ = state_time_ > 0 ? std::clamp(0.5 * (time - state_time_ - period), 0.0, longest_age) : 0;
  state_time_ = time;
}

void LinkMeter::note_delay(double delay) noexcept {
  delays_[delay_count_++ % delays_.size()] = static_cast<float>(delay + extra_age_);
}

fs_status LinkMeter::tell(double now, const Totals& totals, fs_link& out) noexcept {
  const size_t kept = std::min(delay_count_, delays_.size());
  const bool goes_on = past_count_ > 0 && now - past_[(past_count_ - 1) % past_.size()].time <= longest_pause;
  if (!goes_on) past_count_ = 0;
  const Past before = past_[past_count_ < past_.size() ? 0 : past_count_ % past_.size()];
  past_[past_count_++ % past_.size()] = {now, totals};
  if (!goes_on || kept < fewest_delays || now <= before.time) return FS_ERROR_UNSUPPORTED;

  const auto grown = [&](uint32_t Totals::* count) { return totals.*count - before.totals.*count; };
  const uint32_t states = grown(&Totals::states), sent = grown(&Totals::sent), came = grown(&Totals::came);
  out.rate = std::min(1e6, states / (now - before.time));
  out.loss = came < sent ? static_cast<double>(sent - came) / sent : 0;  // late ones may make more come than were sent

  const size_t count = std::clamp<size_t>(states, fewest_delays, kept);
  for (size_t i = 0; i < count; ++i) sorted_[i] = delays_[(delay_count_ - 1 - i) % delays_.size()];
  const auto end = sorted_.begin() + static_cast<ptrdiff_t>(count);
  const auto at = [&](size_t place) {
    const auto found = sorted_.begin() + static_cast<ptrdiff_t>(std::min(place, count - 1));
    std::nth_element(sorted_.begin(), found, end);
    return std::clamp(static_cast<double>(*found), 0.0, 10.0);
  };
  out.delay = at(count / 2);
  out.delay_p99 = std::max(out.delay, at(count * 99 / 100));
  return FS_OK;
}

}  // namespace fs
