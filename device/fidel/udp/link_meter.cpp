#include "device/fidel/udp/link_meter.h"

#include <algorithm>

namespace fs::udp {
namespace {

// How many of those that were sent did not come. Late ones may make more come than were sent within the time.
double missing(uint32_t sent, uint32_t came) noexcept { return came < sent ? static_cast<double>(sent - came) : 0; }

}  // namespace

void LinkMeter::note_state(double time, uint32_t number, uint32_t came, uint32_t command, uint32_t commands_came) noexcept {
  newest_ = {time, number, came, command, commands_came};
}

void LinkMeter::note_delay(double delay) noexcept { delays_[delay_count_++ % delays_.size()] = static_cast<float>(delay); }

void LinkMeter::publish(double time) noexcept {
  if (time - published_at_ < interval || newest_.number == 0) return;
  published_at_ = time;
  const Counts oldest = past_[past_count_ < past_.size() ? 0 : past_count_ % past_.size()];
  const bool is_first = past_count_ == 0;
  past_[past_count_++ % past_.size()] = newest_;
  if (is_first || std::min(delay_count_, delays_.size()) < least_delays) return;
  const fs_link link = measured(oldest);
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  link_ = link;
  has_link_ = true;
}

fs_link LinkMeter::measured(const Counts& from) noexcept {
  fs_link out{};
  const double time = newest_.time - from.time;
  const uint32_t states = newest_.number - from.number, came = newest_.came - from.came;
  const uint32_t commands = newest_.command - from.command, commands_came = newest_.commands_came - from.commands_came;
  out.rate = time > 0 ? std::min(1e6, came / time) : 0;
  const double sent = static_cast<double>(states) + commands;
  out.loss = sent > 0 ? std::min(1.0, (missing(states, came) + missing(commands, commands_came)) / sent) : 0;
  // Of the last second.
  const size_t kept = std::min(delay_count_, delays_.size());
  const size_t count = std::clamp(static_cast<size_t>(out.rate), std::min(kept, least_delays), kept);
  for (size_t i = 0; i < count; ++i) sorted_[i] = delays_[(delay_count_ - 1 - i) % delays_.size()];
  std::sort(sorted_.begin(), sorted_.begin() + static_cast<ptrdiff_t>(count));
  out.delay = static_cast<double>(sorted_[count / 2]);
  out.delay_p99 = static_cast<double>(sorted_[std::min(count - 1, count * 99 / 100)]);
  return out;
}

bool LinkMeter::tell(fs_link& out) const noexcept {
  const std::lock_guard lock(mutex_);
  if (!has_link_) return false;
  const uint32_t size = out.struct_size;
  out = link_;
  out.struct_size = size;
  return true;
}

}  // namespace fs::udp
