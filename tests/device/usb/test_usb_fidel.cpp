// fidel:usb through the public functions: the module, the real libusb, a bus in this process, and the reference firmware with a
// simulated hand.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "device/table.h"
#include "device/usb/fidel_rig.h"

using namespace scenes;

// ------------------------------------------------------------------------------------------------------------ it works

START_TEST(a_wall_is_felt) {
  Loop loop;
  ck_assert(until([&] { return loop.pushes(); }));
  // The hand's spring pushes by 300 N/m from -20 mm, the wall by 500: they meet at -7.5 mm.
  ck_assert(until([&] { return std::fabs(loop.look([](FidelBody& b) { return b.position.z; }) + 0.0075) < 2e-3; }));
  const fs_vec3 force = loop.look([](FidelBody& b) { return b.force; });
  ck_assert_double_lt(std::hypot(force.x, force.y), 0.1);
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(loop.device.get(), &info));
  ck_assert_str_eq(info.serial, "F0001");
  EXPECT_NEAR(info.force_max, 25, 0);
  EXPECT_NEAR(info.torque_max, 0.5, 1e-9);
  EXPECT_NEAR(info.resolution, 17e-6, 1e-6);  // of one encoder; the simulator tells 20e-6
  ck_assert(until([&] { return loop.answer("status").find("homed, motors on") == 0; }));
  ck_assert(until([&] { return loop.stats().link_delay_p50 > 0; }));
  ck_assert_double_le(loop.stats().link_delay_p50, loop.stats().link_delay_p99);
  std::printf("  delay %.2f ms, p99 %.2f ms\n", 1e3 * loop.stats().link_delay_p50, 1e3 * loop.stats().link_delay_p99);
  std::printf("  %s\n", loop.answer("status").c_str());
  loop.servo.reset();
  ck_assert(until([&] { return loop.is_zero(); }));  // the 0 has been handed to the bus
  loop.device.reset();
  ck_assert_uint_eq(loop.bus.counts(1).open_now, 0);
}
END_TEST

START_TEST(poses_torques_and_buttons) {
  Plugged plugged({.wrist_torque = 0.2});
  plugged.change([](FidelBody& b) {
    b.target = {0.05, -0.03, 0.02};
    b.inputs.buttons = 5;
  });
  const Device device = open_device("fidel:usb:F0001");
  ck_assert(until([&] { return norm(plugged.look([](FidelBody& b) { return b.position - b.target; })) < 1e-4; }));
  fs_state state;
  ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK && state.flags == FS_STATE_READY; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK; }));
  EXPECT_VECTOR(state.pose.position, (fs_vec3{0.05, -0.03, 0.02}), 2e-4);
  ck_assert_uint_eq(state.buttons, 5);
  const fs_wrench wrench{{2, 0, -1}, {0.1, 0, 0}};
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return plugged.look([](FidelBody& b) { return norm(b.force - fs_vec3{2, 0, -1}) < 0.02; }); }));
  ck_assert(until([&] { return plugged.look([](FidelBody& b) { return std::fabs(b.wrist.x - 0.05) < 1e-3; }); }));  // 2 N m/rad
}
END_TEST

START_TEST(row_of_the_table) {
  const Plugged plugged;
  expect_in_table(open_device("fidel:usb").get(), "`fidel:usb`");
}
END_TEST

START_TEST(two_devices_at_once) {
  Plugged plugged;
  const auto second = std::make_shared<FidelModel>(FidelOptions{.serial = "F0002"});
  plugged.bus.plug(2, second);
  std::vector<fs_device_entry> entries(16);
  size_t count = 0;
  {
    const Device first = open_device("fidel:usb");
  }  // loads the driver
  OK(fs_device_list(entries.data(), entries.size(), &count));
  std::string uris;
  for (size_t i = 0; i < count; ++i) uris += std::string(entries[i].uri) + " ";
  ck_assert_msg(uris.find("fidel:usb:F0001 fidel:usb:F0002") != std::string::npos, "%s", uris.c_str());
  const Device a = open_device("fidel:usb:F0001"), b = open_device("fidel:usb:F0002");
  const fs_wrench left{{-1, 0, 0}, {}}, right{{1, 0, 0}, {}};
  ck_assert(until([&] {  // ready
    OK(fs_device_write(a.get(), &left));
    OK(fs_device_write(b.get(), &right));
    bool is_good = false;
    plugged.bus.with_models([&] { is_good = plugged.model->body().force.x < -0.9 && second->body().force.x > 0.9; });
    return is_good;
  }));
  expect_open(FS_ERROR_IO, "in use", "fidel:usb:F0002");
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- opening

START_TEST(what_cannot_be_opened_says_why) {
  Plugged plugged;
  expect_open(FS_ERROR_INVALID, "usb:NUMBER", "fidel:usb:");
  expect_open(FS_ERROR_INVALID, "'speed' is unknown", "fidel:usb?speed=1");
  expect_open(FS_ERROR_NOT_FOUND, "F0001", "fidel:usb:F0009");
  expect_open(FS_ERROR_NOT_FOUND, "there is no FIDEL 3", "fidel:usb:3");
  UsbFaults faults;
  faults.is_denied = true;
  plugged.bus.set(1, faults);
  expect_open(FS_ERROR_DENIED, "60-forceserver.rules");
  faults = {};
  for (const auto fault : {UsbFault::stall, UsbFault::error}) {
    faults.control = fault;
    plugged.bus.set(1, faults);
    expect_open(FS_ERROR_IO, "FIDEL");
  }
  plugged.bus.set(1, {});
  plugged.change([](FidelBody& b) { b.version = 2; });
  expect_open(FS_ERROR_VERSION, "version 2");
  plugged.change([](FidelBody& b) { b.version = 0; });
  expect_open(FS_ERROR_IO, "damaged");
  plugged.change([](FidelBody& b) { b.version = 1, b.firmware.constants.joint_counts = 10; });
  expect_open(FS_ERROR_IO, "number of counts");
  plugged.change([](FidelBody& b) { b.firmware.constants.joint_counts = 80000, b.firmware.constants.serial[0] = 'G'; });
  expect_open(FS_ERROR_IO, "'G0001'");
  plugged.change([](FidelBody& b) { b.firmware.constants.serial[0] = 'F'; });
  for (const auto moment : {UsbMoment::open, UsbMoment::claim, UsbMoment::control}) {
    plugged.bus.unplug_at(1, moment, 1, Unplug::in_flight);
    fs_device* device = nullptr;
    const fs_status status = fs_device_open("fidel:usb", &device);
    ck_assert_msg(status == FS_ERROR_DISCONNECTED || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_IO, "%s",
                  fs_last_error());
    ck_assert(until([&] { return plugged.bus.counts(1).open_now == 0; }));
    plugged.bus.plug(1, plugged.model);
  }
  // Gone with the first report or the first command: the device has been opened, and comes back.
  for (const auto moment : {UsbMoment::in, UsbMoment::out}) {
    plugged.bus.unplug_at(1, moment, 1, Unplug::between);
    const Device device = open_device("fidel:usb");
    ck_assert(until([&] { return !plugged.bus.is_plugged(1); }));
    fs_state state;
    ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_ERROR_DISCONNECTED; }));
    plugged.bus.plug(1, plugged.model);
    ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK && state.flags == FS_STATE_READY; }));
  }
}
END_TEST

// ----------------------------------------------------------------------------------------------------- what goes wrong

START_TEST(unplugged_and_back) {
  for (const auto how : {Unplug::in_flight, Unplug::between}) {
    Loop loop;
    ck_assert(until([&] { return loop.pushes(); }));
    loop.bus.unplug(1, how);
    ck_assert(loop.is_told("lost"));
    ck_assert(loop.stats().faults & FS_FAULT_DEVICE);
    loop.bus.plug(1, std::make_shared<FidelModel>(FidelOptions{.serial = "F0002"}));
    ck_assert(until([&] { return loop.bus.counts(1).claims >= 2; }));  // it was looked at, and not taken
    ck_assert(loop.stats().faults & FS_FAULT_DEVICE);
    loop.bus.unplug(1, how);
    loop.bus.plug(1, loop.model);  // for 20 ms and more it has had no command
    ck_assert(loop.is_told("ready"));
    ck_assert(until([&] { return loop.pushes() && loop.stats().faults == 0; }));
    loop.expect_ramps();
  }
}
END_TEST

START_TEST(unplugged_at_any_transfer) {
  for (const auto moment : {UsbMoment::in, UsbMoment::out}) {
    for (const auto how : {Unplug::in_flight, Unplug::between}) {
      Loop loop;
      ck_assert(until([&] { return loop.pushes(); }));
      loop.bus.unplug_at(1, moment, 7, how);
      ck_assert(until([&] { return !loop.bus.is_plugged(1); }));
      ck_assert(loop.is_told("lost"));
      loop.bus.plug(1, loop.model);
      ck_assert(until([&] { return loop.pushes(); }));
    }
  }
}
END_TEST

START_TEST(transfers_that_fail) {
  const auto bad = [](const char* name, UsbFault UsbFaults::* way, UsbFault fault) {
    Loop loop;
    UsbFaults faults;
    faults.*way = fault;
    const double time = loop.time_to_zero([&] { loop.bus.set(1, faults); });
    std::printf("  %s: no torque after %.0f ms\n", name, time);
    loop.bus.set(1, {});
    OK(fs_servo_set_enabled(loop.servo.get(), true));
    ck_assert_msg(until([&] { return loop.pushes(); }), "after %s", name);
    loop.expect_ramps();
  };
  bad("reports stall", &UsbFaults::in, UsbFault::stall);
  bad("reports stop", &UsbFaults::in, UsbFault::silence);
  bad("reports fail", &UsbFaults::in, UsbFault::error);
  bad("reports are short", &UsbFaults::in, UsbFault::shortened);
  bad("reports are too long", &UsbFaults::in, UsbFault::overlong);
  bad("reports are garbage", &UsbFaults::in, UsbFault::garbage);
  bad("commands stall", &UsbFaults::out, UsbFault::stall);
  bad("commands are not taken", &UsbFaults::out, UsbFault::silence);
  bad("commands fail", &UsbFaults::out, UsbFault::error);
}
END_TEST

START_TEST(devices_that_err) {
  const auto bad = [](const char* name, auto fault, auto mend, const char* words) {
    Loop loop;
    ck_assert(until([&] { return loop.pushes(); }));
    const double time = loop.time_to_zero([&] { loop.change(fault); });
    std::printf("  %s: no torque after %.0f ms\n", name, time);
    if (*words) ck_assert_msg(loop.answer("status").find(words) != std::string::npos, "%s", loop.answer("status").c_str());
    loop.change(mend);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    loop.answer("clear");  // at a jump the device itself has seen a joint that was too fast
    // Where the machine was too late to see an encoder jump back, it must be homed.
    if (loop.answer("status").find("has jumped") != std::string::npos) loop.home_again();
    OK(fs_servo_set_enabled(loop.servo.get(), true));
    ck_assert_msg(until([&] { return loop.pushes(); }), "after %s: %s", name, loop.answer("status").c_str());
    loop.expect_ramps();
  };
  bad("no reports", [](FidelBody& b) { b.is_silent = true; }, [](FidelBody& b) { b.is_silent = false; }, "");
  bad("every report is damaged", [](FidelBody& b) { b.damages = 1; }, [](FidelBody& b) { b.damages = 0; }, "damaged");
  bad(
      "the same number again and again", [](FidelBody& b) { b.repeats = true; }, [](FidelBody& b) { b.repeats = false; },
      "damaged");
  bad("short reports", [](FidelBody& b) { b.cuts = 1; }, [](FidelBody& b) { b.cuts = 0; }, "damaged");
  bad("reports of 64 bytes", [](FidelBody& b) { b.cuts = -24; }, [](FidelBody& b) { b.cuts = 0; }, "damaged");
  bad("reports of 65 bytes", [](FidelBody& b) { b.cuts = -25; }, [](FidelBody& b) { b.cuts = 0; }, "");
  bad(
      "no ear for commands", [](FidelBody& b) { b.is_deaf = true; }, [](FidelBody& b) { b.is_deaf = false; },
      "no command for 20 ms");
  bad("an encoder jumps", [](FidelBody& b) { b.jump[1] = 900; }, [](FidelBody& b) { b.jump[1] = 0; }, "has jumped");
}
END_TEST

// One report in ten has a wrong bit: the force goes on, and they are counted.
START_TEST(some_damaged_reports) {
  Loop loop;
  ck_assert(until([&] { return loop.pushes(); }));
  loop.change([](FidelBody& b) { b.damages = 10; });
  const uint32_t begin = loop.look([](FidelBody& b) { return b.reports; });
  ck_assert(until([&] { return loop.look([&](FidelBody& b) { return b.reports; }) > begin + 500; }));
  ck_assert(until([&] { return loop.pushes(); }));
  const std::string status = loop.answer("status");
  unsigned long good = 0, lost = 0, damaged = 0;
  ck_assert_int_eq(std::sscanf(std::strstr(status.c_str(), "Reports:"), "Reports: %lu good, %lu lost, %lu damaged", &good, &lost,
                               &damaged),
                   3);
  ck_assert_uint_ge(damaged, 45);
  ck_assert_uint_le(damaged, good / 5);
}
END_TEST

START_TEST(a_stuck_encoder) {
  Loop loop;
  ck_assert(until([&] { return loop.pushes(); }));
  loop.change([](FidelBody& b) {
    b.stuck_joint = 2;
    b.stuck_count = b.inputs.counters[2];
    b.target = {0.08, 0.04, -0.02};
  });
  ck_assert(until([&] { return loop.answer("status").find("stands still") != std::string::npos; }));
  ck_assert(until([&] { return loop.is_zero(); }));
  loop.change([](FidelBody& b) {
    b.stuck_joint = -1;
    b.target = {0, 0, -0.02};
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ck_assert(loop.is_zero());  // where it is now nobody knows, until it is homed
  loop.home_again();
  ck_assert(until([&] { return loop.pushes(); }));
}
END_TEST

// In homing: nothing is felt, a device that is unplugged and comes back is still not homed, and homing goes on.
START_TEST(homing_with_a_bad_plug) {
  Loop loop({.is_homed = false});
  ck_assert(loop.is_told("not homed"));
  loop.change([](FidelBody& b) { b.target = {0, 0, -0.04}; });
  UsbFaults faults;
  for (const auto fault : {UsbFault::stall, UsbFault::garbage, UsbFault::silence, UsbFault::overlong}) {
    faults.in = fault;
    loop.bus.set(1, faults);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    loop.bus.set(1, {});
  }
  loop.bus.unplug(1, Unplug::in_flight);
  fs_answer answer;
  ck_assert(until([&] { return fs_device_control(loop.device.get(), "status", &answer) == FS_ERROR_DISCONNECTED; }));
  loop.bus.plug(1, loop.model);
  ck_assert(until([&] { return fs_device_control(loop.device.get(), "status", &answer) == FS_OK; }));
  ck_assert_ptr_nonnull(std::strstr(answer.text, "not homed, marks passed: no no no, motors off"));
  ck_assert_uint_eq(loop.look([](FidelBody& b) { return b.last_torque; }), 0);
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_control(loop.device.get(), "calibrate", &answer), "not homed");
  loop.change([](FidelBody& b) { b.target = {0, 0, 0.06}; });
  ck_assert(until([&] { return loop.answer("status").find("homed, motors on") == 0; }));
  loop.change([](FidelBody& b) { b.target = {0, 0, -0.02}; });
  ck_assert(until([&] { return loop.pushes(); }));
  loop.expect_ramps();
}
END_TEST

START_TEST(the_reason_for_no_force_is_told) {
  Loop loop;
  const auto told = [&](const char* words, auto change, auto back) {
    ck_assert(until([&] { return loop.pushes(); }));
    loop.change(change);
    ck_assert_msg(loop.is_told(words), "%s", words);
    ck_assert(until([&] { return loop.is_zero(); }));
    back();
    ck_assert_msg(until([&] { return loop.pushes(); }), "after %s", words);
  };
  fs_answer answer;
  told(
      "emergency stop", [](FidelBody& b) { b.inputs.stop_pressed = 1; },
      [&] {
        EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_control(loop.device.get(), "clear", &answer), "refuses");
        loop.change([](FidelBody& b) { b.inputs.stop_pressed = 0; });
        ck_assert(loop.answer("status").find("emergency stop") != std::string::npos);
        ck_assert(until([&] { return fs_device_control(loop.device.get(), "clear", &answer) == FS_OK; }));
      });
  told(
      "too fast", [](FidelBody& b) { b.velocity = {0, 0, 6}; },
      [&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        loop.answer("clear");
        loop.home_again();  // at 6 m/s the encoders seemed to jump
      });
  told(
      "holder", [](FidelBody& b) { b.inputs.in_holder = 1; }, [&] { loop.change([](FidelBody& b) { b.inputs.in_holder = 0; }); });
  told("not homed", [](FidelBody& b) { b.firmware.marks = 3; }, [&] { loop.change([](FidelBody& b) { b.firmware.marks = 7; }); });
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(loop.device.get(), "dance", &answer), "the requests are: status, home");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(loop.device.get(), "calibrate=now", &answer), "cancel");
}
END_TEST

// A request is answered while forces go on, and one that is not answered holds up neither them nor the end.
START_TEST(requests_beside_a_servo) {
  Loop loop;
  ck_assert(until([&] { return loop.pushes(); }));
  std::vector<std::thread> asking;
  std::atomic<int> answered{0};
  for (int i = 0; i < 3; ++i) {
    asking.emplace_back([&] {
      fs_answer answer;
      for (int n = 0; n < 30; ++n) answered += fs_device_control(loop.device.get(), "status", &answer) == FS_OK;
    });
  }
  for (auto& thread : asking) thread.join();
  ck_assert_int_ge(answered, 80);
  ck_assert(until([&] { return loop.pushes(); }));
  UsbFaults faults;
  faults.control = UsbFault::silence;
  loop.bus.set(1, faults);
  fs_answer answer;
  ck_assert_int_eq(fs_device_control(loop.device.get(), "status", &answer), FS_ERROR_TIMEOUT);
  ck_assert(until([&] { return loop.pushes(); }));
  loop.servo.reset();
  ck_assert(until([&] { return loop.is_zero(); }));  // the 0 has been handed to the bus
}
END_TEST

// ----------------------------------------------------------------------------------------------- when the host is dead

START_TEST(a_killed_host_is_no_force_within_20_ms) {
  const Folder folder;  // for what the killed one leaves behind
  FidelModel model;  // before the child: its memory is shared
  setenv("XDG_CONFIG_HOME", folder.path.c_str(), 1);
  setenv("TMPDIR", folder.path.c_str(), 1);
  const pid_t child = fork();
  ck_assert_int_ge(child, 0);
  if (child == 0) {
    EmulatedBus bus;
    bus.plug(1, std::shared_ptr<FidelModel>(&model, [](FidelModel*) {}));
    const Device device = open_device("fidel:usb");
    const fs_wrench wrench{{3, 0, 0}, {}};
    for (;;) {
      fs_device_write(device.get(), &wrench);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  volatile const FidelBody& seen = model.body();
  ck_assert(until([&] { return seen.force.x > 2.9 && seen.commands > 100; }));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  model.run(1);
  const FidelBody& body = model.body();
  ck_assert_int_eq(body.firmware.torques[0], 0);
  // us. A little below 0 where the child was killed after the firmware took a command, and before the next tick acted on it.
  const auto kept = static_cast<int32_t>(body.last_torque - body.firmware.command_time);
  ck_assert_int_ge(kept, -20000);
  ck_assert_int_le(kept, 20000);
  std::printf("  killed: the last torque %g ms after the last command\n", 1e-3 * kept);
}
END_TEST

// --------------------------------------------------------------------------------------------------------- calibration

START_TEST(calibrated_and_kept) {
  Plugged plugged({.mark_errors = {0.02, -0.015, 0.01}, .scale = 1.02});
  Device device = open_device("fidel:usb");
  const auto ask = [&] {
    fs_answer answer;
    OK(fs_device_control(device.get(), "calibrate", &answer));
    std::printf("  %s\n", answer.text);
    return std::string(answer.text);
  };
  const auto go = [&](fs_vec3 place) {
    plugged.change([&](FidelBody& b) { b.target = place; });
    ck_assert(until([&] {
      return plugged.look([&](FidelBody& b) { return norm(b.position - place) < 1e-6 && norm(b.velocity) < 1e-6; });
    }));
  };
  fs_state state;
  const auto position = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK; }));  // on a busy machine reports come late
    return state.pose.position;
  };
  go({0.02, 0.03, 0.01});
  ck_assert_double_gt(norm(position() - fs_vec3{0.02, 0.03, 0.01}), 1e-3);
  ck_assert_ptr_nonnull(std::strstr(ask().c_str(), "step 1"));
  ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK && !(state.flags & FS_STATE_READY); }));
  plugged.change([](FidelBody& b) { b.shakes = true; });
  fs_answer answer;
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_control(device.get(), "calibrate", &answer), "has moved");
  plugged.change([](FidelBody& b) { b.shakes = false; });
  go({});
  ck_assert_ptr_nonnull(std::strstr(ask().c_str(), "step 2"));
  go({0.1, 0, 0});
  ck_assert_ptr_nonnull(std::strstr(ask().c_str(), "done"));
  ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_OK && state.flags == FS_STATE_READY; }));
  EXPECT_VECTOR(position(), (fs_vec3{0.1, 0, 0}), 1e-4);
  device = open_device("sim:");  // closes it
  device = open_device("fidel:usb");
  go({0.02, 0.03, 0.01});
  EXPECT_VECTOR(position(), (fs_vec3{0.02, 0.03, 0.01}), 1e-4);
  device = open_device("sim:");
  device = open_device("fidel:usb?calibration=none");
  ck_assert_double_gt(norm(position() - fs_vec3{0.02, 0.03, 0.01}), 1e-3);
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_device_control(device.get(), "calibrate", &answer), "calibration=none");
  device = open_device("sim:");
  std::ofstream(plugged.file(), std::ios::trunc) << "{";
  expect_open(FS_ERROR_INVALID, "fidel-F0001.json: it is no JSON object");
  std::ifstream stream(plugged.file());
  ck_assert(std::string(std::istreambuf_iterator<char>(stream), {}) == "{");
}
END_TEST

int main() {
  Suite* suite = suite_create("usb_fidel");
  add_case(suite, "works", {a_wall_is_felt, poses_torques_and_buttons, row_of_the_table, two_devices_at_once});
  add_case(suite, "opening", {what_cannot_be_opened_says_why});
  add_case(suite, "faults",
           {unplugged_and_back, unplugged_at_any_transfer, transfers_that_fail, devices_that_err, some_damaged_reports,
            a_stuck_encoder, homing_with_a_bad_plug, the_reason_for_no_force_is_told, requests_beside_a_servo,
            a_killed_host_is_no_force_within_20_ms});
  add_case(suite, "calibration", {calibrated_and_kept});
  return run_suite(suite);
}
