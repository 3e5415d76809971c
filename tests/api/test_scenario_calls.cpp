// What happens to a scene over time: the same tests run on a scene in this process and on one that is connected to a
// server: reports, events, sync, the hand; no step in force; the simulator, and a servo that runs by itself.
#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <utility>

#include "api/world.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();

// ---------------------------------------------------------------------------------------------------------- reports

START_TEST(reports) {
  World w(_i);
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 0);
  fs_frame frame = fs_frame_init();  // the hand at (0, 0, 0.01) of the device is at (1, 0, 0.1) in the scene
  frame.scale = 10;
  frame.force_scale = 0.5;
  frame.pose = at(-0.1, 0, 0);
  OK(fs_scene_set_frame(w.scene, &frame));
  w.fake.state.pose = at(0, 0, 0.01);
  w.settle();

  w.set(spring("a", {1, 0, 0}, 10));
  fs_report r = report_of(w.scene, "a");
  ck_assert_str_eq(r.name, "a");
  ck_assert_int_eq(r.primitive, FS_PRIMITIVE_POINT);
  ck_assert_int_eq(r.state, FS_OBJECT_PENDING);  // no tick has used it
  ck_assert(r.weight == 0 && r.distance == infinite);
  EXPECT_VECTOR(r.wrench.force, (fs_vec3{}), 0);
  w.settle();
  r = report_of(w.scene, "a");
  ck_assert_int_eq(r.state, FS_OBJECT_FELT);
  ck_assert_double_eq(r.weight, 1);
  EXPECT_NEAR(r.stiffness_wanted, 10 * 0.5 * 10, 1e-9);
  ck_assert_double_eq(r.stiffness_applied, r.stiffness_wanted);
  EXPECT_NEAR(r.distance, 0.1, 1e-9);
  EXPECT_VECTOR(r.point, (fs_vec3{1, 0, 0}), 1e-9);
  EXPECT_VECTOR(r.wrench.force, (fs_vec3{0, 0, -1}), 1e-9);
  EXPECT_VECTOR(r.wrench.torque, (fs_vec3{}), 1e-9);
  ck_assert_double_eq(r.texture_lost, 0);
  ck_assert_double_eq(r.impact_lost, 0);
  for (double x : r.reserved) ck_assert_double_eq(x, 0);
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{0, 0, -0.5}), 1e-9);

  fs_object far = spring("far", {1, 0, 9}, 10);
  far.front.reach = 0.1;
  w.set(far);
  fs_object jump = push("jump", 1);
  jump.back = constant(FS_SENSE_REPULSIVE, 1);
  w.set(jump);
  w.settle();
  ck_assert_double_eq(report_of(w.scene, "far").distance, infinite);
  ck_assert_int_eq(report_of(w.scene, "far").state, FS_OBJECT_FELT);
  ck_assert_double_eq(report_of(w.scene, "jump").stiffness_wanted, infinite);
  ck_assert_int_eq(report_of(w.scene, "jump").primitive, FS_PRIMITIVE_PLANE);

  // While it fades out, and afterwards.
  jump.enabled = false;
  w.set(jump);
  w.settle();
  ck_assert_int_eq(report_of(w.scene, "jump").state, FS_OBJECT_DISABLED);
  ck_assert_double_eq(report_of(w.scene, "jump").weight, 0);
  EXPECT_VECTOR(report_of(w.scene, "far").wrench.force, (fs_vec3{}), 0);
  OK(fs_object_remove(w.scene, "far"));  // nameless at once, while it fades
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 2);
  fs_report gone{};
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_report(w.scene, "far", &gone), "far");
  ck_assert_str_eq(gone.name, "");

  // The list has the same reports.
  std::map<std::string, fs_report> all;
  for (const fs_report& report : own_reports_of(w.scene)) all[report.name] = report;
  ck_assert_uint_eq(all.size(), 2);
  for (const auto& [name, report] : all) {
    const fs_report single = report_of(w.scene, name.c_str());
    ck_assert_int_eq(std::memcmp(&single, &report, sizeof report), 0);
  }
  fs_report one;
  size_t count = 0;
  OK(fs_scene_get_reports(w.scene, &one, 1, &count));
  ck_assert_uint_eq(count, 2);
}
END_TEST

START_TEST(fading_reports) {  // a long fade, and what a report says on the way
  fs_servo_options options = world_options();
  options.fade = 10;
  World w(_i, options);
  w.set(push("a"));
  OK(w.sync(w.scene));
  w.step_until(5);
  const fs_report r = report_of(w.scene, "a");
  ck_assert_int_eq(r.state, FS_OBJECT_FADING);
  ck_assert_double_gt(r.weight, 0.3);
  ck_assert_double_lt(r.weight, 0.51);
  EXPECT_VECTOR(r.wrench.force, (fs_vec3{0, 0, 2 * r.weight}), 1e-9);  // with its weight
  EXPECT_NEAR(w.fake.written.force.z, 2 * r.weight, 1e-9);
  fs_response response;
  OK(fs_scene_get_hand(w.scene, nullptr, &response, nullptr));
  ck_assert_uint_eq(response.flags, FS_RESPONSE_FADING);
  fs_object o = push("a");
  o.enabled = false;
  OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
  OK(w.sync(w.scene));
  const double weight = report_of(w.scene, "a").weight;
  w.step(100);
  EXPECT_NEAR(report_of(w.scene, "a").weight, weight - 0.01, 1e-9);
  ck_assert_int_eq(report_of(w.scene, "a").state, FS_OBJECT_FADING);
}
END_TEST

START_TEST(revisions) {  // grow with every change but moves
  World w(_i);
  fs_object o = spring("a");
  w.set(o);
  uint64_t revision = report_of(w.scene, "a").revision;
  const auto grew = [&] {
    OK(w.sync(w.scene));
    const uint64_t before = std::exchange(revision, report_of(w.scene, "a").revision);
    ck_assert_uint_ge(revision, before);
    return revision > before;
  };
  w.set(o);
  ck_assert(grew());
  o.enabled = false;
  OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
  ck_assert(grew());
  OK(fs_object_change(w.scene, &o, 0));
  ck_assert(!grew());
  const fs_pose pose = at(1, 0, 0);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  ck_assert(!grew());
  OK(fs_scene_begin(w.scene));
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  w.set(spring("b"));
  OK(fs_scene_commit(w.scene));
  ck_assert(!grew());
  OK(fs_scene_begin(w.scene));
  w.set(o);
  OK(fs_scene_cancel(w.scene));
  ck_assert(!grew());
  OK(fs_object_remove(w.scene, "a"));
  w.set(o);
  ck_assert(grew());
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- events

START_TEST(device_events) {
  World w(_i);
  w.step(10);
  fs_event event = next_event(w.scene, FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, FS_OK);  // ready
  ck_assert_str_eq(event.name, "fake device");
  EXPECT_NEAR(event.time, 0.001, 1e-12);
  ck_assert_double_eq(event.value, 0);
  w.fake.read_status = FS_ERROR_DISCONNECTED;
  w.step(10);
  event = next_event(w.scene, FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, FS_ERROR_DISCONNECTED);
  ck_assert_double_eq(event.value, FS_FAULT_DEVICE);
  EXPECT_NEAR(event.time, 0.011, 1e-12);
  ck_assert_str_eq(event.text, "lost: it is not connected; the force will ramp up again");
  w.fake.read_status = FS_OK;
  w.step(10);
  ck_assert_int_eq(next_event(w.scene, FS_EVENT_DEVICE).status, FS_OK);
  w.fake.state.flags = 0;
  w.step(10);
  event = next_event(w.scene, FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, FS_ERROR_STATE);
  ck_assert_str_eq(event.text, "not ready; the force will ramp up again");
  w.fake.state.flags = FS_STATE_READY;
  w.step(10);
  ck_assert_int_eq(next_event(w.scene, FS_EVENT_DEVICE).status, FS_OK);
  w.fake.state.pose.position.x = NAN;
  w.step(10);
  event = next_event(w.scene, FS_EVENT_DEVICE);  // stopped by a fault
  ck_assert_int_eq(event.status, FS_ERROR_STATE);
  ck_assert_double_eq(event.value, FS_FAULT_NUMBER);
  ck_assert_uint_gt(std::strlen(event.text), 3);
  ck_assert_uint_eq(stats_of(w.scene).faults & FS_FAULT_NUMBER, FS_FAULT_NUMBER);
  ck_assert_uint_eq(events_now(w.scene).size(), 0);
}
END_TEST

START_TEST(nothing_happens) {
  World w(_i);
  w.step();
  next_event(w.scene, FS_EVENT_DEVICE);
  for (const double timeout : {0.0, 0.05}) {
    const auto start = std::chrono::steady_clock::now();
    fs_event event;
    OK(fs_scene_next_event(w.scene, timeout, &event));
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    ck_assert_int_eq(event.kind, FS_EVENT_NONE);
    ck_assert_double_ge(waited.count(), 0.98 * timeout);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_next_event(w.scene, -1, &event), "timeout");
  }
}
END_TEST

START_TEST(ready_events) {  // of a connected scene alone
  World w(_i);
  OK(fs_scene_begin(w.scene));
  for (const char* name : {"a", "b"}) w.set(spring(name));
  OK(fs_scene_commit(w.scene));
  w.settle();
  std::map<std::string, int> seen;
  const auto fetch = [&] {
    fs_event event;
    OK(fs_scene_next_event(w.scene, 0, &event));
    if (event.kind == FS_EVENT_READY) ++seen[event.name];
    if (event.kind == FS_EVENT_READY) ck_assert_int_eq(event.status, FS_OK);
    return event.kind != FS_EVENT_NONE;
  };
  if (_i == connected) ck_assert(eventually([&] { return !fetch() && seen.size() == 2; }));
  w.set(spring("a", {1, 2, 3}));  // the name exists already
  w.settle();
  wait_a_little(0.03);
  while (fetch()) {
  }
  if (_i == connected) {
    ck_assert(seen.size() == 2 && seen["a"] == 1 && seen["b"] == 1);
  } else {
    ck_assert_uint_eq(seen.size(), 0);
  }
}
END_TEST

START_TEST(waiting_holds_up_nobody) {
  World w(_i);
  w.step();
  next_event(w.scene, FS_EVENT_DEVICE);
  fs_event event{};
  std::atomic<bool> is_back{false};
  std::thread waiter([&] {
    do {
      fs_scene_next_event(w.scene, 30, &event);
    } while (event.kind == FS_EVENT_READY);
    is_back = true;
  });
  const fs_object o = spring("a");
  fs_status status = FS_OK;
  for (int k = 0; k < 100; ++k) {
    status = std::min(status, fs_object_set(w.scene, &o));
    w.step();
  }
  const bool was_back = is_back;
  w.fake.read_status = FS_ERROR_DISCONNECTED;
  w.step();
  waiter.join();
  EXPECT(FS_OK, status);
  ck_assert(!was_back);
  ck_assert_int_eq(event.kind, FS_EVENT_DEVICE);
}
END_TEST

START_TEST(overflow) {  // older events are dropped, and counted
  const size_t many = 3000;
  World w(_i);
  w.step();
  next_event(w.scene, FS_EVENT_DEVICE);
  OK(fs_scene_begin(w.scene));
  for (size_t i = 0; i < many; ++i) {
    fs_object o = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    o.lifetime = 0.01;
    w.set(o);
  }
  OK(fs_scene_commit(w.scene));
  w.settle();
  wait_a_little(0.05);  // the server passes the events on
  std::map<std::string, int> ready, expired;
  size_t dropped = 0, fetched = 0;
  const size_t all = _i == connected ? 2 * many : many;
  const bool is_whole = eventually([&] {
    for (;;) {
      fs_event event;
      OK(fs_scene_next_event(w.scene, 0, &event));
      if (event.kind == FS_EVENT_NONE) break;
      if (event.kind == FS_EVENT_READY) ck_assert_int_eq(++ready[event.name], 1);
      if (event.kind == FS_EVENT_EXPIRED) ck_assert_int_eq(++expired[event.name], 1);
      if (event.kind == FS_EVENT_OVERFLOW) dropped += static_cast<size_t>(event.value);
      if (event.kind != FS_EVENT_OVERFLOW) ++fetched;
    }
    return fetched + dropped >= all;
  });
  ck_assert_msg(is_whole, "%zu were fetched and %zu dropped of %zu", fetched, dropped, all);
  ck_assert_uint_eq(fetched + dropped, all);
  ck_assert_uint_gt(dropped, 0);
}
END_TEST

// ---------------------------------------------------------------------------------------------------- sync, the hand

START_TEST(sync_waits) {
  World w(_i);
  w.step();
  OK(w.sync(w.scene));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_sync(w.scene, -1), "timeout");
  EXPECT(FS_ERROR_INVALID, fs_scene_sync(w.scene, NAN));
  w.set(push("a"));
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(w.scene, 0));
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, fs_scene_sync(w.scene, 0.02), "0.02");  // nobody steps
  OK(w.sync(w.scene));
  const fs_pose pose = at(0, 0, -100);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(w.scene, 0.02));
  OK(w.sync(w.scene));
  OK(fs_scene_begin(w.scene));  // the changes of an open group do not count
  w.set(push("b"));
  OK(w.sync(w.scene));
  OK(fs_scene_commit(w.scene));
  // Several syncs at once.
  std::atomic<int> good{0};
  {
    const Stepper stepper(w.servo.get());
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&, i] {
        const fs_object o = push(("t" + std::to_string(i)).c_str());
        bool is_good = true;
        for (int k = 0; k < 10; ++k) {
          is_good = is_good && fs_object_set(w.scene, &o) == FS_OK && fs_scene_sync(w.scene, long_enough) == FS_OK;
        }
        good += is_good;
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  ck_assert_int_eq(good, 4);
  w.settle();
  EXPECT_NEAR(w.fake.written.force.z, 6 * 2, 1e-12);
}
END_TEST

START_TEST(hand_stats_device) {
  World w(_i);
  fs_state state;
  fs_response response;
  fs_wrench sent;
  const fs_state zero{};
  OK(fs_scene_get_hand(w.scene, &state, &response, &sent));  // before the first tick
  EXPECT_VECTOR(state.pose.position, (fs_vec3{}), 0);
  ck_assert_double_eq(state.pose.orientation.w, 1);
  ck_assert_double_eq(response.proxy.orientation.w, 1);
  ck_assert(state.time == 0 && state.flags == 0 && response.felt_count == 0);
  ck_assert_int_eq(std::memcmp(&sent, &zero, sizeof sent), 0);
  OK(fs_scene_get_hand(w.scene, nullptr, nullptr, nullptr));

  w.fake.state.pose = {{0.01, 0.02, 0.03}, turn({1, 0, 0}, 0.5)};
  w.fake.state.buttons = 5;
  w.set(push("a"));
  w.settle();
  OK(fs_scene_get_hand(w.scene, &state, &response, &sent));
  EXPECT_VECTOR(state.pose.position, (fs_vec3{0.01, 0.02, 0.03}), 0);
  EXPECT_NEAR(state.pose.orientation.x, std::sin(0.25), 1e-15);
  EXPECT_NEAR(state.time, now(w.scene), 1e-12);
  ck_assert_uint_eq(state.buttons, 5);
  ck_assert_uint_eq(state.flags, FS_STATE_READY);
  EXPECT_VECTOR(response.wrench.force, (fs_vec3{0, 0, 2}), 1e-12);
  ck_assert_uint_eq(response.felt_count, 1);
  EXPECT_VECTOR(sent.force, (fs_vec3{0, 0, 2}), 1e-12);

  const fs_servo_stats stats = stats_of(w.scene), own = stats_of(w.base.get());
  ck_assert_int_eq(std::memcmp(&stats, &own, sizeof stats), 0);
  EXPECT_NEAR(static_cast<double>(stats.ticks) / 1000, now(w.scene), 1e-9);
  ck_assert_uint_eq(stats.protections_off, FS_OFF_SLEW | FS_OFF_STIFFNESS | FS_OFF_DAMPING | FS_OFF_BLEND |
                                               FS_OFF_RAMP | FS_OFF_SPEED);
  fs_device_info info = fs_device_info_init(), own_info = info;
  OK(fs_scene_get_device_info(w.scene, &info));
  OK(fs_scene_get_device_info(w.base.get(), &own_info));
  ck_assert_int_eq(std::memcmp(&info, &own_info, sizeof info), 0);
  ck_assert_str_eq(info.name, "fake device");
  EXPECT(FS_ERROR_STATE, fs_scene_set_time(w.scene, 10));

  w.fake.read_status = FS_ERROR_DISCONNECTED;  // lost: the pose stays the last known one
  w.step(3);
  OK(fs_scene_get_hand(w.scene, &state, &response, &sent));
  EXPECT_VECTOR(state.pose.position, (fs_vec3{0.01, 0.02, 0.03}), 0);
  ck_assert(state.flags == 0 && state.buttons == 0);
  EXPECT_VECTOR(response.wrench.force, (fs_vec3{}), 0);
  EXPECT_VECTOR(sent.force, (fs_vec3{}), 0);
  ck_assert_uint_eq(stats_of(w.scene).device_errors, 3);
}
END_TEST

START_TEST(the_simulator) {  // a hand of 300 N/m and a spring of 200 N/m come to rest
  World w(_i, world_options(), "sim:?hand=firm&hand_stiffness=300&friction=0&encoder=ideal");
  w.step(100);
  w.set(spring("a", {0.02, 0, 0}, 200));
  OK(w.sync(w.scene));
  w.step(5000);
  const std::vector<fs_tick> record = record_of(w.servo.get());
  EXPECT_VECTOR(record.back().state.pose.position, (fs_vec3{0.008, 0, 0}), 1e-6);
  EXPECT_VECTOR(record.back().sent.force, (fs_vec3{2.4, 0, 0}), 2e-4);
  OK(fs_object_remove(w.scene, "a"));
  OK(w.sync(w.scene));
  w.step(5000);
  EXPECT_VECTOR(record_of(w.servo.get()).back().state.pose.position, (fs_vec3{}), 1e-6);
}
END_TEST

// ------------------------------------------------------------------------------------------------- a servo that runs

START_TEST(a_running_servo) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  options.priority = -1;
  World w(_i, options);
  const auto is_felt = [&](fs_vec3 force) {
    return eventually([&] {
      w.resume_after_lateness();
      fs_wrench sent;
      OK(fs_scene_get_hand(w.scene, nullptr, nullptr, &sent));
      return norm(sent.force - force) < 1e-9;
    });
  };
  ck_assert_int_eq(next_event(w.scene, FS_EVENT_DEVICE).status, FS_OK);
  w.set(spring("a"));
  OK(w.sync(w.scene));
  const double before = now(w.scene);
  for (int k = 0; k < 200; ++k) {  // as an application that tracks something
    const fs_pose pose = at(0.001 * k, 0, 0);
    OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
    if (k % 4 == 0) wait_a_little();
  }
  ck_assert_double_gt(now(w.scene), before);
  const fs_pose pose = at(0.05, 0.01, 0);
  const fs_twist still{};
  OK(fs_object_move(w.scene, "a", &pose, &still, FS_NOW));
  ck_assert(is_felt({5, 1, 0}));
  OK(fs_scene_set_clutch(w.scene, true));
  ck_assert(is_felt({}));
  {
    const std::lock_guard lock(w.fake.mutex);
    w.fake.state.pose = at(0, 0.03, 0);
  }
  OK(w.sync(w.scene));
  ck_assert(eventually([&] {
    fs_state state;
    OK(fs_scene_get_hand(w.scene, &state, nullptr, nullptr));
    return state.pose.position.y == 0.03;
  }));
  OK(fs_scene_set_clutch(w.scene, false));
  ck_assert(is_felt({5, 1, 0}));
  EXPECT_VECTOR(frame_of(w.scene).pose.position, (fs_vec3{0, 0.03, 0}), 1e-12);
  fs_object o = push("short", 1);
  o.lifetime = 0.1;
  w.set(o);
  const fs_event expired = next_event(w.scene, FS_EVENT_EXPIRED);
  ck_assert_str_eq(expired.name, "short");
  ck_assert(is_felt({5, 1, 0}));
  {
    const std::lock_guard lock(w.fake.mutex);
    w.fake.read_status = FS_ERROR_DISCONNECTED;
  }
  fs_event lost;
  do {
    lost = next_event(w.scene, FS_EVENT_DEVICE);
  } while (lost.value == double{FS_FAULT_LATE});
  ck_assert_int_eq(lost.status, FS_ERROR_DISCONNECTED);
  ck_assert(is_felt({}));
}
END_TEST

int main() {
  Suite* suite = suite_create("scenario_calls");
  add_on_both(suite, "reports", {reports, fading_reports, revisions});
  add_on_both(suite, "events", {device_events, nothing_happens, ready_events, waiting_holds_up_nobody, overflow},
              OwnThreads::yes);
  add_on_both(suite, "sync", {sync_waits, hand_stats_device, a_running_servo}, OwnThreads::yes);
  add_on_both(suite, "force", {the_simulator});
  return run_suite(suite);
}
