#include "device/sim/sim.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "device/support/refusal.h"

namespace fs {
namespace {

using namespace fidel;

constexpr double stop_radius = workspace_radius + stop_margin, stop_height = workspace_height / 2 + stop_margin;

Vec3 position_of(const AxisState (&axes)[3]) { return {axes[0].x, axes[1].x, axes[2].x}; }
Vec3 velocity_of(const AxisState (&axes)[3]) { return {axes[0].v, axes[1].v, axes[2].v}; }

// Mechanical stops: moves the handle back to the edge and removes its outward speed.
void stop_handle(AxisState (&axes)[3]) {
  const double radius = std::hypot(axes[0].x, axes[1].x);
  if (radius > stop_radius) {
    const double x = axes[0].x / radius, y = axes[1].x / radius;
    const double outward = std::max(0.0, axes[0].v * x + axes[1].v * y);
    axes[0] = {stop_radius * x, axes[0].v - outward * x};
    axes[1] = {stop_radius * y, axes[1].v - outward * y};
  }
  if (axes[2].x > stop_height) axes[2] = {stop_height, std::min(0.0, axes[2].v)};
  if (axes[2].x < -stop_height) axes[2] = {-stop_height, std::max(0.0, axes[2].v)};
}

void stop_wrist(AxisState& axis) {
  if (axis.x > wrist_angle) axis = {wrist_angle, std::min(0.0, axis.v)};
  if (axis.x < -wrist_angle) axis = {-wrist_angle, std::max(0.0, axis.v)};
}

Vec3 wrist_motor_torque(Vec3 torque) { return norm(torque) > wrist_torque_max ? wrist_torque_max * normalized(torque) : torque; }

// A random number within [-0.5, 0.5), by S. Vigna's splitmix64.
double next_phase(uint64_t& state) {
  uint64_t z = state += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53 - 0.5;
}

}  // namespace

Simulator::Simulator(const SimOptions& options)
    : options_(options), path_(options.path), handle_(options.mass + options.hand.mass, damping + options.hand.damping,
                                                      options.hand.stiffness, options.friction, stick_speed, substep),
      wrist_(wrist_inertia, wrist_damping + options.hand.grip_damping, options.hand.grip_stiffness, 0, 0, substep),
      joint_phase_{}, wrist_phase_{}, velocity_(options.ideal_encoder ? 0 : resolution, VelocityEstimator::local_rest),
      line_(static_cast<size_t>(options.delay_steps) + 1) {
  if (options.seed != 0) {
    uint64_t state = options.seed;
    for (double& phase : joint_phase_) phase = next_phase(state);
    for (double& phase : wrist_phase_) phase = next_phase(state);
  }
  const Vec3 start = path_.at(0).position;  // begin at rest there, or at the nearest stop
  position_[0].x = start.x;
  position_[1].x = start.y;
  position_[2].x = start.z;
  stop_handle(position_);
  if (options.link != SimLink::NONE) link_.emplace(options.link_delay_steps, options.link_period_steps);
}

void Simulator::get_info(fs_device_info& out) const noexcept {
  out.force_axes = 3;
  out.torque_axes = options_.active_wrist ? 3 : 0;
  std::snprintf(out.name, sizeof out.name, "FIDEL (simulated)");
  std::snprintf(out.serial, sizeof out.serial, "sim-%u", options_.seed);
  out.workspace_radius = workspace_radius;
  out.workspace_height = workspace_height;
  out.workspace_angle = wrist_angle;
  out.force_max = force_max;
  out.torque_max = options_.active_wrist ? wrist_torque_max : 0;
  out.resolution = options_.ideal_encoder ? 0 : resolution;
  out.rate = rate;
  out.delay = (options_.delay_steps + options_.link_delay_steps) * substep;
  out.damping = damping;
  out.mass = options_.mass;
  if (link_) {
    out.link_rate = 1 / (options_.link_period_steps * substep);
    out.watchdog = fade_after + fade_length;
  }
  if (options_.link != SimLink::MODEL) return;
  out.controller_rate = 1 / (controller_steps * substep);
  out.controller_delay = options_.delay_steps * substep;
  out.controller_damping = controller_damping;
}

void Simulator::advance(double time) noexcept {
  // The number of the grid step that has begun by `time`; the tolerance of 25 ns absorbs the rounding of k/rate.
  double wanted = std::floor((time - origin_) / substep + 1e-3);
  if (!started_ || wanted < static_cast<double>(steps_)) {  // the first call, or a clock that went back
    started_ = true;
    origin_ = time - static_cast<double>(steps_) * substep;
    return;
  }
  const double skipped = wanted - static_cast<double>(steps_) - std::round(catch_up_max / substep);
  if (skipped > 0) {
    origin_ += skipped * substep;
    wanted -= skipped;
  }
  while (static_cast<double>(steps_) < wanted) step();
}

void Simulator::step() noexcept {
  if (link_) {
    link_->step(steps_, [this] { return measured(); });
    if (steps_ % controller_steps == 0) command_ = control();
  }
  const size_t size = line_.size(), now = static_cast<size_t>(steps_) % size;
  line_[now] = command_;
  const Wrench& acting = line_[(now + 1) % size];  // the oldest command; without a delay the newest
  step_handle(motor_force(acting.force, position_of(position_)));
  step_wrist(options_.active_wrist ? wrist_motor_torque(acting.torque) : Vec3{});
  ++steps_;
}

// What the controller behind the link commands.
Wrench Simulator::control() noexcept {
  const double silence = static_cast<double>(steps_ - link_->last_arrival()) * substep;
  const Link::Command& command = link_->command();
  const double weight = std::clamp(1 - (silence - command.hold) / fade_length, 0.0, 1.0);
  Wrench out{weight * command.f0.force, weight * command.f0.torque};
  if (options_.link != SimLink::MODEL) return out;
  const fs_state state = measured();
  const Vec3 away = state.pose.position - command.x0.position;
  const Vec3 speed = velocity_.update({state.pose.position, identity_quat()}, state.time).linear;
  out.force += weight * (command.dfdx * away) - controller_damping * speed;
  if (norm(out.force) > force_max) out.force = force_max * normalized(out.force);
  const Vec3 turn = log_rotation(state.pose.orientation * conjugate(command.x0.orientation));
  out.torque += weight * (command.dtdr * turn);
  return out;
}

void Simulator::write_model(const Link::Command& command) noexcept {
  if (link_) link_->write(command, steps_);
  else command_ = command.f0;
}

void Simulator::step_handle(Vec3 force) noexcept {
  const HandPath::Target target = path_.at((static_cast<double>(steps_) + 0.5) * substep);
  const fidel::Hand& hand = options_.hand;
  const Vec3 input = force + hand.stiffness * target.position + hand.damping * target.velocity;
  position_[0] = handle_.advance(position_[0], input.x);
  position_[1] = handle_.advance(position_[1], input.y);
  position_[2] = handle_.advance(position_[2], input.z);
  stop_handle(position_);
}

void Simulator::step_wrist(Vec3 torque) noexcept {
  const Vec3 input = transposed(rotation_jacobian(position_of(rotation_))) * torque;  // the transpose preserves power
  rotation_[0] = wrist_.advance(rotation_[0], input.x);
  rotation_[1] = wrist_.advance(rotation_[1], input.y);
  rotation_[2] = wrist_.advance(rotation_[2], input.z);
  for (AxisState& axis : rotation_) stop_wrist(axis);
}

Vec3 Simulator::encoded_position() const noexcept {
  const Vec3 position = position_of(position_);
  const auto angles = delta_inverse(geometry, to_delta(position));
  if (!angles) return position;  // cannot happen within the stops
  const auto measured = delta_forward(geometry, {encoded(angles->x, joint_counts, joint_phase_[0]),
                                                 encoded(angles->y, joint_counts, joint_phase_[1]),
                                                 encoded(angles->z, joint_counts, joint_phase_[2])});
  return measured ? from_delta(*measured) : position;
}

Vec3 Simulator::encoded_rotation() const noexcept {
  return {encoded(rotation_[0].x, wrist_counts, wrist_phase_[0]), encoded(rotation_[1].x, wrist_counts, wrist_phase_[1]),
          encoded(rotation_[2].x, wrist_counts, wrist_phase_[2])};
}

fs_state Simulator::measured() const noexcept {
  fs_state out{};
  if (options_.ideal_encoder) {
    const Vec3 rotation = position_of(rotation_);
    out.pose = {position_of(position_), exp_rotation(rotation)};
    out.twist = {velocity_of(position_), rotation_jacobian(rotation) * velocity_of(rotation_)};
  } else {
    out.pose = {encoded_position(), exp_rotation(encoded_rotation())};
  }
  out.time = origin_ + static_cast<double>(steps_) * substep;
  out.flags = FS_STATE_READY;
  return out;
}

void Simulator::read(fs_state& out) noexcept {
  if (link_) out = link_->read(steps_);  // until the first pose has come, it is not READY
  else out = measured();
}

// ------------------------------------------------------------------------------------------------ the driver's table

namespace {

Simulator& simulator(void* self) { return *static_cast<Simulator*>(self); }

fs_status sim_list(fs_device_entry* out, size_t capacity, size_t* count) {
  *count = 1;
  if (capacity < 1) return FS_OK;
  out[0] = {};
  std::snprintf(out[0].uri, sizeof out[0].uri, "sim:");
  std::snprintf(out[0].label, sizeof out[0].label, "simulated FIDEL");
  return FS_OK;
}

fs_status sim_open(const char* address, void** self) {
  return answer_of([&] { *self = new Simulator(parse_sim_options(address)); });
}

void sim_close(void* self) { delete static_cast<Simulator*>(self); }

fs_status sim_get_info(void* self, fs_device_info* out) {
  simulator(self).get_info(*out);
  return FS_OK;
}

fs_status sim_read(void* self, fs_state* out) {
  simulator(self).read(*out);
  return FS_OK;
}

fs_status sim_write(void* self, const fs_wrench* wrench) {
  simulator(self).write(*wrench);
  return FS_OK;
}

fs_status sim_write_model(void* self, const fs_model* model) {
  simulator(self).write_model({model->x0, model->f0, model->dfdx, model->dtdr, model->hold});
  return FS_OK;
}

fs_status sim_advance(void* self, double time) {
  if (!std::isfinite(time)) return FS_ERROR_INVALID;
  simulator(self).advance(time);
  return FS_OK;
}

}  // namespace

const fs_driver& sim_driver() {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "sim";
    table.list = sim_list;
    table.open = sim_open;
    table.close = sim_close;
    table.get_info = sim_get_info;
    table.read = sim_read;
    table.write = sim_write;
    table.write_model = sim_write_model;
    table.advance = sim_advance;
    return table;
  }();
  return driver;
}

}  // namespace fs
