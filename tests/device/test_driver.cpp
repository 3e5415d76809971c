// URIs, the registry and the device handle, with drivers that misbehave.
#include <cmath>
#include <cstdint>
#include <memory>
#include <thread>

#include "support.h"

#include "scenes/fake_device.h"
#include "scenes/longer.h"

#include "driver/registry.h"

using namespace fs;

namespace {

std::unique_ptr<scenes::FakeDevice> fake;  // "fake:0"

void setup() {
  fake = std::make_unique<scenes::FakeDevice>("0");
  fake->written = {{9, 9, 9}, {9, 9, 9}};
  fake->state.pose.orientation = {1, 0, 0, 0};
}
void teardown() {
  ck_assert(fake->has_clean_reads);
  fake = nullptr;
}

START_TEST(registry_refuses_bad_tables) {
  const auto refused = [](fs_status status, const char* part, auto change) {
    fs_driver driver = scenes::fake_driver("other");
    change(driver);
    expect_error(status, part, [&] { register_driver(driver); });
    ck_assert(!find_driver("other"));
  };
  refused(FS_ERROR_VERSION, "fs_driver is 4104", [](fs_driver& d) { d.struct_size = 4104; });
  refused(FS_ERROR_INVALID, "fs_driver is 8", [](fs_driver& d) { d.struct_size = 8; });
  refused(FS_ERROR_INVALID, "fs_driver is 0", [](fs_driver& d) { d.struct_size = 0; });
  const scenes::Longer newer(scenes::fake_driver("other"), 1);
  expect_error(FS_ERROR_VERSION, ("fs_driver has a field at byte " + std::to_string(sizeof(fs_driver))).c_str(), [&] { register_driver(newer.known); });
  refused(FS_ERROR_INVALID, "reserved is 1", [](fs_driver& d) { d.reserved = 1; });
  refused(FS_ERROR_INVALID, "scheme is null", [](fs_driver& d) { d.scheme = nullptr; });
  for (const char* scheme : {"", "Other", "a b", "a:", "a-b", "\xc3\xa4", "a23456789012345678901234567890123"}) {
    refused(FS_ERROR_INVALID, "driver.scheme is", [&](fs_driver& d) { d.scheme = scheme; });
  }
  refused(FS_ERROR_INVALID, "driver.open of", [](fs_driver& d) { d.open = nullptr; });
  refused(FS_ERROR_INVALID, "driver.close of", [](fs_driver& d) { d.close = nullptr; });
  refused(FS_ERROR_INVALID, "driver.get_info of", [](fs_driver& d) { d.get_info = nullptr; });
  refused(FS_ERROR_INVALID, "driver.read of 'other' is null, and write is there: both or neither are needed",
          [](fs_driver& d) { d.read = nullptr; });
  refused(FS_ERROR_INVALID, "driver.write of 'other' is null, and read is there: both or neither are needed",
          [](fs_driver& d) { d.write = nullptr; });
  refused(FS_ERROR_INVALID, "driver.send of 'other' is null, and receive is there: both or neither are needed", [](fs_driver& d) {
    d.read = nullptr, d.write = nullptr, d.advance = nullptr;
    d.receive = [](void*, fs_state*) { return FS_OK; };
  });
  refused(FS_ERROR_INVALID, "driver.receive of 'other' is null: it needs receive and send, or read and write",
          [](fs_driver& d) { d.read = nullptr, d.write = nullptr; });
  expect_error(FS_ERROR_EXISTS, "'fake'", [] { register_driver(scenes::fake_driver("fake")); });
}
END_TEST

START_TEST(registry_copies_and_sorts) {
  char scheme[] = "b2";
  register_driver(scenes::fake_driver(scheme));
  std::strcpy(scheme, "zz");  // the caller may change its string
  register_driver(scenes::fake_driver("a1"));
  std::string schemes;
  for (const fs_driver* driver : all_drivers()) schemes += std::string(driver->scheme) + " ";
  ck_assert_str_eq(schemes.c_str(), "a1 b2 fake fakelink fakemodel fakereal fakereallink sim ");
  ck_assert_str_eq(find_driver("b2")->scheme, "b2");
  ck_assert(!find_driver("zz"));
  ck_assert(!find_driver("b2")->list && !find_driver("b2")->write_model);
}
END_TEST

START_TEST(registry_from_many_threads) {
  const size_t before = all_drivers().size();
  std::vector<std::thread> threads;
  std::atomic<int> taken{0};
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) {
        try {
          register_driver(scenes::fake_driver(("x" + std::to_string(i)).c_str()));
        } catch (const Error& error) {
          if (error.status == FS_ERROR_EXISTS) ++taken;
        }
        ck_assert(find_driver("x" + std::to_string(i)));
        all_drivers();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ck_assert_int_eq(taken, 150);
  ck_assert_uint_eq(all_drivers().size(), before + 50);
}
END_TEST

START_TEST(device_of_no_driver) {
  const std::string text = expect_error(FS_ERROR_NOT_FOUND, "no driver 'foo', and no module ", [] { open_device("foo:bar"); });
  ck_assert_msg(text.find("fakereallink, sim") != std::string::npos, "%s", text.c_str());
  expect_error(FS_ERROR_NOT_FOUND, "'Foo:bar': the name of a driver is 1..31 of a-z and 0-9", [] { open_device("Foo:bar"); });
  const std::string endless(100000, 'x');
  ck_assert(expect_error(FS_ERROR_NOT_FOUND, "xxx...'", [&] { open_device((endless + ":bar").c_str()); }).size() < 400);
  expect_error(FS_ERROR_INVALID, "no scheme", [] { open_device("sim"); });
  expect_error(FS_ERROR_INVALID, "no scheme", [] { open_device(""); });
  expect_error(FS_ERROR_INVALID, "no scheme", [] { open_device(":x"); });
  expect_error(FS_ERROR_INVALID, "key=value", [] { open_device("sim:?x"); });
}
END_TEST

START_TEST(device_that_does_not_open) {
  fake->open_status = FS_ERROR_DENIED;
  fake->sentence = "the plug is red";
  expect_error(FS_ERROR_DENIED, "the plug is red", [] { open_device("fake:0?x=1"); });
  ck_assert_str_eq(fake->address.c_str(), "0?x=1");
  fake->open_status = FS_ERROR_IO;
  fake->sentence = nullptr;  // it gives no sentence, and an earlier sentence is not used instead
  set_last_error(FS_ERROR_FULL, "an older failure");
  expect_error(FS_ERROR_IO, "driver 'fake': open failed with status -8", [] { open_device("fake:0"); });
  ck_assert_str_eq(last_error(), "an older failure");
  fake->open_status = static_cast<fs_status>(77);
  expect_error(FS_ERROR_IO, "status 77", [] { open_device("fake:0"); });
  fake->open_status = FS_OK;
  fake->info_status = FS_ERROR_IO;
  expect_error(FS_ERROR_IO, "get_info failed", [] { open_device("fake:0"); });
  ck_assert(!fake->is_open);
}
END_TEST

START_TEST(device_with_bad_info) {
  const auto refused = [](const char* part, auto change) {
    const fs_device_info good = fake->info;
    change(fake->info);
    expect_error(FS_ERROR_INVALID, part, [] { open_device("fake:0"); });
    ck_assert(!fake->is_open);
    fake->info = good;
  };
  using Info = fs_device_info;
  refused("force_axes is 4", [](Info& i) { i.force_axes = 4; });
  refused("torque_axes", [](Info& i) { i.torque_axes = 0xffffffff; });
  refused("info.name", [](Info& i) { std::memset(i.name, 'x', sizeof i.name); });
  refused("info.serial", [](Info& i) { std::memset(i.serial, 'x', sizeof i.serial); });
  refused("force_max", [](Info& i) { i.force_max = 0; });
  refused("force_max", [](Info& i) { i.force_max = -1; });
  refused("torque_max", [](Info& i) { i.torque_max = NAN; });
  refused("rate", [](Info& i) { i.rate = 99; });
  refused("rate", [](Info& i) { i.rate = 20001; });
  refused("rate", [](Info& i) { i.rate = NAN; });
  refused("delay", [](Info& i) { i.delay = -1e-3; });
  refused("delay", [](Info& i) { i.delay = INFINITY; });
  refused("damping", [](Info& i) { i.damping = -1; });
  refused("mass", [](Info& i) { i.mass = NAN; });
  refused("resolution", [](Info& i) { i.resolution = INFINITY; });
  refused("link_rate", [](Info& i) { i.link_rate = 1e-320; });
  refused("workspace_radius", [](Info& i) { i.workspace_radius = -1; });
  refused("workspace_height", [](Info& i) { i.workspace_height = NAN; });
  refused("workspace_angle", [](Info& i) { i.workspace_angle = INFINITY; });
  const Ref<Device> device = open_device("fake:0");
  ck_assert_uint_eq(device->info().struct_size, sizeof(Info));
  ck_assert_double_eq(device->info().force_max, 10);
}
END_TEST

START_TEST(device_closes_with_no_force) {
  {
    const Ref<Device> device = open_device("fake:0");
    const fs_wrench wrench{{1, 2, 3}, {}};
    ck_assert_int_eq(device->write(wrench), FS_OK);
  }
  ck_assert(fake->written.force == Vec3{});
  ck_assert(!fake->is_open);
}
END_TEST

START_TEST(device_has_one_owner) {
  const Ref<Device> device = open_device("fake:0");
  ck_assert(!device->is_owned());
  device->acquire(-1, false, 1e-3);
  ck_assert(device->is_owned());
  expect_error(FS_ERROR_STATE, "has a servo already", [&] { device->acquire(-1, false, 1e-3); });
  device->release_ownership();
  device->acquire(-1, false, 1e-3);
}
END_TEST

START_TEST(device_is_silent) {  // until its owner closes it
  const Ref<Device> device = open_device("fake:0");
  device->acquire(-1, false, 1e-3);
  ck_assert(device->take_turn());
  ck_assert(!device->take_turn());
  device->end_turn();
  ck_assert_int_eq(device->write({{1, 2, 3}, {}}), FS_OK);
  device->silence();
  ck_assert(fake->written.force == Vec3{});
  ck_assert(device->is_silent());
  ck_assert(!device->take_turn());
  device->release_ownership();
  ck_assert(!device->is_silent());
  ck_assert(device->take_turn());
  device->end_turn();
}
END_TEST

START_TEST(device_read_fills_in) {
  const Ref<Device> device = open_device("fake:0");
  fs_state state;
  fake->state.pose.orientation = {0, 0, 0, 0};
  ck_assert_int_eq(device->read(5.5, state), FS_OK);
  ck_assert_double_eq(fake->time, 5.5);
  ck_assert_double_eq(state.time, 5.5);
  ck_assert_double_eq(state.pose.orientation.w, 1);
  fake->state.time = 5.25;
  fake->state.pose.orientation = {0.6 * 1.0005, 0, 0.8 * 1.0005, 0};
  ck_assert_int_eq(device->read(5.6, state), FS_OK);
  ck_assert_double_eq(state.time, 5.25);
  ck_assert_double_eq_tol(norm(state.pose.orientation), 1, 1e-15);
  ck_assert_double_eq_tol(state.pose.orientation.y, 0.8, 1e-15);
}
END_TEST

// What a driver says of a failure is told; of a call that succeeds nothing is.
START_TEST(what_a_driver_says) {
  fs_driver talker = scenes::fake_driver("talker");
  talker.list = [](fs_device_entry*, size_t, size_t*) { return fs_fail(FS_ERROR_IO, "the bus is gone"); };
  register_driver(talker);
  fs_device* out = nullptr;
  ck_assert_int_eq(fs_device_open("nobody:0", &out), FS_ERROR_NOT_FOUND);
  const std::string before = fs_last_error();
  size_t count;
  ck_assert_int_eq(fs_device_list(nullptr, 0, &count), FS_OK);
  ck_assert_str_eq(fs_last_error(), before.c_str());

  ck_assert_int_eq(fs_device_open("fake:0", &out), FS_OK);
  ck_assert_str_eq(fs_last_error(), before.c_str());
  fs_state state;
  fake->state.pose.orientation = {2, 0, 0, 0};
  ck_assert_int_eq(fs_device_read(out, &state), FS_ERROR_INVALID);
  ck_assert_msg(std::strstr(fs_last_error(), "an orientation whose length is not 1"), "%s", fs_last_error());
  fake->state.pose.orientation = {1, 0, 0, 0};
  fake->read_status = FS_ERROR_DISCONNECTED;
  ck_assert_int_eq(fs_device_read(out, &state), FS_ERROR_DISCONNECTED);
  ck_assert_msg(std::strstr(fs_last_error(), "FS_ERROR_DISCONNECTED"), "%s", fs_last_error());
  fs_device_close(out);
}
END_TEST

bool all_zero(const fs_state& state) {
  static const fs_state zeros{};
  return same_bits(state, zeros);
}

START_TEST(device_read_failures_are_zeros) {
  const Ref<Device> device = open_device("fake:0");
  fs_state state;
  fake->state.pose.position = {1, 2, 3};
  fake->read_status = FS_ERROR_DISCONNECTED;
  ck_assert_int_eq(device->read(1, state), FS_ERROR_DISCONNECTED);
  ck_assert(all_zero(state));
  for (const int status : {INT32_MIN, FS_ERROR_INTERNAL - 1, 1, 3, INT32_MAX}) {
    fake->read_status = static_cast<fs_status>(status);
    ck_assert_int_eq(device->read(1, state), FS_ERROR_IO);
  }
  fake->read_status = FS_OK;
  const uint64_t reads = fake->reads;
  fake->advance_status = FS_ERROR_IO;
  ck_assert_int_eq(device->read(1, state), FS_ERROR_IO);
  ck_assert_uint_eq(fake->reads, reads);
  fake->advance_status = FS_OK;
  fake->state.pose.orientation = {2, 0, 0, 0};
  ck_assert_int_eq(device->read(1, state), FS_ERROR_INVALID);
  ck_assert(all_zero(state));
  fake->state.pose.orientation = {1, 0, 0, 0};
  fake->state.time = NAN;
  ck_assert_int_eq(device->read(1, state), FS_ERROR_INVALID);
  fake->state.time = 0;
  ck_assert_int_eq(device->read(1, state), FS_OK);
}
END_TEST

// The guard catches numbers that are not finite; here they come through, and do no harm afterwards.
START_TEST(device_read_shows_what_is_not_finite) {
  const Ref<Device> device = open_device("fake:0");
  fs_state state;
  device->read(0.001, state);
  fake->state.pose.position.y = NAN;
  ck_assert_int_eq(device->read(0.002, state), FS_OK);
  ck_assert(std::isnan(state.pose.position.y));
  fake->state.pose.position.y = 0;
  fake->state.pose.orientation.x = INFINITY;
  ck_assert_int_eq(device->read(0.003, state), FS_OK);
  ck_assert(std::isinf(state.pose.orientation.x));
  fake->state.pose.orientation.x = 0;
  device->read(0.004, state);
  fake->state.pose.position.x = 1e-3;
  device->read(0.005, state);
  ck_assert(is_finite(state.twist));
  ck_assert_double_gt(state.twist.linear.x, 0.1);
}
END_TEST

START_TEST(device_works_out_the_twist) {
  const Ref<Device> device = open_device("fake:0");
  fs_state state;
  for (int k = 0; k <= 100; ++k) {
    fake->state.pose.position.x = 0.2 * k * 1e-3;
    fake->state.pose.orientation = exp_rotation({0, 0, 3 * k * 1e-3});
    device->read(k * 1e-3 + 1, state);
  }
  ck_assert_double_eq_tol(state.twist.linear.x, 0.2, 1e-9);
  ck_assert_double_eq_tol(state.twist.angular.z, 3, 1e-9);
  // Not ready: no twist, and the jump of homing makes none afterwards.
  fake->state.flags = 0;
  device->read(1.101, state);
  ck_assert_double_eq(state.twist.linear.x, 0);
  fake->state.pose.position.x = 0.5;
  fake->state.flags = FS_STATE_READY;
  device->read(1.102, state);
  ck_assert_double_eq(state.twist.linear.x, 0);
  // The driver gives a twist itself: it is used as it is, unless it is 0 or the poses contradict it.
  fake->state.twist.linear.y = 0.7;
  device->read(1.103, state);
  ck_assert_double_eq(state.twist.linear.y, 0.7);
  fake->state.pose.position.x += 0.5e-3;
  device->read(1.104, state);
  ck_assert_double_eq(state.twist.linear.x, 0);
  ck_assert_double_eq(state.twist.linear.y, 0.7);
  fake->state.pose.position.x += 0.1;
  device->read(1.105, state);
  ck_assert_double_gt(state.twist.linear.x, 10);
  for (int k = 0; k < 100; ++k) device->read(1.106 + k * 1e-3, state);
  fake->state.twist.linear.y = 0;
  for (int k = 0; k < 3; ++k) {
    fake->state.pose.position.x += 1e-3;
    device->read(1.206 + k * 1e-3, state);
  }
  ck_assert_double_gt(state.twist.linear.x, 0.1);
}
END_TEST

START_TEST(device_write_limits_and_keeps_the_direction) {
  const Ref<Device> device = open_device("fake:0");
  fs_wrench wrench{{1, 2, -3}, {0.1, 0.2, 0.3}};
  ck_assert_int_eq(device->write(wrench), FS_OK);
  ck_assert(fake->written.force == wrench.force && fake->written.torque == wrench.torque);  // untouched
  for (const double scale : {20.0, 1e150, 1e300}) {
    wrench = {scale * Vec3{3, 0, -4}, scale * Vec3{0, 2, 1}};
    device->write(wrench);
    ck_assert_double_le(norm(fake->written.force), 10);
    ck_assert_double_eq_tol(fake->written.force.x, 6, 1e-12);
    ck_assert_double_eq_tol(fake->written.force.z, -8, 1e-12);
    ck_assert_double_le(norm(fake->written.torque), 1);
    ck_assert_double_eq_tol(fake->written.torque.y, 2 / std::sqrt(5), 1e-12);
  }
  fake->write_status = FS_ERROR_DISCONNECTED;
  ck_assert_int_eq(device->write(wrench), FS_ERROR_DISCONNECTED);
  fake->write_status = FS_OK;
  for (const double bad : {NAN * 1.0, INFINITY * 1.0}) {
    wrench = {{1, 1, 1}, {0, bad, 0}};
    ck_assert_int_eq(device->write(wrench), FS_ERROR_INVALID);
    ck_assert(fake->written.force == Vec3{} && fake->written.torque == Vec3{});
  }
}
END_TEST

START_TEST(device_write_without_all_axes) {
  const fs_wrench wrench{{3, 4, 100}, {0.1, 0.1, 0.1}};
  fake->info.force_axes = 2;
  fake->info.torque_axes = 0;
  fake->info.torque_max = 0;
  {
    const Ref<Device> device = open_device("fake:0");
    device->write(wrench);
    ck_assert(fake->written.force == (Vec3{3, 4, 0}));  // an axis that the device lacks does not count for the maximum
    ck_assert(fake->written.torque == Vec3{});
  }
  fake->info.force_axes = 1;
  {
    const Ref<Device> device = open_device("fake:0");
    device->write(wrench);
    ck_assert(fake->written.force == (Vec3{3, 0, 0}));
  }
  fake->info.force_axes = 0;
  const Ref<Device> device = open_device("fake:0");
  device->write(wrench);
  ck_assert(fake->written.force == Vec3{});
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("driver");
  TCase* all = tcase_create("driver");
  tcase_set_timeout(all, 500);
  tcase_add_checked_fixture(all, setup, teardown);
  tcase_add_test(all, registry_refuses_bad_tables);
  tcase_add_test(all, registry_copies_and_sorts);
  tcase_add_test(all, registry_from_many_threads);
  tcase_add_test(all, device_of_no_driver);
  tcase_add_test(all, device_that_does_not_open);
  tcase_add_test(all, device_with_bad_info);
  tcase_add_test(all, device_closes_with_no_force);
  tcase_add_test(all, device_has_one_owner);
  tcase_add_test(all, device_is_silent);
  tcase_add_test(all, device_read_fills_in);
  tcase_add_test(all, what_a_driver_says);
  tcase_add_test(all, device_read_failures_are_zeros);
  tcase_add_test(all, device_read_shows_what_is_not_finite);
  tcase_add_test(all, device_works_out_the_twist);
  tcase_add_test(all, device_write_limits_and_keeps_the_direction);
  tcase_add_test(all, device_write_without_all_axes);
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
