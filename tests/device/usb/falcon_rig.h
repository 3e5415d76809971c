// What the tests of the driver falcon share: Falcons on an emulated bus, and a servo that pushes one.
#pragma once

#include <memory>

#include "api/support.h"
#include "device/usb/emulated_bus.h"
#include "device/usb/falcon_model.h"

namespace scenes {

inline double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

// A Falcon with its firmware, in socket 1, homed.
struct FalconRig {
  EmulatedBus bus;
  std::shared_ptr<FalconModel> falcon = made("A1");

  explicit FalconRig(bool is_plugged = true) {
    if (is_plugged) bus.plug(1, falcon);
  }
  static std::shared_ptr<FalconModel> made(const char* serial) {
    const auto model = std::make_shared<FalconModel>(serial);
    model->has_firmware = true;
    return model;
  }

  // What the model shows, or what is set, at one moment.
  template <class Look>
  auto see(Look look) const {
    decltype(look(*falcon)) seen{};
    bus.with_models([&] { seen = look(*falcon); });
    return seen;
  }
  template <class Change>
  void change(Change change) {
    bus.with_models([&] { change(*falcon); });
  }
  double push() const {  // N, of the motors
    return see([](FalconModel& model) { return norm(model.force()); });
  }
  void fault(UsbFault in, UsbFault out = UsbFault::none, UsbFault control = UsbFault::none) {
    UsbFaults faults;
    faults.in = in;
    faults.out = out;
    faults.control = control;
    bus.set(1, faults);
  }
};

inline bool pushes(const FalconRig& rig) { return rig.push() > 0.5; }
inline fs_state state_of(fs_device* device) {
  fs_state state{};
  fs_device_read(device, &state);
  return state;
}
inline bool is_ready(fs_device* device) { return state_of(device).flags & FS_STATE_READY; }

// A spring at a point, felt by the hand that holds a Falcon.
struct Pushing {
  Scene scene = make_scene();
  Servo servo;

  Pushing(fs_device* device, fs_vec3 to, double stiffness = 100, double most = 3) {
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
    spring.pose = at(to);
    spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, most);
    require(fs_object_set(scene.get(), &spring), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_THREAD;
    servo = start_servo(scene.get(), device, options);
  }
  // Whether an event of the device with this word has come by now; those before it are dropped.
  bool event_with(const char* word) const {
    fs_event event;
    while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
      if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return true;
    }
    return false;
  }
  fs_servo_stats stats() const { return stats_of(scene.get()); }
};

}  // namespace scenes
