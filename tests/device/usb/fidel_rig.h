// A bus with a FIDEL, and a wall that its hand touches, for the tests of fidel:usb.
#pragma once

#include <algorithm>
#include <cmath>

#include "api/support.h"
#include "device/usb/emulated_bus.h"
#include "device/usb/fidel_model.h"
#include "scenes/folder.h"

namespace scenes {

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

// A bus with a FIDEL in socket 1. Calibrations go to a folder of the test's own.
struct Plugged {
  explicit Plugged(const FidelOptions& options = {}) : model(std::make_shared<FidelModel>(options)) {
    setenv("XDG_CONFIG_HOME", home.path.c_str(), 1);
    bus.plug(1, model);
  }
  template <class Look>
  auto look(Look f) const {
    decltype(f(model->body())) result{};
    bus.with_models([&] { result = f(model->body()); });
    return result;
  }
  template <class Change>
  void change(Change f) {
    bus.with_models([&] { f(model->body()); });
  }
  std::string file(const char* serial = "F0001") const { return home / ("forceserver/fidel-" + std::string(serial) + ".json"); }

  Folder home;
  EmulatedBus bus;
  std::shared_ptr<FidelModel> model;
};

// A wall at z = 0 into which the hand goes by 20 mm.
struct Loop : Plugged {
  explicit Loop(const FidelOptions& options = {}) : Plugged(options), scene(make_scene()) {
    const fs_object wall = fs_wall_init("wall", {0, 0, 0}, {0, 0, 1}, 500, 10);
    require(fs_object_set(scene.get(), &wall), "fs_object_set");
    change([](FidelBody& b) { b.target = {0, 0, -0.02}; });
    device = open_device("fidel:usb");
    fs_servo_options servo_options = fs_servo_options_init();
    servo_options.fade = -1;
    servo_options.ramp = 0.3;
    servo = start_servo(scene.get(), device.get(), servo_options);
  }
  bool pushes() const {
    return look([](FidelBody& b) { return b.force.z > 1; });
  }
  bool is_zero() const {
    return look([](FidelBody& b) {
      return std::all_of(b.firmware.torques, b.firmware.torques + 6, [](int t) { return t == 0; });
    });
  }
  fs_servo_stats stats() const { return stats_of(scene.get()); }
  std::string answer(const char* request) const {
    fs_answer out;
    OK(fs_device_control(device.get(), request, &out));
    return out.text;
  }
  // Asks for the home again and leads the handle over the marks of its joints, then back into the wall.
  void home_again() {
    ck_assert(answer("home").find("move the handle") == 0);
    change([](FidelBody& b) { b.target = {0, 0, 0.06}; });
    ck_assert(until([&] { return answer("status").find("homed, motors on") == 0; }));
    change([](FidelBody& b) { b.target = {0, 0, -0.02}; });
  }
  // An event of the device with this word comes.
  bool is_told(const char* word) const {
    return until([&] {
      fs_event event;
      while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
        if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return true;
      }
      return false;
    });
  }
  // Whenever the motors began to push, they began gently: 6 N are felt in the end.
  void expect_ramps() const {
    ck_assert_double_lt(look([](FidelBody& b) { return b.largest_start; }), 2);
  }
  // From the fault until the last torque acted, ms of the device's clock.
  template <class Fault>
  double time_to_zero(Fault fault) {
    ck_assert(until([&] { return pushes(); }));
    const uint32_t begin = look([](FidelBody& b) { return b.clock; });
    fault();
    ck_assert(until([&] { return is_zero(); }));
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    ck_assert(is_zero());
    return 1e-3 * look([&](FidelBody& b) { return b.last_torque > begin ? b.last_torque - begin : 0u; });
  }

  Scene scene;
  Device device;
  Servo servo;
};

inline void expect_open(fs_status status, const char* part, const char* uri = "fidel:usb") {
  fs_device* device = nullptr;
  const fs_status got = fs_device_open(uri, &device);
  ck_assert_msg(got == status && std::strstr(fs_last_error(), part), "%s: %s, not %s", fs_status_name(got), fs_last_error(),
                part);
}

}  // namespace scenes
