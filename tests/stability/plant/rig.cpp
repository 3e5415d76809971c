#include "plant/rig.h"

#include <atomic>
#include <cstring>

namespace stability {

using namespace scenes;

// A name that no other rig has; rigs are made in several threads at once.
static std::string new_name() {
  static std::atomic<int> count = 0;
  return "plant" + std::to_string(++count);
}

fs_servo_options raw_options() {
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.slew_limit = options.speed_limit = options.ramp = options.fade = options.blend = options.damping =
      options.max_stiffness = -1;
  return options;
}

fs_servo_options default_options() {
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  return options;
}

Rig::Rig(const DeviceModel& device, const HandModel& hand)
    : scene(make_scene()), plant(device, hand, device.rate), period_(1 / device.rate), fake_(new_name()) {
  fs_device_info& info = fake_.info;
  std::strcpy(info.name, "plant");
  info.torque_axes = device.torque_max > 0 ? 3 : 0;
  info.workspace_radius = info.workspace_height = 1;
  info.workspace_angle = device.torque_max > 0 ? 0.35 : 0;
  info.force_max = device.force_max;
  info.torque_max = device.torque_max;
  info.resolution = device.encoder;
  info.rate = device.rate;
  info.delay = device.delay;
  info.damping = device.damping;
  fake_.on_read = [this](FakeDevice& fake, double time) { read(fake.state, time); };
  fake_.on_write = [this](FakeDevice& fake) { plant.command(fake.written.force, fake.written.torque); };
}

void Rig::read(fs_state& out, double time) {
  plant.advance(time);
  const fs_vec3 x = plant.measured();
  if (plant.device().gives_raw_twist && last_time_ >= 0) out.twist.linear = (1 / (time - last_time_)) * (x - out.pose.position);
  out.pose.position = x;
  if (plant.device().torque_max > 0) {
    const fs_vec3 r = plant.measured_rotation();
    out.pose.orientation = norm(r) > 0 ? turn(r, norm(r)) : fs_quat{};
  }
  out.time = last_time_ = time;
}

bool Rig::start(const fs_servo_options& options) {
  fake_.info.mass = tells_no_mass ? 0 : plant.device().mass;
  device_ = fake_.open();
  fs_servo* servo = nullptr;
  if (fs_servo_start(scene.get(), device_.get(), &options, &servo) != FS_OK) return false;
  servo_.reset(servo);
  return true;
}

void Rig::step() { require(fs_servo_step(servo_.get(), 1), "fs_servo_step"); }

fs_servo_stats Rig::stats() const {
  fs_servo_stats out = fs_servo_stats_init();
  require(fs_scene_get_servo_stats(scene.get(), &out), "fs_scene_get_servo_stats");
  return out;
}

}  // namespace stability
