#include "servo/guard.h"

#include <algorithm>

namespace fs {
namespace {

constexpr int late_ticks = 20;        // in a row, each later than a period: the machine is too slow
constexpr double stall_limit = 0.02;  // s: after this long the world may have moved; the force only ramps

// At most `limit`, direction kept; true when it was more.
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
    guarded_ = faults_ && is_wanted;
    ramp_ = 0;
    return {};
  }
  ramp_ = limits_.ramp > 0 ? std::min(1.0, ramp_ + limits_.period / limits_.ramp) : 1.0;
  Wrench out = wanted;
  guarded_ = limit_vector(out.force, limits_.force);
  if (limits_.torque > 0) {
    guarded_ |= limit_vector(out.torque, limits_.torque);
  } else {
    out.torque = {};
  }
  return {ramp_ * out.force, ramp_ * out.torque};
}

void Guard::set_enabled(bool enabled) noexcept {
  if (enabled) {
    faults_ &= FS_FAULT_DEVICE;
    late_in_a_row_ = 0;
  } else {
    ramp_ = 0;
  }
  enabled_ = enabled;
}

}  // namespace fs
