// What the tests of the driver haply share: a service, a device, and a servo that pushes it.
#pragma once

#include <cstdio>
#include <string>

#include <forceserver/driver.h>

#include "api/support.h"
#include "device/makers/haply_service.h"

namespace scenes {

using makers::HaplyDevice;
using makers::HaplyGrip;
using makers::HaplyService;

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

inline std::string uri(unsigned short port, const std::string& place = "0", const std::string& options = "") {
  return "haply:" + place + "?port=" + std::to_string(port) + (options.empty() ? "" : "&" + options);
}
inline Device opened(const HaplyService& service, const std::string& place = "0", const std::string& options = "") {
  return open_device(uri(service.port(), place, options).c_str());
}

inline fs_state state_of(const Device& device) {
  fs_state state{};
  fs_device_read(device.get(), &state);
  return state;
}
bool is_ready(const Device& device) { return state_of(device).flags & FS_STATE_READY; }
inline bool is_flagged(const Device& device, uint32_t flag) {
  return until([&] { return (state_of(device).flags & (flag | FS_STATE_READY)) == flag; });
}
inline std::string answer(const Device& device) {
  fs_answer out{};
  OK(fs_device_control(device.get(), "status", &out));
  return out.text;
}
inline bool comes_to_say(const Device& device, const char* words) {
  return until([&] { return answer(device).find(words) != std::string::npos; });
}

double push_of(HaplyDevice& device) { return norm(device.handle.force()); }

// A servo with a spring that pulls the handle aside with up to 3 N.
struct Pushing {
  Scene scene = make_scene();
  Servo servo;

  explicit Pushing(fs_device* device) {
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
    spring.pose = at({0.2, 0, 0});
    spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 3);
    require(fs_object_set(scene.get(), &spring), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_THREAD;
    servo = start_servo(scene.get(), device, options);
  }
  bool event_with(const char* word) const {
    fs_event event;
    while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
      if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return true;
    }
    return false;
  }
};

// A service, a device, and a servo that pushes it.
struct HaplyRig {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  Device device = opened(service);
  Pushing pushing{device.get()};

  HaplyRig() { ck_assert(pushes()); }
  bool pushes() {
    return until([&] { return push_of(arm) > 0.5; });
  }
  // The force ends for good, at the latest by the idle of the service, and what a busy machine adds.
  void expect_end() {
    const double begin = now_s();
    ck_assert(until([&] { return push_of(arm) == 0; }));
    std::printf("  the force ended after %.0f ms\n", 1e3 * (arm.handle.last_force_time() - begin));
  }
  template <class Change>
  void change(Change change) {
    service.with([&](HaplyService& it) { return change(it), 0; });
  }
};

}  // namespace scenes
