// FIDEL over USB without a bus: the packets of the page, the firmware beside the host, what watches the encoders, calibrations.
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <span>

#include "api/support.h"
#include "device/fidel/usb/calibration.h"
#include "device/fidel/usb/encoder_watch.h"
#include "device/fidel/usb/link_meter.h"
#include "device/fidel/usb/protocol.h"
#include "device/support/refusal.h"
#include "device/usb/fidel_model.h"
#include "scenes/folder.h"

using namespace scenes;
using namespace fs::fidel_usb;
using Bytes = std::vector<uint8_t>;

namespace {

Bytes bytes_of(const char* hex) {
  Bytes bytes;
  for (const char* at = hex; *at; at += at[2] ? 3 : 2) bytes.push_back(static_cast<uint8_t>(std::strtol(std::string(at, 2).c_str(), nullptr, 16)));
  return bytes;
}

// Section 7 of the page.
const Bytes report_vector = bytes_of("52 01 34 12 40 42 0f 00 f4 1d 00 00 ff ff ff ff 80 38 01 00 64 00 a9 fb 00 00 05 00 1f 00 ff 00 "
                                     "fa 00 03 00 00 00 35 32");
const Bytes command_vector = bytes_of("43 01 00 01 60 e3 16 00 80 c5 ab ff 00 00 00 00 00 00 00 00 90 d0 03 00 e0 5e f8 ff 00 00 a3 16");
const Bytes identity_vector = bytes_of("49 01 00 01 46 30 30 30 31 00 00 00 00 00 00 00 00 00 00 00 10 98 02 00 50 c3 00 00 40 0d 03 00 "
                                       "10 09 05 00 c0 45 04 00 80 38 01 00 20 4e 00 00 80 3a 54 00 20 a1 07 00 e0 2e 00 00 00 00 75 5f");
const Bytes status_vector = bytes_of("53 01 1f 00 40 42 0f 00 e8 03 00 00 de 03 00 00 03 00 00 00 01 00 00 00 02 00 00 00 00 00 10 a3");

bool is_same(std::span<const uint8_t> a, std::span<const uint8_t> b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

Bytes asked(FidelModel& model, uint8_t type, uint8_t request, uint16_t length) {
  uint8_t answer[FIDEL_IDENTITY_SIZE];
  const int size = fidel_firmware_control(&model.body().firmware, type, request, 0, 0, length, answer);
  return size < 0 ? Bytes{} : Bytes(answer, answer + size);
}
Report report_of(FidelModel& model) {
  uint8_t bytes[FIDEL_REPORT_SIZE];
  fidel_firmware_report(&model.body().firmware, bytes);
  const auto report = parse_report(bytes);
  ck_assert(report);
  return *report;
}
void command(FidelModel& model, const Command& command) {
  const auto bytes = packed(command);
  model.out(0x01, bytes, model.body().time);
}

// Runs what must throw a Refusal of this status whose sentence has this part.
template <class Call>
void expect_refusal(fs_status status, const char* part, Call call) {
  try {
    call();
  } catch (const fs::Refusal& refusal) {
    ck_assert_msg(refusal.status == status && refusal.text.find(part) != std::string::npos, "status %d: %s", refusal.status,
                  refusal.text.c_str());
    return;
  }
  ck_abort_msg("nothing was thrown, '%s' was expected", part);
}

}  // namespace

// -------------------------------------------------------------------------------------------------------------- packets

START_TEST(vectors_of_the_page) {
  const char digits[] = "123456789";
  ck_assert_uint_eq(crc16({reinterpret_cast<const uint8_t*>(digits), 9}), 0x29b1);
  const auto report = parse_report(report_vector);
  ck_assert(report);
  ck_assert_uint_eq(report->number, 0x1234);
  ck_assert_uint_eq(report->time, 1000000);
  ck_assert(report->joints == (std::array<int32_t, 3>{7668, -1, 80000}));
  ck_assert(report->wrist == (std::array<int16_t, 3>{100, -1111, 0}));
  ck_assert_uint_eq(report->buttons, 5);
  ck_assert_uint_eq(report->status, 0x1f);
  ck_assert_uint_eq(report->command, 0xff);
  ck_assert_uint_eq(report->command_age, 250);
  ck_assert_uint_eq(report->refused, 3);
  ck_assert(is_same(packed(*report), report_vector));

  const auto command = parse_command(command_vector);
  ck_assert(command);
  ck_assert_uint_eq(command->number, 0x100);
  ck_assert(command->joints == (std::array<int32_t, 3>{1500000, -5520000, 0}));
  ck_assert(command->wrist == (std::array<int32_t, 3>{0, 250000, -500000}));
  ck_assert(is_same(packed(*command), command_vector));

  const auto identity = parse_identity(identity_vector);
  ck_assert(identity);
  ck_assert_str_eq(identity->serial.data(), "F0001");
  ck_assert_uint_eq(identity->forearm, 330000);
  ck_assert_uint_eq(identity->joint_speed, 12000);
  const auto status = parse_status(status_vector);
  ck_assert(status);
  ck_assert_uint_eq(status->accepted, 990);
  ck_assert_uint_eq(status->watchdog, 2);
}
END_TEST

// The firmware was written from the page, not from the host's parser.
START_TEST(firmware_and_host_agree) {
  FidelModel model;
  ck_assert(is_same(asked(model, 0xc0, 1, 64), identity_vector));
  ck_assert_uint_eq(asked(model, 0xc0, 1, 8).size(), 8);
  model.run(0.01);
  Report report = report_of(model);
  ck_assert_uint_eq(report.status, status_homed | 7 * status_mark_1 | status_watchdog);
  ck_assert_uint_eq(report.command_age, 65535);
  command(model, {7, {1500000, -2520000, 0}, {0, 250000, -500000}});
  model.run(0.002);
  report = report_of(model);
  ck_assert_uint_eq(report.status, status_homed | 7 * status_mark_1 | status_motors);
  ck_assert_uint_eq(report.command, 7);
  ck_assert_uint_eq(report.command_age, 2000);
  ck_assert_int_eq(model.body().firmware.torques[1], -2520000);
  ck_assert_int_eq(model.body().firmware.torques[5], -500000);
  const auto status = parse_status(asked(model, 0xc0, 4, 32));
  ck_assert(status);
  ck_assert_uint_eq(status->accepted, 1);
  ck_assert_uint_eq(status->status, report.status);
  ck_assert_uint_eq(asked(model, 0xc0, 9, 64).size(), 0);  // stall
  ck_assert_uint_eq(asked(model, 0x40, 1, 64).size(), 0);

  // Every number, both ways.
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    const auto any = [&] { return static_cast<int32_t>(random()); };
    const Command sent{static_cast<uint16_t>(i + 8), {any(), any(), any()}, {any() / 5000, any() / 5000, any() / 5000}};
    command(model, sent);
    ck_assert_uint_eq(model.body().firmware.command_number, sent.number);
    model.body().firmware.inputs.counters[1] = any();
    const int32_t count = static_cast<int32_t>(static_cast<uint32_t>(model.body().firmware.inputs.counters[1]) +
                                               static_cast<uint32_t>(model.body().firmware.offsets[1]));
    ck_assert_int_eq(report_of(model).joints[1], count);
  }
  ck_assert_uint_eq(model.body().firmware.refused, 0);
}
END_TEST

START_TEST(what_is_damaged_counts_and_does_nothing) {
  FidelModel model;
  model.run(0.01);
  command(model, {1, {1000000, 0, 0}, {}});
  const auto good = packed(Command{2, {2000000, 0, 0}, {}});
  std::mt19937 random(2);
  uint32_t refused = 0;
  const auto offer = [&](const Bytes& bytes) {
    fidel_firmware_command(&model.body().firmware, bytes.data(), bytes.size(), model.body().clock);
    ck_assert_uint_eq(model.body().firmware.refused, ++refused);
    ck_assert_int_eq(model.body().firmware.wanted[0], 1000000);
    ck_assert(!parse_command(bytes));
  };
  for (size_t bit = 0; bit < 8 * good.size(); ++bit) {  // any single bit
    Bytes bytes(good.begin(), good.end());
    bytes[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    offer(bytes);
  }
  for (size_t size = 0; size < 64; ++size) {  // any other length
    Bytes bytes(good.begin(), good.end());
    bytes.resize(size);
    if (size != good.size()) offer(bytes);
  }
  for (int i = 0; i < 100000; ++i) {  // noise, half of it with the right beginning
    const size_t sizes[] = {command_size, report_size, identity_size, random() % 65};
    Bytes bytes(sizes[random() % 4]);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    if (i % 2 && bytes.size() > 2) bytes[0] = static_cast<uint8_t>("CRIS"[i / 2 % 4]), bytes[1] = 1;
    if (parse_command(bytes)) continue;  // one in 65536 of those with the right beginning has the right checksum, and bytes 28, 29 seldom
    offer(bytes);
    ck_assert(!parse_report(bytes) && !parse_identity(bytes) && !parse_status(bytes));
  }
  // A good checksum does not make bits good that must be 0.
  Bytes bytes(report_vector);
  bytes[29] |= 0x80;
  const uint16_t crc = crc16(std::span(bytes).first(38));
  bytes[38] = static_cast<uint8_t>(crc);
  bytes[39] = static_cast<uint8_t>(crc >> 8);
  ck_assert(!parse_report(bytes));
  for (size_t bit = 0; bit < 8 * report_vector.size(); ++bit) {
    Bytes damaged(report_vector);
    damaged[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    ck_assert(!parse_report(damaged));
  }
}
END_TEST

// --------------------------------------------------------------------------------------------- what protects the user

START_TEST(a_silent_host_is_no_force_within_20_ms) {
  FidelModel model;
  for (const double pause : {0.0004, 0.0, 0.0009}) {
    model.run(0.01 + pause);
    command(model, {static_cast<uint16_t>(model.body().firmware.command_number + 1), {1000000, 0, 0}, {}});
    const uint32_t last = model.body().clock;
    model.run(0.015);
    ck_assert_int_ne(model.body().firmware.torques[0], 0);
    model.run(0.1);
    ck_assert_int_eq(model.body().firmware.torques[0], 0);
    ck_assert_uint_lt(model.body().last_torque - last, 20000);
    ck_assert(report_of(model).status & status_watchdog);
  }
  ck_assert_uint_eq(model.body().firmware.watchdog, 3);
}
END_TEST

START_TEST(the_device_limits_again) {
  FidelModel model;
  model.run(0.01);
  command(model, {1, {11040000, -5520000, 2760000}, {100000, 2000000, 0}});
  model.run(0.001);
  const int32_t* const torques = model.body().firmware.torques;
  const int32_t wanted[] = {5520000, -2760000, 1380000, 25000, 500000, 0};
  for (int i = 0; i < 6; ++i) ck_assert_int_eq(torques[i], wanted[i]);
  ck_assert(report_of(model).status & status_limited);
  command(model, {2, {INT32_MIN, INT32_MIN, INT32_MIN}, {INT32_MIN, INT32_MAX, 0}});
  model.run(0.001);
  ck_assert_int_eq(torques[0], -5520000);
  ck_assert_int_eq(torques[3], -500000);
}
END_TEST

START_TEST(commands_out_of_turn_are_refused) {
  FidelModel model;
  model.run(0.01);
  const auto sent = [&](uint16_t number) {
    const uint32_t before = model.body().firmware.accepted;
    command(model, {number, {}, {}});
    return model.body().firmware.accepted > before;
  };
  ck_assert(sent(65000) && sent(65001) && !sent(65001) && !sent(65000) && !sent(64000) && sent(100) && !sent(65002) && sent(32867) && !sent(100));
  model.run(0.05);  // the watchdog: the host may be a new one
  ck_assert(sent(1) && !sent(1));
}
END_TEST

START_TEST(reasons_for_no_force) {
  FidelModel model;
  FidelBody& body = model.body();
  uint16_t number = 0;
  const auto has_force = [&] {
    command(model, {++number, {1000000, 0, 0}, {}});
    model.run(0.001);
    ck_assert_int_eq(body.firmware.torques[0] != 0, (report_of(model).status & status_motors) != 0);
    return body.firmware.torques[0] != 0;
  };
  model.run(0.01);
  ck_assert(has_force());
  body.inputs.stop_pressed = 1;
  ck_assert(!has_force());
  ck_assert_uint_eq(asked(model, 0x40, 3, 0).size(), 0);
  body.inputs.stop_pressed = 0;
  model.run(0.001);
  ck_assert(!has_force());  // it is held until it is cleared
  ck_assert(report_of(model).status & status_emergency_stop);
  asked(model, 0x40, 3, 0);
  ck_assert(has_force());
  body.inputs.hot = 1;
  ck_assert(!has_force() && report_of(model).status & status_over_heated);
  body.inputs.hot = 0;
  body.inputs.no_supply = 1;
  ck_assert(!has_force() && report_of(model).status & status_no_supply);
  body.inputs.no_supply = 0;
  ck_assert(has_force());
  body.velocity = {0, 0, 6};  // m/s
  for (int i = 0; i < 6; ++i) has_force();
  ck_assert(!has_force() && report_of(model).status & status_over_speed);
  model.run(1);
  asked(model, 0x40, 3, 0);
  ck_assert(has_force());
  asked(model, 0x40, 2, 0);  // home
  ck_assert(!has_force() && !(report_of(model).status & status_homed));
}
END_TEST

START_TEST(homing) {
  FidelModel model({.is_homed = false});
  FidelBody& body = model.body();
  model.run(0.01);
  ck_assert(!(report_of(model).status & status_homed));
  body.target = {0, 0, -0.04};
  model.run(1);
  body.target = {0, 0, 0.06};
  model.run(1);
  ck_assert(report_of(model).status & status_homed);
  body.target = {0.03, -0.02, 0.01};
  model.run(3);
  const Report report = report_of(model);
  const Arm arm(*parse_identity(identity_vector));
  const auto measured = arm.measured(report.joints, report.wrist, {});
  ck_assert_int_eq(measured.place, Arm::good);
  EXPECT_VECTOR(measured.pose.position, body.position, 2e-5);
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- the arm

START_TEST(forces_are_what_was_wanted) {
  const Arm arm(*parse_identity(identity_vector));
  EXPECT_NEAR(arm.force_max(), 25, 0);
  FidelModel model;
  FidelBody& body = model.body();
  uint16_t number = 0;
  for (const fs_vec3 place : {fs_vec3{}, fs_vec3{0.1, 0.05, 0.08}, fs_vec3{-0.07, 0.12, -0.09}}) {
    body.target = place;
    model.run(2);
    for (const fs_vec3 force : {fs_vec3{5, 0, 0}, fs_vec3{0, -3, 1}, fs_vec3{1, 2, -4}, fs_vec3{10, 20, -100}}) {
      model.run(1);
      const Report report = report_of(model);
      const auto measured = arm.measured(report.joints, report.wrist, {});
      EXPECT_VECTOR(measured.pose.position, body.position, 3e-5);
      Command wanted = arm.command(measured, {force, {0.1, 0, 0.2}});
      wanted.number = ++number;
      command(model, wanted);
      model.run(0.001);
      const double length = norm(body.force);
      if (norm(force) <= 25) EXPECT_VECTOR(body.force, force, 5e-3);
      else EXPECT_VECTOR((norm(force) / length) * body.force, force, 0.1);  // the direction is kept
      ck_assert_double_lt(length, 60);
      ck_assert_uint_eq(body.firmware.limited, 0);
    }
  }
  // A distorted identity is refused.
  Identity identity = *parse_identity(identity_vector);
  identity.forearm = 100000;
  expect_refusal(FS_ERROR_IO, "do not reach", [&] { Arm{identity}; });
  identity.forearm = 3;
  expect_refusal(FS_ERROR_IO, "forearm", [&] { Arm{identity}; });
  // Where the encoders tell nonsense there is a reason, and no torque.
  const auto away = arm.measured({0, 0, 20000}, {0, 0, 0}, {});
  ck_assert_int_ne(away.place, Arm::good);
  ck_assert(arm.command(away, {{1, 1, 1}, {}}).joints == (std::array<int32_t, 3>{}));
  ck_assert_int_eq(arm.measured({INT32_MAX, INT32_MIN, 0}, {0, 0, 0}, {}).place != Arm::good, 1);
  ck_assert_int_eq(arm.measured({7600, 7600, 7600}, {0, 3000, 0}, {}).place, Arm::twisted);
}
END_TEST

START_TEST(encoders_are_watched) {
  EncoderWatch watch(80000, 12);
  const auto judge = [&](int32_t a, int32_t b, int32_t c) { return watch.judge({a, b, c}, 1e-3); };
  ck_assert_int_eq(judge(0, 0, 0), EncoderWatch::plausible);
  ck_assert_int_eq(judge(190, -190, 100), EncoderWatch::plausible);  // 14.9 rad/s
  ck_assert_int_eq(judge(800, -200, 100), EncoderWatch::jumped);
  for (int i = 0; i < 1000; ++i) ck_assert_int_eq(judge(800, -200, 100), EncoderWatch::jumped);  // for as long as it lasts
  for (int i = 1; i <= 150; ++i) ck_assert_int_eq(judge(800 - 10 * i, -200 + 5 * i, 100 + i), EncoderWatch::jumped);  // the hand goes on
  for (int i = 0; i < 10; ++i) ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::jumped);  // back by 600
  ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::plausible);
  for (int i = 0; i < 100; ++i) ck_assert_int_eq(judge(-1300 + 5000 * (i % 7), 550, 250), i ? EncoderWatch::jumped : EncoderWatch::plausible);
  watch.forget();
  ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::plausible);
  ck_assert_int_eq(watch.judge({30000, 15000, -20000}, 1.0), EncoderWatch::plausible);  // a second without reports
  watch.forget();
  ck_assert_int_eq(judge(-70000, 5, 5), EncoderWatch::plausible);

  // Stuck: the others move by 5 degrees, which is 1111 counts.
  watch.forget();
  EncoderWatch::Verdict verdict = EncoderWatch::plausible;
  int moved = 0;
  for (; verdict == EncoderWatch::plausible && moved < 3000; moved += 20) verdict = judge(100, moved, -moved);
  ck_assert_int_eq(verdict, EncoderWatch::stuck);
  ck_assert_int_ge(moved, 1100);
  ck_assert_int_le(moved, 1200);
  ck_assert_int_eq(judge(101, moved, -moved), EncoderWatch::stuck);
  watch.forget();
  ck_assert_int_eq(judge(101, moved, -moved), EncoderWatch::plausible);

  // A hand at its slowest and at rest, and joints that turn back.
  FidelModel model;
  model.body().shakes = true;
  watch.forget();
  for (int i = 0; i < 5000; ++i) {
    if (i == 2500) model.body().shakes = false;
    model.run(0.001);
    ck_assert_int_eq(watch.judge(report_of(model).joints, 1e-3), EncoderWatch::plausible);
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------------- calibration

START_TEST(calibrations_are_found_and_kept) {
  const Arm arm(*parse_identity(identity_vector));
  const double errors[3] = {0.02, -0.015, 0.01}, scale = 1.02;
  FidelModel model({.mark_errors = {errors[0], errors[1], errors[2]}, .scale = scale});
  const auto counts_at = [&](fs_vec3 place) {
    model.body().target = place;
    model.run(4);
    const auto joints = report_of(model).joints;
    return std::array<double, 3>{double(joints[0]), double(joints[1]), double(joints[2])};
  };
  const auto first = counts_at(first_place), second = counts_at(second_place);
  const Calibration found = calibrated(arm, first, second);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(found.offsets[i], errors[i], 1e-4);
  EXPECT_NEAR(found.scale, scale, 1e-3);
  model.body().target = {-0.05, 0.08, 0.06};
  model.run(4);
  const Report report = report_of(model);
  EXPECT_VECTOR(arm.measured(report.joints, report.wrist, found).pose.position, model.body().position, 1e-4);
  expect_refusal(FS_ERROR_INVALID, "offsets", [&] { calibrated(arm, {0, 0, 0}, second); });
  expect_refusal(FS_ERROR_INVALID, "scale", [&] { calibrated(arm, first, first); });
  expect_refusal(FS_ERROR_INVALID, "to the right", [&] { calibrated(arm, first, counts_at({0, -0.1, 0})); });

  const Folder folder;
  setenv("XDG_CONFIG_HOME", folder.path.c_str(), 1);
  const std::string file = calibration_file("F0001");
  ck_assert(file == folder / "forceserver/fidel-F0001.json");
  ck_assert(!read_calibration(file, "F0001"));
  write_calibration(file, "F0001", found);
  const auto kept = read_calibration(file, "F0001");
  ck_assert(kept && kept->offsets == found.offsets && kept->scale == found.scale);
  write_calibration(file, "F0001", {});  // a good one is replaced
  ck_assert(read_calibration(file, "F0001")->scale == 1);
  ck_assert_int_eq(std::distance(std::filesystem::directory_iterator(folder / "forceserver"), {}), 1);  // nothing else is left
  setenv("XDG_CONFIG_HOME", "relative", 1);
  setenv("HOME", folder.path.c_str(), 1);
  ck_assert(calibration_file("F0001") == folder / ".config/forceserver/fidel-F0001.json");

  expect_refusal(FS_ERROR_INVALID, "but the device is 'F0002'", [&] { read_calibration(file, "F0002"); });
  const auto bad = [&](const char* text, const char* part) {
    std::ofstream(file, std::ios::trunc) << text;
    expect_refusal(FS_ERROR_INVALID, part, [&] { read_calibration(file, "F0001"); });
    expect_refusal(FS_ERROR_INVALID, "move it away", [&] { write_calibration(file, "F0001", found); });
    std::ifstream stream(file);
    ck_assert(std::string(std::istreambuf_iterator<char>(stream), {}) == text);
  };
  bad("", "no JSON");
  bad("{\"format\":", "no JSON");
  bad("[1]", "no JSON");
  bad("{}", "format");
  const std::string head = "{\"format\": \"forceserver calibration of FIDEL\", \"version\": ";
  bad((head + "2}").c_str(), "version is 2");
  bad((head + "1, \"serial\": 5}").c_str(), "serial is 5");
  bad((head + "1, \"serial\": \"F0001\", \"joint_offsets\": [0, 0]}").c_str(), "joint_offsets");
  bad((head + "1, \"serial\": \"F0001\", \"joint_offsets\": [0, 0, 7], \"scale\": 1}").c_str(), "is 7");
  bad((head + "1, \"serial\": \"F0001\", \"joint_offsets\": [0, 0, 0], \"scale\": \"big\"}").c_str(), "scale is \"big\"");
  bad((head + "1, \"serial\": \"F0001\", \"joint_offsets\": [0, 0, 0]}").c_str(), "scale is null");
}
END_TEST

// ---------------------------------------------------------------------------------------------------------- the link

START_TEST(the_link_is_measured) {
  LinkMeter meter;
  fs_link link{};
  ck_assert_int_eq(meter.get(link), FS_ERROR_UNSUPPORTED);
  // 400 us there, 300 us back, and the device takes 200 us to make a report. Each tenth report is lost.
  for (int i = 1; i <= 3000; ++i) {
    const double now = 100 + 1e-3 * i;
    Report report{};
    report.number = static_cast<uint16_t>(i);
    report.command = static_cast<uint16_t>(i);
    report.command_age = 200;
    meter.sent(static_cast<uint16_t>(i), now);
    if (i % 10) meter.came(report, i % 10 == 1 && i > 1, now + 9e-4);
  }
  ck_assert_int_eq(meter.get(link), FS_OK);
  EXPECT_NEAR(link.delay, 7e-4, 1e-5);
  EXPECT_NEAR(link.delay_p99, 7e-4, 1e-5);
  EXPECT_NEAR(link.rate, 900, 5);
  EXPECT_NEAR(link.loss, 0.1, 0.01);
  ck_assert_uint_eq(meter.lost(), 299);

  // The device's clock runs 100 us/s fast and wraps; reports come 0.1 to 2 ms late.
  DeviceClock clock;
  std::mt19937 random(3);
  double worst = 0, last = 0;
  for (int i = 0; i < 20000; ++i) {
    const double made = 50 + 1e-3 * i, late = 1e-4 + 1.9e-3 * (random() % 1000) / 1000;
    const auto device = static_cast<uint32_t>(static_cast<uint64_t>(4290000000 + 1e6 * (made - 50) * 1.0001));
    const double time = clock.time_of(device, made + late);
    ck_assert_double_le(time, made + late);
    if (i > 100) worst = std::max(worst, std::fabs(time - made));
    if (i > 100) ck_assert_double_gt(time, last);
    last = time;
  }
  ck_assert_double_lt(worst, 1e-3);
  const double jumped = clock.time_of(17, 100);  // it has begun anew
  ck_assert_double_le(jumped, 100);
  EXPECT_NEAR(clock.time_of(1017, 100.001), 100.001, 0.051);
}
END_TEST

int main() {
  Suite* suite = suite_create("fidel_protocol");
  add_case(suite, "packets", {vectors_of_the_page, firmware_and_host_agree, what_is_damaged_counts_and_does_nothing});
  add_case(suite, "device", {a_silent_host_is_no_force_within_20_ms, the_device_limits_again, commands_out_of_turn_are_refused,
                             reasons_for_no_force, homing});
  add_case(suite, "host", {forces_are_what_was_wanted, encoders_are_watched, calibrations_are_found_and_kept, the_link_is_measured});
  return run_suite(suite);
}
