#include <algorithm>

#include "device/falcon/falcon.h"

namespace fs::falcon {

void Falcon::Link::sent(double time) noexcept {
  ++sent_;
  if (waiting_++ == 0) sent_at_ = time;
}

// Where two commands were on their way, nobody knows which this report answers.
void Falcon::Link::came(double time) noexcept {
  ++reports_;
  if (waiting_ == 1 && count_ < trips_.size()) trips_[count_++] = time - sent_at_;
  waiting_ = 0;
  if (since_ == 0) since_ = time;
  if (time - since_ >= 0.5 && count_ > 0) evaluate(time);
}

void Falcon::Link::evaluate(double time) noexcept {
  const auto at = [&](double part) {
    const auto place = trips_.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(count_ - 1));
    std::nth_element(trips_.begin(), place, trips_.begin() + static_cast<std::ptrdiff_t>(count_));
    return *place;
  };
  const double median = at(0.5), p99 = std::max(median, at(0.99));
  const auto reports = static_cast<double>(reports_), sent = static_cast<double>(sent_);
  delay_p99_.store(p99, std::memory_order_relaxed);
  rate_.store(reports / (time - since_), std::memory_order_relaxed);
  loss_.store(sent > reports ? (sent - reports) / sent : 0, std::memory_order_relaxed);
  delay_.store(median, std::memory_order_release);
  count_ = sent_ = reports_ = 0;
  since_ = time;
}

bool Falcon::Link::get(fs_link& out) const noexcept {
  out.delay = delay_.load(std::memory_order_acquire);
  out.delay_p99 = std::max(out.delay, delay_p99_.load(std::memory_order_relaxed));
  out.rate = rate_.load(std::memory_order_relaxed);
  out.loss = loss_.load(std::memory_order_relaxed);
  return out.delay > 0;
}

}  // namespace fs::falcon
