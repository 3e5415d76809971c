// The parts of the driver falcon that need no device: packets, kinematics, motors.
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include <check.h>
#undef fail  // an old name of check.h

#include "device/falcon/kinematics.h"
#include "device/falcon/packet.h"
#include "device/support/usb.h"

using namespace fs;
using namespace fs::falcon;

namespace {

using Counts = std::array<int16_t, 3>;

Packet bytes_of(const char* text) {  // "3c 50 .."
  Packet packet{};
  for (size_t i = 0; i < packet.size(); ++i) packet[i] = static_cast<uint8_t>(std::strtol(text + 3 * i, nullptr, 16));
  return packet;
}

Packet report_with(const Counts& encoders, uint8_t bits) {  // the coding of the numbers is that of a command
  Packet packet = packet_of({encoders, 0});
  packet[13] = static_cast<uint8_t>('A' + bits);
  return packet;
}

std::vector<Report> found_in(const std::vector<uint8_t>& bytes, Reports& reports) {
  std::vector<Report> found;
  reports.put(bytes.data(), bytes.size(), [&](const Report& report) { found.push_back(report); });
  return found;
}

// Calls visit(position) for random positions of the workspace, and `beyond` (m) around it.
template <class Visit>
void visit_workspace(double beyond, Visit visit) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int i = 0; i < 20000; ++i) {
    const double radius = (workspace_radius + beyond) * std::sqrt(std::fabs(any(random))), angle = 3.15 * any(random);
    visit(centre + Vec3{radius * std::cos(angle), (workspace_height / 2 + beyond) * any(random), radius * std::sin(angle)});
  }
}

double count_of(double angle) { return (angle - angle_at_zero) / radians_per_count; }

}  // namespace

START_TEST(packets_equal_the_known_ones) {
  ck_assert(packet_of({{4095, 3906, 4034}, light_green}) == bytes_of("3c 50 50 50 41 43 45 50 41 43 4d 50 41 45 41 3e"));
  ck_assert(packet_of({}) == bytes_of("3c 41 41 41 41 41 41 41 41 41 41 41 41 41 41 3e"));
  const auto report = report_of(report_with({-200, 32767, -32768}, homed_first * 5 + button_centre));
  ck_assert(report && report->encoders == (Counts{-200, 32767, -32768}) && report->bits == 16 * 5 + 4);
  // Each number there and back.
  for (int value = -32768; value <= 32767; value += 13) {
    const auto number = static_cast<int16_t>(value);
    ck_assert(report_of(packet_of({{number, 7, static_cast<int16_t>(-7)}, 0}))->encoders[0] == number);
  }
  // A byte that is none at its place.
  for (size_t i = 0; i <= 13; ++i) {
    Packet packet = packet_of({});
    packet[i] = '@';
    ck_assert(!report_of(packet));
  }
}
END_TEST

START_TEST(reports_are_found_in_a_stream) {
  const Packet good = report_with({1, -2, 3}, all_homed);
  std::mt19937 random(3);
  for (int round = 0; round < 2000; ++round) {
    Reports reports;
    std::vector<uint8_t> bytes(random() % 40);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 4 ? random() : '<');
    if (round % 2) bytes.insert(bytes.end(), good.begin(), good.begin() + random() % 16);  // one that was cut
    for (int i = 0; i < 3; ++i) bytes.insert(bytes.end(), good.begin(), good.end());
    size_t good_ones = 0;
    for (size_t at = 0; at < bytes.size();) {  // in pieces
      const size_t size = std::min<size_t>(1 + random() % 20, bytes.size() - at);
      for (const Report& report : found_in({bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.begin() + static_cast<std::ptrdiff_t>(at + size)}, reports))
        good_ones += report.encoders == Counts{1, -2, 3};
      at += size;
    }
    ck_assert_uint_eq(good_ones, 3);  // a false beginning costs none that is whole
  }
  // Without trouble nothing is lost, and nothing is stray.
  Reports reports;
  std::vector<uint8_t> bytes;
  for (int i = 0; i < 50; ++i) bytes.insert(bytes.end(), good.begin(), good.end());
  ck_assert_uint_eq(found_in(bytes, reports).size(), 50);
  ck_assert_uint_eq(reports.stray(), 0);
  ck_assert_uint_eq(found_in({1, 2, 3}, reports).size(), 0);
  ck_assert_uint_eq(reports.stray(), 3);
}
END_TEST

START_TEST(angles_equal_the_known_ones) {
  const struct {
    Vec3 position;
    double counts[3];
  } known[] = {{{0, 0, .125}, {-200.1, -200.1, -200.1}}, {{0, 0, .075}, {-1463.4, -1463.4, -1463.4}},
               {{0, 0, .170}, {871.6, 871.6, 871.6}},    {{.03, 0, .125}, {60.0, -616.7, 232.3}},
               {{0, .03, .125}, {-608.9, 30.4, 253.5}},  {{-.02, .025, .140}, {-250.7, 585.8, 319.5}}};
  for (const auto& each : known) {
    const Vec3 angles = *angles_at(each.position);
    ck_assert_double_eq_tol(count_of(angles.x), each.counts[0], 0.06);
    ck_assert_double_eq_tol(count_of(angles.y), each.counts[1], 0.06);
    ck_assert_double_eq_tol(count_of(angles.z), each.counts[2], 0.06);
  }
  const Mat3 torques = transposed(*jacobian_at(centre));
  const Vec3 x = torques * Vec3{1, 0, 0}, z = torques * Vec3{0, 0, 1};
  ck_assert_double_lt(norm(x - Vec3{.0179, -.0606, .0427}), 1e-4);
  ck_assert_double_lt(norm(z - Vec3{.0252, .0252, .0252}), 1e-4);
  ck_assert(!angles_at({0, 0, 0.4}) && !angles_at({0.2, 0, 0.1}));
}
END_TEST

START_TEST(round_trips_over_the_workspace) {
  double warm_error = 0, cold_error = 0;
  int lost = 0, all = 0;
  Vec3 before = centre;
  visit_workspace(0.003, [&](Vec3 p) {
    const auto angles = angles_at(p);
    ck_assert(angles);
    ++all;
    const auto cold = pose_at(*angles);
    if (!cold) return void(++lost);
    cold_error = std::max(cold_error, norm(cold->position - p));
    const auto warm = pose_from(*angles, p + 0.05 * (before - p));
    ck_assert(warm);
    warm_error = std::max(warm_error, norm(warm->position - p));
    before = p;
  });
  std::printf("  largest |FK(IK(x)) - x| of %d: warm %.2g m, cold %.2g m; lost when cold: %d\n", all, warm_error, cold_error, lost);
  ck_assert_int_eq(lost, 0);
  ck_assert_double_lt(warm_error, 1e-9);
  ck_assert_double_lt(cold_error, 1e-9);
}
END_TEST

START_TEST(the_jacobian_equals_differences) {
  constexpr double step = 1e-6;
  double error = 0, lever = 0;
  visit_workspace(0, [&](Vec3 p) {
    const Mat3 j = *jacobian_at(p);
    for (const Vec3 way : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
      const Vec3 rates = (1 / (2 * step)) * (*angles_at(p + step * way) - *angles_at(p - step * way));
      error = std::max(error, norm(j * rates - way));
    }
    lever = std::max({lever, norm(Vec3{j.xx, j.yx, j.zx}), norm(Vec3{j.xy, j.yy, j.zy}), norm(Vec3{j.xz, j.yz, j.zz})});
  });
  std::printf("  the Jacobian differs from differences by %.2g; longest lever %.5f m (%.5f)\n", error, lever, longest_lever());
  ck_assert_double_lt(error, 1e-6);
  ck_assert_double_le(lever, longest_lever() * 1.001);
  ck_assert_double_gt(lever, longest_lever() * 0.95);
}
END_TEST

START_TEST(motors_are_scaled_together) {
  const auto exact = commands_of({0.1, -0.2, 0.05}, 1e4);
  ck_assert(exact == (Counts{-1000, 2000, -500}));
  const auto scaled = commands_of({1, -2, 0.5}, 1e4);
  ck_assert(scaled == (Counts{-2048, 4096, -1024}));
  ck_assert(commands_of({NAN, 0, 0}, 1e4) == (Counts{}));
  ck_assert(commands_of({1e300, 0, INFINITY}, 1e4) == (Counts{}));
}
END_TEST

START_TEST(who_has_a_file_open) {
  char path[] = "/tmp/forceserver-test-XXXXXX";
  const int file = mkstemp(path);
  ck_assert_int_ge(file, 0);
  const std::string pid = "(pid " + std::to_string(getpid()) + ")";
  ck_assert(programs_that_use(path) == "this program " + pid);
  ck_assert(programs_that_use(path, 1).empty());
  const pid_t child = fork();
  if (child == 0) {
    pause();
    _exit(0);
  }
  close(file);
  const std::string users = programs_that_use(path);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ck_assert_msg(users == "test_falcon (pid " + std::to_string(child) + ")", "%s", users.c_str());
  ck_assert(programs_that_use(path).empty());
  unlink(path);
}
END_TEST

int main() {
  Suite* suite = suite_create("falcon");
  TCase* tests = tcase_create("falcon");
  tcase_set_timeout(tests, 120);
  tcase_add_test(tests, packets_equal_the_known_ones);
  tcase_add_test(tests, reports_are_found_in_a_stream);
  tcase_add_test(tests, angles_equal_the_known_ones);
  tcase_add_test(tests, round_trips_over_the_workspace);
  tcase_add_test(tests, the_jacobian_equals_differences);
  tcase_add_test(tests, motors_are_scaled_together);
  tcase_add_test(tests, who_has_a_file_open);
  suite_add_tcase(suite, tests);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
