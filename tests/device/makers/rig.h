// What the tests of the drivers that use a maker's interface share.
#pragma once

#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "api/support.h"
#include "scenes/sanitizer.h"

namespace makers {

using namespace scenes;

inline double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

// The stand-in in the library at this path, which the driver loads, too; function gives it.
template <class StandIn>
StandIn& load_stand_in(const char* path, const char* function) {
  void* const library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  ck_assert_msg(library, "%s", dlerror());
  return *reinterpret_cast<StandIn* (*)()>(dlsym(library, function))();
}

// Whether the long tests are wanted, too: tests/run --all.
inline bool does_all() { return std::getenv("FORCESERVER_ALL_TESTS") != nullptr; }

inline fs_state state_of(const Device& device) {
  fs_state state{};
  fs_device_read(device.get(), &state);
  return state;
}
inline bool is_ready(const Device& device) { return state_of(device).flags & FS_STATE_READY; }
inline bool is_flagged(const Device& device, uint32_t flag) {
  return until([&] { return (state_of(device).flags & (flag | FS_STATE_READY)) == flag; });
}
inline std::string answer(const Device& device, const char* request) {
  fs_answer out{};
  OK(fs_device_control(device.get(), request, &out));
  return out.text;
}
inline bool says(const Device& device, const char* words) { return answer(device, "status").find(words) != std::string::npos; }
inline bool comes_to_say(const Device& device, const char* words) {
  return until([&] { return says(device, words); });
}

// A servo with a spring that pulls the handle aside with up to 3 N.
struct Pushing {
  Scene scene = make_scene();
  Servo servo;

  explicit Pushing(const Device& device) {
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
    spring.pose = at({0.2, 0, 0});
    spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 3);
    require(fs_object_set(scene.get(), &spring), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_THREAD;
    servo = start_servo(scene.get(), device.get(), options);
  }
  fs_state hand() const {
    fs_state state{};
    OK(fs_scene_get_hand(scene.get(), &state, nullptr, nullptr));
    return state;
  }
  // Whether an event of the device with this word has come by now; those before it are dropped.
  bool event_with(const char* word) const {
    fs_event event;
    while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
      if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return true;
    }
    return false;
  }
};

// Runs `forceserver test-device` on the device, with a push. It must find nothing, neither odd nor failed; a busy machine makes states
// late, so it may try again. Under a sanitizer all is so slow that something may be odd.
inline void expect_nothing_found(const char* program, const std::string& uri) {
  const std::string command = program + (" test-device '" + uri) + "' --push 1 --seconds 1 2>&1";
  std::string page;
  bool is_good = false;
  for (int i = 0; i < 20 && !is_good; ++i) {
    FILE* const output = popen(command.c_str(), "r");
    page.clear();
    char line[512];
    while (std::fgets(line, sizeof line, output)) page += line;
    const int status = pclose(output);
    const bool has_page = page.find("## Result") != std::string::npos;
    is_good = is_sanitized ? has_page && page.find("FAILED") == std::string::npos : status == 0;
  }
  ck_assert_msg(is_good, "%s", page.c_str());
}

}  // namespace makers
