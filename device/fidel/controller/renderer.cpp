#include "device/fidel/controller/renderer.h"

#include <algorithm>

namespace fs::udp {
namespace {

Vec3 limited(Vec3 v, double most) noexcept { return norm(v) > most ? most * normalized(v) : v; }

}  // namespace

void Renderer::take(const Command& command, double time) noexcept {
  command_ = command;
  has_command_ = true;
  came_ = time;
}

void Renderer::drop() noexcept {
  has_command_ = false;
  weight_ = 0;
}

fs_wrench Renderer::render(const fs_state& state, double time) noexcept {
  const Vec3 speed = velocity_.update({state.pose.position, identity_quat()}, state.time).linear;
  const double dt = std::max(0.0, time - rendered_at_);
  rendered_at_ = time;
  if (!(state.flags & FS_STATE_READY)) {
    velocity_.reset();
    drop();
  }
  const double held = command_.is_model ? std::min(hold, static_cast<double>(command_.hold)) : hold;
  const bool is_present = has_command_ && time - came_ <= held;
  weight_ = std::clamp(weight_ + (is_present ? dt : -dt) / fade, 0.0, 1.0);
  if (!has_command_ || weight_ == 0) return {};
  Wrench out = command_.force;
  if (command_.is_model) {
    out.force += command_.dfdx * (state.pose.position - command_.pose.position) - damping * speed;
    out.torque += command_.dtdr * log_rotation(state.pose.orientation * conjugate(command_.pose.orientation));
  }
  return {weight_ * limited(out.force, force_max_), weight_ * limited(out.torque, torque_max_)};
}

}  // namespace fs::udp
