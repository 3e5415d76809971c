// The driver falcon through the public C ABI, with the real libusb, on an emulated bus.
#include <cmath>
#include <fstream>

#include "device/table.h"
#include "device/usb/falcon_rig.h"
#include "scenes/folder.h"

using namespace scenes;

// A way of the handle in the device frame: the Falcon's z points to who sits before it, its y up.
static fs_vec3 to_device(fs_vec3 v) { return {v.x, -(v.z - 0.125), v.y}; }

START_TEST(positions_come_and_forces_go) {
  FalconRig rig;
  rig.change([](FalconModel& model) {
    model.target = {0.01, -0.015, 0.135};
    model.odd_buttons = 5;
  });
  const Device device = open_device("falcon:0");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.serial, "A1");
  ck_assert_str_eq(info.name, "Novint Falcon");
  std::printf("  force_max %g N, resolution %g m\n", info.force_max, info.resolution);
  ck_assert(until([&] { return is_ready(device.get()); }));
  ck_assert(until([&] {
    const fs_vec3 exact = to_device(rig.see([](FalconModel& model) { return model.position(); }));
    return norm(state_of(device.get()).pose.position - exact) < 2e-4;
  }));
  ck_assert_uint_eq(state_of(device.get()).buttons, 5);

  // A force of 1 N in each direction is felt as such, in spite of the driver's Jacobian and the model's own.
  for (const fs_vec3 wanted : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}, fs_vec3{-0.5, 0.6, -0.4}}) {
    fs_wrench wrench{};
    wrench.force = wanted;
    OK(fs_device_write(device.get(), &wrench));
    const fs_vec3 in_falcon{wanted.x, wanted.z, -wanted.y};
    ck_assert(until([&] { return norm(rig.see([](FalconModel& model) { return model.force(); }) - in_falcon) < 0.01; }));
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------ opening

START_TEST(row_of_the_table) {
  FalconRig rig;
  expect_in_table(open_device("falcon:0").get(), "`falcon:`");
}
END_TEST

START_TEST(what_is_not_there_is_named) {
  FalconRig rig(false);
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("falcon:0", &raw), "no Novint Falcon (0403:cb48)");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("falcon:0", &raw), "nothing is on the USB");
  rig.bus.plug(2, rig.falcon);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("falcon:B2", &raw), "serial number 'B2'; on the USB are those with 'A1'");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("falcon:1", &raw), "there is no Novint Falcon 1");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("falcon:", &raw), "'A1'");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open("falcon:0?motor=7", &raw), "1000..100000");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open("falcon:0?speed=7", &raw), "firmware, motor");
  const Device by_serial = open_device("falcon:A1");
}
END_TEST

START_TEST(a_machine_without_usb) {
  fs_device* raw = nullptr;
  EXPECT(FS_ERROR_NOT_FOUND, fs_device_open("falcon:0", &raw));
  std::printf("  %s\n", fs_last_error());
}
END_TEST

START_TEST(a_node_that_may_not_be_opened) {
  FalconRig rig;
  UsbFaults faults;
  faults.is_denied = true;
  rig.bus.set(1, faults);
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open("falcon:0", &raw), rig.bus.node(1).c_str());
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open("falcon:0", &raw), "60-forceserver.rules");
  std::printf("  %s\n", fs_last_error());
  ck_assert_uint_eq(rig.bus.counts(1).open_now, 0);
}
END_TEST

START_TEST(one_that_is_in_use) {
  FalconRig rig;
  fs_device* raw = nullptr;
  UsbFaults faults;
  faults.is_in_use = true;
  rig.bus.set(1, faults);
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("falcon:0", &raw), "is in use");
  faults.is_in_use = false;
  faults.kernel_driver = "ftdi_sio";
  rig.bus.set(1, faults);
  const Device device = open_device("falcon:0");
  ck_assert_uint_eq(rig.bus.counts(1).detached, 1);
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("falcon:0", &raw), "is in use");
  ck_assert_uint_eq(rig.bus.counts(1).open_now, 1);
}
END_TEST

START_TEST(all_are_listed) {
  FalconRig rig;
  rig.bus.plug(2, FalconRig::made("B2"));
  size_t count = 0;
  fs_device_entry entries[8];
  OK(fs_device_list(entries, 8, &count));
  std::string text;
  for (size_t i = 0; i < count; ++i) {
    if (std::strncmp(entries[i].uri, "falcon:", 7) == 0) text += std::string(entries[i].uri) + " ";
  }
  ck_assert_str_eq(text.c_str(), "falcon:A1 falcon:B2 ");
}
END_TEST

// ----------------------------------------------------------------------------------------------------------------- firmware

static std::vector<uint8_t> some_firmware(size_t size) {
  std::vector<uint8_t> bytes(size);
  uint32_t state = 1;
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  return bytes;
}

static std::string written(const Folder& folder, const char* name, const std::vector<uint8_t>& bytes) {
  std::ofstream(folder / name, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return folder / name;
}

static void without_firmware(FalconRig& rig) {
  rig.change([](FalconModel& model) {
    model.firmware = some_firmware(1500);
    model.has_firmware = false;
  });
}

START_TEST(firmware_is_loaded_once) {
  const Folder folder;
  FalconRig rig;
  without_firmware(rig);
  const std::string path = written(folder, "good", some_firmware(1500));
  const std::string uri = "falcon:0?firmware=" + path;
  rig.change([](FalconModel& model) { model.deaf_greetings = 3; });
  {
    const Device device = open_device(uri.c_str());
    ck_assert(rig.see([](FalconModel& model) { return model.has_firmware; }));
    ck_assert(until([&] { return is_ready(device.get()); }));
  }
  std::filesystem::remove(path);  // it is not looked at where the device has its firmware already
  const Device device = open_device(uri.c_str());
  ck_assert(until([&] { return is_ready(device.get()); }));
}
END_TEST

START_TEST(a_device_without_firmware_says_so_and_takes_it) {
  const Folder folder;
  FalconRig rig;
  without_firmware(rig);
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return state_of(device.get()).flags == FS_STATE_FIRMWARE_MISSING; }));
  Pushing pushing(device.get(), {0.01, 0, 0});
  fs_answer answer;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_control(device.get(), "firmware=/nowhere", &answer), "/nowhere");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(device.get(), ("firmware=" + written(folder, "empty", {})).c_str(), &answer),
                  "must have 1..");
  const std::string path = written(folder, "good", some_firmware(1500));
  rig.change([](FalconModel& model) { model.wrong_echo_at = 700; });
  OK(fs_device_control(device.get(), ("firmware=" + path).c_str(), &answer));  // the second try
  ck_assert(until([&] { return rig.push() > 0.5; }));
  OK(fs_device_control(device.get(), ("firmware=" + path).c_str(), &answer));
  ck_assert(std::strstr(answer.text, "already"));
}
END_TEST

START_TEST(a_wrong_firmware_has_its_story) {
  const Folder folder;
  FalconRig rig;
  without_firmware(rig);
  fs_device* raw = nullptr;
  const auto expect = [&](const char* file, const char* word) {
    EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open(("falcon:0?firmware=" + (folder / file)).c_str(), &raw), word);
    std::printf("  %s\n", fs_last_error());
  };
  written(folder, "other", some_firmware(700));
  expect("other", "all was echoed, but then it does not answer");
  rig.change([](FalconModel& model) { model.deaf_greetings = 1000; });
  expect("other", "try 1: to the greeting 0a 43 0d nothing came back");
  expect("other", "try 3: the same");
  rig.change([](FalconModel& model) { model.deaf_greetings = 0; });
  // Unplugged in the middle of loading.
  rig.bus.unplug_at(1, UsbMoment::out, 30, Unplug::in_flight);
  EXPECT_SENTENCE(FS_ERROR_DISCONNECTED, fs_device_open(("falcon:0?firmware=" + (folder / "other")).c_str(), &raw), "unplugged");
}
END_TEST

// ------------------------------------------------------------------------------------------------- homing, lights, requests

START_TEST(without_homing_there_is_no_force) {
  FalconRig rig;
  rig.change([](FalconModel& model) { model.is_homed = model.homes_when_asked = false; });
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.lights; }) == 1 + 2; }));  // homing, red
  const uint64_t before = rig.see([](FalconModel& model) { return model.commands; });
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.commands; }) > before + 200; }));
  ck_assert_int_eq(rig.see([](FalconModel& model) { return model.most_motor; }), 0);
  ck_assert(until([&] { return pushing.event_with("it is not homed"); }));
  fs_answer answer;
  OK(fs_device_control(device.get(), "status", &answer));
  ck_assert_msg(std::strstr(answer.text, "not homed") == answer.text, "%s", answer.text);

  rig.change([](FalconModel& model) { model.homes_when_asked = true; });
  ck_assert(until([&] { return rig.push() > 0.5; }));
  ck_assert_int_eq(rig.see([](FalconModel& model) { return model.lights; }), 4);  // green

  // Asked for once more: no force meanwhile.
  rig.change([](FalconModel& model) {
    model.is_homed = model.homes_when_asked = false;
    model.most_motor = 0;
  });
  OK(fs_device_control(device.get(), "home", &answer));
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.lights; }) == 1 + 2; }));
  ck_assert(until([&] { return rig.push() == 0; }));
  rig.change([](FalconModel& model) { model.homes_when_asked = true; });
  ck_assert(until([&] { return rig.push() > 0.5; }));
}
END_TEST

START_TEST(requests) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  fs_answer answer;
  const auto lights = [&] { return rig.see([](FalconModel& model) { return model.lights; }); };
  OK(fs_device_control(device.get(), "lights=red+blue", &answer));
  ck_assert(until([&] { return lights() == 2 + 8; }));
  OK(fs_device_control(device.get(), "lights=off", &answer));
  ck_assert(until([&] { return lights() == 0; }));
  OK(fs_device_control(device.get(), "lights=auto", &answer));
  ck_assert(until([&] { return lights() == 4; }));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(device.get(), "lights=pink", &answer), "'pink'");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(device.get(), "lights=red+", &answer), "'red+'");
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(device.get(), "dance", &answer), "home, status, lights=");
  ck_assert(until([&] {
    OK(fs_device_control(device.get(), "status", &answer));
    return std::strstr(answer.text, "ready") == answer.text;
  }));
  std::printf("  %s\n", answer.text);
}
END_TEST

// ----------------------------------------------------------------------------------------------------------------- the rest

START_TEST(the_link_is_measured) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushing.stats().link_delay_p50 > 0; }));
  const fs_servo_stats stats = pushing.stats();
  std::printf("  round trip p50 %g, p99 %g ms, %g reports/s, loss %g\n", 1e3 * stats.link_delay_p50, 1e3 * stats.link_delay_p99,
              stats.link_rate, stats.link_loss);
  ck_assert_double_ge(stats.link_delay_p99, stats.link_delay_p50);
  ck_assert_double_gt(stats.link_delay_p50, 4e-4);  // the model needs 0.6 ms to answer
  ck_assert_double_gt(stats.link_rate, 50);
}
END_TEST

START_TEST(the_force_ends_with_the_device) {
  FalconRig rig;
  {
    const Device device = open_device("falcon:0");
    Pushing pushing(device.get(), {0.01, 0, 0});
    ck_assert(until([&] { return rig.push() > 0.5; }));
  }
  ck_assert_int_eq(rig.see([](FalconModel& model) { return model.motors[0] | model.motors[1] | model.motors[2]; }), 0);
  ck_assert_int_eq(rig.see([](FalconModel& model) { return model.lights; }), 0);
  ck_assert_uint_eq(rig.bus.counts(1).open_now, 0);
}
END_TEST

// The largest force anywhere, in the worst direction, fits the motors; with another constant the commands grow with it.
START_TEST(forces_fit_the_motors) {
  for (const auto& [uri, constant] : {std::pair("falcon:0", 1e4), std::pair("falcon:0?motor=28000", 28e3)}) {
    FalconRig rig;
    rig.change([](FalconModel& model) {
      model.target = {0.028, 0.040, 0.125 + 0.028};
      model.is_held_fast = true;
    });
    const Device device = open_device(uri);
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(device.get(), &info));
    ck_assert(until([&] { return is_ready(device.get()); }));
    for (int i = 0; i < 20; ++i) {
      fs_wrench wrench{};
      const double angle = 0.7 * i, up = std::sin(1.3 * i);
      wrench.force = 100.0 * fs_vec3{std::cos(angle), std::sin(angle), up};
      OK(fs_device_write(device.get(), &wrench));
      // The motors of the model have a constant of 1e4.
      const fs_vec3 wanted = (info.force_max * constant / 1e4) * unit(fs_vec3{wrench.force.x, wrench.force.z, -wrench.force.y});
      ck_assert(until([&] { return norm(rig.see([](FalconModel& model) { return model.force(); }) - wanted) < 0.03; }));
    }
    const int most = rig.see([](FalconModel& model) { return model.most_motor; });
    std::printf("  %s: force_max %g N, largest command %d\n", uri, info.force_max, most);
    ck_assert_int_le(most, 4096);
    ck_assert_int_gt(most, 2000);
  }
}
END_TEST

int main() {
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  Suite* suite = suite_create("usb_falcon");
  add_case(suite, "falcon",
           {positions_come_and_forces_go, row_of_the_table, what_is_not_there_is_named, a_machine_without_usb, a_node_that_may_not_be_opened,
            one_that_is_in_use, all_are_listed, firmware_is_loaded_once, a_device_without_firmware_says_so_and_takes_it,
            a_wrong_firmware_has_its_story, without_homing_there_is_no_force, requests, the_link_is_measured,
            the_force_ends_with_the_device, forces_fit_the_motors});
  return run_suite(suite);
}
