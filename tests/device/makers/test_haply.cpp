// The driver haply through the public C ABI, on a stand-in for the Haply Inverse Service.
#include <cmath>
#include <cstdio>

#include "device/makers/haply_rig.h"
#include "device/makers/wall.h"
#include "device/table.h"

using namespace makers;

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
  expect_in_table(opened(service).get(), "`haply:`");
  ck_assert(comes_to_say(device, "ready; service 3.5.0, messages of 3.5; inverse3 049D, no grip"));
  fs_answer out{};
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(device.get(), "home", &out), "its requests are: status");
  std::printf("  %s\n", answer(device, "status").c_str());
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
    ck_assert(until([&] { return norm(arm.handle.force()) < 1e-9; }));  // else it moves away again
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
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri(service.port(), "0", "speed=1").c_str(), &raw), "host, port, grip, rate, force, dialect");
  service.with([](HaplyService& it) { return it.devices[0]->is_in_use = true; });
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
  service.with([&](HaplyService&) { return arm.scale = 2; });
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_open(uri(service.port()).c_str(), &raw), "must be 1");
  service.with([&](HaplyService&) { return arm.scale = 1, arm.basis = "XZY", 0; });
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_open(uri(service.port()).c_str(), &raw), "'XZY', must be XYZ");
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
  ck_assert(comes_to_say(rig.device, "the service says that the device is not ready;"));
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
  const Pushing pushing(device);
  ck_assert(comes_to_say(device, "filters: damping 0.5, force gate 0.3"));
  ck_assert(until([&] { return push_of(arm) > 1; }));
  ck_assert(answer(device, "status").find("differs") == std::string::npos);
  service.with([&](HaplyService&) { return arm.force_told = 0.5; });
  ck_assert(comes_to_say(device, "differs from the force sent by more than a fifth"));
}
END_TEST

START_TEST(a_wall_stands_and_shakes) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  stability::DeviceModel model;
  model.friction = 0.05, model.force_max = 5;
  arm.handle.become(model, stability::light);
  const Device device = opened(service);
  ck_assert(until([&] { return is_ready(device); }));
  expect_wall_stands_and_shakes(device.get(), arm.handle, model, 0.1e-3);
}
END_TEST

#ifdef PROGRAM
START_TEST(test_device_finds_nothing) {
  const HaplyService service;
  expect_nothing_found(PROGRAM, uri(service.port()));
}
END_TEST
#endif

int main() {
  Suite* suite = suite_create("haply");
  add_case(suite, "poses and forces", {what_it_is, axes, axes_of_an_old_service, axes_in_the_words_of_an_old_service, grips_and_buttons});
  add_case(suite, "opening", {which_device, nothing_listens, frames_that_would_be_wrong});
  add_case(suite, "readiness", {why_there_is_no_force, flags, what_falsifies_forces_is_told});
  if (does_all()) {
    add_case(suite, "walls", {a_wall_stands_and_shakes});
#ifdef PROGRAM
    add_case(suite, "test-device", {test_device_finds_nothing});
#endif
  }
  return run_suite(suite);
}
