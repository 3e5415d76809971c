#include "device/fidel/udp/clock_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fs::udp {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();
constexpr double longest_way = 0.5;    // s, of a state to the host: a longer one is a jump of a clock
constexpr double longest_trip = 2;     // s
constexpr double drift_slack = 1e-3;   // s: two clocks drift apart by 200 ppm within two seconds, and more
constexpr double slew = 0.01;          // s/s, by which the mapping follows: time passes at nearly its own speed

}  // namespace

double ClockMap::offset_of(uint64_t sent, double came) const noexcept {
  return came - 1e-9 * static_cast<double>(static_cast<int64_t>(sent - base_));
}

ClockMap::Bucket& ClockMap::bucket_at(double came) noexcept {
  const auto number = static_cast<int64_t>(came / bucket_length);
  Bucket& bucket = buckets_[static_cast<size_t>(number) % buckets_.size()];
  if (bucket.number != number) bucket = {number, never, -never, never};
  return bucket;
}

ClockMap::Bounds ClockMap::bounds(double came) const noexcept {
  const auto now = static_cast<int64_t>(came / bucket_length);
  Bounds out{never, -never, never};
  for (const Bucket& bucket : buckets_) {
    if (bucket.number < 0 || bucket.number + static_cast<int64_t>(buckets_.size()) <= now) continue;
    out.high = std::min(out.high, bucket.high);
    out.low = std::max(out.low, bucket.low);
    out.round_trip = std::min(out.round_trip, bucket.round_trip);
  }
  return out;
}

void ClockMap::note(uint64_t sent, double came) noexcept { note(sent, came, -1); }

void ClockMap::note(uint64_t sent, double came, double round_trip) noexcept {
  const bool is_first = !has_base_;
  if (is_first) {
    base_ = sent;
    has_base_ = true;
  }
  const double high = offset_of(sent, came);
  if (is_first) {
    begin_anew(high, came);
  } else if (std::fabs(high - offset_) > longest_way) {
    ++jumps_;
    begin_anew(high, came);
  }
  Bucket& bucket = bucket_at(came);
  bucket.high = std::min(bucket.high, high);
  if (round_trip >= 0 && round_trip <= longest_trip) {
    bucket.low = std::max(bucket.low, high - round_trip);
    bucket.round_trip = std::min(bucket.round_trip, round_trip);
  }
  if (const Bounds now = bounds(came); now.high + drift_slack < now.low) {
    ++jumps_;
    begin_anew(high, came);
  }
  follow(came);
}

// Only this offset is known; the round trip is no matter of clocks, and stays.
void ClockMap::begin_anew(double high, double came) noexcept {
  for (Bucket& each : buckets_) each.number = -1;
  bucket_at(came) = {static_cast<int64_t>(came / bucket_length), high, -never, round_trip_ > 0 ? round_trip_ : never};
  offset_ = high - round_trip_ / 2;
  followed_at_ = came;
}

void ClockMap::follow(double came) noexcept {
  const Bounds now = bounds(came);
  if (now.round_trip < never) {
    const bool is_first = round_trip_ == 0;
    round_trip_ = std::max(now.round_trip, 1e-9);
    if (is_first) offset_ = now.high - round_trip_ / 2;
  }
  const double wanted = now.low > -never ? (now.high + now.low) / 2 : now.high - round_trip_ / 2;
  const double most = slew * std::max(0.0, came - followed_at_);
  offset_ += std::clamp(wanted - offset_, -most, most);
  followed_at_ = came;
}

double ClockMap::to_host(uint64_t time, double came) noexcept {
  return std::min(came, offset_ + 1e-9 * static_cast<double>(static_cast<int64_t>(time - base_)));
}

}  // namespace fs::udp
