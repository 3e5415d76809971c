#include "servo/guard.h"

#include <algorithm>
#include <cassert>

namespace fs {
namespace {

constexpr int late_ticks = 20;        // in a row, each later than a period: the machine is too slow
constexpr double stall_limit = 0.02;  // s: after a longer pause the hand may be elsewhere, so the force ramps up again

// Keeps the first `axes` of x, y and z, those on which the device acts, and makes the others zero.
Vec3 first_axes(Vec3 v, uint32_t axes) noexcept { return {axes > 0 ? v.x : 0, axes > 1 ? v.y : 0, axes > 2 ? v.z : 0}; }

// The same for both directions of a matrix: along an axis that the device lacks, nothing answers to anything.
Mat3 first_axes(const Mat3& m, uint32_t axes) noexcept {
  const auto row = [&](uint32_t i, Vec3 v) { return i < axes ? first_axes(v, axes) : Vec3{}; };
  const Vec3 x = row(0, {m.xx, m.xy, m.xz}), y = row(1, {m.yx, m.yy, m.yz}), z = row(2, {m.zx, m.zy, m.zz});
  return {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
}

// Shortens v to `limit` and keeps its direction. Returns true when v was longer.
bool limit_vector(Vec3& v, double limit) noexcept {
  const double magnitude = norm(v);
  if (magnitude <= limit) return false;
  v = std::isfinite(magnitude) ? (limit / magnitude) * v : limit * normalized(v);
  return true;
}

}  // namespace

Mat3 shortened(const Mat3& stiffness, Vec3 whole, double limit) noexcept {
  const double magnitude = norm(whole);
  if (!std::isfinite(magnitude)) return {};
  const Vec3 along = normalized(whole);
  return (limit / magnitude) * ((identity() + -1.0 * outer(along, along)) * stiffness);
}

void Guard::note_faults(const Hand& hand, const Wrench& wanted) noexcept {
  faults_ = hand.is_ready ? faults_ & ~static_cast<uint32_t>(FS_FAULT_DEVICE) : faults_ | FS_FAULT_DEVICE;
  const bool is_number = is_finite(hand.state.pose) && is_finite(hand.state.twist) && is_finite(speed_);
  if (!is_number || !is_finite(wanted)) faults_ |= FS_FAULT_NUMBER;
  if (hand.is_ready && norm(hand.state.twist.linear) > limits_.speed) faults_ |= FS_FAULT_SPEED;
  late_in_a_row_ = hand.late > limits_.period ? late_in_a_row_ + 1 : 0;
  if (late_in_a_row_ >= late_ticks) faults_ |= FS_FAULT_LATE;
  if (hand.late >= stall_limit) ramp_ = 0;
}

// Takes what the hand did since the last tick: its energy and its filtered velocity.
void Guard::observe(const Hand& hand, bool is_damped) noexcept {
  if (!hand.is_ready || !is_finite(hand.state.pose) || !is_finite(speed_)) {
    has_pose_ = false;
    velocity_.reset();
    speed_ = {};
    return;
  }
  const Pose& pose = hand.state.pose;
  if (has_pose_) {
    energy_ += dot(sent_.force, pose.position - pose_.position);
    const bool has_torque = !(sent_.torque == Vec3{});
    if (has_torque) energy_ += dot(sent_.torque, log_rotation(pose.orientation * conjugate(pose_.orientation)));
  }
  pose_ = pose;
  has_pose_ = true;
  if (is_damped) speed_ = velocity_.update({pose.position, identity_quat()}, hand.state.time).linear;
}

Guard::GuardedForce Guard::apply(const Hand& hand, const fs_response& response) noexcept {
  guarded_ = false;
  const Wrench& wanted = response.wrench;
  const double damping = damping_.next(), slew = slew_.next();
  observe(hand, damping > 0);
  note_faults(hand, wanted);

  const bool is_wanted = !(wanted.force == Vec3{} && wanted.torque == Vec3{});
  if (faults_ || !enabled_) {
    guarded_ = is_wanted;
    ramp_ = 0;
    sent_ = {};
    return {};
  }
  ramp_ = limits_.ramp > 0 ? std::min(1.0, ramp_ + limits_.period / limits_.ramp) : 1.0;
  const Vec3 force = damping > 0 ? wanted.force - damping * speed_ : wanted.force;
  Wrench out{first_axes(force, limits_.force_axes), first_axes(wanted.torque, limits_.torque_axes)};
  Mat3 stiffness = first_axes(response.stiffness, limits_.force_axes);
  if (const Vec3 whole = out.force; limit_vector(out.force, limits_.force)) {
    guarded_ = true;
    stiffness = shortened(stiffness, whole, limits_.force);
  }
  guarded_ |= limit_vector(out.torque, limits_.torque);
  out = {ramp_ * out.force, ramp_ * out.torque};
  stiffness = ramp_ * stiffness;
  const double most_change = slew * (limits_.period + hand.late);  // N
  const Vec3 whole_change = out.force - sent_.force;
  if (Vec3 change = whole_change; limit_vector(change, most_change)) {
    guarded_ = true;
    out.force = sent_.force + change;
    stiffness = shortened(stiffness, whole_change, most_change);
  }
  assert(norm(out.force) <= limits_.force * (1 + 1e-9) && norm(out.torque) <= limits_.torque * (1 + 1e-9));
  sent_ = out;
  return {out, stiffness};
}

void Guard::follow(double damping, double slew) noexcept {
  constexpr double slew_falls_in = 1;  // s
  limits_.damping = damping;
  damping_.go_to(damping, limits_.blend / limits_.period);
  slew_.go_to(slew, slew < limits_.slew ? slew_falls_in / limits_.period : 0);
  limits_.slew = slew;
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
