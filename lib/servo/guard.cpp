#include "servo/guard.h"

#include <algorithm>

namespace fs {
namespace {

constexpr int late_ticks = 20;        // in a row, each later than a period: the machine is too slow
constexpr double stall_limit = 0.02;  // s: after a longer pause the hand may be elsewhere, so the force ramps up again

// Keeps the first `axes` of x, y and z, those on which the device acts, and makes the others zero.
Vec3 first_axes(Vec3 v, uint32_t axes) noexcept { return {axes > 0 ? v.x : 0, axes > 1 ? v.y : 0, axes > 2 ? v.z : 0}; }

// Shortens v to `limit` and keeps its direction. Returns true when v was longer.
bool limit_vector(Vec3& v, double limit) noexcept {
  const double magnitude = norm(v);
  if (magnitude <= limit) return false;
  v = std::isfinite(magnitude) ? (limit / magnitude) * v : limit * normalized(v);
  return true;
}

}  // namespace

Wrench Guard::apply(const Hand& hand, const Wrench& wanted) noexcept {
  guarded_ = false;
  faults_ = hand.is_ready ? faults_ & ~static_cast<uint32_t>(FS_FAULT_DEVICE) : faults_ | FS_FAULT_DEVICE;
  if (!is_finite(hand.state.pose) || !is_finite(hand.state.twist) || !is_finite(wanted)) faults_ |= FS_FAULT_NUMBER;
  if (hand.is_ready && norm(hand.state.twist.linear) > limits_.speed) faults_ |= FS_FAULT_SPEED;
  late_in_a_row_ = hand.late > limits_.period ? late_in_a_row_ + 1 : 0;
  if (late_in_a_row_ >= late_ticks) faults_ |= FS_FAULT_LATE;
  if (hand.late >= stall_limit) ramp_ = 0;

  const bool is_wanted = !(wanted.force == Vec3{} && wanted.torque == Vec3{});
  if (faults_ || !enabled_) {
    guarded_ = is_wanted;
    ramp_ = 0;
    return {};
  }
  ramp_ = limits_.ramp > 0 ? std::min(1.0, ramp_ + limits_.period / limits_.ramp) : 1.0;
  Wrench out{first_axes(wanted.force, limits_.force_axes), first_axes(wanted.torque, limits_.torque_axes)};
  guarded_ = limit_vector(out.force, limits_.force);
  guarded_ |= limit_vector(out.torque, limits_.torque);
  return {ramp_ * out.force, ramp_ * out.torque};
}

void Guard::set_enabled(bool enabled) noexcept {
  if (enabled) {
    if (is_latched() || !enabled_) late_in_a_row_ = 0;
    faults_ &= FS_FAULT_DEVICE;
  } else {
    ramp_ = 0;
  }
  enabled_ = enabled;
}

}  // namespace fs
