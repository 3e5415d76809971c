#include "device/fidel/usb/link_meter.h"

#include <algorithm>
#include <cmath>

namespace fs::fidel_usb {
namespace {

constexpr double drift = 2e-4;       // s/s, of two clocks, at most
constexpr double farthest = 0.05;    // s: a report that seems to be older means that the device's clock has jumped
constexpr uint32_t fewest_trips = 50;
constexpr uint16_t age_unknown = 65535;

}  // namespace

double DeviceClock::time_of(uint32_t device_time, double now) noexcept {
  const uint32_t way = device_time - last_;
  const bool has_jumped = !has_begun_ || way > 1u << 31;
  last_ = device_time;
  step_ = has_jumped ? 0 : 1e-6 * way;
  device_ += step_;
  const double offset = now - device_;
  offset_ = std::min(offset, offset_ + drift * step_);
  if (has_jumped || offset - offset_ > farthest) offset_ = offset;
  has_begun_ = true;
  return std::min(now, device_ + offset_);
}

void LinkMeter::sent(uint16_t number, double now) noexcept { sent_[number % numbers_kept] = now; }

void LinkMeter::came(const Report& report, uint32_t lost_before, double now) noexcept {
  const uint64_t reports = reports_.fetch_add(1, std::memory_order_relaxed) + 1;
  if (lost_before) lost_.fetch_add(lost_before, std::memory_order_relaxed);
  double& sent = sent_[report.command % numbers_kept];
  if (sent != 0 && report.command_age != age_unknown) {
    const double trip = std::max(0.0, now - sent - 1e-6 * report.command_age);
    const uint32_t count = trip_count_.load(std::memory_order_relaxed);
    trips_[count % trips_kept].store(static_cast<float>(trip), std::memory_order_relaxed);
    trip_count_.store(count + 1, std::memory_order_release);
    sent = 0;
  }
  if (second_began_ == 0) {
    second_began_ = now;
    reports_before_ = reports;
    return;
  }
  if (now - second_began_ < 1) return;
  const uint64_t bad = lost() + damaged_count();
  const double good = static_cast<double>(reports - reports_before_);
  rate_.store(good / (now - second_began_), std::memory_order_relaxed);
  loss_.store(static_cast<double>(bad - bad_before_) / (good + static_cast<double>(bad - bad_before_)),
              std::memory_order_relaxed);
  second_began_ = now;
  reports_before_ = reports;
  bad_before_ = bad;
}

fs_status LinkMeter::get(fs_link& out) const noexcept {
  std::array<float, trips_kept> trips;
  const uint32_t count = std::min(trip_count_.load(std::memory_order_acquire), trips_kept);
  if (count < fewest_trips) return FS_ERROR_UNSUPPORTED;
  for (uint32_t i = 0; i < count; ++i) trips[i] = trips_[i].load(std::memory_order_relaxed);
  std::sort(trips.begin(), trips.begin() + count);
  out.delay = std::min(10.0, static_cast<double>(trips[count / 2]));
  out.delay_p99 = std::clamp(static_cast<double>(trips[count * 99 / 100]), out.delay, 10.0);
  out.rate = rate_.load(std::memory_order_relaxed);
  out.loss = loss_.load(std::memory_order_relaxed);
  return FS_OK;
}

}  // namespace fs::fidel_usb
