// The simulated FIDEL through its device handle: options, delay, time, paths, and no allocation at the servo rate.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <numbers>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include "support.h"

#include "device/sim/sim.h"
#include "driver/registry.h"

using namespace fs;

// Counts what is allocated while `counting` is set.
static bool counting = false;
static int allocations = 0;
[[gnu::noinline]] void* operator new(size_t size) {
  if (counting) ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept { std::free(memory); }

namespace {

const std::string plain = "sim:?encoder=ideal&friction=0";

// ---------------------------------------------------------------------------------------------------- options

START_TEST(info_of_the_simulator) {
  const auto device = open_device("sim:");
  const fs_device_info& info = device->info();
  ck_assert_str_eq(info.name, "FIDEL (simulated)");
  ck_assert_str_eq(info.serial, "sim-0");
  ck_assert_uint_eq(info.force_axes, 3);
  ck_assert_uint_eq(info.torque_axes, 0);
  ck_assert_double_eq(info.workspace_radius, 0.15);
  ck_assert_double_eq(info.workspace_height, 0.2);
  ck_assert_double_eq_tol(info.workspace_angle, 20 * std::numbers::pi / 180, 1e-15);
  ck_assert_double_eq(info.force_max, 25);
  ck_assert_double_eq(info.torque_max, 0);
  ck_assert_double_eq(info.resolution, 20e-6);
  ck_assert_double_eq(info.rate, 1000);
  ck_assert_double_eq(info.delay, 0);
  ck_assert_double_eq(info.damping, 1);
  ck_assert_double_eq(info.mass, 0.3);
  const auto other = open_device("sim:?wrist=active&delay_ms=7.31&mass=0.1&encoder=ideal");
  ck_assert_uint_eq(other->info().torque_axes, 3);
  ck_assert_double_eq(other->info().torque_max, 0.5);
  ck_assert_double_eq_tol(other->info().delay, 7.3e-3, 1e-12);  // on the grid of 25 us
  ck_assert_double_eq(other->info().mass, 0.1);
  ck_assert_double_eq(other->info().resolution, 0);
}
END_TEST

START_TEST(list_of_the_simulator) {
  const fs_driver* driver = find_driver("sim");
  ck_assert(driver);
  size_t count = 0;
  ck_assert_int_eq(driver->list(nullptr, 0, &count), FS_OK);
  ck_assert_uint_eq(count, 1);
  fs_device_entry entry;
  driver->list(&entry, 1, &count);
  ck_assert_str_eq(entry.uri, "sim:");
  ck_assert_str_eq(entry.label, "simulated FIDEL");
}
END_TEST

START_TEST(bad_options_each_with_its_sentence) {
  const struct { const char *uri, *part; } cases[] = {
      {"sim:x", "takes no address, is 'x'"},
      {"sim:?color=red", "'color' is unknown; the options are hand, hand_mass"},
      {"sim:?hand=heavy", "hand is 'heavy', must be one of nominal, firm, light, released"},
      {"sim:?hand_mass=-1", "hand_mass is '-1', must be a number within 0..10"},
      {"sim:?hand_damping=1e9", "hand_damping is '1e9'"},
      {"sim:?hand_stiffness=nan", "hand_stiffness is 'nan'"},
      {"sim:?hold=0,0", "hold is '0,0', must be three numbers"},
      {"sim:?hold=0,0,2", "each within -1..1"},
      {"sim:?mass=0", "mass is '0', must be a number within 0.01..10"},
      {"sim:?friction=x", "friction is 'x'"},
      {"sim:?encoder=perfect", "encoder is 'perfect', must be one of joint, ideal"},
      {"sim:?wrist=on", "wrist is 'on', must be one of passive, active"},
      {"sim:?delay_ms=1001", "delay_ms is '1001', must be a number within 0..1000"},
      {"sim:?delay_ms=-1", "delay_ms is '-1'"},
      {"sim:?seed=-1", "seed is '-1'"},
      {"sim:?seed=1.5", "seed is '1.5', must be a whole number within 0..4294967295"},
      {"sim:?link=radio", "link is 'radio', must be one of force, model"},
      {"sim:?link_ms=2", "option 'link_ms' needs the option 'link'"},
      {"sim:?link_hz=100", "option 'link_hz' needs the option 'link'"},
      {"sim:?link=force&link_ms=1001", "link_ms is '1001', must be a number within 0..1000"},
      {"sim:?link=force&link_hz=9", "link_hz is '9', must be a number within 10..10000"},
      {"sim:?hold=0,0,0&path=touch", "hold and path cannot be given together"},
  };
  for (const auto& c : cases) expect_error(FS_ERROR_INVALID, c.part, [&] { open_device(c.uri); });
}
END_TEST

// ---------------------------------------------------------------------------------------------------- delay and time

START_TEST(delay_is_exact) {
  const fs_wrench force{{1, 0, 0}, {}}, none{};
  const double pulse = step_response({0.854, 7.45, 135}, 1, tick).x;
  for (const int delay : {0, 1, 5, 20, 1000}) {
    const auto device = open_device(plain + "&delay_ms=" + std::to_string(delay));
    for (int k = 0; k <= delay + 11; ++k) {
      const double x = read_at(*device, k * tick).pose.position.x;
      if (k <= 10 + delay) ck_assert_double_eq(x, 0);
      if (k == 11 + delay) ck_assert_double_eq_tol(x, pulse, 1e-15);
      device->write(k == 10 ? force : none);
    }
  }
}
END_TEST

START_TEST(delayed_writes_come_in_order) {
  const auto delayed = open_device(plain + "&delay_ms=7"), direct = open_device(plain);
  std::vector<double> expected;
  for (int k = 1; k <= 300; ++k) {
    const fs_wrench force{{std::sin(0.1 * k), std::cos(0.37 * k), 0.01 * (k % 17)}, {}};
    expected.push_back(norm(read_at(*direct, k * tick).pose.position));
    const double seen = norm(read_at(*delayed, k * tick).pose.position);
    if (k > 7) ck_assert_double_eq(seen, expected[static_cast<size_t>(k - 8)]);
    direct->write(force);
    delayed->write(force);
  }
}
END_TEST

START_TEST(same_input_same_bits) {
  for (const char* uri : {"sim:?path=figure8&seed=7", "sim:?path=touch&wrist=active&delay_ms=3", "sim:?hand=firm",
                          "sim:?path=figure8&link=force&link_ms=7&link_hz=300"}) {
    const auto a = open_device(uri), b = open_device(uri);
    for (int k = 1; k <= 2000; ++k) {
      const fs_wrench force{{0.3 * std::sin(0.1 * k), -0.2, 0.5 * std::cos(0.01 * k)}, {0.1, 0, 0.02}};
      ck_assert(same_bits(read_at(*a, k * tick), read_at(*b, k * tick)));
      a->write(force);
      b->write(force);
    }
  }
}
END_TEST

START_TEST(worst_is_a_light_hand) {  // without friction and with a delay, unless they are given
  const std::pair<const char*, const char*> same[]{
      {"sim:?hand=worst", "sim:?hand=light&friction=0&delay_ms=1"},
      {"sim:?hand=worst&friction=0.2&delay_ms=3", "sim:?hand=light&friction=0.2&delay_ms=3"}};
  for (const auto& [worst, light] : same) {
    const auto a = open_device(std::string(worst) + "&hold=0.01,0,0"), b = open_device(std::string(light) + "&hold=0.01,0,0");
    ck_assert_double_eq(a->info().delay, b->info().delay);
    for (int k = 1; k < 500; ++k) {
      ck_assert(same_bits(read_at(*a, k * tick), read_at(*b, k * tick)));
      a->write({{1, 2, -1}, {}});
      b->write({{1, 2, -1}, {}});
    }
  }
  ck_assert_double_eq_tol(open_device("sim:?hand=worst")->info().delay, 1e-3, 1e-12);
}
END_TEST

START_TEST(bits_do_not_depend_on_how_often_it_is_read) {
  const auto often = open_device("sim:?path=figure8"), seldom = open_device("sim:?path=figure8");
  read_at(*often, 0);
  read_at(*seldom, 0);
  for (int k = 1; k <= 4000; ++k) {
    const fs_state a = read_at(*often, k * 0.25e-3);
    if (k % 20 == 0) {
      fs_state b = read_at(*seldom, k * 0.25e-3);
      ck_assert_mem_eq(&a.pose, &b.pose, sizeof a.pose);
    }
  }
}
END_TEST

START_TEST(seed_moves_the_counts_alone) {
  const auto position = [](const char* uri) { return read_at(*open_device(uri), 1).pose.position; };
  ck_assert(position("sim:?hold=0.03,0.01,0.02&seed=3") == position("sim:?hold=0.03,0.01,0.02&seed=3"));
  ck_assert(!(position("sim:?hold=0.03,0.01,0.02&seed=3") == position("sim:?hold=0.03,0.01,0.02&seed=4")));
  ck_assert(!(position("sim:?hold=0.03,0.01,0.02&seed=3") == position("sim:?hold=0.03,0.01,0.02")));
  ck_assert(position("sim:?seed=3&encoder=ideal") == position("sim:?seed=4&encoder=ideal"));
}
END_TEST

START_TEST(time_of_any_clock) {
  const double start = 123456.7;
  const auto real = open_device("sim:?path=sweep"), zero = open_device("sim:?path=sweep");
  ck_assert_double_eq(read_at(*real, start).time, start);
  read_at(*zero, 0);
  for (int k = 1; k <= 500; ++k) {
    const fs_state a = read_at(*real, start + k * tick), b = read_at(*zero, k * tick);
    ck_assert_double_eq_tol(a.time, start + k * tick, 1e-9);
    ck_assert_mem_eq(&a.pose, &b.pose, sizeof a.pose);
  }
  // After a stall of a minute 0.1 s is simulated, but the time is that of the clock.
  ck_assert_double_eq_tol(read_at(*real, start + 60).time, start + 60, 130e-6);
  fs_state before = read_at(*zero, 0.6);
  ck_assert_double_eq_tol(read_at(*real, start + 60).pose.position.x, before.pose.position.x, 1e-12);
  // Another clock, behind this one: nothing jumps, and it runs on.
  const fs_state held = read_at(*real, 0.001);
  ck_assert_double_eq_tol(held.time, 0.001, 1e-15);
  ck_assert_double_eq(held.pose.position.x, before.pose.position.x);
  const fs_state on = read_at(*real, 0.101);
  ck_assert_double_eq_tol(on.pose.position.x, read_at(*zero, 0.7).pose.position.x, 1e-12);
  fs_state none;
  ck_assert_int_eq(real->read(NAN, none), FS_ERROR_INVALID);
  ck_assert_int_eq(real->read(INFINITY, none), FS_ERROR_INVALID);
  ck_assert_double_eq_tol(read_at(*real, 0.102).time, 0.102, 1e-9);
}
END_TEST

START_TEST(no_allocation_at_the_servo_rate) {
  for (const char* uri : {"sim:", "sim:?path=figure8&wrist=active&delay_ms=10&encoder=ideal", "sim:?link=model",
                          "sim:?link=force&link_ms=1&link_hz=10000"}) {
    const auto device = open_device(uri);
    const fs_wrench force{{100, 2, 3}, {1, 0, 0}};
    fs_state state;
    counting = true;
    for (int k = 1; k <= 300; ++k) {
      device->read(k * tick, state);
      device->write(force);
    }
    device->read(50, state);
    device->read(NAN, state);
    counting = false;
    ck_assert_int_eq(allocations, 0);
  }
  counting = true;  // the counter counts
  operator delete(operator new(1));
  counting = false;
  ck_assert_int_eq(allocations, 1);
}
END_TEST

// ---------------------------------------------------------------------------------------------------- paths

START_TEST(paths_of_its_own_stay_in_the_workspace) {
  for (const char* name : {"figure8", "sweep", "touch"}) {
    HandPath path = HandPath::named(name);
    double low = 1, high = -1, radius = 0;
    const double h = 1e-6;
    for (double t = 0; t < 20; t += 0.003) {
      const HandPath::Target a = path.at(t), b = path.at(t + h);
      // the path has its own velocity
      ck_assert_double_lt(norm((1 / h) * (b.position - a.position) - a.velocity), 1e-5);
      low = std::min(low, a.position.z);
      high = std::max(high, a.position.z);
      radius = std::max(radius, std::hypot(a.position.x, a.position.y));
    }
    ck_assert_double_lt(radius, fidel::workspace_radius);
    ck_assert_double_lt(std::max(high, -low), fidel::workspace_height / 2);
    if (std::string(name) == "touch") {
      ck_assert_double_eq_tol(high, 0.06, 1e-6);
      ck_assert_double_eq_tol(low, -0.02, 1e-6);
    }
  }
}
END_TEST

std::string write_file(const char* text) {
  char name[] = "/tmp/fs_path_XXXXXX";
  const int file = mkstemp(name);
  ck_assert_int_ge(file, 0);
  ck_assert_int_eq(write(file, text, std::strlen(text)), static_cast<ssize_t>(std::strlen(text)));
  close(file);
  return name;
}

START_TEST(path_from_a_file) {
  const std::string name = write_file("# t x y z\n\n1 0 0 0 # begin\r\n  2\t0.1 -0.02 3e-2\n3 0.1 -0.02 0.03");
  HandPath path = HandPath::named(name);
  ck_assert(path.at(0).position == Vec3{});
  ck_assert(path.at(0.5).velocity == Vec3{});
  ck_assert_double_eq_tol(norm(path.at(1.25).position - Vec3{0.025, -0.005, 0.0075}), 0, 1e-15);
  ck_assert_double_eq_tol(norm(path.at(1.25).velocity - Vec3{0.1, -0.02, 0.03}), 0, 1e-15);
  ck_assert_double_eq_tol(norm(path.at(2).position - Vec3{0.1, -0.02, 0.03}), 0, 1e-15);
  ck_assert(path.at(2.5).velocity == Vec3{});
  ck_assert(path.at(99).position == (Vec3{0.1, -0.02, 0.03}));
  // The hand follows a ramp by its spring and damper, and lags by b_device v/k.
  const auto device = open_device(plain + "&path=" + name);
  double x = 0;
  for (int k = 0; k <= 1990; ++k) x = read_at(*device, k * tick).pose.position.x;
  ck_assert_double_eq_tol(x, 0.099 - 1 * 0.1 / 135, 0.2e-3);
  unlink(name.c_str());
}
END_TEST

START_TEST(bad_path_files) {
  expect_error(FS_ERROR_NOT_FOUND, "none of figure8, sweep, touch", [] { open_device("sim:?path=/nowhere/file"); });
  expect_error(FS_ERROR_IO, "path '/tmp'", [] { open_device("sim:?path=/tmp"); });
  const struct { const char *text, *part; } cases[] = {
      {"", "there is no line"},
      {"# only words\n", "there is no line"},
      {"0 0 0 0\n1 2 3\n", ":2: must be four numbers"},
      {"0 0 0 0 0\n", ":1: must be four numbers"},
      {"0 0 0 x\n", ":1: must be four numbers"},
      {"0 0 0 nan\n", ":1: must be four numbers"},
      {"0 0 0 0\n\n0 0 0 0.1\n", ":3: t is 0, must be above the 0 before it"},
      {"0 0 0 1.5\n", ":1: a coordinate is 1.5, must be within -1..1 m"},
  };
  for (const auto& c : cases) {
    const std::string name = write_file(c.text);
    expect_error(FS_ERROR_PARSE, c.part, [&] { open_device("sim:?path=" + name); });
    unlink(name.c_str());
  }
  expect_error(FS_ERROR_IO, "/dev/zero: is a device, must be a file", [] { open_device("sim:?path=/dev/zero"); });
  const std::string name = write_file((std::string(600, ' ') + "0 0 0 0 # a long line").c_str());
  open_device("sim:?path=" + name);
  ck_assert_int_eq(truncate(name.c_str(), (64 << 20) + 1), 0);
  expect_error(FS_ERROR_IO, "has 67108865 bytes, must have at most 67108864",
               [&] { open_device("sim:?path=" + name); });
  unlink(name.c_str());
  ck_assert_int_eq(mkfifo(name.c_str(), 0600), 0);  // no process writes into it
  expect_error(FS_ERROR_IO, "is a pipe, must be a file", [&] { open_device("sim:?path=" + name); });
  unlink(name.c_str());
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("sim");
  TCase* all = tcase_create("sim");
  tcase_set_timeout(all, 500);
  tcase_add_test(all, info_of_the_simulator);
  tcase_add_test(all, list_of_the_simulator);
  tcase_add_test(all, bad_options_each_with_its_sentence);
  tcase_add_test(all, delay_is_exact);
  tcase_add_test(all, delayed_writes_come_in_order);
  tcase_add_test(all, same_input_same_bits);
  tcase_add_test(all, worst_is_a_light_hand);
  tcase_add_test(all, bits_do_not_depend_on_how_often_it_is_read);
  tcase_add_test(all, seed_moves_the_counts_alone);
  tcase_add_test(all, time_of_any_clock);
  tcase_add_test(all, no_allocation_at_the_servo_rate);
  tcase_add_test(all, paths_of_its_own_stay_in_the_workspace);
  tcase_add_test(all, path_from_a_file);
  tcase_add_test(all, bad_path_files);
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
