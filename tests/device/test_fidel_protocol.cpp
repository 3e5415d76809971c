// FIDEL over USB without a bus: the packets of the page, the firmware beside the host, and what protects the user.

#include <algorithm>
#include <random>
#include <span>

#include "device/fidel/usb/arm.h"
#include "device/usb/fidel_packets.h"

using namespace scenes;

namespace {

// Section 7 of the page.
const Bytes report_vector = bytes_of(
    "52 01 34 12 40 42 0f 00 f4 1d 00 00 ff ff ff ff 80 38 01 00 64 00 a9 fb 00 00 05 00 1f 00 ff 00 "
    "fa 00 03 00 00 00 35 32");
const Bytes command_vector =
    bytes_of("43 01 00 01 60 e3 16 00 80 c5 ab ff 00 00 00 00 00 00 00 00 90 d0 03 00 e0 5e f8 ff 00 00 a3 16");
const Bytes status_vector =
    bytes_of("53 01 1f 00 40 42 0f 00 e8 03 00 00 de 03 00 00 03 00 00 00 01 00 00 00 02 00 00 00 00 00 10 a3");

bool is_same(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

Bytes asked(FidelModel& model, uint8_t type, uint8_t request, uint16_t length) {
  uint8_t answer[FIDEL_IDENTITY_SIZE];
  const int size = fidel_firmware_control(&model.body().firmware, type, request, 0, 0, length, answer);
  return size < 0 ? Bytes{} : Bytes(answer, answer + size);
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
    if (parse_command(bytes))
      continue;  // one in 65536 of those with the right beginning has the right checksum, and bytes 28, 29 seldom
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
  ck_assert(sent(65000) && sent(65001) && !sent(65001) && !sent(65000) && !sent(64000) && sent(100) && !sent(65002) &&
            sent(32867) && !sent(100));
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

int main() {
  Suite* suite = suite_create("fidel_protocol");
  add_case(suite, "packets", {vectors_of_the_page, firmware_and_host_agree, what_is_damaged_counts_and_does_nothing});
  add_case(suite, "device",
           {a_silent_host_is_no_force_within_20_ms, the_device_limits_again, commands_out_of_turn_are_refused,
            reasons_for_no_force, homing});
  return run_suite(suite);
}
