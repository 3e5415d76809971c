#include "device/fidel/usb/device_clock.h"

#include <algorithm>

namespace fs::fidel_usb {
namespace {

constexpr double drift = 2e-4;       // s/s, of two clocks, at most
constexpr double farthest = 0.05;    // s: a report that seems to be older means that the device's clock has jumped

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

}  // namespace fs::fidel_usb
