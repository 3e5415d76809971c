// The servo on a device that does what the test says: ramp, faults, limits, record, options, ownership.
#include <sched.h>

#include <chrono>
#include <limits>
#include <thread>
#include <vector>

#include "api/support.h"
#include "scenes/longer.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();

// The force is the same everywhere: 2 N upwards, unless a test needs another.
static fs_object lift(double force = 2) {
  fs_object o = fs_object_init("lift", FS_PRIMITIVE_PLANE);
  o.front = o.back = constant(FS_SENSE_REPULSIVE, force);
  o.back.sense = FS_SENSE_ATTRACTIVE;
  return o;
}

// Without fades, so that only the servo's own behaviour shows.
static fs_servo_options plain(double ramp = -1) {
  fs_servo_options options = virtual_options();
  options.fade = -1;
  options.ramp = ramp;
  return options;
}

// The number of a processor that this thread may run on.
static int usable_processor() {
  cpu_set_t set;
  ck_assert_int_eq(sched_getaffinity(0, sizeof set, &set), 0);
  int cpu = 0;
  while (!CPU_ISSET(cpu, &set)) ++cpu;
  return cpu;
}

static void set(fs_scene* scene, const fs_object& o) { OK(fs_object_set(scene, &o)); }

static fs_wrench sent_of(fs_scene* scene) {
  fs_wrench sent;
  OK(fs_scene_get_hand(scene, nullptr, nullptr, &sent));
  return sent;
}

// Steps until the ramp of 0.1 s is over, and checks that the force rose as a ramp.
static void expect_ramp(Rig& rig, double force) {
  double before = norm(rig.sent());
  ck_assert_double_lt(before, 0.02 * force);
  for (int k = 0; k < 99; ++k) {
    rig.step(1);
    const double after = norm(rig.sent());
    ck_assert_double_ge(after, before);
    ck_assert_double_le(after - before, force * 0.001 / 0.1 * (1 + 1e-6));
    before = after;
  }
  ck_assert_double_gt(before, 0.95 * force);
  rig.step(3);
  EXPECT_NEAR(norm(rig.sent()), force, 1e-12);
}

START_TEST(ramps_at_the_start) {
  Rig rig("ramp");
  set(rig.scene.get(), lift());
  rig.start(plain(0.1));
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  rig.step(1);
  expect_ramp(rig, 2);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
}
END_TEST

START_TEST(no_ramp) {
  Rig rig("noramp");
  set(rig.scene.get(), lift());
  rig.start(plain());
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  ck_assert(stats_of(rig.scene.get()).protections_off & FS_OFF_RAMP);
}
END_TEST

START_TEST(zero_until_ready) {
  Rig rig("ready");
  set(rig.scene.get(), lift());
  rig.fake.state.flags = 0;
  rig.start(plain(0.1));
  for (int k = 0; k < 50; ++k) {
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  }
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_DEVICE);
  rig.fake.state.flags = FS_STATE_READY;
  rig.step(1);
  expect_ramp(rig, 2);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
  rig.fake.state.flags = 0;  // no longer homed
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
}
END_TEST

START_TEST(a_lost_device_comes_back) {
  for (bool at_write : {false, true}) {
    Rig rig(at_write ? "lostwrite" : "lostread");
    set(rig.scene.get(), lift());
    rig.start(plain(0.1));
    rig.step(200);
    (at_write ? rig.fake.write_status : rig.fake.read_status) = FS_ERROR_DISCONNECTED;
    for (int k = 0; k < 20; ++k) EXPECT(FS_ERROR_DISCONNECTED, fs_servo_step(rig.servo.get(), 1));
    const fs_servo_stats stats = stats_of(rig.scene.get());
    ck_assert_uint_eq(stats.device_errors, 20);
    ck_assert_uint_eq(stats.ticks, 220);  // all ticks ran
    ck_assert(stats.faults & FS_FAULT_DEVICE);
    if (!at_write) EXPECT_VECTOR(sent_of(rig.scene.get()).force, (fs_vec3{}), 0);
    (at_write ? rig.fake.write_status : rig.fake.read_status) = FS_OK;
    fs_servo_step(rig.servo.get(), 1);
    if (at_write) rig.step(1);
    expect_ramp(rig, 2);  // the force comes back by itself
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
  }
}
END_TEST

// A sheet that the hand presses from above holds it over a short gap, of reading or of READY. After a longer one the hand may be
// anywhere, and is where it is: here below the sheet, which then pushes it no more.
START_TEST(a_gap_without_the_hand) {
  for (const bool is_read : {false, true}) {
    for (const int gap : {1, 90, 200}) {  // ticks, ms
      Rig rig(("gap" + std::to_string(gap) + (is_read ? "read" : "ready")).c_str());
      fs_object sheet = fs_object_init("sheet", FS_PRIMITIVE_PLANE);
      sheet.contact = {FS_KEEP_EITHER, 0, 500, 10, 0, 0, {}};
      set(rig.scene.get(), sheet);
      rig.fake.state.pose.position.z = 0.002;
      rig.start(plain());
      for (double& z = rig.fake.state.pose.position.z; z > -0.003; z -= 0.0005) rig.step(1);
      rig.fake.state.pose.position.z = -0.003;
      rig.step(30);
      EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 1.5}), 1e-9);
      if (is_read) {
        rig.fake.read_status = FS_ERROR_IO;
      } else {
        rig.fake.state.flags = 0;
        rig.fake.state.pose.position.z = 0.01;  // as it is homed
      }
      fs_servo_step(rig.servo.get(), static_cast<uint64_t>(gap));
      EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
      rig.fake.read_status = FS_OK;
      rig.fake.state.flags = FS_STATE_READY;
      rig.fake.state.pose.position.z = -0.003;
      rig.step(30);
      EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, gap < 100 ? 1.5 : 0}), 1e-9);
    }
  }
}
END_TEST

static void take_all_events(fs_scene* scene) {
  fs_event event;
  do OK(fs_scene_next_event(scene, 0, &event));
  while (event.kind != FS_EVENT_NONE);
}

// The next event is of the device, with this status, these faults and, if given, this in its text.
static void expect_event(fs_scene* scene, fs_status status, uint32_t faults, const char* text = "") {
  fs_event event;
  OK(fs_scene_next_event(scene, 0, &event));
  ck_assert_int_eq(event.kind, FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, status);
  ck_assert_double_eq(event.value, faults);
  ck_assert_msg(std::strstr(event.text, text), "\"%s\" does not say \"%s\"", event.text, text);
}
static void expect_no_event(fs_scene* scene) {
  fs_event event;
  OK(fs_scene_next_event(scene, 0, &event));
  ck_assert_int_eq(event.kind, FS_EVENT_NONE);
}

// One pose of a device that measures its own twist is wrong by 10 mm: that is a fault, not a kick by damping or spring.
START_TEST(a_wrong_pose_beside_a_good_twist) {
  Rig rig("glitch");
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  set(rig.scene.get(), spring);
  uint64_t reads = 0;
  rig.fake.on_read = [&](FakeDevice& fake, double) {
    fake.state.pose.position.x = ++reads == 300 ? 0.02 : 0.01;
    fake.state.twist.linear.x = 1e-4;
  };
  fs_servo_options options = plain();
  options.damping = 0;
  rig.start(options);
  rig.step(299);
  ck_assert_double_lt(rig.sent().x, -1);
  const double before = rig.sent().x;
  fs_servo_step(rig.servo.get(), 1);
  ck_assert_msg(rig.sent().x == 0, "%g N before, %g N at the wrong pose", before, rig.sent().x);
}
END_TEST

// An overflow counts what was dropped, and comes before what was kept.
START_TEST(events_that_nobody_fetches) {
  Rig rig("flickers");
  uint64_t reads = 0;
  rig.fake.on_read = [&](FakeDevice& fake, double) { fake.state.flags = ++reads % 2 ? FS_STATE_READY : FS_STATE_STOPPED; };
  rig.start(plain());
  const size_t many = 3000;
  for (size_t i = 0; i < many; ++i) fs_servo_step(rig.servo.get(), 1);
  size_t fetched = 0, dropped = 0;
  double last = -1;
  for (fs_event event; fs_scene_next_event(rig.scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE;) {
    if (event.kind == FS_EVENT_OVERFLOW) {
      ck_assert_msg(fetched == 0, "events were dropped after %zu", fetched);
      dropped += static_cast<size_t>(event.value);
      continue;
    }
    ck_assert_double_gt(event.time, last);
    last = event.time;
    ++fetched;
  }
  ck_assert_uint_ge(fetched, 1000);  // 1024 are kept, in the servo and in the scene, that tells how many were dropped
  ck_assert_uint_eq(fetched + dropped, many);
}
END_TEST

START_TEST(an_old_pose_is_no_pose) {  // older than 20 ms and the device's delay, at most 100 ms
  const struct {
    double delay, good, bad;  // s
    const char* text;
  } cases[]{{0, 0.015, 0.025, "its pose is 25 ms old, must be at most 20 ms; "},
            {0.03, 0.045, 0.055, "its pose is 55 ms old, must be at most 50 ms; "},
            {0.5, 0.095, 0.105, "its pose is 105 ms old, must be at most 100 ms; "}};
  for (const auto& c : cases) {
    Rig rig("old");
    set(rig.scene.get(), lift());
    rig.fake.info.delay = c.delay;
    double age = c.good;
    rig.fake.on_read = [&](FakeDevice& fake, double time) { fake.state.time = std::fmax(time - age, 1e-9); };
    rig.start(plain());
    rig.step(200);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
    take_all_events(rig.scene.get());
    age = c.bad;
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_DEVICE);
    expect_event(rig.scene.get(), FS_ERROR_STATE, FS_FAULT_DEVICE, c.text);
    age = 0;
    rig.step(2);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  }
}
END_TEST

// An application that enables the servo at each fault event, and only then, has its force back when the cause is gone.
START_TEST(told_again) {
  Rig rig("again");
  fs_scene* const scene = rig.scene.get();
  set(scene, lift());
  rig.start(plain());
  rig.step(10);
  expect_event(scene, FS_OK, 0, "ready");
  rig.fake.state.twist.linear.x = 3;
  for (int k = 0; k < 5; ++k) {
    rig.step(1);
    expect_event(scene, FS_ERROR_STATE, FS_FAULT_SPEED, "speed_limit");
    rig.step(10);
    expect_no_event(scene);
    OK(fs_servo_set_enabled(rig.servo.get(), true));
    OK(fs_servo_set_enabled(rig.servo.get(), true));  // two calls between two ticks count as one
  }
  rig.fake.state.twist.linear.x = NAN;  // another cause: the first is gone by then
  fs_servo_step(rig.servo.get(), 1);
  expect_event(scene, FS_ERROR_STATE, FS_FAULT_NUMBER, "not finite");
  rig.fake.state.twist.linear.x = 3;  // and the first cause again, while the other is latched
  rig.step(1);
  expect_event(scene, FS_ERROR_STATE, FS_FAULT_SPEED, "speed_limit");
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.fake.on_read = [](FakeDevice& fake, double) { fake.state.pose.position.x = NAN; };  // both at once
  fs_servo_step(rig.servo.get(), 1);
  expect_event(scene, FS_ERROR_STATE, FS_FAULT_SPEED | FS_FAULT_NUMBER, "speed_limit, 2 m/s; a pose");
  rig.fake.on_read = nullptr;
  rig.fake.state.pose.position.x = 0;
  rig.fake.state.flags = 0;
  rig.step(1);
  expect_event(scene, FS_ERROR_STATE, FS_FAULT_DEVICE, "not ready");
  rig.fake.state.flags = FS_STATE_READY;
  rig.step(1);
  expect_event(scene, FS_OK, 0, "until it is enabled: the hand");  // no force yet, and the event says so
  OK(fs_servo_set_enabled(rig.servo.get(), false));
  rig.step(1);
  expect_no_event(scene);
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.step(1);
  expect_event(scene, FS_ERROR_STATE, FS_FAULT_SPEED, "speed_limit");
  rig.fake.state.twist.linear.x = 0.1;
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.step(1);
  expect_no_event(scene);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
}
END_TEST

// A fault that stays until the servo is enabled again; the record stops with it.
static void expect_latched(Rig& rig, uint32_t fault, const std::function<void()>& heal) {
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults & fault, fault);
  std::vector<fs_tick> record(2000);
  size_t count = 0;
  OK(fs_servo_get_record(rig.servo.get(), record.data(), record.size(), &count));
  ck_assert_uint_gt(count, 0);
  ck_assert(record[count - 1].faults & fault);  // the tick of the fault is the last
  const double last = record[count - 1].state.time;
  heal();
  rig.step(100);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults & fault, fault);
  OK(fs_servo_get_record(rig.servo.get(), record.data(), record.size(), &count));
  ck_assert_double_eq(record[count - 1].state.time, last);
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.step(1);
  expect_ramp(rig, 2);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
  OK(fs_servo_get_record(rig.servo.get(), record.data(), record.size(), &count));
  ck_assert_double_gt(record[count - 1].state.time, last);
}

START_TEST(a_jump_while_away_is_no_speed) {
  Rig rig("jump");
  set(rig.scene.get(), lift());
  rig.fake.state.pose = at(0.05, -0.05, 0.05);  // the first pose may be anywhere
  rig.start(plain());
  rig.step(5);
  EXPECT_NEAR(norm(rig.sent()), 2, 1e-12);
  rig.fake.state.flags = 0;
  rig.step(5);
  rig.fake.state.pose = at(0, 0.05, 0);  // homed: the pose is elsewhere
  rig.step(1);
  rig.fake.state.flags = FS_STATE_READY;
  rig.step(5);
  EXPECT_NEAR(norm(rig.sent()), 2, 1e-12);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
}
END_TEST

START_TEST(speeds_are_worked_out) {  // where the driver leaves the twist at 0
  Rig rig("twists");
  rig.fake.on_read = [](FakeDevice& fake, double time) {
    fake.state.pose = {{0.1 * time, 0, -0.05 * time}, turn({0, 0, 1}, 0.5 * time)};
  };
  rig.start(plain());
  rig.step(500);
  fs_state state;
  OK(fs_scene_get_hand(rig.scene.get(), &state, nullptr, nullptr));
  EXPECT_VECTOR(state.twist.linear, (fs_vec3{0.1, 0, -0.05}), 0.002);
  EXPECT_VECTOR(state.twist.angular, (fs_vec3{0, 0, 0.5}), 0.01);
}
END_TEST

START_TEST(axes_that_are_not_there) {  // get nothing
  Rig rig("axes");
  const fs_vec3 arm{0.5, 0, 0};
  OK(fs_scene_set_tool(rig.scene.get(), &arm, 1));
  set(rig.scene.get(), lift(2));
  rig.fake.info.torque_axes = 0;
  rig.fake.info.torque_max = 0;
  rig.start(plain());
  rig.step(5);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  EXPECT_VECTOR(rig.fake.written.torque, (fs_vec3{}), 0);
}
END_TEST

START_TEST(too_fast) {
  for (bool given : {false, true}) {
    Rig rig(given ? "twist" : "speed");
    set(rig.scene.get(), lift());
    double speed = 1.9;
    rig.fake.on_read = [&](FakeDevice& fake, double) {
      fake.state.pose.position.x += speed * 0.001;
      if (given) fake.state.twist.linear.x = speed;
    };
    rig.start(plain(0.1));
    rig.step(200);
    EXPECT_NEAR(norm(rig.sent()), 2, 1e-12);
    speed = 2.2;
    rig.step(100);  // worked-out speeds may be filtered
    expect_latched(rig, FS_FAULT_SPEED, [&] { speed = 0; });
  }
  {
    Rig rig("slow");
    set(rig.scene.get(), lift());
    rig.fake.state.twist.linear.y = 0.6;
    fs_servo_options options = plain(0.1);
    options.speed_limit = 0.5;
    rig.start(options);
    rig.step(10);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_SPEED);
  }
  {
    Rig rig("free");
    set(rig.scene.get(), lift());
    rig.fake.state.twist.linear.y = 50;
    fs_servo_options options = plain();
    options.speed_limit = -1;
    rig.start(options);
    rig.step(10);
    EXPECT_NEAR(norm(rig.sent()), 2, 1e-12);
    ck_assert(stats_of(rig.scene.get()).protections_off & FS_OFF_SPEED);
  }
}
END_TEST

START_TEST(not_a_number) {
  void (*const spoils[])(fs_state&){[](fs_state& s) { s.pose.position.y = NAN; },
                                    [](fs_state& s) { s.pose.orientation.w = infinite; },
                                    [](fs_state& s) { s.pose.position.z = -infinite; },
                                    [](fs_state& s) { s.twist.angular.x = NAN; }};
  for (size_t i = 0; i < std::size(spoils); ++i) {
    Rig rig(("nan" + std::to_string(i)).c_str());
    set(rig.scene.get(), lift());
    rig.start(plain(0.1));
    rig.step(200);
    const fs_state good = rig.fake.state;
    spoils[i](rig.fake.state);
    fs_servo_step(rig.servo.get(), 1);
    expect_latched(rig, FS_FAULT_NUMBER, [&] { rig.fake.state = good; });
  }
}
END_TEST

START_TEST(too_strong) {  // the force is shortened, its direction kept
  Rig rig("strong");
  fs_object o = lift(20);
  o.pose.orientation = turn({1, 2, 0}, 0.8);
  o.pose.position = {0, 0, -5};
  set(rig.scene.get(), o);
  const fs_vec3 direction = rotate(o.pose.orientation, {0, 0, 1});
  rig.start(plain());
  rig.step(10);
  EXPECT_VECTOR(rig.sent(), 10.0 * direction, 1e-9);
  ck_assert_uint_eq(stats_of(rig.scene.get()).guarded, 10);
  fs_response response;
  fs_wrench sent;
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, &sent));
  EXPECT_VECTOR(response.wrench.force, 20.0 * direction, 1e-9);  // before the guard
  EXPECT_VECTOR(sent.force, 10.0 * direction, 1e-9);
  fs_tick tick;
  size_t count = 0;
  OK(fs_servo_get_record(rig.servo.get(), &tick, 1, &count));
  ck_assert(tick.response.flags & FS_RESPONSE_GUARDED);
  ck_assert_uint_eq(tick.faults, 0);
  set(rig.scene.get(), lift(9));
  rig.step(5);
  ck_assert_uint_eq(stats_of(rig.scene.get()).guarded, 10);
  OK(fs_servo_get_record(rig.servo.get(), &tick, 1, &count));
  ck_assert(!(tick.response.flags & FS_RESPONSE_GUARDED));
}
END_TEST

START_TEST(limits_of_ones_own) {
  Rig rig("limits");
  const fs_vec3 arm{0.5, 0, 0};  // 2 N at 0.5 m: 1 N m
  OK(fs_scene_set_tool(rig.scene.get(), &arm, 1));
  set(rig.scene.get(), lift(2));
  fs_servo_options options = plain();
  options.force_limit = 1.5;
  options.torque_limit = 0.25;
  rig.start(options);
  rig.step(5);
  ck_assert_double_le(norm(rig.fake.written.force), 1.5 * (1 + 1e-12));
  ck_assert_double_le(norm(rig.fake.written.torque), 0.25 * (1 + 1e-12));
  EXPECT_VECTOR(unit(rig.fake.written.force), (fs_vec3{0, 0, 1}), 1e-12);
  EXPECT_VECTOR(unit(rig.fake.written.torque), (fs_vec3{0, -1, 0}), 1e-12);
}
END_TEST

START_TEST(enabled_or_not) {
  Rig rig("enabled");
  set(rig.scene.get(), lift());
  rig.start(plain(0.1));
  ck_assert_uint_eq(stats_of(rig.scene.get()).enabled, 1);
  rig.step(200);
  OK(fs_servo_set_enabled(rig.servo.get(), false));
  for (int k = 0; k < 50; ++k) {
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  }
  fs_response response;
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
  ck_assert(response.flags & FS_RESPONSE_GUARDED);
  fs_servo_stats stats = stats_of(rig.scene.get());
  ck_assert_uint_eq(stats.enabled, 0);
  ck_assert_uint_eq(stats.reserved, 0);
  ck_assert_uint_eq(stats.guarded, 50);
  ck_assert_uint_eq(stats.faults, 0);
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.step(1);
  stats = stats_of(rig.scene.get());
  ck_assert_uint_eq(stats.enabled, 1);
  ck_assert_uint_eq(stats.guarded, 50);
  expect_ramp(rig, 2);
  rig.fake.state.pose.position.x = NAN;
  fs_servo_step(rig.servo.get(), 1);
  rig.fake.state.pose.position.x = 0;
  OK(fs_servo_set_enabled(rig.servo.get(), false));  // disabling does not clear a fault
  rig.step(5);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  OK(fs_servo_set_enabled(rig.servo.get(), true));
  rig.step(1);
  expect_ramp(rig, 2);
}
END_TEST

START_TEST(the_record) {
  Rig rig("record");
  set(rig.scene.get(), lift());
  rig.fake.state.pose = at(0.01, 0.02, 0.03);
  rig.fake.state.buttons = 5;
  rig.start(plain());
  std::vector<fs_tick> record(3000);
  size_t count = 9;
  OK(fs_servo_get_record(rig.servo.get(), record.data(), 3000, &count));
  ck_assert_uint_eq(count, 0);
  rig.step(10);
  OK(fs_servo_get_record(rig.servo.get(), record.data(), 3000, &count));
  ck_assert_uint_eq(count, 10);
  for (size_t k = 0; k < count; ++k) {
    const fs_tick& tick = record[k];
    EXPECT_NEAR(tick.state.time, 0.001 * (k + 1), 1e-12);
    EXPECT_VECTOR(tick.state.pose.position, (fs_vec3{0.01, 0.02, 0.03}), 0);
    ck_assert_uint_eq(tick.state.buttons, 5);
    EXPECT_VECTOR(tick.response.wrench.force, (fs_vec3{0, 0, 2}), 1e-12);
    EXPECT_VECTOR(tick.sent.force, (fs_vec3{0, 0, 2}), 1e-12);
    ck_assert_int_eq(tick.device, FS_OK);
    ck_assert_uint_eq(tick.faults, 0);
  }
  rig.step(2990);
  OK(fs_servo_get_record(rig.servo.get(), record.data(), 3000, &count));
  ck_assert_uint_eq(count, 2000);  // 2 s
  EXPECT_NEAR(record[0].state.time, 1.001, 1e-12);
  EXPECT_NEAR(record[1999].state.time, 3, 1e-12);
  OK(fs_servo_get_record(rig.servo.get(), record.data(), 3, &count));  // the newest, oldest first
  ck_assert_uint_eq(count, 2000);
  EXPECT_NEAR(record[0].state.time, 2.998, 1e-12);
  EXPECT_NEAR(record[2].state.time, 3, 1e-12);
  OK(fs_servo_get_record(rig.servo.get(), nullptr, 0, &count));
  ck_assert_uint_eq(count, 2000);
}
END_TEST

// By its scene: each tick once, however often and with however much room it is asked for.
START_TEST(the_record_of_a_scene) {
  Rig rig("scene_record");
  const fs_frame frame{at(0.5, 0, 0), 2, 3, {}};
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  std::vector<fs_recorded_tick> record(3000);
  size_t count = 9;
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_scene_get_record(rig.scene.get(), 0, record.data(), 3000, &count), "no servo");
  rig.fake.state.pose = at(0.01, 0.02, 0.03);
  rig.start(plain());
  OK(fs_scene_get_record(rig.scene.get(), 0, record.data(), 3000, &count));
  ck_assert_uint_eq(count, 0);
  uint64_t last = 0;
  for (const uint64_t steps : {1, 2, 700, 0, 1999}) {
    rig.step(steps);
    std::vector<fs_tick> all(3000);
    size_t all_count = 0;
    OK(fs_servo_get_record(rig.servo.get(), all.data(), all.size(), &all_count));
    uint64_t seen = 0;
    do {
      OK(fs_scene_get_record(rig.scene.get(), last, record.data(), 600, &count));
      for (size_t i = 0; i < std::min<size_t>(count, 600); ++i) {
        ck_assert_uint_eq(record[i].number, ++last);
        EXPECT_NEAR(record[i].tick.state.time, 0.001 * last, 1e-9);
        const fs_tick& same = all[all_count - steps + seen++];
        ck_assert_int_eq(std::memcmp(&record[i].tick, &same, sizeof same), 0);  // in the device frame
      }
    } while (count > 600);
    ck_assert_uint_eq(seen, steps);
  }
  rig.step(2500);  // more than it keeps: the numbers tell what is missing
  OK(fs_scene_get_record(rig.scene.get(), last, record.data(), 3000, &count));
  ck_assert_uint_eq(count, 2000);
  ck_assert_uint_eq(record[0].number, last + 501);
  ck_assert_uint_eq(record[1999].number, last + 2500);
  for (const uint64_t after : {last + 2500, last + 2501, ~uint64_t{0}}) {
    OK(fs_scene_get_record(rig.scene.get(), after, record.data(), 3000, &count));
    ck_assert_uint_eq(count, 0);
  }
}
END_TEST

START_TEST(stats) {
  Rig rig("stats");
  fs_servo_stats stats = fs_servo_stats_init();
  EXPECT(FS_ERROR_STATE, fs_scene_get_servo_stats(rig.scene.get(), &stats));
  fs_device_info info = fs_device_info_init();
  EXPECT(FS_ERROR_STATE, fs_scene_get_device_info(rig.scene.get(), &info));
  EXPECT(FS_ERROR_STATE, fs_scene_get_hand(rig.scene.get(), nullptr, nullptr, nullptr));
  fs_servo_options options = virtual_options();
  options.rate = 500;
  rig.start(options);
  rig.step(250);
  stats = stats_of(rig.scene.get());
  ck_assert_uint_eq(stats.ticks, 250);
  ck_assert_uint_eq(stats.misses, 0);
  ck_assert_uint_eq(stats.device_errors, 0);
  ck_assert_uint_eq(stats.approximated, 0);
  ck_assert_uint_eq(stats.faults, 0);
  EXPECT_NEAR(stats.rate, 500, 1e-6);
  ck_assert_double_eq(stats.damping, 0);
  ck_assert_double_eq(stats.max_stiffness, infinite);
  // The options of this test switch off all but BLEND, which does not exist yet.
  ck_assert_uint_eq(stats.protections_off, FS_OFF_SLEW | FS_OFF_STIFFNESS | FS_OFF_DAMPING | FS_OFF_BLEND);
  EXPECT_NEAR(now(rig.scene.get()), 0.5, 1e-12);  // tick k is at k/rate
  EXPECT(FS_ERROR_STATE, fs_scene_set_time(rig.scene.get(), 10));
  OK(fs_scene_get_device_info(rig.scene.get(), &info));
  ck_assert_str_eq(info.name, "fake device");
  EXPECT_NEAR(info.force_max, 10, 0);
  Longer longer(stats, 1);
  OK(fs_scene_get_servo_stats(rig.scene.get(), &longer.known));
  ck_assert(longer.added == 0 && longer.known.struct_size == sizeof longer && longer.known.ticks == stats.ticks);
  Longer longer_info(info, 1);
  OK(fs_scene_get_device_info(rig.scene.get(), &longer_info.known));
  ck_assert(longer_info.added == 0 && longer_info.known.struct_size == sizeof longer_info);
  stats.struct_size = 4104;
  EXPECT(FS_ERROR_VERSION, fs_scene_get_servo_stats(rig.scene.get(), &stats));
  stats.struct_size = 8;
  EXPECT(FS_ERROR_INVALID, fs_scene_get_servo_stats(rig.scene.get(), &stats));
  rig.servo.reset();
  EXPECT(FS_ERROR_STATE, fs_scene_get_hand(rig.scene.get(), nullptr, nullptr, nullptr));
}
END_TEST

START_TEST(rate_of_the_device) {
  Rig rig("rate");
  rig.fake.info.rate = 2000;
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  rig.start(options);
  rig.step(100);
  EXPECT_NEAR(now(rig.scene.get()), 0.05, 1e-12);
  EXPECT_NEAR(rig.fake.time, 0.05, 1e-12);
}
END_TEST

START_TEST(bad_options) {
  Rig rig("options");
  rig.device = rig.fake.open();
  const struct {
    const char* field;
    void (*spoil)(fs_servo_options&);
  } cases[]{{"mode", [](fs_servo_options& o) { o.mode = static_cast<fs_servo_mode>(3); }},
            {"mode", [](fs_servo_options& o) { o.mode = static_cast<fs_servo_mode>(-1); }},
            {"rate", [](fs_servo_options& o) { o.rate = 99; }},
            {"rate", [](fs_servo_options& o) { o.rate = 20001; }},
            {"rate", [](fs_servo_options& o) { o.rate = -1; }},
            {"rate", [](fs_servo_options& o) { o.rate = NAN; }},
            {"force_limit", [](fs_servo_options& o) { o.force_limit = 10.1; }},
            {"force_limit", [](fs_servo_options& o) { o.force_limit = -1; }},
            {"force_limit", [](fs_servo_options& o) { o.force_limit = NAN; }},
            {"torque_limit", [](fs_servo_options& o) { o.torque_limit = 1.1; }},
            {"torque_limit", [](fs_servo_options& o) { o.torque_limit = -1; }},
            {"slew_limit", [](fs_servo_options& o) { o.slew_limit = NAN; }},
            {"speed_limit", [](fs_servo_options& o) { o.speed_limit = infinite; }},
            {"ramp", [](fs_servo_options& o) { o.ramp = NAN; }},
            {"fade", [](fs_servo_options& o) { o.fade = infinite; }},
            {"blend", [](fs_servo_options& o) { o.blend = NAN; }},
            {"delay", [](fs_servo_options& o) { o.delay = NAN; }},
            {"delay", [](fs_servo_options& o) { o.delay = -0.01; }},
            {"damping", [](fs_servo_options& o) { o.damping = NAN; }},
            {"max_stiffness", [](fs_servo_options& o) { o.max_stiffness = NAN; }},
            {"priority", [](fs_servo_options& o) { o.priority = 100; }},
            {"cpu", [](fs_servo_options& o) { o.cpu = -1; }},
            {"cpu", [](fs_servo_options& o) { o.cpu = 1000000; }},
            {"delay", [](fs_servo_options& o) { o.delay = 10.1; }},
            {"damping", [](fs_servo_options& o) { o.damping = 1e10; }}};
  for (const auto& c : cases) {
    fs_servo_options options = virtual_options();
    c.spoil(options);
    fs_servo* servo = nullptr;
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_servo_start(rig.scene.get(), rig.device.get(), &options, &servo), c.field);
    ck_assert_ptr_null(servo);
  }
  fs_servo_options options = virtual_options();
  fs_servo* servo = nullptr;
  const Longer longer(options, 1);
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_servo_start(rig.scene.get(), rig.device.get(), &longer.known, &servo), "fs_servo_options");
  options.struct_size = 8;
  EXPECT(FS_ERROR_INVALID, fs_servo_start(rig.scene.get(), rig.device.get(), &options, &servo));
  // The servo's thread runs where the calling thread may run.
  cpu_set_t before, here;
  ck_assert_int_eq(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&here);
  CPU_SET(usable_processor(), &here);
  ck_assert_int_eq(sched_setaffinity(0, sizeof here, &here), 0);
  options = virtual_options();
  options.cpu = usable_processor() > 0 ? 1 : 2;
  if (options.cpu <= sysconf(_SC_NPROCESSORS_CONF)) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_servo_start(rig.scene.get(), rig.device.get(), &options, &servo),
                    "the calling thread may not run on");
  }
  ck_assert_int_eq(sched_setaffinity(0, sizeof before, &before), 0);
  // All options at their bounds; a refused start leaves device and scene free.
  options = virtual_options();
  options.rate = 20000;
  options.force_limit = 10;
  options.torque_limit = 1;
  options.slew_limit = options.blend = options.damping = options.max_stiffness = -1;
  options.priority = 99;
  options.cpu = usable_processor() + 1;
  rig.start(options);
  rig.step(10);
}
END_TEST

START_TEST(one_servo_each) {
  Rig rig("one");
  const FakeDevice other_fake("two");
  const Scene other_scene = make_scene();
  const Device other_device = other_fake.open();
  rig.start(plain());
  const fs_servo_options options = plain();
  fs_servo* servo = nullptr;
  EXPECT(FS_ERROR_STATE, fs_servo_start(rig.scene.get(), other_device.get(), &options, &servo));
  EXPECT(FS_ERROR_STATE, fs_servo_start(other_scene.get(), rig.device.get(), &options, &servo));
  ck_assert_ptr_null(servo);
  fs_state state;
  const fs_wrench wrench{{1, 0, 0}, {}};
  EXPECT(FS_ERROR_STATE, fs_device_read(rig.device.get(), &state));
  EXPECT(FS_ERROR_STATE, fs_device_write(rig.device.get(), &wrench));
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(rig.device.get(), &info));
  rig.step(1);
  rig.servo.reset();
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  OK(fs_device_read(rig.device.get(), &state));
  OK(fs_device_write(rig.device.get(), &wrench));
  EXPECT_VECTOR(rig.sent(), wrench.force, 0);
  // The refused starts left nothing behind.
  { const Servo second = start_servo(rig.scene.get(), other_device.get(), options); }
  { const Servo third = start_servo(other_scene.get(), rig.device.get(), options); }
}
END_TEST

START_TEST(device_by_hand) {  // scaled into the maxima
  FakeDevice fake("hand");
  fake.state.pose = at(1, 2, 3);
  Device device = fake.open();
  fs_state state;
  OK(fs_device_read(device.get(), &state));
  EXPECT_VECTOR(state.pose.position, (fs_vec3{1, 2, 3}), 0);
  fs_wrench wrench{{30, 40, 0}, {0, 0, -3}};
  OK(fs_device_write(device.get(), &wrench));
  EXPECT_VECTOR(fake.written.force, (fs_vec3{6, 8, 0}), 1e-12);
  EXPECT_VECTOR(unit(fake.written.torque), (fs_vec3{0, 0, -1}), 1e-12);
  ck_assert_double_le(norm(fake.written.torque), 1 + 1e-12);
  wrench.force.x = NAN;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_write(device.get(), &wrench), "wrench.force.x is nan, must be finite");
  fake.state.pose.position.x = NAN;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_read(device.get(), &state), "a pose or twist that is not finite");
  EXPECT_VECTOR(state.pose.position, (fs_vec3{1, 2, 3}), 0);  // it stays as it was
  fake.state.pose.position.x = 1;
  fake.read_status = FS_ERROR_DISCONNECTED;
  EXPECT(FS_ERROR_DISCONNECTED, fs_device_read(device.get(), &state));
  fake.write_status = FS_ERROR_IO;
  wrench.force.x = 1;
  EXPECT(FS_ERROR_IO, fs_device_write(device.get(), &wrench));
  fake.write_status = FS_OK;
  device.reset();
  ck_assert(!fake.is_open);
  EXPECT_VECTOR(fake.written.force, (fs_vec3{}), 0);
}
END_TEST

START_TEST(lives_on_without_its_makers) {
  Rig rig("orphan");
  set(rig.scene.get(), lift());
  rig.start(plain());
  rig.step(5);
  rig.scene.reset();
  rig.device.reset();
  rig.step(5);
  ck_assert(rig.fake.is_open);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  rig.servo.reset();
  ck_assert(!rig.fake.is_open);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
}
END_TEST

START_TEST(frames) {  // x_device = pose*(x_scene/scale), F_device = force_scale*(turned F)
  Rig rig("frames");
  fs_frame frame = fs_frame_init();
  frame.pose = {{0.1, 0.2, 0.3}, turn({0, 0, 1}, 1.5707963267948966)};
  frame.scale = 4;
  frame.force_scale = 0.5;
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  // In the scene a spring at (1, 0, 0); on the device that is at (0.1, 0.2 + 0.25, 0.3).
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.pose = at(1, 0, 0);
  spring.front = attract(10, 100);
  set(rig.scene.get(), spring);
  const fs_vec3 arm{0, 0, 0.4};  // scene metres, frame of the handle; 0.1 on the device
  OK(fs_scene_set_tool(rig.scene.get(), &arm, 1));
  // 20 mm off along the device's y: 80 mm along the scene's x.
  rig.fake.state.pose = at(0.1, 0.2 + 0.25 + 0.02, 0.3 - 0.1);
  rig.fake.state.twist.linear = {0, 0.03, 0};
  rig.start(plain());
  rig.step(3);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, -0.4, 0}), 1e-9);         // 0.5*10*0.08
  EXPECT_VECTOR(rig.fake.written.torque, (fs_vec3{0.1 * 0.4, 0, 0}), 1e-9);   // z x -y, in device metres
  fs_state state;
  fs_wrench sent;
  OK(fs_scene_get_hand(rig.scene.get(), &state, nullptr, &sent));
  EXPECT_VECTOR(state.pose.position, (fs_vec3{1.08, 0, -0.4}), 1e-9);
  EXPECT_VECTOR(state.twist.linear, (fs_vec3{0.12, 0, 0}), 1e-9);
  EXPECT_VECTOR(rotate(state.pose.orientation, {1, 0, 0}), (fs_vec3{0, -1, 0}), 1e-9);
  EXPECT_VECTOR(sent.force, (fs_vec3{-0.4, 0, 0}), 1e-9);  // along this scene's axes
  fs_tick tick;
  size_t count = 0;
  OK(fs_servo_get_record(rig.servo.get(), &tick, 1, &count));
  EXPECT_VECTOR(tick.state.pose.position, rig.fake.state.pose.position, 0);   // device frame
  EXPECT_VECTOR(tick.response.wrench.force, (fs_vec3{0, -0.4, 0}), 1e-9);
  EXPECT_NEAR(tick.response.stiffness.yy, -4 * 0.5 * 10, 1e-9);               // scale*force_scale*k
}
END_TEST

START_TEST(ages_stay) {  // a virtual servo begins at 0, whatever the scene's clock was
  Rig rig("ages");
  OK(fs_scene_set_time(rig.scene.get(), 10000));
  fs_object o = lift();
  o.name[0] = 'm';
  o.front = attract(10, 100);  // moves up with 0.5 m/s: the hand at 1 m is drawn down
  o.twist.linear = {0, 0, 0.5};
  set(rig.scene.get(), o);
  fs_object mortal = lift(0.5);
  mortal.lifetime = 5;
  set(rig.scene.get(), mortal);
  if (has_expressions()) {
    const Curve curve = make_expression("t");
    fs_object clock = fs_object_init("clock", FS_PRIMITIVE_PLANE);
    clock.pose.orientation = turn({0, 1, 0}, 1.5707963267948966);  // its front is +x
    clock.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 100);
    clock.front.curve = curve.get();
    set(rig.scene.get(), clock);
  }
  OK(fs_scene_set_time(rig.scene.get(), 10000.04));
  rig.fake.state.pose = at(1, 0, 1);
  rig.fake.info.force_max = 100;
  rig.start(plain());
  rig.step(30);  // 0.07 s old: moved by 35 mm
  EXPECT_NEAR(rig.sent().z, 0.5 - 10 * (1 - 0.035), 1e-9);
  if (has_expressions()) EXPECT_NEAR(rig.sent().x, 0.07, 1e-9);
  rig.step(4900);
  EXPECT_NEAR(rig.sent().z, 0.5 - 10 * 0.95, 1e-9);
  rig.step(100);  // 5.07 s: expired
  EXPECT_NEAR(rig.sent().z, -10 * 0.95, 1e-9);
  if (has_expressions()) EXPECT_NEAR(rig.sent().x, 5.07, 1e-9);
  rig.servo.reset();
  const Tool tool = make_tool(rig.scene.get());
  const fs_vec3 f = force_at(tool.get(), {1, 0, 1});  // on the clock that the scene has now
  EXPECT_NEAR(f.z, -10 * 0.95, 1e-9);
  if (has_expressions()) {
    ck_assert_double_ge(f.x, 5.07 - 1e-6);
    ck_assert_double_lt(f.x, 60);
  }
}
END_TEST

START_TEST(a_hundred_thousand_objects) {
  Rig rig("crowd");
  const Content content = crowd(100000);
  fill(rig.scene.get(), content);
  rig.start(plain());
  rig.step(5);
  const Tool tool = make_tool(rig.scene.get());
  Random random(5);
  for (int k = 0; k < 10; ++k) {
    // Put one beside the hand: felt by the servo at the next tick, and by the tool.
    const size_t i = random.below(content.objects.size());
    const fs_pose near = at(0.001, 0, 0), back = content.objects[i].pose;
    const fs_vec3 before = force_at(tool.get(), {});
    const fs_twist still{};
    OK(fs_object_move(rig.scene.get(), content.objects[i].name, &near, &still, FS_NOW));
    const fs_vec3 after = force_at(tool.get(), {});
    EXPECT_VECTOR(after - before, (fs_vec3{0.2, 0, 0}), 1e-9);
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), after, 1e-9);
    OK(fs_object_move(rig.scene.get(), content.objects[i].name, &back, &still, FS_NOW));
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), before, 1e-9);
  }
}
END_TEST

// On the real clock. Nothing here depends on how fast the machine is, only on what it does when it is late.

START_TEST(late_ticks_latch) {  // 20 in a row, each later than a period
  Rig rig("late");
  set(rig.scene.get(), lift());
  rig.device = rig.fake.open(false);
  fs_servo_options options = plain(0.1);
  options.mode = FS_SERVO_CALLER;
  options.rate = 2000;
  rig.servo = start_servo(rig.scene.get(), rig.device.get(), options);
  for (int k = 0; k < 40; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
    rig.step(1);
  }
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_LATE);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  ck_assert_uint_gt(stats_of(rig.scene.get()).misses, 0);
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
}
END_TEST

START_TEST(a_stall_ramps) {
  Rig rig("stall");
  set(rig.scene.get(), lift());
  rig.device = rig.fake.open(false);
  fs_servo_options options = plain(0.02);
  options.mode = FS_SERVO_CALLER;
  options.rate = 100;
  rig.servo = start_servo(rig.scene.get(), rig.device.get(), options);
  while (norm(rig.sent()) < 1.999) rig.step(1);  // three ticks, unless the machine stalls meanwhile
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  rig.step(1);
  ck_assert_double_lt(norm(rig.sent()), 1.999);
  ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);  // a single stall is no fault
}
END_TEST

START_TEST(its_own_thread) {
  Rig rig("thread");
  set(rig.scene.get(), lift());
  rig.device = rig.fake.open(false);
  fs_servo_options options = plain();
  options.mode = FS_SERVO_THREAD;
  rig.servo = start_servo(rig.scene.get(), rig.device.get(), options);
  EXPECT(FS_ERROR_UNSUPPORTED, fs_servo_step(rig.servo.get(), 1));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // for the figures below
  OK(fs_scene_sync(rig.scene.get(), 30));
  const fs_servo_stats stats = stats_of(rig.scene.get());
  std::vector<fs_tick> record(2000);
  size_t count = 0;
  OK(fs_servo_get_record(rig.servo.get(), record.data(), record.size(), &count));
  ck_assert_uint_gt(count, 0);
  for (size_t k = 0; k < count; ++k) {  // a machine that is too slow is a fault, too
    EXPECT_VECTOR(record[k].sent.force, (record[k].faults ? fs_vec3{} : fs_vec3{0, 0, 2}), 1e-9);
  }
  uint64_t last = 0;
  for (int looks = 0; looks < 30; ++looks) {  // every tick once, while they are written
    std::vector<fs_recorded_tick> more(2000);
    OK(fs_scene_get_record(rig.scene.get(), last, more.data(), more.size(), &count));
    for (size_t k = 0; k < count; ++k) {
      ck_assert(k == 0 && looks == 0 ? more[k].number >= 1 : more[k].number == last + 1);
      ck_assert(last == 0 || more[k].tick.state.time > 0);
      last = more[k].number;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const char* const granted[]{"none", "nice", "FIFO", "FIFO and locked memory"};
  std::printf("  thread: %lu ticks in 0.3 s, %lu missed, real time: %s; late p50 %.0f us, p99 %.0f us, max %.0f us\n",
              (unsigned long)stats.ticks, (unsigned long)stats.misses, granted[stats.realtime],
              1e6 * stats.late_p50, 1e6 * stats.late_p99, 1e6 * stats.late_max);
  rig.servo.reset();
  const std::lock_guard lock(rig.fake.mutex);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{}), 0);
}
END_TEST

START_TEST(the_simulator) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:?hold=0.01,0,0");
  fs_object o = hello().objects[0];
  OK(fs_object_set(scene.get(), &o));
  const Servo servo = start_servo(scene.get(), device.get(), virtual_options());
  OK(fs_servo_step(servo.get(), 5000));
  fs_state state;
  fs_response response;
  fs_wrench sent;
  OK(fs_scene_get_hand(scene.get(), &state, &response, &sent));
  ck_assert(state.flags & FS_STATE_READY);
  // The hand is between its target and the spring's origin; the force is that of the spring.
  ck_assert_double_gt(state.pose.position.x, 0.001);
  ck_assert_double_lt(state.pose.position.x, 0.01);
  EXPECT_VECTOR(response.wrench.force, -200.0 * state.pose.position, 1e-6);
  EXPECT_VECTOR(sent.force, response.wrench.force, 1e-6);
}
END_TEST

int main() {
  Suite* suite = suite_create("servo");
  add_case(suite, "thread", {its_own_thread});
  if (seeks_races) return run_suite(suite);
  add_case(suite, "force", {ramps_at_the_start, no_ramp, too_strong, limits_of_ones_own, axes_that_are_not_there,
                            enabled_or_not, frames});
  add_case(suite, "faults", {zero_until_ready, a_lost_device_comes_back, a_gap_without_the_hand, a_wrong_pose_beside_a_good_twist, events_that_nobody_fetches, an_old_pose_is_no_pose, told_again,
                             too_fast, not_a_number, a_jump_while_away_is_no_speed, speeds_are_worked_out});
  add_case(suite, "record", {the_record, the_record_of_a_scene, stats, rate_of_the_device});
  add_case(suite, "ownership", {bad_options, one_servo_each, device_by_hand,
                                lives_on_without_its_makers});
  add_case(suite, "time", {ages_stay, a_hundred_thousand_objects, late_ticks_latch, a_stall_ramps, the_simulator});
  return run_suite(suite);
}
