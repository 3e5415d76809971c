// Scenes that are felt on a fake device: run by a servo of their own, or connected to a server in this process. A loop
// test of Check, whose `_i` is the variant, runs the same code for both.
#pragma once

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "api/support.h"
#include "scenes/folder.h"

namespace scenes {

enum Variant { in_process, connected };  // of a World
inline constexpr double world_fade = 0.05;  // s

// A name that no other test and no other run of it has.
inline std::string new_endpoint() {
  static int count = 0;
  return "shm:test-" + std::to_string(getpid()) + "-" + std::to_string(++count);
}

// A virtual servo without a ramp and without a speed limit.
inline fs_servo_options world_options() {
  fs_servo_options options = virtual_options();
  options.fade = world_fade;
  options.ramp = options.speed_limit = -1;
  return options;
}

inline void wait_a_little(double seconds = 1e-3) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

// Waits until it is so; whether it came to that.
template <class F>
bool eventually(F&& is_so) {
  Patience patience;
  do {
    if (is_so()) return true;
  } while (patience.lasts());
  return is_so();
}

// Steps a virtual servo in a thread of its own as long as this object lives, for calls that wait for ticks. Slow enough
// that little virtual time passes meanwhile.
class Stepper {
 public:
  explicit Stepper(fs_servo* servo) : thread_([this, servo] {
    while (!is_done_) {
      fs_servo_step(servo, 1);
      wait_a_little(5e-4);
    }
  }) {}
  ~Stepper() {
    is_done_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> is_done_{false};
  std::thread thread_;
};

inline Server start_server(fs_servo* servo, const std::string& endpoint, const fs_server_options& options) {
  fs_server* server = nullptr;
  require(fs_server_start(servo, endpoint.c_str(), &options, &server), "fs_server_start");
  return Server(server);
}
inline Scene connect(const std::string& endpoint, const char* client) {
  fs_scene* scene = nullptr;
  OK(fs_scene_connect(endpoint.c_str(), client, &scene));
  return Scene(scene);
}

// A servo on a fake device, or on that of a URI, with an empty scene of its own.
struct ServoRig {
  FakeDevice fake;
  Scene base = make_scene();
  Device device;
  Servo servo;
  const bool is_virtual;

  explicit ServoRig(const fs_servo_options& options = world_options(), const char* uri = nullptr)
      : fake(new_endpoint()), is_virtual(options.mode == FS_SERVO_VIRTUAL) {
    fake.info.force_max = fake.info.torque_max = 1000;
    device = uri ? open_device(uri) : fake.open();
    servo = start_servo(base.get(), device.get(), options);
  }

  void step(uint64_t ticks = 1) {  // even if the device is lost: all ticks run
    const fs_status status = fs_servo_step(servo.get(), ticks);
    if (status != FS_ERROR_DISCONNECTED) require(status, "fs_servo_step");
  }
  // Steps until the tick of this time, a multiple of 1 ms.
  void step_until(double time) {
    const double rest = time - now(base.get());
    ck_assert_msg(rest > -1e-9, "it is %g s too late", -rest);
    step(static_cast<uint64_t>(rest * 1000 + 0.5));
    EXPECT_NEAR(now(base.get()), time, 1e-9);
  }
  void step_through_fade() { step(static_cast<uint64_t>(world_fade * 1000) + 3); }
  // fs_scene_sync while somebody steps.
  fs_status sync(fs_scene* scene, double timeout = long_enough) {
    if (!is_virtual) return fs_scene_sync(scene, timeout);
    const Stepper stepper(servo.get());
    return fs_scene_sync(scene, timeout);
  }
  // Steps until all changes of the scene are felt and nothing fades any more: of two versions in succession the second
  // may have to wait for the first.
  void settle(fs_scene* scene) {
    OK(sync(scene));
    for (int i = 0; i < 2; ++i) step_through_fade();
  }
  // If the machine is too slow for the servo's thread, the guard stops the force for good, which is right but not what a
  // test is about: the force goes on.
  void resume_after_lateness() {
    if (stats_of(base.get()).faults == FS_FAULT_LATE) OK(fs_servo_set_enabled(servo.get(), true));
  }
  // The force that the device gets with the hand at rest at this place.
  fs_wrench wrench_at(const fs_pose& hand) {
    fake.state.pose = hand;
    step();
    return fake.written;
  }
  fs_vec3 force_at(fs_vec3 hand) { return wrench_at(at(hand)).force; }
};

// The rig with a server.
struct ServerRig : ServoRig {
  const std::string endpoint = new_endpoint();
  Server server;

  explicit ServerRig(const fs_server_options& server_options = fs_server_options_init(),
                     const fs_servo_options& options = world_options())
      : ServoRig(options), server(start_server(servo.get(), endpoint, server_options)) {}
  Scene join(const char* client) const { return connect(endpoint, client); }
};

// The rig with a scene to look at, of either variant.
struct World : ServoRig {
  std::string endpoint;
  Server server;
  Scene client;
  fs_scene* scene = base.get();

  explicit World(int variant, const fs_servo_options& options = world_options(), const char* uri = nullptr)
      : ServoRig(options, uri) {
    if (variant == in_process) return;
    endpoint = new_endpoint();
    server = start_server(servo.get(), endpoint, fs_server_options_init());
    client = connect(endpoint, "me");
    scene = client.get();
  }
  void set(const fs_object& object) { OK(fs_object_set(scene, &object)); }
  void settle() { ServoRig::settle(scene); }
};

// An object as fs_object_get returns it, with its handles.
struct Got {
  fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
  Got(fs_scene* scene, const char* name) { OK(fs_object_get(scene, name, &object)); }
  ~Got() { fs_object_release(&object); }
  Got(const Got&) = delete;
  Got& operator=(const Got&) = delete;
  const fs_object* operator->() const { return &object; }
};
inline bool has(fs_scene* scene, const char* name) {
  fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
  const fs_status status = PATIENTLY(fs_object_get(scene, name, &out));
  fs_object_release(&out);
  ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND);
  return status == FS_OK;
}

inline fs_frame frame_of(fs_scene* scene, const char* client = nullptr) {
  fs_frame frame;
  OK(fs_scene_get_frame(scene, client, &frame));
  return frame;
}
inline std::vector<fs_vec3> tool_of(fs_scene* scene) {
  std::vector<fs_vec3> points(FS_TOOL_POINTS_MAX);
  size_t count = 0;
  OK(fs_scene_get_tool(scene, points.data(), points.size(), &count));
  points.resize(count);
  return points;
}
inline std::vector<fs_report> reports_of(fs_scene* scene) {
  std::vector<fs_report> reports(object_count(scene));
  size_t count = 0;
  OK(fs_scene_get_reports(scene, reports.data(), reports.size(), &count));
  reports.resize(std::min(count, reports.size()));
  return reports;
}
// The scene's own objects: the names of other clients' objects have a '/'.
inline std::vector<fs_report> own_reports_of(fs_scene* scene) {
  std::vector<fs_report> reports = reports_of(scene);
  std::erase_if(reports, [](const fs_report& r) { return std::strchr(r.name, '/'); });
  return reports;
}
inline std::vector<fs_tick> record_of(fs_servo* servo) {
  std::vector<fs_tick> record(3000);
  size_t count = 0;
  require(fs_servo_get_record(servo, record.data(), record.size(), &count), "fs_servo_get_record");
  record.resize(count);
  return record;
}

// The next event of this kind; those of other kinds are passed over.
inline fs_event next_event(fs_scene* scene, fs_event_kind kind) {
  for (;;) {
    fs_event event;
    OK(fs_scene_next_event(scene, long_enough, &event));
    if (event.kind == kind) return event;
    ck_assert_msg(event.kind != FS_EVENT_NONE, "no event of kind %d came", kind);
  }
}
// The present events except READY, which only a connected scene has.
inline std::vector<fs_event> events_now(fs_scene* scene) {
  std::vector<fs_event> events;
  for (;;) {
    fs_event event;
    OK(fs_scene_next_event(scene, 0, &event));
    if (event.kind == FS_EVENT_NONE) return events;
    if (event.kind != FS_EVENT_READY) events.push_back(event);
  }
}

// Draws to its origin with `stiffness` (N/m).
inline fs_object spring(const char* name, fs_vec3 position = {}, double stiffness = 100) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = attract(stiffness, 1e6);
  o.pose = at(position);
  return o;
}
// The same force everywhere, along a direction.
inline fs_object push(const char* name, double force = 2, fs_vec3 direction = {0, 0, 1}) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
  require(fs_pose_from_z(-100.0 * direction, direction, &o.pose), "fs_pose_from_z");
  o.front = constant(FS_SENSE_REPULSIVE, force);
  return o;
}
inline fs_object solid(const char* name, const Shape& shape, double stiffness = 100) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_MESH);
  o.shape = shape.get();
  o.front = attract(stiffness, 1000);
  return o;
}
inline void set(const Scene& scene, const fs_object& o) { OK(fs_object_set(scene.get(), &o)); }

// A test may leave nothing behind: no endpoint and no thread of the library.
inline void nothing_remains() {
  std::string found;
  const bool is_clean = eventually([&] {  // a joined thread may still be listed for a moment
    found.clear();
    std::ifstream sockets("/proc/net/unix");
    const std::string mine = "test-" + std::to_string(getpid()) + "-";
    for (std::string line; std::getline(sockets, line);) {
      if (line.find(mine) != std::string::npos) found = line;
    }
    std::error_code gone;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task", gone)) {
      std::string name;
      std::ifstream comm(thread.path() / "comm");
      if (std::getline(comm, name) && name.starts_with("fs-")) found = name;
    }
    return found.empty();
  });
  ck_assert_msg(is_clean, "this remains: %s", found.c_str());
}

inline TCase* new_case(Suite* suite, const char* name) {
  TCase* test_case = tcase_create(name);
  tcase_set_timeout(test_case, 500);  // for what hangs, not for a slow machine
  tcase_add_checked_fixture(test_case, nullptr, nothing_remains);
  suite_add_tcase(suite, test_case);
  return test_case;
}
// Each test twice: `_i` is its Variant. Races are sought in process only where the tests have threads of their own: otherwise
// a thread runs there only while the test waits for it.
enum class OwnThreads { no, yes };
inline void add_on_both(Suite* suite, const char* name, std::initializer_list<const TTest*> tests,
                        OwnThreads threads = OwnThreads::no) {
  TCase* test_case = new_case(suite, name);
  const Variant first = seeks_races && threads == OwnThreads::no ? connected : in_process;
  for (const TTest* test : tests) tcase_add_loop_test(test_case, test, first, connected + 1);
}
inline void add_once(Suite* suite, const char* name, std::initializer_list<const TTest*> tests) {
  TCase* test_case = new_case(suite, name);
  for (const TTest* test : tests) tcase_add_test(test_case, test);
}

}  // namespace scenes
