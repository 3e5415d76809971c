// The driver haply through the public C ABI, on a stand-in for the Haply Inverse Service.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <random>

#include <forceserver/driver.h>

#include "api/support.h"
#include "device/makers/haply_service.h"
#include "device/makers/wall.h"
#include "stability/boundary.h"

using namespace scenes;
using makers::HaplyDevice;
using makers::HaplyGrip;
using makers::HaplyService;

namespace {

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::string uri(unsigned short port, const std::string& place = "0", const std::string& options = "") {
  return "haply:" + place + "?port=" + std::to_string(port) + (options.empty() ? "" : "&" + options);
}
Device opened(const HaplyService& service, const std::string& place = "0", const std::string& options = "") {
  return open_device(uri(service.port(), place, options).c_str());
}

fs_state state_of(const Device& device) {
  fs_state state{};
  fs_device_read(device.get(), &state);
  return state;
}
bool is_ready(const Device& device) { return state_of(device).flags & FS_STATE_READY; }
bool is_flagged(const Device& device, uint32_t flag) {
  return until([&] { return (state_of(device).flags & (flag | FS_STATE_READY)) == flag; });
}
std::string answer(const Device& device) {
  fs_answer out{};
  OK(fs_device_control(device.get(), "status", &out));
  return out.text;
}
bool comes_to_say(const Device& device, const char* words) {
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

}  // namespace

// ------------------------------------------------------------------------------------------------------------ poses and forces

START_TEST(what_it_is) {
  HaplyService service;
  const Device device = opened(service, "049D", "force=3");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.name, "Haply Inverse3");
  ck_assert_str_eq(info.serial, "049D");
  ck_assert_uint_eq(info.force_axes, 3);
  ck_assert_uint_eq(info.torque_axes, 0);
  EXPECT_NEAR(info.force_max, 3, 0);
  EXPECT_NEAR(info.rate, 1000, 0);
  EXPECT_NEAR(info.workspace_radius, 0.1, 0);
  ck_assert(comes_to_say(device, "ready; service 3.5.0, messages of 3.5; inverse3 049D, no grip"));
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(device.get(), "home", &out), "its requests are: status");
  std::printf("  %s\n", answer(device).c_str());
}
END_TEST

static void check_axes(const char* version, const char* options) {
  HaplyService service(version);
  HaplyDevice& arm = *service.devices.front();
  const Device device = opened(service, "0", options);
  ck_assert(until([&] { return is_ready(device); }));
  for (const fs_vec3 way : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
    const fs_vec3 before = state_of(device).pose.position;
    EXPECT_VECTOR(before, (fs_vec3{}), 1e-3);  // the preset has put the origin into the middle
    fs_wrench wrench{};
    wrench.force = 2.0 * way;
    OK(fs_device_write(device.get(), &wrench));
    ck_assert(until([&] { return norm(arm.handle.force() - wrench.force) < 1e-9; }));
    ck_assert(until([&] { return dot(state_of(device).pose.position - before, way) > 0.008; }));
    const fs_vec3 moved = state_of(device).pose.position - before;
    ck_assert_msg(dot(moved, way) > 0.9 * norm(moved), "%g %g %g", moved.x, moved.y, moved.z);
    wrench.force = {};
    OK(fs_device_write(device.get(), &wrench));
    arm.handle.with_plant([](stability::Plant& plant) { plant.put({}); });
    ck_assert(until([&] { return norm(state_of(device).pose.position) < 1e-3; }));
  }
  ck_assert_uint_eq(service.with([](HaplyService& it) { return it.refused; }), 0);
}

START_TEST(axes) { check_axes("3.5.0", ""); }
END_TEST
START_TEST(axes_of_an_old_service) { check_axes("3.4.2", ""); }
END_TEST
START_TEST(axes_in_the_words_of_an_old_service) { check_axes("3.5.0", "dialect=3.4"); }
END_TEST

START_TEST(grips_and_buttons) {
  HaplyService service;
  const double half = std::sqrt(0.5);
  service.grips = {{"61548", false, true, false, false, {half, 0, 0, half}}, {"W1", true, true, false, true, {half, half, 0, 0}}};
  {
    const Device wired = opened(service, "0", "grip=61548");
    ck_assert(until([&] { return state_of(wired).buttons == 1; }));
    EXPECT_NEAR(state_of(wired).pose.orientation.z, half, 1e-9);
  }
  {
    const Device wireless = opened(service, "0", "grip=W1");
    ck_assert(until([&] { return state_of(wireless).buttons == 5; }));
    EXPECT_NEAR(state_of(wireless).pose.orientation.x, half, 1e-9);
    service.with([](HaplyService& it) { return it.grips.clear(), 0; });  // it keeps its orientation
    ck_assert(until([&] { return state_of(wireless).buttons == 0; }));
    EXPECT_NEAR(state_of(wireless).pose.orientation.x, half, 1e-9);
    ck_assert(comes_to_say(wireless, "grip W1 (silent)"));
  }
  service.with([](HaplyService& it) { return it.grips = {{"A", true, false, true}}, 0; });
  const Device only = opened(service);  // the only one needs no option
  ck_assert(until([&] { return state_of(only).buttons == 2; }));
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri(service.port(), "0", "grip=B").c_str(), &raw), "'A'");
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------ opening

START_TEST(which_device) {
  HaplyService service;
  service.devices.push_back(std::make_shared<HaplyDevice>("04BA"));
  const Device first = opened(service, "0"), second = opened(service, "04BA");
  fs_wrench wrench{};
  wrench.force = {0, 1, 0};
  OK(fs_device_write(second.get(), &wrench));
  ck_assert(until([&] { return push_of(*service.devices[1]) > 0.9; }));
  EXPECT_NEAR(push_of(*service.devices[0]), 0, 0);
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri(service.port(), "2").c_str(), &raw), "'049D', '04BA'");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri(service.port(), "0", "force=30").c_str(), &raw), "0.1..20");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri(service.port(), "0", "speed=1").c_str(), &raw), "host, port, grip, force, dialect");
  service.devices[0]->is_in_use = true;
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri(service.port(), "0").c_str(), &raw), "is in use");
}
END_TEST

START_TEST(nothing_listens) {
  unsigned short port;
  {
    HaplyService service;
    port = service.port();
  }
  fs_device* raw = nullptr;
  const double begin = now_s();
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri(port).c_str(), &raw), "systemctl start haply-inverse-service");
  std::printf("  after %.1f ms: %s\n", 1e3 * (now_s() - begin), fs_last_error());
  ck_assert_msg(now_s() - begin < 2, "%g s", now_s() - begin);
}
END_TEST

START_TEST(frames_that_would_be_wrong) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  fs_device* raw = nullptr;
  arm.scale = 2;
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_open(uri(service.port()).c_str(), &raw), "must be 1");
  arm.scale = 1;
  arm.basis = "XZY";
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_open(uri(service.port()).c_str(), &raw), "'XZY', must be XYZ");
}
END_TEST

// ---------------------------------------------------------------------------------------------------------------- readiness

START_TEST(why_there_is_no_force) {
  HaplyRig rig;
  rig.change([&](HaplyService&) { rig.arm.is_calibrated = false; });
  rig.expect_end();
  ck_assert(comes_to_say(rig.device, "not calibrated;"));
  rig.change([&](HaplyService&) { rig.arm.is_calibrated = true, rig.arm.has_power = false; });
  ck_assert(comes_to_say(rig.device, "its motors have no power;"));
  rig.change([&](HaplyService&) { rig.arm.has_power = true, rig.arm.is_ready = false; });
  ck_assert(comes_to_say(rig.device, "it does not answer yet;"));
  rig.change([&](HaplyService&) { rig.arm.is_ready = true; });
  ck_assert(comes_to_say(rig.device, "ready;"));
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(flags) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  arm.is_calibrated = false;
  const Device device = opened(service);
  ck_assert(is_flagged(device, FS_STATE_NOT_HOMED));
  service.with([&](HaplyService&) { return arm.has_power = false; });
  ck_assert(is_flagged(device, FS_STATE_STOPPED));
  service.with([&](HaplyService&) { return arm.has_power = arm.is_calibrated = true, arm.is_ready = false; });
  ck_assert(is_flagged(device, FS_STATE_CONNECTING));
}
END_TEST

START_TEST(what_falsifies_forces_is_told) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  arm.damping = 0.5;
  const Device device = opened(service);
  const Pushing pushing(device.get());
  ck_assert(comes_to_say(device, "filters: damping 0.5, force gate 0.3"));
  ck_assert(until([&] { return push_of(arm) > 1; }));
  ck_assert(answer(device).find("differs") == std::string::npos);
  service.with([&](HaplyService&) { return arm.force_told = 0.5; });
  ck_assert(comes_to_say(device, "differs from the force sent by more than a fifth"));
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------- faults

// What comes is of no use: the force ends, the reason is told, and it goes on when all is well again.
START_TEST(answers_of_no_use) {
  HaplyRig rig;
  std::string deep = R"({"inverse3":)";
  deep += std::string(30000, '[');
  const struct {
    const char* name;
    std::string answer;
    const char* words;
  } faults[]{{"garbage", "\x01 not JSON", "no JSON object"},
             {"NaN", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":NaN,"y":0,"z":0}}}]})", "no JSON object"},
             {"infinity", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1e999,"y":0,"z":0}}}]})", "no JSON object"},
             {"wrong type", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":"0","y":0,"z":0}}}]})", "cursor_position"},
             {"missing", R"({"inverse3":[{"device_id":"049D"}]})", "cursor_position"},
             {"far", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1.5,"y":0,"z":0}}}]})", "1 m from the origin"},
             {"nested", deep, "64 levels"},
             {"another", R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":0,"y":0,"z":0}}}]})", "no longer tells of this"}};
  for (const auto& fault : faults) {
    std::printf("  %s:", fault.name);
    rig.change([&](HaplyService& it) { it.answer = fault.answer; });
    rig.expect_end();
    ck_assert_msg(until([&] { return rig.pushing.event_with(fault.words); }), "%s", fault.name);
    rig.change([](HaplyService& it) { it.answer.clear(); });
    ck_assert_msg(rig.pushes(), "%s", fault.name);
  }
}
END_TEST

// The connection is of no use any more, so the library opens another.
START_TEST(connections_of_no_use) {
  HaplyRig rig;
  std::string huge("\x81\x7f\0\0\0\0\x06\0\0\0", 10);  // a frame of 100 MB
  const struct {
    const char* name;
    std::string bytes;
  } faults[]{{"no frame", "\xff\xff\xff\xff"}, {"half a message", std::string("\x81\x40{\"inv", 7)}, {"100 MB", huge}};
  for (const auto& fault : faults) {
    std::printf("  %s:", fault.name);
    rig.change([&](HaplyService& it) { it.bytes = fault.bytes; });
    rig.expect_end();
    ck_assert_msg(until([&] { return rig.pushing.event_with("Haply Inverse Service"); }), "%s", fault.name);
    rig.change([](HaplyService& it) { it.bytes.clear(); });
    ck_assert_msg(rig.pushes(), "%s", fault.name);
  }
  std::printf("  closed:");
  rig.change([](HaplyService& it) { it.closes = true; });
  rig.expect_end();
  rig.change([](HaplyService& it) { it.closes = false; });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(it_does_not_answer) {
  HaplyRig rig;
  for (bool HaplyService::*fault : {&HaplyService::is_silent, &HaplyService::is_deaf}) {
    rig.change([&](HaplyService& it) { it.*fault = true; });
    rig.expect_end();
    const double begin = now_s();
    const uint64_t before = stats_of(rig.pushing.scene.get()).ticks;
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    // receive and send come back within 25 ms together, so the servo has ticked.
    const double cycle = (now_s() - begin) / static_cast<double>(stats_of(rig.pushing.scene.get()).ticks - before);
    std::printf("  a tick each %.1f ms\n", 1e3 * cycle);
    ck_assert_msg(cycle < 0.1, "%g s", cycle);
    ck_assert(until([&] { return rig.pushing.event_with("does not answer"); }));
    rig.change([&](HaplyService& it) { it.*fault = false; });
    ck_assert(rig.pushes());
  }
}
END_TEST

START_TEST(late_answers_do_not_queue) {
  HaplyRig rig;
  rig.change([](HaplyService& it) { it.lag = 0.1; });
  rig.expect_end();
  const uint64_t before = rig.service.with([](HaplyService& it) { return it.messages; });
  std::this_thread::sleep_for(std::chrono::seconds(1));
  rig.change([&](HaplyService& it) {
    ck_assert_uint_ge(it.messages, before + 1);
    ck_assert_msg(it.most_waiting < 250, "%d bytes", it.most_waiting);  // one message, which ends a force
    it.lag = 0;
  });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(the_service_goes_and_comes_back) {
  HaplyRig rig;
  rig.service.stop();
  rig.expect_end();
  ck_assert(until([&] { return rig.pushing.event_with("is gone"); }));
  rig.arm.id = "04BA";  // another device is not the same
  rig.service.start();
  ck_assert(until([&] { return rig.pushing.event_with("'04BA'") || answer(rig.device).empty(); }));
  rig.change([&](HaplyService&) { rig.arm.id = "049D"; });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(closing_ends_the_force) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  arm.handle.set_watchdog(0);
  {
    const Device device = opened(service);
    const Pushing pushing(device.get());
    ck_assert(until([&] { return push_of(arm) > 0.5; }));
  }
  ck_assert(push_of(arm) == 0);
}
END_TEST

START_TEST(a_process_that_is_killed) {
  int way[2];
  ck_assert(pipe(way) == 0);
  const pid_t child = fork();
  if (child == 0) {
    unsigned short port = 0;
    if (read(way[0], &port, sizeof port) != sizeof port) _exit(1);
    const Device device = open_device(uri(port).c_str());
    const Pushing pushing(device.get());
    for (;;) pause();
  }
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  const unsigned short port = service.port();
  ck_assert(write(way[1], &port, sizeof port) == sizeof port);
  ck_assert(until([&] { return push_of(arm) > 0.5; }));
  const double begin = now_s();
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ck_assert(until([&] { return push_of(arm) == 0; }));
  std::printf("  the force ended after %.0f ms\n", 1e3 * (arm.handle.last_force_time() - begin));
}
END_TEST

START_TEST(random_messages) {
  HaplyRig rig;
  const std::string good = rig.service.with([](HaplyService& it) { return it.state(true); });
  std::mt19937 random(1);
  const auto below = [&](size_t bound) { return std::uniform_int_distribution<size_t>(0, bound - 1)(random); };
  for (int i = 0; i < 300; ++i) {
    std::string text = good;
    for (size_t k = 1 + below(8); k > 0 && !text.empty(); --k) {
      const size_t at = below(text.size());
      if (below(3) == 0) text.erase(at, below(20));
      else if (below(2) == 0) text.insert(at, text.substr(below(text.size()), below(40)));
      else text[at] = "{}[]\":,0e-x"[below(11)];
    }
    rig.change([&](HaplyService& it) { it.answer = text; });
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
  }
  rig.change([](HaplyService& it) { it.answer.clear(); });
  ck_assert(rig.pushes());
}
END_TEST

// -------------------------------------------------------------------------------------------------------------------- walls

START_TEST(a_wall_stands_and_shakes) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  stability::DeviceModel model;
  model.friction = 0.05, model.force_max = 5;
  arm.handle.become(model, stability::light);
  const Device device = opened(service);
  ck_assert(until([&] { return is_ready(device); }));
  double granted = 0;
  const double stands = makers::swing_at_wall(device.get(), arm.handle, 1e5, true, &granted);
  const double critical = stability::critical_stiffness({model.mass + stability::light.mass, model.damping + stability::light.damping,
                                                         stability::light.stiffness, 1e-3, 0.5e-3});
  const double shakes = makers::swing_at_wall(device.get(), arm.handle, 3 * critical, false);
  std::printf("  granted %.0f N/m: %.3f mm; %.0f N/m without bounds: %.3f mm\n", granted, 1e3 * stands, 3 * critical, 1e3 * shakes);
  ck_assert_msg(stands < 0.2e-3, "%g m", stands);
  ck_assert_msg(shakes > 0.5e-3, "%g m", shakes);
}
END_TEST

#ifdef PROGRAM
START_TEST(test_device_finds_nothing) {
  HaplyService service;
  const std::string command = PROGRAM " test-device '" + uri(service.port()) + "' --push 1 --seconds 1 2>&1";
  std::string page;
  int status = 1;
  for (int i = 0; i < 20 && status != 0; ++i) {  // a busy machine makes states late
    FILE* const program = popen(command.c_str(), "r");
    page.clear();
    char line[512];
    while (std::fgets(line, sizeof line, program)) page += line;
    status = pclose(program);
  }
  ck_assert_msg(status == 0 && page.find("FAILED") == std::string::npos, "%s", page.c_str());
}
END_TEST
#endif

int main() {
  Suite* suite = suite_create("haply");
  add_case(suite, "poses and forces", {what_it_is, axes, axes_of_an_old_service, axes_in_the_words_of_an_old_service, grips_and_buttons});
  add_case(suite, "opening", {which_device, nothing_listens, frames_that_would_be_wrong});
  add_case(suite, "readiness", {why_there_is_no_force, flags, what_falsifies_forces_is_told});
  add_case(suite, "faults", {answers_of_no_use, connections_of_no_use, it_does_not_answer, late_answers_do_not_queue,
                             the_service_goes_and_comes_back, closing_ends_the_force, a_process_that_is_killed, random_messages});
  add_case(suite, "walls", {a_wall_stands_and_shakes});
#ifdef PROGRAM
  add_case(suite, "test-device", {test_device_finds_nothing});
#endif
  return run_suite(suite);
}
