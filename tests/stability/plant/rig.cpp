#include "plant/rig.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>

#include <forceserver/driver.h>

namespace stability {

using namespace scenes;

namespace {

// The rigs whose plants can be opened, by number.
std::mutex mutex;
std::map<int, Rig*> rigs;
int last_number = 0;

// What the driver keeps of an open device.
struct Handle {
  Plant* plant;
  bool tells_no_mass;
  fs_vec3 last{};
  double time = 0, last_time = -1;
};

fs_status open_plant(const char* address, void** self) {
  const std::lock_guard lock(mutex);
  const auto found = rigs.find(std::atoi(address));
  if (found == rigs.end()) return fs_fail(FS_ERROR_NOT_FOUND, "there is no such plant");
  *self = new Handle{&found->second->plant, found->second->tells_no_mass};
  return FS_OK;
}

void close_plant(void* self) { delete static_cast<Handle*>(self); }

fs_status get_info(void* self, fs_device_info* out) {
  const Handle& handle = *static_cast<Handle*>(self);
  const DeviceModel& model = handle.plant->device();
  std::strcpy(out->name, "plant");
  out->force_axes = 3;
  out->torque_axes = model.torque_max > 0 ? 3 : 0;
  out->workspace_radius = out->workspace_height = 1;
  out->workspace_angle = model.torque_max > 0 ? 0.35 : 0;
  out->force_max = model.force_max;
  out->torque_max = model.torque_max;
  out->resolution = model.encoder;
  out->rate = model.rate;
  out->delay = model.delay;
  out->damping = model.damping;
  out->mass = handle.tells_no_mass ? 0 : model.mass;
  return FS_OK;
}

fs_status advance(void* self, double time) {
  Handle& handle = *static_cast<Handle*>(self);
  handle.plant->advance(time);
  handle.time = time;
  return FS_OK;
}

fs_status read(void* self, fs_state* out) {
  Handle& handle = *static_cast<Handle*>(self);
  const Plant& plant = *handle.plant;
  out->pose.position = plant.measured();
  if (plant.device().torque_max > 0) {
    const fs_vec3 r = plant.measured_rotation();
    if (norm(r) > 0) out->pose.orientation = turn(r, norm(r));
  }
  out->time = handle.time;
  out->flags = FS_STATE_READY;
  if (plant.device().gives_raw_twist) {
    if (handle.last_time >= 0) out->twist.linear = (1 / (handle.time - handle.last_time)) * (plant.measured() - handle.last);
    handle.last = plant.measured();
    handle.last_time = handle.time;
  }
  return FS_OK;
}

fs_status write(void* self, const fs_wrench* wrench) {
  static_cast<Handle*>(self)->plant->command(wrench->force, wrench->torque);
  return FS_OK;
}

void register_once() {
  static const fs_status status = [] {
    fs_driver driver{};
    driver.struct_size = sizeof driver;
    driver.scheme = "plant";
    driver.open = open_plant;
    driver.close = close_plant;
    driver.get_info = get_info;
    driver.read = read;
    driver.write = write;
    driver.advance = advance;
    return fs_driver_register(&driver);
  }();
  require(status, "fs_driver_register");
}

int add(Rig* rig) {
  register_once();
  const std::lock_guard lock(mutex);
  rigs[++last_number] = rig;
  return last_number;
}

}  // namespace

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
    : scene(make_scene()), plant(device, hand, device.rate), period_(1 / device.rate), number_(add(this)) {}

Rig::~Rig() {
  servo_.reset();
  device_.reset();
  const std::lock_guard lock(mutex);
  rigs.erase(number_);
}

bool Rig::start(const fs_servo_options& options) {
  device_ = open_device(("plant:" + std::to_string(number_)).c_str());
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
