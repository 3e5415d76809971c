// The host's part of FIDEL over USB without a bus: kinematics, what watches the encoders, calibrations, the measured link.
#include <algorithm>
#include <fstream>
#include <random>

#include "device/fidel/usb/calibration.h"
#include "device/fidel/usb/device_clock.h"
#include "device/support/encoder_watch.h"
#include "device/support/link_meter.h"
#include "device/support/refusal.h"
#include "device/usb/fidel_packets.h"
#include "scenes/folder.h"

using namespace scenes;
using fs::EncoderWatch, fs::LinkMeter;

namespace {

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
  EncoderWatch watch({190985, 16, 1111});  // a joint with 80000 counts a revolution, at 15 rad/s
  const auto judge = [&](int32_t a, int32_t b, int32_t c) { return watch.judge({a, b, c}, 1e-3); };
  ck_assert_int_eq(judge(0, 0, 0), EncoderWatch::good);
  ck_assert_int_eq(judge(190, -190, 100), EncoderWatch::good);  // 14.9 rad/s
  ck_assert_int_eq(judge(800, -200, 100), EncoderWatch::jumped);
  for (int i = 0; i < 1000; ++i) ck_assert_int_eq(judge(800, -200, 100), EncoderWatch::jumped);  // for as long as it lasts
  for (int i = 1; i <= 150; ++i)
    ck_assert_int_eq(judge(800 - 10 * i, -200 + 5 * i, 100 + i), EncoderWatch::jumped);  // the hand goes on
  for (int i = 0; i < 10; ++i) ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::jumped);  // back by 600
  ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::good);
  for (int i = 0; i < 100; ++i)
    ck_assert_int_eq(judge(-1300 + 5000 * (i % 7), 550, 250), i ? EncoderWatch::jumped : EncoderWatch::good);
  watch.forget();
  ck_assert_int_eq(judge(-1300, 550, 250), EncoderWatch::good);
  ck_assert_int_eq(watch.judge({30000, 15000, -20000}, 1.0), EncoderWatch::good);  // a second without reports
  watch.forget();
  ck_assert_int_eq(judge(-70000, 5, 5), EncoderWatch::good);
  // A jump that is hardly one stays a jump: nothing has jumped back.
  ck_assert_int_eq(judge(-70300, 5, 5), EncoderWatch::jumped);
  for (int i = 0; i < 100; ++i) ck_assert_int_eq(judge(-70300, 5, 5), EncoderWatch::jumped);

  // Stuck: the others move by 5 degrees, which is 1111 counts.
  watch.forget();
  EncoderWatch::Verdict verdict = EncoderWatch::good;
  int moved = 0;
  for (; verdict == EncoderWatch::good && moved < 3000; moved += 20) verdict = judge(100, moved, -moved);
  ck_assert_int_eq(verdict, EncoderWatch::stuck);
  ck_assert_int_ge(moved, 1100);
  ck_assert_int_le(moved, 1200);
  ck_assert_int_eq(judge(101, moved, -moved), EncoderWatch::stuck);
  watch.forget();
  ck_assert_int_eq(judge(101, moved, -moved), EncoderWatch::good);

  // A hand at its slowest and at rest, and joints that turn back.
  FidelModel model;
  model.body().shakes = true;
  watch.forget();
  for (int i = 0; i < 5000; ++i) {
    if (i == 2500) model.body().shakes = false;
    model.run(0.001);
    ck_assert_int_eq(watch.judge(report_of(model).joints, 1e-3), EncoderWatch::good);
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
  LinkMeter::Totals totals;
  fs_link link{};
  link.struct_size = sizeof link;
  ck_assert_int_eq(meter.tell(100, totals, link), FS_ERROR_UNSUPPORTED);
  // Each fifth of 500 states a second is lost, and each tenth command; in each second two delays are long. The counts go round.
  const auto run = [&](double begin, double end) {
    totals.sent += 0xfffff000u;
    totals.came += 0xfffff000u;
    for (int i = 1; begin + 2e-3 * i < end; ++i) {
      totals.sent += 2;
      totals.states += i % 5 != 0;
      totals.came += (i % 5 != 0) + (i % 10 != 0);
      meter.note_delay(i % 50 ? 0.01 : 0.03);
      if (i % 20 == 0) meter.tell(begin + 2e-3 * i, totals, link);
    }
  };
  run(100, 104);
  ck_assert_uint_eq(link.struct_size, sizeof link);
  EXPECT_NEAR(link.delay, 0.01, 1e-6);
  EXPECT_NEAR(link.delay_p99, 0.03, 1e-6);
  EXPECT_NEAR(link.rate, 400, 10);
  EXPECT_NEAR(link.loss, 0.15, 0.01);
  // What came before a pause counts no more: neither its rate nor its loss.
  totals.sent += 100000;
  ck_assert_int_eq(meter.tell(200, totals, link), FS_ERROR_UNSUPPORTED);
  ck_assert_int_eq(meter.tell(200.04, {totals.states + 16, totals.sent + 20, totals.came + 20}, link), FS_OK);
  EXPECT_NEAR(link.rate, 400, 1);
  ck_assert_double_eq(link.loss, 0);
}
END_TEST

// Half of the time by which states come later than a period counts as delay.
START_TEST(states_that_come_seldom) {
  const auto delay_at = [](double interval) {
    LinkMeter meter;
    fs_link link{};
    for (uint32_t i = 1; i <= 1000; ++i) {
      meter.note_state(100 + interval * i, 1e-3);
      meter.note_delay(2e-3);
      if (i % 4 == 0) meter.tell(100 + interval * i, {i, i, i}, link);
    }
    return link.delay;
  };
  EXPECT_NEAR(delay_at(5e-4), 2e-3, 1e-5);
  EXPECT_NEAR(delay_at(1e-3), 2e-3, 1e-5);
  EXPECT_NEAR(delay_at(5e-3), 4e-3, 1e-5);
  EXPECT_NEAR(delay_at(0.1), 22e-3, 1e-5);  // 20 ms are added at most
}
END_TEST

START_TEST(the_device_clock_is_mapped) {
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
  Suite* suite = suite_create("fidel_host");
  add_case(suite, "host",
           {forces_are_what_was_wanted, encoders_are_watched, calibrations_are_found_and_kept, the_link_is_measured, states_that_come_seldom,
            the_device_clock_is_mapped});
  return run_suite(suite);
}
