// The driver openhaptics through the public C ABI, on a stand-in for the library of OpenHaptics.
#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include <forceserver/driver.h>

#include "api/support.h"
#include "device/makers/hd_stand_in.h"
#include "device/makers/libraries.h"
#include "device/makers/rig.h"
#include "device/makers/troubles.h"
#include "device/makers/wall.h"
#include "device/table.h"

using namespace makers;

namespace {

// The stand-in, with one Touch, T1. Each test has a process of its own.
HdStandIn& stand_in() {
  static HdStandIn& found = load_stand_in<HdStandIn>(STAND_IN, "hd_stand_in_here");
  return found;
}
HdDevice& first() { return *stand_in().devices.front(); }

template <class Change>
void set(Change change) {
  stand_in().change([&](HdStandIn&) { return change(first()), 0; });
}
template <class Look>
auto see(Look look) {
  return stand_in().change([&](HdStandIn&) { return look(first()); });
}

std::string uri(const std::string& name = "") { return "openhaptics:" + name + "?library=" STAND_IN; }
Device opened(const std::string& name = "") { return open_device(uri(name).c_str()); }
double push() { return norm(first().handle.force()); }

// All calls came as the interface wants them.
void expect_order() {
  stand_in().change([](HdStandIn& all) {
    ck_assert_uint_eq(all.nested, 0);
    ck_assert_uint_eq(all.outside, 0);
    ck_assert_uint_eq(all.opened_beside, 0);
    return 0;
  });
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------ poses and forces

START_TEST(what_it_is) {
  const Device device = opened();
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.name, "Touch");
  ck_assert_str_eq(info.serial, "T1");
  ck_assert_uint_eq(info.force_axes, 3);
  ck_assert_uint_eq(info.torque_axes, 0);
  EXPECT_NEAR(info.force_max, 3.3, 0);
  EXPECT_NEAR(info.workspace_radius, 0.05, 1e-12);
  EXPECT_NEAR(info.workspace_height, 0.16, 1e-12);
  ck_assert(until([&] { return is_ready(device); }));
  ck_assert(says(device, "ready; motors at 20 %"));
  expect_in_table(device.get(), "`openhaptics:` Touch");
  ck_assert(see([](HdDevice& it) { return it.is_enabled && it.is_clamped; }));
}
END_TEST

START_TEST(axes) {
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  for (const fs_vec3 way : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
    const fs_vec3 before = state_of(device).pose.position;
    fs_wrench wrench{};
    wrench.force = 2.0 * way;
    OK(fs_device_write(device.get(), &wrench));
    ck_assert(until([&] { return norm(first().handle.force() - wrench.force) < 1e-9; }));
    ck_assert(until([&] { return dot(state_of(device).pose.position - before, way) > 0.008; }));
    const fs_vec3 moved = state_of(device).pose.position - before;
    ck_assert_msg(dot(moved, way) > 0.9 * norm(moved), "%g %g %g", moved.x, moved.y, moved.z);
    EXPECT_VECTOR(moved + before, first().handle.position(), 3e-3);
    wrench.force = {};
    OK(fs_device_write(device.get(), &wrench));
    ck_assert(until([&] { return norm(first().handle.force()) < 1e-9; }));  // else it moves away again
    first().handle.with_plant([](stability::Plant& plant) { plant.put({}); });
    ck_assert(until([&] { return norm(state_of(device).pose.position) < 1e-4; }));
  }
  expect_order();
}
END_TEST

START_TEST(orientation_buttons_and_torque) {
  const fs_quat orientation = turn({0.3, -0.5, 0.8}, 1.1);
  set([&](HdDevice& it) {
    it.model = "Premium 3.0/6DOF";
    it.output_axes = 6;
    it.orientation = orientation;
    it.buttons = 0b0101;
  });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  const fs_state state = state_of(device);
  for (const fs_vec3 axis : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
    EXPECT_VECTOR(rotate(state.pose.orientation, axis), rotate(orientation, axis), 1e-9);
  }
  ck_assert_uint_eq(state.buttons, 5);
  fs_wrench wrench{};
  wrench.torque = {0.01, -0.02, 0.03};
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return norm(see([](HdDevice& it) { return it.torque; }) - wrench.torque) < 1e-9; }));
}
END_TEST

START_TEST(two_devices) {
  HdStandIn& all = stand_in();
  const auto other = std::make_shared<HdDevice>("left", "T2");
  all.change([&](HdStandIn& it) { return it.devices.push_back(other), 0; });
  const Device right = opened();
  ck_assert(until([&] { return is_ready(right); }));
  {
    const Device left = opened("left");
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(left.get(), &info));
    ck_assert_str_eq(info.serial, "T2");
    ck_assert(until([&] { return is_ready(left) && is_ready(right); }));
    const fs_wrench up{{0, 0, 1}, {}}, aside{{2, 0, 0}, {}};
    OK(fs_device_write(left.get(), &up));
    OK(fs_device_write(right.get(), &aside));
    ck_assert(until([&] { return norm(other->handle.force() - up.force) < 1e-9 && norm(first().handle.force() - aside.force) < 1e-9; }));
    ck_assert_int_eq(all.change([](HdStandIn& it) { return it.callbacks; }), 1);
  }
  ck_assert(all.change([&](HdStandIn&) { return !other->is_open; }));
  ck_assert(norm(other->handle.force()) == 0);
  ck_assert(until([&] { return is_ready(right) && push() > 1.9; }));  // the other one goes on
  ck_assert(see([](HdDevice& it) { return it.stopped_pushing; }) == 0);
  expect_order();
}
END_TEST

START_TEST(the_last_one_ends_the_callback) {
  { const Device device = opened(); }
  ck_assert_int_eq(stand_in().change([](HdStandIn& it) { return it.callbacks; }), 0);
  ck_assert(!stand_in().change([](HdStandIn& it) { return it.is_running; }));
  const Device again = opened();
  ck_assert(until([&] { return is_ready(again); }));
}
END_TEST

// -------------------------------------------------------------------------------------------------------------------- opening

START_TEST(nothing_is_printed_where_results_go) {
  const Folder folder;
  std::fflush(stdout);
  const int kept = dup(STDOUT_FILENO), file = open((folder / "output").c_str(), O_CREAT | O_WRONLY, 0600);
  dup2(file, STDOUT_FILENO);
  {
    const Device device = opened();
    std::printf("a result\n");
    std::fflush(stdout);
  }
  dup2(kept, STDOUT_FILENO);
  std::ifstream output(folder / "output");
  const std::string text((std::istreambuf_iterator<char>(output)), {});
  ck_assert_str_eq(text.c_str(), "a result\n");
}
END_TEST

START_TEST(what_cannot_be_opened_says_why) {
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri("right").c_str(), &raw), "'right' of OpenHaptics cannot be opened: HD_COMM_ERROR");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri("right").c_str(), &raw), "Touch_Setup");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open((uri() + "&speed=1").c_str(), &raw), "the options are library");
  {
    const Device device = opened();
    EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri().c_str(), &raw), "in use");
    ck_assert(until([&] { return is_ready(device); }));
  }
  set([](HdDevice& it) { it.box[3] = INFINITY; });
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri().c_str(), &raw), "does not tell what it is");
  ck_assert(!see([](HdDevice& it) { return it.is_open; }));
  expect_order();
}
END_TEST

START_TEST(a_version_without_a_default) {
  stand_in().change([](HdStandIn& it) { return it.refuses_null = true, it.default_name = "Default PHANToM", 0; });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
}
END_TEST

START_TEST(libraries_that_are_no_good) {
  const Folder folder;
  fs_device* raw = nullptr;
  const auto with = [](const std::string& library) { return "openhaptics:?library=" + library; };
  if (!is_installed("libHD.so.3.4")) {
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("openhaptics:", &raw), "libHD.so.3.4: cannot open shared object file");
  }
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(no_library(folder)).c_str(), &raw), "text.so: ");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(for_another_processor(folder, STAND_IN)).c_str(), &raw), "other.so: ");
  if (!is_installed("libncurses.so.5")) {
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(CURSES_LIBRARY).c_str(), &raw), "libncurses.so.5: cannot open");
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(CURSES_LIBRARY).c_str(), &raw), "install the package libncurses5");
  }
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_device_open(with(DRIVER).c_str(), &raw), "has no function hdGetError");
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------ readiness

START_TEST(in_the_inkwell) {
  set([](HdDevice& it) { it.is_in_inkwell = true, it.calibration = 0x5001; });
  const Device device = opened();
  ck_assert(is_flagged(device, FS_STATE_IN_HOLDER));  // where it was calibrated
  ck_assert(see([](HdDevice& it) { return it.updates == 1 && it.calibration == 0x5000; }));
  ck_assert(says(device, "holder"));
  set([](HdDevice& it) { it.is_in_inkwell = false; });
  ck_assert(until([&] { return is_ready(device); }));
}
END_TEST

START_TEST(not_calibrated) {
  set([](HdDevice& it) { it.calibration = 0x5001; });
  const Device device = opened();
  ck_assert(is_flagged(device, FS_STATE_NOT_HOMED));
  ck_assert(says(device, "see the request home"));
  ck_assert(answer(device, "home").find("into the inkwell") != std::string::npos);
  ck_assert_int_eq(see([](HdDevice& it) { return it.updates; }), 0);  // only in the inkwell
  const Pushing pushing(device);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ck_assert(see([](HdDevice& it) { return norm(it.force); }) == 0);
  set([](HdDevice& it) { it.is_in_inkwell = true; });
  ck_assert(until([&] { return see([](HdDevice& it) { return it.updates; }) == 1; }));
  set([](HdDevice& it) { it.is_in_inkwell = false; });
  ck_assert(until([&] { return push() > 2.5; }));
}
END_TEST

START_TEST(calibrated_by_itself_or_by_hand) {
  set([](HdDevice& it) { it.style = 2, it.calibration = 0x5001; });
  {
    const Device device = opened();
    ck_assert(until([&] { return is_ready(device); }));
  }
  set([](HdDevice& it) { it.style = 1, it.calibration = 0x5002, it.updates = 0; });
  const Device device = opened();
  ck_assert(is_flagged(device, FS_STATE_NOT_HOMED));
  ck_assert(says(device, "by hand"));
  ck_assert_int_eq(see([](HdDevice& it) { return it.updates; }), 0);
  ck_assert(answer(device, "home").find("the pose that it has now") != std::string::npos);
  ck_assert(until([&] { return is_ready(device); }));
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(device.get(), "dance", &out), "home, status");
}
END_TEST

START_TEST(two_ways_to_calibrate) {  // out of the inkwell it calibrates by itself, in it by the inkwell
  set([](HdDevice& it) { it.style = 2 | 4, it.calibration = 0x5001; });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  ck_assert_int_eq(see([](HdDevice& it) { return it.last_style; }), 2);
  set([](HdDevice& it) { it.is_in_inkwell = true; });
  ck_assert(is_flagged(device, FS_STATE_IN_HOLDER));
  set([](HdDevice& it) { it.calibration = 0x5001; });
  ck_assert(until([&] { return see([](HdDevice& it) { return it.last_style; }) == 4; }));
}
END_TEST

START_TEST(errors_that_end_the_force) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  const struct {
    unsigned code;
    uint32_t flag;
    const char* words;
  } errors[]{{0x200, FS_STATE_STOPPED, "HD_WARM_MOTORS (0x200, internal 7)"}, {0x203, FS_STATE_TOO_FAST, "HD_EXCEEDED_MAX_VELOCITY"},
             {0x204, FS_STATE_STOPPED, "HD_FORCE_ERROR"}};
  for (const auto& error : errors) {
    set([&](HdDevice& it) { it.errors = {0x402, error.code}; });  // the second one counts
    ck_assert(until([&] {
      fs_state hand{};
      OK(fs_scene_get_hand(pushing.scene.get(), &hand, nullptr, nullptr));
      return hand.flags & error.flag;
    }));
    ck_assert(until([&] { return push() == 0; }));
    ck_assert_msg(says(device, error.words), "%s", answer(device, "status").c_str());
    double last = 0, step = 0;  // and it comes back by the ramp
    ck_assert(until([&] {
      const double now = push();
      step = std::fmax(step, now - last);
      last = now;
      return now > 2.5;
    }));
    ck_assert_msg(step < 1.5, "a step of %g N", step);
  }
  expect_order();
}
END_TEST

// ----------------------------------------------------------------------------------------------------------------------- faults

START_TEST(a_bad_pose) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  set([](HdDevice& it) { it.gives_nan = true; });
  ck_assert(until([&] { return pushing.event_with("a pose that no device has"); }));
  ck_assert(until([&] { return push() == 0; }));
  set([](HdDevice& it) { it.gives_nan = false; });
  ck_assert(until([&] { return push() > 2.5; }));
}
END_TEST

START_TEST(its_thread_stops) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  first().handle.set_watchdog(0.05);  // as a device may have; otherwise its force stays, as nobody can end it
  const double stopped = now_s();
  stand_in().change([](HdStandIn& it) { return it.thread_stands = true; });
  ck_assert(until([&] {
    fs_wrench sent{};
    OK(fs_scene_get_hand(pushing.scene.get(), nullptr, nullptr, &sent));
    return norm(sent.force) == 0;
  }));
  ck_assert(until([&] { return push() == 0; }));
  std::printf("  the thread of OpenHaptics stops: no force after %.1f ms\n", 1e3 * (first().handle.last_force_time() - stopped));
  ck_assert(until([&] { return pushing.event_with("has stopped") || pushing.event_with("lost"); }));
  stand_in().change([](HdStandIn& it) { return it.thread_stands = false; });
  ck_assert(until([&] { return push() > 2.5; }));
}
END_TEST

START_TEST(unplugged_and_back) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  set([](HdDevice& it) { it.is_there = false; });
  ck_assert(until([&] { return pushing.event_with("lost"); }));
  ck_assert(until([&] { return !see([](HdDevice& it) { return it.is_open; }); }));
  set([](HdDevice& it) { it.is_there = true; });
  ck_assert(until([&] { return push() > 2.5; }));
  set([](HdDevice& it) { it.is_there = false; });
  ck_assert(until([&] { return !see([](HdDevice& it) { return it.is_open; }); }));
  set([](HdDevice& it) { it.is_there = true, it.serial = "T2", it.times_opened = 0; });
  ck_assert(until([&] { return see([](HdDevice& it) { return it.times_opened > 1; }); }));
  ck_assert(pushing.event_with("another device is there: Touch, serial number 'T2'"));
  ck_assert(push() == 0);
}
END_TEST

// The thread of OpenHaptics stands still while another device is opened or closed: the force of the first begins anew by the ramp.
START_TEST(opening_another_gives_no_step) {
  const Device device = opened();
  const Pushing pushing(device);
  stand_in().change([](HdStandIn& all) { return all.devices.push_back(std::make_shared<HdDevice>("left", "T2")), 0; });
  for (int i = 0; i < 6; ++i) {
    ck_assert(until([&] { return push() > 2.5; }));
    fs_device* raw = nullptr;
    if (i % 2) EXPECT(FS_ERROR_NOT_FOUND, fs_device_open(uri("nobody").c_str(), &raw));
    else const Device second = opened("left");
  }
  ck_assert(until([&] { return push() > 2.5; }));
  ck_assert_msg(first().handle.largest_rise() < largest_step, "a step of %g N", first().handle.largest_rise());
}
END_TEST

START_TEST(calibration_lost_for_a_moment) {
  const Device device = opened();
  const Pushing pushing(device);
  for (const int time : {5, 20, 50}) {  // ms
    ck_assert(until([&] { return push() > 2.5; }));
    set([](HdDevice& it) { it.calibration = 0x5002; });
    std::this_thread::sleep_for(std::chrono::milliseconds(time));
    set([](HdDevice& it) { it.calibration = 0x5000; });
    ck_assert(until([&] { return push() < 2; }));
  }
  ck_assert(until([&] { return push() > 2.5; }));
  ck_assert_msg(first().handle.largest_rise() < largest_step, "a step of %g N", first().handle.largest_rise());
}
END_TEST

START_TEST(the_servo_never_calls_the_library) {
  {
    const Device device = opened();
    const Pushing pushing(device);
    ck_assert(until([&] { return push() > 2.5; }));
    ck_assert(until([&] { return stats_of(pushing.scene.get()).link_delay_p50 > 0; }));
    std::printf("  from pose to force %.2f ms\n", 1e3 * stats_of(pushing.scene.get()).link_delay_p50);
  }
  ck_assert_uint_eq(first().handle.calls_of_servo(), 0);
  ck_assert(push() == 0);
  ck_assert_int_eq(see([](HdDevice& it) { return it.closed_pushing; }), 0);
}
END_TEST

START_TEST(at_random) {
  const auto change = [](auto change_it) {
    return [=] { set(change_it); };
  };
  const auto stands = [](bool does) {
    return [=] { stand_in().change([=](HdStandIn& all) { return all.thread_stands = does, 0; }); };
  };
  const auto fails = [](unsigned code) {
    return [=] { set([=](HdDevice& it) { it.errors = {code}; }); };
  };
  live_with({{"unplugged", change([](HdDevice& it) { it.is_there = false, it.handle.rest(); }), change([](HdDevice& it) { it.is_there = true; })},
             {"another in its place", change([](HdDevice& it) { it.serial = "T2"; }), change([](HdDevice& it) { it.serial = "T1"; }), false},
             {"in the inkwell", change([](HdDevice& it) { it.is_in_inkwell = true; }), change([](HdDevice& it) { it.is_in_inkwell = false; })},
             {"not calibrated", change([](HdDevice& it) { it.calibration = 0x5002; }), change([](HdDevice& it) { it.calibration = 0x5000; })},
             {"NaN", change([](HdDevice& it) { it.gives_nan = true; }), change([](HdDevice& it) { it.gives_nan = false; })},
             {"its thread stands", stands(true), stands(false)},
             {"warm motors", fails(0x202)},
             {"too fast", fails(0x204)},
             {"a communication error", fails(0x303)},
             {"an error that nobody knows", fails(0x7777)}},
            uri(), first().handle);
}
END_TEST

START_TEST(a_wall_stands_and_shakes) {
  stability::DeviceModel model;
  model.mass = 0.1, model.friction = 0.02, model.force_max = 10, model.encoder = 20e-6, model.damping = 0.3;
  set([&](HdDevice& it) { it.handle.become(model, stability::light), it.max_force = 10; });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  expect_wall_stands_and_shakes(device.get(), first().handle, model, 1e-3);
}
END_TEST

#ifdef PROGRAM
START_TEST(test_device_finds_nothing) { expect_nothing_found(PROGRAM, uri()); }
END_TEST
#endif

int main() {
  Suite* suite = suite_create("openhaptics");
  add_case(suite, "poses and forces", {what_it_is, axes, orientation_buttons_and_torque, two_devices, the_last_one_ends_the_callback});
  add_case(suite, "opening", {nothing_is_printed_where_results_go, what_cannot_be_opened_says_why, a_version_without_a_default,
                              libraries_that_are_no_good});
  add_case(suite, "readiness", {in_the_inkwell, not_calibrated, calibrated_by_itself_or_by_hand, two_ways_to_calibrate, errors_that_end_the_force});
  add_case(suite, "faults",
           {a_bad_pose, its_thread_stops, unplugged_and_back, opening_another_gives_no_step, calibration_lost_for_a_moment, the_servo_never_calls_the_library, at_random});
  if (does_all()) {
    add_case(suite, "walls", {a_wall_stands_and_shakes});
#ifdef PROGRAM
    add_case(suite, "test-device", {test_device_finds_nothing});
#endif
  }
  return run_suite(suite);
}
