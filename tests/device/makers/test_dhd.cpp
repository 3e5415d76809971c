// The driver dhd through the public C ABI, on a stand-in for the library of Force Dimension.
#include <cmath>

#include <forceserver/driver.h>

#include "api/support.h"
#include "device/makers/drd_stand_in.h"
#include "device/makers/libraries.h"
#include "device/makers/rig.h"
#include "device/makers/troubles.h"
#include "device/makers/wall.h"
#include "device/table.h"

using namespace makers;

namespace {

// The stand-in, with one omega.3 that has the serial number 4711. Each test has a process of its own.
DrdStandIn& stand_in() {
  static DrdStandIn& found = load_stand_in<DrdStandIn>(STAND_IN, "drd_stand_in_here");
  return found;
}
DrdDevice& first() { return *stand_in().devices.front(); }

template <class Change>
void set(Change change) {
  stand_in().change([&](DrdStandIn&) { return change(first()), 0; });
}
template <class Look>
auto see(Look look) {
  return stand_in().change([&](DrdStandIn&) { return look(first()); });
}

std::string uri(const std::string& place, const std::string& options = "") {
  return "dhd:" + place + "?library=" STAND_IN + (options.empty() ? "" : "&" + options);
}
Device opened(const std::string& place = "0", const std::string& options = "") { return open_device(uri(place, options).c_str()); }

double push() { return norm(first().handle.force()); }

}  // namespace

// ------------------------------------------------------------------------------------------------------------ poses and forces

START_TEST(what_it_is) {
  set([](DrdDevice& device) { device.limit = 9; });
  const Device device = opened();
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.name, "Force Dimension omega.3");
  ck_assert_str_eq(info.serial, "4711");
  ck_assert_uint_eq(info.force_axes, 3);
  ck_assert_uint_eq(info.torque_axes, 0);
  EXPECT_NEAR(info.force_max, 9, 0);  // a limit of the user counts, if it is below that of the model
  EXPECT_NEAR(info.mass, 0.25, 1e-9);
  EXPECT_NEAR(info.resolution, 10e-6, 1e-12);
  EXPECT_NEAR(info.workspace_radius, 0.075, 0);
  ck_assert(until([&] { return is_ready(device); }));
  ck_assert(says(device, "ready; SDK 3.17.1"));
}
END_TEST

START_TEST(rows_of_the_table) {
  const struct {
    int type;
    const char *name, *row;
  } models[]{{33, "omega.3", "`dhd:` omega.3"}, {63, "delta.3", "`dhd:` delta.3"}, {104, "sigma.7", "`dhd:` sigma.7"},
             {109, "lambda.7", "`dhd:` lambda.7"}};
  for (const auto& model : models) {
    set([&](DrdDevice& it) { it.type = model.type, it.name = model.name, it.has_active_wrist = model.type > 100; });
    expect_in_table(opened().get(), model.row);
  }
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
    EXPECT_VECTOR(moved + before, first().handle.position(), 2e-3);
    wrench.force = {};
    OK(fs_device_write(device.get(), &wrench));
    ck_assert(until([&] { return norm(first().handle.force()) < 1e-9; }));  // else it moves away again
    first().handle.with_plant([](stability::Plant& plant) { plant.put({}); });
    ck_assert(until([&] { return norm(state_of(device).pose.position) < 1e-4; }));
  }
}
END_TEST

START_TEST(a_wrist_with_motors) {
  const fs_quat turned = turn({0.3, -0.5, 0.8}, 0.7);
  set([&](DrdDevice& device) {
    device.type = 104;
    device.name = "sigma.7";
    device.has_wrist = device.has_active_wrist = device.has_gripper = true;
    device.orientation = turned;
    device.grip = -0.25;  // of a device for the left hand
    device.buttons = 5;
  });
  const Device device = opened();
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_uint_eq(info.torque_axes, 3);
  EXPECT_NEAR(info.torque_max, 0.2, 0);
  ck_assert(until([&] { return is_ready(device); }));
  const fs_state state = state_of(device);
  for (const fs_vec3 axis : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
    EXPECT_VECTOR(rotate(state.pose.orientation, axis), rotate(turned, axis), 1e-9);
  }
  EXPECT_NEAR(state.grip, 0.5, 1e-9);
  ck_assert_uint_eq(state.buttons, 5);
  set([](DrdDevice& it) { it.grip = std::nan(""); });
  ck_assert(until([&] { return state_of(device).grip == 0; }));
  ck_assert(see([](DrdDevice& it) { return it.buttons_emulated; }));
  fs_wrench wrench{};
  wrench.torque = {0.05, -0.1, 0.15};
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return norm(see([](DrdDevice& it) { return it.asked_torque; }) - wrench.torque) < 1e-9; }));
}
END_TEST

START_TEST(every_orientation) {
  set([](DrdDevice& device) { device.has_wrist = true; });
  const Device device = opened();
  for (const fs_vec3 axis : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}, fs_vec3{1, 1, 1}, fs_vec3{-2, 1, 3}}) {
    for (const double angle : {0.0, 1e-9, 1.0, 3.0, 3.14159265358979, -3.1}) {
      const fs_quat turned = turn(axis, angle);
      set([&](DrdDevice& it) { it.orientation = turned; });
      const auto off = [&] {
        const fs_quat seen = state_of(device).pose.orientation;
        double most = 0;
        for (const fs_vec3 v : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}})
          most = std::fmax(most, norm(rotate(seen, v) - rotate(turned, v)));
        return most;
      };
      ck_assert(until([&] { return off() < 1e-9; }));
    }
  }
}
END_TEST

START_TEST(a_pose_counts_once) {  // the SDK gives it again within its time guard, and says so
  stand_in().change([](DrdStandIn& all) { return all.time_guard = 0.004; });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  std::vector<double> times;
  for (const double end = now_s() + 0.3; now_s() < end;) {
    const double time = state_of(device).time;
    if (times.empty() || time != times.back()) times.push_back(time);
    std::this_thread::sleep_for(std::chrono::microseconds(100));
  }
  ck_assert_msg(times.size() > 20 && times.size() < 80, "%zu poses in 0.3 s", times.size());
}
END_TEST

START_TEST(more_than_its_motors_give) {
  set([](DrdDevice& device) {
    device.type = 63;  // a delta.3: 20 N
    device.name = "delta.3";
  });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  fs_wrench wrench{};
  wrench.force = {0, 0, 15};
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return std::fabs(push() - 12) < 1e-9; }));
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return !says(device, "; 0 of"); }));
}
END_TEST

START_TEST(odd_poses) {
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2; }));
  ck_assert(until([&] {  // again and again, as a pose that took long does not count
    set([](DrdDevice& it) { it.odd_answer = 7; });
    return pushing.event_with("a pose that no device has");
  }));
  ck_assert(until([&] { return push() > 2; }));
  set([](DrdDevice& it) { it.odd_answer = -1; });
  ck_assert(until([&] { return pushing.event_with("the pose cannot be read: command refused"); }));
  ck_assert(until([&] { return push() > 2; }));
}
END_TEST

// -------------------------------------------------------------------------------------------------------------------- opening

START_TEST(which_device) {
  DrdStandIn& all = stand_in();
  all.devices.push_back(std::make_shared<DrdDevice>(815));
  fs_device* raw = nullptr;
  {
    const Device second = opened("815");
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(second.get(), &info));
    ck_assert_str_eq(info.serial, "815");
    EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri("1").c_str(), &raw), "'1' of Force Dimension cannot be opened");
    EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri("815").c_str(), &raw), "free are: 4711; others are in use: by this program");
    const Device by_index = opened("0");
    OK(fs_device_get_info(by_index.get(), &info));
    ck_assert_str_eq(info.serial, "4711");
  }
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri("7").c_str(), &raw), "there are 2, with the serial numbers: 4711, 815");
  EXPECT(FS_ERROR_NOT_FOUND, fs_device_open(uri("").c_str(), &raw));
  EXPECT(FS_ERROR_NOT_FOUND, fs_device_open(uri("-1").c_str(), &raw));
  EXPECT(FS_ERROR_NOT_FOUND, fs_device_open(uri("0x").c_str(), &raw));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri("0", "rate=7").c_str(), &raw), "100..4000");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri("0", "home=perhaps").c_str(), &raw), "no, yes");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri("0", "speed=7").c_str(), &raw), "library, home, rate, falcon");
  set([](DrdDevice& device) { device.is_taken = true; });
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(uri("0").c_str(), &raw), "in use: perhaps by another program (device already in use)");
  all.change([](DrdStandIn& it) { return it.devices.clear(), 0; });
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(uri("0").c_str(), &raw), "finds no device");
}
END_TEST

START_TEST(the_order_changes) {  // the one that was open keeps its place in the process, although the SDK counts anew
  DrdStandIn& all = stand_in();
  const auto other = std::make_shared<DrdDevice>(815);
  all.devices.push_back(other);
  const Device second = opened("815");
  ck_assert(until([&] { return is_ready(second); }));
  all.change([](DrdStandIn& it) { return it.devices.erase(it.devices.begin()), 0; });
  fs_wrench wrench{};
  wrench.force = {1, 0, 0};
  OK(fs_device_write(second.get(), &wrench));
  ck_assert(until([&] { return std::fabs(norm(other->handle.force()) - 1) < 1e-9; }));
}
END_TEST

START_TEST(a_falcon_has_a_driver_of_its_own) {
  set([](DrdDevice& device) {
    device.type = 60;
    device.name = "Falcon";
    device.serial = 0;
  });
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_open(uri("0").c_str(), &raw), "falcon:0");
  const Device device = opened("0", "falcon=yes");
}
END_TEST

START_TEST(libraries_that_are_no_good) {
  const Folder folder;
  fs_device* raw = nullptr;
  const auto with = [](const std::string& library) { return "dhd:0?library=" + library; };
  if (!is_installed("libdrd.so.3")) {
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("dhd:0", &raw), "libdrd.so.3: cannot open shared object file");
  }
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(folder / "none.so").c_str(), &raw), "none.so: cannot open");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(no_library(folder)).c_str(), &raw), "text.so: ");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open(with(for_another_processor(folder, STAND_IN)).c_str(), &raw), "other.so: ");
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_device_open(with(DRIVER).c_str(), &raw), "has no function dhdGetSDKVersion");
  setenv("OLD_DRD_VERSION", "3.15", 1);
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_device_open(with(OLD_LIBRARY).c_str(), &raw), "SDK 3.15.0, must be 3.16");
  setenv("OLD_DRD_VERSION", "3.16", 1);
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_device_open(with(OLD_LIBRARY).c_str(), &raw), "has no function dhdErrorGetLast");
  { const Device device = opened(); }
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(with(OLD_LIBRARY).c_str(), &raw), "already uses");
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------ readiness

START_TEST(homing_moves_so_it_must_be_asked_for) {
  set([](DrdDevice& device) { device.is_initialized = false; });
  const Device device = opened();
  ck_assert(is_flagged(device, FS_STATE_NOT_HOMED));
  ck_assert(says(device, "send it the request home"));
  const Pushing pushing(device);
  ck_assert_msg(until([&] { return pushing.hand().flags == FS_STATE_NOT_HOMED; }), "%u", pushing.hand().flags);
  ck_assert_int_eq(see([](DrdDevice& it) { return it.times_homed; }), 0);
  const std::string homed = answer(device, "home");
  ck_assert_str_eq(homed.c_str(), "the device has homed");
  ck_assert(until([&] { return push() > 2; }));
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(device.get(), "dance", &out), "home, status");
}
END_TEST

START_TEST(homed_at_opening) {
  set([](DrdDevice& device) { device.is_initialized = false; });
  const Device device = opened("0", "home=yes");
  ck_assert_int_eq(see([](DrdDevice& it) { return it.times_homed; }), 1);
  ck_assert(until([&] { return is_ready(device); }));
}
END_TEST

START_TEST(one_that_cannot_home) {
  set([](DrdDevice& device) { device.is_initialized = device.can_home = false; });
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_open(uri("0", "home=yes").c_str(), &raw), "cannot home by itself");
  ck_assert(!see([](DrdDevice& it) { return it.is_open; }));
}
END_TEST

START_TEST(why_there_is_no_force) {
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  const struct {
    int cause;
    uint32_t flag;
    const char* words;
  } causes[]{{1, FS_STATE_STOPPED, "force button"}, {6, FS_STATE_STOPPED, "nobody holds the handle"}, {4, FS_STATE_STOPPED, "switched off"}};
  for (const auto& each : causes) {
    set([&](DrdDevice& it) { it.has_force = false, it.cause = each.cause; });
    ck_assert(is_flagged(device, each.flag));
    ck_assert_msg(comes_to_say(device, each.words), "%s", answer(device, "status").c_str());
  }
  set([](DrdDevice& it) { it.has_power = false; });
  ck_assert(until([&] { return says(device, "no power"); }));
  set([](DrdDevice& it) { it.has_power = it.has_force = true, it.cause = 0; });
  ck_assert(until([&] { return is_ready(device); }));
}
END_TEST

START_TEST(the_force_button_off_and_on) {  // the force begins again by the ramp, and not with a jerk
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  set([](DrdDevice& it) { it.has_force = false, it.cause = 1, it.handle.rest(); });
  ck_assert(until([&] { return see([](DrdDevice& it) { return norm(it.asked); }) == 0; }));
  set([](DrdDevice& it) { it.has_force = true, it.cause = 0; });
  double last = 0, step = 0;
  ck_assert(until([&] {
    const double now = push();
    step = std::fmax(step, now - last);
    last = now;
    return now > 2.9;
  }));
  ck_assert_msg(step < 1.5, "a step of %g N", step);
}
END_TEST

START_TEST(homing_begins_without_force) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  std::thread homes([&] { answer(device, "home"); });
  ck_assert(until([&] { return see([](DrdDevice& it) { return it.is_homing; }); }));
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_control(device.get(), "home", &out), "homes already");
  homes.join();
  EXPECT_VECTOR(see([](DrdDevice& it) { return it.asked_when_homing; }), (fs_vec3{}), 0);
  ck_assert_int_eq(see([](DrdDevice& it) { return it.times_homed; }), 1);
  ck_assert(until([&] { return push() > 2.9; }));
}
END_TEST

START_TEST(a_status_that_cannot_be_read) {
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  set([](DrdDevice& it) { it.has_status = false; });
  ck_assert(until([&] { return push() == 0; }));
  ck_assert(comes_to_say(device, "the SDK does not answer"));
  set([](DrdDevice& it) { it.has_status = true; });
  ck_assert(until([&] { return push() > 2.9; }));
}
END_TEST

START_TEST(too_fast) {
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  set([](DrdDevice& it) { it.fastest = 1, it.handle.with_plant([](stability::Plant& plant) { plant.put({}, {3, 0, 0}); }); });
  ck_assert(is_flagged(device, FS_STATE_TOO_FAST));
  ck_assert(says(device, "too fast"));
  ck_assert(until([&] { return is_ready(device); }));  // it has rested for a second
  ck_assert(!see([](DrdDevice& it) { return it.has_brakes; }));
}
END_TEST

START_TEST(its_weight_is_carried) {  // also when no servo has a force, and when one has
  set([](DrdDevice& it) { it.weight = 2.5; });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  const auto drops = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    return state_of(device).pose.position.z < -0.004;  // its hand has a spring of 100 N/m
  };
  ck_assert(until([&] { return std::fabs(push() - 2.5) < 1e-9; }));
  ck_assert(!drops());
  set([](DrdDevice& it) { it.is_carried = false; });
  ck_assert(drops());
}
END_TEST

// ----------------------------------------------------------------------------------------------------------------------- faults

START_TEST(its_watchdog) {
  const Device device = opened();
  ck_assert_int_eq(see([](DrdDevice& it) { return it.watchdog; }), 160);
  ck_assert(says(device, "the device itself ends the force 20 ms after"));
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  const double hung = now_s();
  set([](DrdDevice& it) { it.stuck_for = 0.4; });  // the SDK hangs in a call
  ck_assert(until([&] { return push() == 0; }));
  const double ended = first().handle.last_force_time() - hung;
  std::printf("  the SDK hangs: no force after %.1f ms\n", 1e3 * ended);
  ck_assert_msg(ended < 0.1, "%g s", ended);
  ck_assert(until([&] { return push() > 2.9; }));  // and it comes back
}
END_TEST

START_TEST(firmware_without_a_watchdog) {
  set([](DrdDevice& it) { it.has_watchdog = false; });
  const Device device = opened();
  ck_assert(says(device, "NO WATCHDOG"));
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_double_eq(info.watchdog, -1);
}
END_TEST

START_TEST(unplugged_and_back) {
  const std::shared_ptr<DrdDevice> omega = stand_in().devices.front();
  const Device device = opened("4711", "home=yes");
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  stand_in().change([](DrdStandIn& all) { return all.devices.clear(), 0; });
  ck_assert(until([&] { return pushing.event_with("lost"); }));
  // Another device in its place is not it.
  stand_in().change([](DrdStandIn& all) { return all.devices.push_back(std::make_shared<DrdDevice>(815)), 0; });
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  ck_assert(!see([](DrdDevice& it) { return it.is_open; }));
  // It comes back without power for its encoders: it does not home by itself, as it would move in somebody's hand.
  stand_in().change([&](DrdStandIn& all) {
    omega->is_initialized = false;
    omega->times_homed = 0;
    all.devices.push_back(omega);
    return 0;
  });
  ck_assert(until([&] { return stand_in().change([&](DrdStandIn&) { return omega->is_open; }); }));
  ck_assert(until([&] {
    fs_state hand{};
    OK(fs_scene_get_hand(pushing.scene.get(), &hand, nullptr, nullptr));
    return hand.flags & FS_STATE_NOT_HOMED;
  }));
  ck_assert(stand_in().change([&](DrdStandIn&) { return omega->times_homed == 0 && !omega->is_homing; }));
  fs_answer out{};
  ck_assert(until([&] { return fs_device_control(device.get(), "home", &out) == FS_OK; }));
  ck_assert(until([&] { return norm(omega->handle.force()) > 2.9; }));
}
END_TEST

START_TEST(another_in_its_place_is_left_alone) {  // it neither homes nor gets its motors switched on
  const std::shared_ptr<DrdDevice> omega = stand_in().devices.front(), other = std::make_shared<DrdDevice>(815);
  other->is_initialized = false;
  const Device device = opened("0", "home=yes");
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  stand_in().change([&](DrdStandIn& all) { return all.devices = {other}, 0; });
  ck_assert(until([&] { return pushing.event_with("lost"); }));
  std::this_thread::sleep_for(std::chrono::milliseconds(1200));
  ck_assert(stand_in().change([&](DrdStandIn&) { return other->times_homed == 0 && other->times_enabled == 0; }));
  stand_in().change([&](DrdStandIn& all) { return all.devices = {other, omega}, 0; });  // it is found at another place, too
  ck_assert(until([&] { return norm(omega->handle.force()) > 2.5; }));
}
END_TEST

START_TEST(poses_that_come_seldom) {  // are old when they are used: that counts as delay
  stand_in().change([](DrdStandIn& all) { return all.time_guard = 0.004; });
  const Device device = opened("0", "rate=4000");
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  ck_assert(until([&] { return stats_of(pushing.scene.get()).link_delay_p50 > 0.0015; }));
}
END_TEST

START_TEST(its_mass_is_told_a_little_otherwise) {  // when it is there again
  const std::shared_ptr<DrdDevice> omega = stand_in().devices.front();
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.9; }));
  stand_in().change([](DrdStandIn& all) { return all.devices.clear(), 0; });
  ck_assert(until([&] { return pushing.event_with("lost"); }));
  stability::DeviceModel model = makers::omega();
  model.mass *= 1 + 1e-12;
  omega->handle.become(model, stability::light);
  stand_in().change([&](DrdStandIn& all) { return all.devices.push_back(omega), 0; });
  ck_assert(until([&] { return norm(omega->handle.force()) > 2.9; }));
}
END_TEST

START_TEST(home_of_one_that_is_gone) {
  const Device device = opened();
  stand_in().change([](DrdStandIn& all) { return all.devices.clear(), 0; });
  fs_answer out{};
  const fs_status status = fs_device_control(device.get(), "home", &out);
  ck_assert_msg(status == FS_ERROR_IO || status == FS_ERROR_DISCONNECTED, "%s", fs_last_error());
}
END_TEST

START_TEST(motors_are_switched_on_without_a_force) {  // the SDK may have kept the newest command
  const Device device = opened();
  const Pushing pushing(device);
  for (int i = 0; i < 10; ++i) {
    ck_assert(until([&] { return push() > 2.5; }));
    set([](DrdDevice& it) { it.stuck_for = 0.025; });
    ck_assert(until([&] { return see([](DrdDevice& it) { return !it.has_force; }) || push() == 0; }));
  }
  ck_assert(until([&] { return push() > 2.5; }));
  EXPECT_NEAR(see([](DrdDevice& it) { return it.asked_when_enabled; }), 0, 0);
}
END_TEST

START_TEST(a_frame_that_is_no_rotation) {
  set([](DrdDevice& it) { it.has_wrist = true; });
  const Device device = opened();
  const Pushing pushing(device);
  ck_assert(until([&] { return push() > 2.5; }));
  set([](DrdDevice& it) { it.orientation.x = std::nan(""); });
  ck_assert(until([&] { return pushing.event_with("a pose that no device has"); }));
  set([](DrdDevice& it) { it.orientation = {1, 0, 0, 0}; });
  ck_assert(until([&] { return push() > 2.5; }));  // it ends by itself
}
END_TEST

START_TEST(unplugged_while_it_homes) {
  set([](DrdDevice& device) { device.is_initialized = false; });
  const Device device = opened();
  std::thread unplugs([] {
    until([] { return see([](DrdDevice& it) { return it.is_homing; }); });
    stand_in().change([](DrdStandIn& all) { return all.devices.clear(), 0; });
  });
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_control(device.get(), "home", &out), "has not homed: communication error");
  unplugs.join();
  ck_assert(until([&] {
    fs_state state;
    return fs_device_read(device.get(), &state) == FS_ERROR_DISCONNECTED;
  }));
}
END_TEST

START_TEST(the_servo_never_waits_for_the_library) {
  set([](DrdDevice& device) { device.is_initialized = false; });
  {
    const Device device = opened();
    const Pushing pushing(device);
    fs_answer out{};
    OK(fs_device_control(device.get(), "home", &out));
    ck_assert(until([&] { return push() > 2.9; }));
    set([](DrdDevice& it) { it.stuck_for = 0.1; });
    ck_assert(until([&] { return push() == 0; }));
    ck_assert(until([&] { return push() > 2.9; }));
    ck_assert(stats_of(pushing.scene.get()).link_delay_p50 > 0 || until([&] { return stats_of(pushing.scene.get()).link_delay_p50 > 0; }));
  }
  ck_assert_uint_eq(first().handle.calls_of_servo(), 0);
  ck_assert(!see([](DrdDevice& it) { return it.is_open || it.has_force; }));
  ck_assert(see([](DrdDevice& it) { return it.has_brakes; }));  // closed
}
END_TEST

START_TEST(at_random) {
  const std::shared_ptr<DrdDevice> omega = stand_in().devices.front();
  const auto change = [=](auto change_it) {
    return [=] { stand_in().change([&](DrdStandIn&) { return change_it(*omega), 0; }); };
  };
  const auto plug = [](auto devices) {
    return [=] { stand_in().change([&](DrdStandIn& all) { return all.devices = devices, 0; }); };
  };
  const std::vector plugged{omega}, nothing(0, omega), another{std::make_shared<DrdDevice>(815)};
  const auto switch_on = change([](DrdDevice& it) { it.has_force = it.has_power = true, it.cause = 0; });
  live_with({{"unplugged", plug(nothing), plug(plugged)},
             {"another in its place", plug(another), plug(plugged)},
             {"the force button", change([](DrdDevice& it) { it.has_force = false, it.cause = 1, it.handle.rest(); }), switch_on},
             {"without power", change([](DrdDevice& it) { it.has_power = false, it.handle.rest(); }), switch_on},
             {"no status", change([](DrdDevice& it) { it.has_status = false; }), change([](DrdDevice& it) { it.has_status = true; })},
             {"not homed", change([](DrdDevice& it) { it.is_initialized = false; }), change([](DrdDevice& it) { it.is_initialized = true; })},
             {"too fast", change([](DrdDevice& it) { it.has_force = false, it.has_brakes = true, it.cause = 2, it.handle.rest(); })},
             {"a short hang", change([](DrdDevice& it) { it.stuck_for = 0.015; })},
             {"a hang", change([](DrdDevice& it) { it.stuck_for = 0.3; })},
             {"NaN", change([](DrdDevice& it) { it.odd_answer = 7; })},
             {"an error", change([](DrdDevice& it) { it.odd_answer = -1; })}},
            uri("4711"), omega->handle);
}
END_TEST

START_TEST(a_wall_stands_and_shakes) {
  stability::DeviceModel model;
  model.mass = 0.25, model.friction = 0.05, model.force_max = 12, model.encoder = 10e-6, model.damping = 0.5;
  set([&](DrdDevice& it) { it.handle.become(model, stability::light); });
  const Device device = opened();
  ck_assert(until([&] { return is_ready(device); }));
  expect_wall_stands_and_shakes(device.get(), first().handle, model, 0.5e-3);
}
END_TEST

START_TEST(drivers_and_devices_are_told) {
  fs_driver_info drivers[16];
  size_t count = 0;
  OK(fs_driver_list(drivers, 16, &count));
  bool is_told = false;
  for (size_t i = 0; i < count; ++i) {
    is_told = is_told || (!std::strcmp(drivers[i].scheme, "dhd") && std::strstr(drivers[i].trouble, "libdrd.so.3: cannot open"));
  }
  ck_assert(is_told || is_installed("libdrd.so.3"));
  const Device device = opened();  // now the library is there
  fs_device_entry entries[8];
  OK(fs_device_list(entries, 8, &count));
  bool is_listed = false;
  for (size_t i = 0; i < count; ++i) is_listed = is_listed || !std::strcmp(entries[i].uri, "dhd:0");
  ck_assert(is_listed);
}
END_TEST

#ifdef PROGRAM
START_TEST(test_device_finds_nothing) { expect_nothing_found(PROGRAM, uri("0")); }
END_TEST
#endif

int main() {
  Suite* suite = suite_create("dhd");
  add_case(suite, "poses and forces",
           {what_it_is, rows_of_the_table, axes, a_wrist_with_motors, every_orientation, a_pose_counts_once, more_than_its_motors_give, odd_poses});
  add_case(suite, "opening", {which_device, the_order_changes, a_falcon_has_a_driver_of_its_own, libraries_that_are_no_good,
                              drivers_and_devices_are_told});
  add_case(suite, "readiness",
           {homing_moves_so_it_must_be_asked_for, homed_at_opening, one_that_cannot_home, why_there_is_no_force,
            the_force_button_off_and_on, homing_begins_without_force, a_status_that_cannot_be_read, too_fast, its_weight_is_carried});
  add_case(suite, "faults", {its_watchdog, firmware_without_a_watchdog, motors_are_switched_on_without_a_force, a_frame_that_is_no_rotation,
                             unplugged_and_back, another_in_its_place_is_left_alone, poses_that_come_seldom, its_mass_is_told_a_little_otherwise, unplugged_while_it_homes, home_of_one_that_is_gone,
                             the_servo_never_waits_for_the_library, at_random});
  if (does_all()) {
    add_case(suite, "walls", {a_wall_stands_and_shakes});
#ifdef PROGRAM
    add_case(suite, "test-device", {test_device_finds_nothing});
#endif
  }
  return run_suite(suite);
}
