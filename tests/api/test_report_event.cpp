// Reports: what became of each object. Events: what happened meanwhile, polled.
#include <atomic>
#include <chrono>
#include <limits>
#include <map>
#include <thread>
#include <vector>

#include "api/support.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();

static fs_object point(const char* name, const fs_profile& profile) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = profile;
  return o;
}

static std::vector<fs_report> reports_of(fs_scene* scene) {
  std::vector<fs_report> reports(object_count(scene));
  size_t count = 0;
  OK(fs_scene_get_reports(scene, reports.data(), reports.size(), &count));
  return reports;
}

START_TEST(without_a_servo) {
  const Scene scene = make_scene();
  for (const char* name : {"b", "a", "c"}) {
    const fs_object o = point(name, attract(200, 3));
    OK(fs_object_set(scene.get(), &o));
  }
  std::map<std::string, fs_report> all;
  for (const fs_report& r : reports_of(scene.get())) all[r.name] = r;
  ck_assert_uint_eq(all.size(), 3);
  for (const auto& [name, r] : all) {
    ck_assert_int_eq(r.primitive, FS_PRIMITIVE_POINT);
    ck_assert_int_eq(r.state, FS_OBJECT_FELT);
    ck_assert_double_eq(r.weight, 1);
    EXPECT_NEAR(r.stiffness_wanted, 200, 1e-9);
    EXPECT_NEAR(r.stiffness_applied, r.stiffness_wanted, 0);
    ck_assert_double_eq(r.distance, infinite);  // nothing is near
    EXPECT_VECTOR(r.wrench.force, (fs_vec3{}), 0);
    for (double x : r.reserved) ck_assert_double_eq(x, 0);
    const fs_report single = report_of(scene.get(), name.c_str());
    ck_assert_int_eq(std::memcmp(&single, &r, sizeof r), 0);
  }
  fs_report two[2], untouched{};
  size_t count = 0;
  OK(fs_scene_get_reports(scene.get(), two, 2, &count));
  ck_assert_uint_eq(count, 3);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_report(scene.get(), "d", &untouched), "d");
  ck_assert_str_eq(untouched.name, "");
  EXPECT(FS_ERROR_INVALID, fs_scene_get_reports(scene.get(), nullptr, 1, &count));
}
END_TEST

START_TEST(revisions) {  // grow with every change but moves
  const Scene scene = make_scene();
  fs_object o = point("a", attract(200, 3));
  OK(fs_object_set(scene.get(), &o));
  uint64_t revision = report_of(scene.get(), "a").revision;
  auto grew = [&] {
    const uint64_t before = revision;
    revision = report_of(scene.get(), "a").revision;
    return revision > before;
  };
  o.front.gain = 100;
  OK(fs_object_set(scene.get(), &o));
  ck_assert(grew());
  o.enabled = false;
  OK(fs_object_change(scene.get(), &o, FS_PART_OTHER));
  ck_assert(grew());
  const fs_pose pose = at(1, 0, 0);
  OK(fs_object_move(scene.get(), "a", &pose, nullptr, FS_NOW));
  ck_assert(!grew());
  OK(fs_object_remove(scene.get(), "a"));
  OK(fs_object_set(scene.get(), &o));
  ck_assert(grew());
}
END_TEST

// The steepest slope of the force, at the device. On a plane whose sides push the same way nothing jumps at d = 0.
START_TEST(stiffness_wanted) {
  const Scene scene = make_scene();
  auto wanted = [&](fs_profile profile) {
    fs_object wall = fs_object_init("a", FS_PRIMITIVE_PLANE);
    wall.front = wall.back = profile;
    wall.back.sense = FS_SENSE_ATTRACTIVE;
    OK(fs_object_set(scene.get(), &wall));
    const fs_report r = report_of(scene.get(), "a");
    ck_assert_double_eq(r.stiffness_applied, r.stiffness_wanted);  // no caps yet
    return r.stiffness_wanted;
  };
  const fs_sense sense = FS_SENSE_REPULSIVE;
  EXPECT_NEAR(wanted(attract(200, 3)), 200, 1e-9);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_LINEAR_DECREASING, sense, -150, 1, 3)), 150, 1e-9);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_GAUSSIAN, sense, 5, 0.005, 5)), 5 / 0.005 * std::exp(-0.5), 1e-6);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_QUADRATIC, sense, 1000, 0, 2.5)), 2 * 1000 * 0.05, 1e-6);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_INVERSE, sense, 0.02, 0, 10)), 5000, 1e-6);
  EXPECT_NEAR(wanted(constant(sense, 2)), 0, 0);
  fs_profile cut = attract(100, 9);
  cut.reach = 0.02;  // 2 N, then none: a jump
  ck_assert_double_eq(wanted(cut), infinite);
  fs_object two_sides = fs_object_init("a", FS_PRIMITIVE_PLANE);
  two_sides.front = attract(100, 3);
  two_sides.back = attract(700, 3);
  OK(fs_object_set(scene.get(), &two_sides));
  EXPECT_NEAR(report_of(scene.get(), "a").stiffness_wanted, 700, 1e-9);
  fs_frame frame = fs_frame_init();
  frame.scale = 10;
  frame.force_scale = 0.5;
  OK(fs_scene_set_frame(scene.get(), &frame));
  EXPECT_NEAR(report_of(scene.get(), "a").stiffness_wanted, 3500, 1e-9);  // scale*force_scale*k
  const fs_object pull = point("a", constant(FS_SENSE_ATTRACTIVE, 1));    // turns over at the point: a jump
  OK(fs_object_set(scene.get(), &pull));
  ck_assert_double_eq(report_of(scene.get(), "a").stiffness_wanted, infinite);
}
END_TEST

// What jumps asks for an infinite stiffness: at d = 0, at the reach, and where two parts of a polyline are equally near.
START_TEST(what_jumps) {
  const Scene scene = make_scene();
  const auto wanted = [&](const fs_object& o) {
    OK(fs_object_set(scene.get(), &o));
    return report_of(scene.get(), o.name).stiffness_wanted;
  };
  const auto line = [&](std::initializer_list<fs_vec3> points, const fs_profile& profile, bool closed = false) {
    const Shape shape = make_polyline(std::data(points), points.size(), closed);
    fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
    o.shape = shape.get();
    o.front = profile;
    return wanted(o);
  };
  const fs_profile spring = attract(150, 2), bell = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 1, 0.01, 1);
  fs_profile late = attract(100, 2), quadratic = fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 1e3, 0, 2);
  late.offset = -1;  // none within 10 mm

  // Points.
  EXPECT_NEAR(wanted(point("p", spring)), 150, 0);
  EXPECT_NEAR(wanted(point("p", late)), 100, 0);
  ck_assert_double_eq(wanted(point("p", bell)), infinite);
  ck_assert_double_eq(wanted(point("p", constant(FS_SENSE_REPULSIVE, 1))), infinite);
  ck_assert_double_eq(wanted(point("p", fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 1, -1, 1))), infinite);
  ck_assert_double_eq(wanted(point("p", fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -9, 1, 1))),
                      infinite);
  late.reach = 0.01;  // f is 0 there: nothing jumps, and nothing is felt at all
  EXPECT_NEAR(wanted(point("p", late)), 0, 0);
  late.reach = 0;

  // A straight polyline is as a point; whichever way it runs, and wherever it lies.
  const fs_vec3 a{1, 2, 3}, b{1.1, 2.2, 2.9};
  EXPECT_NEAR(line({a, b}, spring), 150, 0);
  EXPECT_NEAR(line({a, 0.3 * (b - a) + a, 0.7 * (b - a) + a, b}, spring), 150, 0);
  EXPECT_NEAR(line({a, b, 0.5 * (b - a) + a}, spring, true), 150, 0);
  EXPECT_NEAR(line({a, a, a}, spring), 150, 0);
  ck_assert_double_eq(line({a, b}, bell), infinite);

  // One that is bent jumps wherever it is felt, also if f(0) = 0.
  for (const double bend : {1e-4, 0.01, 0.1}) {
    for (const bool closed : {false, true}) {
      const std::initializer_list<fs_vec3> points{{-0.05, 0, 0}, {0, bend, 0}, {0.05, 0, 0}};
      ck_assert_double_eq(line(points, spring, closed), infinite);
      ck_assert_double_eq(line(points, quadratic, closed), infinite);
      ck_assert_double_eq(line(points, late, closed), infinite);
      EXPECT_NEAR(line(points, attract(0, 2), closed), 0, 0);
      late.reach = 0.005;  // it is never felt
      EXPECT_NEAR(line(points, late, closed), 0, 0);
      late.reach = 0;
    }
  }

  // A plane or mesh: where front and back do not agree.
  const Content content = ball(100);
  for (const fs_primitive primitive : {FS_PRIMITIVE_PLANE, FS_PRIMITIVE_MESH}) {
    fs_object o = fs_object_init("surface", primitive);
    if (primitive == FS_PRIMITIVE_MESH) o.shape = content.shapes[0].get();
    o.back = attract(400, 3);
    EXPECT_NEAR(wanted(o), 400, 0);
    o.front = constant(FS_SENSE_REPULSIVE, 1);
    ck_assert_double_eq(wanted(o), infinite);
    o.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400, 1, 3);  // 1 N too, the same way
    EXPECT_NEAR(wanted(o), 400, 0);
    o.back.sense = FS_SENSE_REPULSIVE;  // the other way
    ck_assert_double_eq(wanted(o), infinite);
  }

  // A curve is looked at at several times.
  if (!has_expressions()) return;
  fs_object pulse = point("p", fs_profile{});
  pulse.front.kind = FS_PROFILE_CUSTOM;
  pulse.front.gain = pulse.front.limit = 1;
  const Curve later = make_expression("t*exp(-d/0.01)"), never = make_expression("30*d*(1+sin(12*t))*exp(-d/0.01)");
  pulse.front.curve = later.get();
  ck_assert_double_eq(wanted(pulse), infinite);
  pulse.front.curve = never.get();
  ck_assert_double_gt(wanted(pulse), 50);
  ck_assert_double_lt(wanted(pulse), 60.1);
}
END_TEST

START_TEST(under_a_servo) {
  Rig rig("report");
  fs_frame frame = fs_frame_init();  // the hand at (0, 0, 0.01) is at (1, 0, 0.1) in the scene
  frame.scale = 10;
  frame.pose = at(-0.1, 0, 0);
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  rig.fake.state.pose = at(0, 0, 0.01);
  fs_servo_options options = virtual_options();
  options.fade = 0.1;
  options.ramp = -1;
  rig.start(options);
  rig.step(1);
  fs_object o = point("a", attract(10, 3));
  o.pose = at(1, 0, 0);
  OK(fs_object_set(rig.scene.get(), &o));
  o = point("far", attract(10, 3));
  o.pose = at(1, 0, 9);
  o.front.reach = 0.1;
  OK(fs_object_set(rig.scene.get(), &o));
  rig.step(50);
  fs_report r = report_of(rig.scene.get(), "a");
  ck_assert_int_eq(r.state, FS_OBJECT_FADING);
  EXPECT_NEAR(r.weight, 0.5, 0.02);
  rig.step(100);
  r = report_of(rig.scene.get(), "a");
  ck_assert_int_eq(r.state, FS_OBJECT_FELT);
  ck_assert_double_eq(r.weight, 1);
  EXPECT_NEAR(r.distance, 0.1, 1e-9);
  EXPECT_VECTOR(r.point, (fs_vec3{1, 0, 0}), 1e-9);
  EXPECT_VECTOR(r.wrench.force, (fs_vec3{0, 0, -1}), 1e-9);
  EXPECT_VECTOR(report_of(rig.scene.get(), "far").wrench.force, (fs_vec3{}), 0);
  o = point("a", attract(10, 3));
  o.pose = at(1, 0, 0);
  o.enabled = false;
  OK(fs_object_set(rig.scene.get(), &o));
  rig.step(50);
  ck_assert_int_eq(report_of(rig.scene.get(), "a").state, FS_OBJECT_FADING);
  EXPECT_NEAR(report_of(rig.scene.get(), "a").weight, 0.5, 0.02);
  rig.step(100);
  ck_assert_int_eq(report_of(rig.scene.get(), "a").state, FS_OBJECT_DISABLED);
  ck_assert_double_eq(report_of(rig.scene.get(), "a").weight, 0);
  OK(fs_object_remove(rig.scene.get(), "far"));  // nameless at once, while it fades
  fs_report gone;
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_report(rig.scene.get(), "far", &gone));
  ck_assert_uint_eq(object_count(rig.scene.get()), 1);
}
END_TEST

// Events.

static fs_event next(fs_scene* scene, double timeout) {
  fs_event event;
  OK(fs_scene_next_event(scene, timeout, &event));
  return event;
}

START_TEST(nothing_happened) {
  const Scene scene = make_scene();
  fs_event event = next(scene.get(), 0);
  ck_assert_int_eq(event.kind, FS_EVENT_NONE);
  const auto start = std::chrono::steady_clock::now();
  event = next(scene.get(), 0.05);
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
  ck_assert_int_eq(event.kind, FS_EVENT_NONE);
  ck_assert_double_ge(waited.count(), 0.049);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_next_event(scene.get(), -1, &event), "timeout");
  EXPECT(FS_ERROR_INVALID, fs_scene_next_event(scene.get(), NAN, &event));
}
END_TEST

// The next event of this kind for the object; those of other kinds are passed over.
static fs_event next_of(fs_scene* scene, fs_event_kind kind) {
  for (;;) {
    const fs_event event = next(scene, 2);
    if (event.kind == kind) return event;
    ck_assert_msg(event.kind != FS_EVENT_NONE, "no event of kind %d came", kind);
  }
}

START_TEST(expired) {
  Rig rig("expired");
  fs_servo_options options = virtual_options();
  options.fade = 0.1;
  rig.start(options);
  rig.step(1);
  fs_object o = point("short", attract(10, 3));
  o.lifetime = 0.2;
  OK(fs_object_set(rig.scene.get(), &o));
  rig.step(150);
  for (fs_event e = next(rig.scene.get(), 0); e.kind != FS_EVENT_NONE; e = next(rig.scene.get(), 0)) {
    ck_assert_int_ne(e.kind, FS_EVENT_EXPIRED);
  }
  rig.step(500);
  const fs_event event = next_of(rig.scene.get(), FS_EVENT_EXPIRED);
  ck_assert_str_eq(event.name, "short");
  ck_assert_double_gt(event.time, 0.19);
  ck_assert_double_lt(event.time, 0.66);
  fs_report r = report_of(rig.scene.get(), "short");  // it stays, at weight 0
  ck_assert_double_eq(r.weight, 0);
  rig.step(500);  // told once
  for (fs_event e = next(rig.scene.get(), 0); e.kind != FS_EVENT_NONE; e = next(rig.scene.get(), 0)) {
    ck_assert_int_ne(e.kind, FS_EVENT_EXPIRED);
  }
  const fs_pose pose = at(0, 0, 0);
  OK(fs_object_move(rig.scene.get(), "short", &pose, nullptr, FS_NOW));  // and comes back when moved, and expires again
  rig.step(150);
  EXPECT_NEAR(report_of(rig.scene.get(), "short").weight, 1, 1e-9);
  rig.step(500);
  const fs_event again = next_of(rig.scene.get(), FS_EVENT_EXPIRED);
  ck_assert_str_eq(again.name, "short");
}
END_TEST

START_TEST(device_events) {
  Rig rig("device");
  rig.start(virtual_options());
  rig.step(10);
  fs_event event = next_of(rig.scene.get(), FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, FS_OK);  // ready
  rig.fake.read_status = FS_ERROR_DISCONNECTED;
  EXPECT(FS_ERROR_DISCONNECTED, fs_servo_step(rig.servo.get(), 10));
  event = next_of(rig.scene.get(), FS_EVENT_DEVICE);
  ck_assert_int_lt(event.status, 0);
  ck_assert_uint_gt(std::strlen(event.text), 3);
  rig.fake.read_status = FS_OK;
  rig.step(10);
  event = next_of(rig.scene.get(), FS_EVENT_DEVICE);
  ck_assert_int_eq(event.status, FS_OK);
  rig.fake.state.pose.position.x = NAN;
  fs_servo_step(rig.servo.get(), 10);
  event = next_of(rig.scene.get(), FS_EVENT_DEVICE);  // stopped by a fault
  ck_assert_int_lt(event.status, 0);
  ck_assert_uint_gt(std::strlen(event.text), 3);
}
END_TEST

START_TEST(waiting_holds_up_nobody) {
  Rig rig("waiting");
  rig.start(virtual_options());
  rig.step(1);
  while (next(rig.scene.get(), 0).kind != FS_EVENT_NONE) {
  }
  fs_event event{};
  std::atomic<bool> is_back{false};
  std::thread waiter([&] {
    fs_scene_next_event(rig.scene.get(), 30, &event);
    is_back = true;
  });
  const fs_object o = point("a", attract(10, 3));
  for (int k = 0; k < 100; ++k) {
    OK(fs_object_set(rig.scene.get(), &o));
    rig.step(1);
  }
  ck_assert(!is_back);
  rig.fake.read_status = FS_ERROR_DISCONNECTED;
  fs_servo_step(rig.servo.get(), 1);
  waiter.join();
  ck_assert_int_eq(event.kind, FS_EVENT_DEVICE);
}
END_TEST

START_TEST(overflow) {  // older events are dropped, and counted
  const size_t many = 20000;
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  OK(fs_scene_begin(scene.get()));
  fs_object o = point("", attract(10, 3));
  o.lifetime = 1;
  for (size_t i = 0; i < many; ++i) {
    std::snprintf(o.name, sizeof o.name, "o%zu", i);
    OK(fs_object_set(scene.get(), &o));
  }
  OK(fs_scene_commit(scene.get()));
  OK(fs_scene_set_time(scene.get(), 12));
  size_t fetched = 0, dropped = 0;
  std::map<std::string, int> seen;
  for (fs_event e = next(scene.get(), 0); e.kind != FS_EVENT_NONE; e = next(scene.get(), 0)) {
    if (e.kind == FS_EVENT_EXPIRED) {
      ++fetched;
      ck_assert_int_eq(++seen[e.name], 1);
    }
    if (e.kind == FS_EVENT_OVERFLOW) dropped += static_cast<size_t>(e.value);
  }
  ck_assert_uint_eq(fetched + dropped, many);
  std::printf("  events: %zu kept, %zu dropped and counted\n", fetched, dropped);
}
END_TEST

int main() {
  Suite* suite = suite_create("report_event");
  add_case(suite, "reports", {without_a_servo, revisions, stiffness_wanted, what_jumps, under_a_servo});
  add_case(suite, "events", {nothing_happened, expired, device_events, waiting_holds_up_nobody, overflow});
  return run_suite(suite);
}
