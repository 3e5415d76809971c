// Time in a scene: the clock, extrapolation by twist, twists worked out from moves, t of f(d, t), lifetimes.
#include <ctime>
#include <vector>

#include "api/support.h"

using namespace scenes;

// A scene on a clock told by the test, with one object whose place can be felt.
struct Watched {
  Scene scene = make_scene();
  Tool tool = make_tool(scene.get());

  explicit Watched(double time) {
    tell(time);
    set(0);
  }
  void tell(double time) { OK(fs_scene_set_time(scene.get(), time)); }
  void set(double x, fs_twist twist = {}, double time = FS_NOW) {
    fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
    o.front = attract(1, 1e9);
    o.pose = at(x, 0, 0);
    o.twist = twist;
    o.time = time;
    OK(fs_object_set(scene.get(), &o));
  }
  void move(double x, double time, const fs_twist* twist = nullptr) {
    const fs_pose pose = at(x, 0, 0);
    OK(fs_object_move(scene.get(), "a", &pose, twist, time));
  }
  // Where the object is along x at `time`: the hand at (0, 0, 1) is drawn by 1 N for each metre.
  double where(double time) { return force_at(tool.get(), {0, 0, 1}, time).x; }
};

START_TEST(given_twists) {  // from `time` on, never back, for 0.1 s at most
  Watched w(10);
  w.set(1, {{2, 0, 0}, {}}, 20);
  EXPECT_NEAR(w.where(15), 1, 1e-15);
  EXPECT_NEAR(w.where(20), 1, 1e-15);
  EXPECT_NEAR(w.where(20.03), 1.06, 1e-12);
  EXPECT_NEAR(w.where(20.1), 1.2, 1e-12);
  EXPECT_NEAR(w.where(21), 1.2, 1e-12);
  EXPECT_NEAR(w.where(1e6), 1.2, 1e-12);
  const fs_twist twist{{-1, 0, 0}, {}}, still{};
  w.move(5, 30, &twist);
  EXPECT_NEAR(w.where(30.05), 4.95, 1e-12);
  EXPECT_NEAR(w.where(31), 4.9, 1e-12);
  w.move(6, 30.04, &still);  // a twist of zero is a twist
  EXPECT_NEAR(w.where(30.1), 6, 1e-15);
}
END_TEST

START_TEST(given_turns) {  // about the origin of the object, along the axes of the scene
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  const fs_vec3 ends[]{{0, 0, 0}, {1, 0, 0}};
  const Shape line = make_polyline(ends, 2, false);
  fs_object o = fs_object_init("a", FS_PRIMITIVE_POLYLINE);
  o.shape = line.get();
  o.front = attract(1, 1e9);
  o.pose = {{0, 5, 0}, turn({0, 0, 1}, 1)};  // the object's x points at 1 rad in the scene
  o.twist = {{0, 1, 0}, {0, 0, 4}};
  o.time = 10;
  OK(fs_object_set(scene.get(), &o));
  // After 0.05 s: origin at y = 5.05, turned to 1.2 rad; the end of the line is drawn at from far outside.
  const fs_vec3 end = fs_vec3{0, 5.05, 0} + fs_vec3{std::cos(1.2), std::sin(1.2), 0};
  const fs_vec3 x = fs_vec3{0, 5.05, 0} + 9.0 * fs_vec3{std::cos(1.2), std::sin(1.2), 0};
  EXPECT_VECTOR(force_at(tool.get(), x, 10.05), end - x, 1e-12);
  o.pose.orientation = turn({1, 0, 0}, 1.5707963267948966);  // about x: its own y is the scene's z
  o.twist = {{}, {0, 0, 4}};                                 // but it turns about the scene's z
  OK(fs_object_set(scene.get(), &o));
  const fs_vec3 end_z = fs_vec3{0, 5, 0} + fs_vec3{std::cos(0.4), std::sin(0.4), 0};
  const fs_vec3 x_z = fs_vec3{0, 5, 0} + 9.0 * fs_vec3{std::cos(0.4), std::sin(0.4), 0};
  EXPECT_VECTOR(force_at(tool.get(), x_z, 11), end_z - x_z, 1e-12);
}
END_TEST

START_TEST(worked_out_twists) {
  Watched w(10);          // at 0 since 10 s
  w.move(0.04, 10.04);    // 1 m/s, used for at most 0.08 s
  EXPECT_NEAR(w.where(10.03), 0.04, 1e-12);
  EXPECT_NEAR(w.where(10.09), 0.09, 1e-12);
  EXPECT_NEAR(w.where(10.12), 0.12, 1e-12);
  EXPECT_NEAR(w.where(12), 0.12, 1e-12);
  w.move(0.04, 10.05);    // it has not moved since: 0 m/s
  EXPECT_NEAR(w.where(10.1), 0.04, 1e-12);
  w.move(0.24, 10.15);    // 2 m/s: 0.1 s, and no longer, though twice the time between is 0.2
  EXPECT_NEAR(w.where(10.2), 0.34, 1e-12);
  EXPECT_NEAR(w.where(11), 0.44, 1e-12);
}
END_TEST

START_TEST(a_stream_of_moves) {  // 25 Hz, as applications are
  Watched w(10);
  for (int k = 1; k <= 50; ++k) {
    w.move(0.3 * 0.04 * k, 10 + 0.04 * k);
    EXPECT_NEAR(w.where(10 + 0.04 * k + 0.039), 0.3 * (0.04 * k + 0.039), 1e-9);
  }
}
END_TEST

START_TEST(a_fast_stream_of_moves) {  // 2 kHz: every one within 1 ms of the one before
  Watched w(10);
  for (int k = 1; k <= 1000; ++k) w.move(0.3 * 0.0005 * k, 10 + 0.0005 * k);
  const double end = 10.5;
  // Still 0.3 m/s, for twice the time between two of them at least.
  EXPECT_NEAR(w.where(end + 0.001), 0.3 * 0.501, 1e-5);
}
END_TEST

// From one end of the world to the other within a moment: no motion, and no number that is too large.
START_TEST(jumps_make_no_twist) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  fs_object o = fs_object_init("o", FS_PRIMITIVE_POINT);
  o.pose = at(-1e15, 0, 0);
  OK(fs_object_set(scene.get(), &o));
  const fs_pose far = at(1e15, 0, 0);
  OK(fs_object_move(scene.get(), "o", &far, nullptr, 10.01));
  fs_object got = fs_object_init("o", FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene.get(), "o", &got));
  EXPECT_VECTOR(got.pose.position, far.position, 0);
  EXPECT_VECTOR(got.twist.linear, (fs_vec3{}), 0);
  fs_object_release(&got);
}
END_TEST

START_TEST(old_moves_make_no_twist) {
  Watched w(10);
  w.move(1, 10.21);  // nothing in the last 0.2 s
  EXPECT_NEAR(w.where(10.3), 1, 1e-12);
  w.move(1.19, 10.4);
  EXPECT_NEAR(w.where(10.45), 1.24, 1e-12);
}
END_TEST

START_TEST(moves_of_one_instant) {  // within 1 ms the later replaces the earlier
  for (double gap : {0.0, 1e-6, 0.0005, 0.0009}) {
    Watched w(10);
    w.move(77, 10.04);
    w.move(0.04 + gap, 10.04 + gap);  // from the set at 10: 1 m/s
    EXPECT_NEAR(w.where(10.06), 0.06, 1e-9);
    EXPECT_NEAR(w.where(11), 0.04 + gap + 2 * (0.04 + gap), 1e-9);
  }
  Watched w(10);
  w.move(1, 10.0005);  // replaces the set: there is nothing before
  EXPECT_NEAR(w.where(10.05), 1, 1e-12);
  w.move(1.05, 10.0505);
  EXPECT_NEAR(w.where(10.06), 1.0595, 1e-9);
}
END_TEST

START_TEST(older_moves_stand) {
  Watched w(10);
  w.move(1, 11);
  w.move(5, 10.95);  // taken, with twist 0
  EXPECT_NEAR(w.where(10.96), 5, 1e-12);
  EXPECT_NEAR(w.where(11.5), 5, 1e-12);
}
END_TEST

START_TEST(given_twists_count_as_last) {
  Watched w(10);
  const fs_twist twist{{9, 0, 0}, {}};
  w.move(1, 10.1, &twist);
  w.move(1.1, 10.2);  // 1 m/s, from the two poses
  EXPECT_NEAR(w.where(10.25), 1.15, 1e-9);
  w.set(2, {}, 10.3);  // a set stands as it says
  EXPECT_NEAR(w.where(10.35), 2, 1e-12);
  w.move(2.05, 10.35);
  EXPECT_NEAR(w.where(10.4), 2.1, 1e-9);
}
END_TEST

START_TEST(worked_out_turns) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  const Tool tool = make_tool(scene.get());
  fs_object o = fs_object_init("a", FS_PRIMITIVE_PLANE);
  o.front = o.back = constant(FS_SENSE_REPULSIVE, 1);
  OK(fs_object_set(scene.get(), &o));
  for (double sign : {1.0, -1.0}) {  // q and -q are the same turn
    OK(fs_object_set(scene.get(), &o));
    fs_pose pose{{}, turn({1, 0, 0}, 0.2)};
    pose.orientation = {sign * pose.orientation.w, sign * pose.orientation.x, 0, 0};
    OK(fs_object_move(scene.get(), "a", &pose, nullptr, 10.04));  // 5 rad/s
    EXPECT_VECTOR(force_at(tool.get(), {0, 0, 1}, 10.06), (fs_vec3{0, -std::sin(0.3), std::cos(0.3)}), 1e-12);
    EXPECT_VECTOR(force_at(tool.get(), {0, 0, 1}, 11), (fs_vec3{0, -std::sin(0.6), std::cos(0.6)}), 1e-12);
  }
}
END_TEST

START_TEST(moves_now) {
  Watched w(10);
  w.tell(10.05);
  w.move(0.05, FS_NOW);
  w.tell(10.1);
  EXPECT_NEAR(w.where(FS_NOW), 0.1, 1e-9);
  EXPECT_NEAR(now(w.scene.get()), 10.1, 0);
}
END_TEST

START_TEST(the_clock) {
  const Scene scene = make_scene();
  timespec before{}, after{};
  clock_gettime(CLOCK_MONOTONIC, &before);
  const double t = now(scene.get());
  clock_gettime(CLOCK_MONOTONIC, &after);
  ck_assert_double_ge(t, before.tv_sec + 1e-9 * before.tv_nsec);
  ck_assert_double_le(t, after.tv_sec + 1e-9 * after.tv_nsec + 1e-6);
  ck_assert_double_ge(now(scene.get()), t);
  for (double bad : {0.0, -1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_set_time(scene.get(), bad), "time");
  }
  OK(fs_scene_set_time(scene.get(), 123.5));
  ck_assert_double_eq(now(scene.get()), 123.5);  // what the caller says, until it says more
  OK(fs_scene_set_time(scene.get(), 124));
  ck_assert_double_eq(now(scene.get()), 124);
}
END_TEST

// The force in N is the age in s: f(d, t) = t.
static fs_object clock_object(fs_curve* curve) {
  fs_object o = fs_object_init("clock", FS_PRIMITIVE_PLANE);
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 1e6);
  o.front.curve = curve;
  return o;
}

START_TEST(start_of_time) {
  if (!has_expressions()) return;
  const Curve curve = make_expression("t");
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  auto age = [&](double time) {
    OK(fs_scene_set_time(scene.get(), time));
    return force_at(tool.get(), {0, 0, 1}).z;
  };
  OK(fs_scene_set_time(scene.get(), 10));
  fs_object o = clock_object(curve.get());
  OK(fs_object_set(scene.get(), &o));  // start 0: now
  EXPECT_NEAR(age(12), 2, 1e-12);
  OK(fs_object_set(scene.get(), &o));  // kept by later sets
  EXPECT_NEAR(age(13), 3, 1e-12);
  OK(fs_object_change(scene.get(), &o, FS_PART_PROFILES));
  const fs_pose pose = at(0, 0, 0.5);
  OK(fs_object_move(scene.get(), "clock", &pose, nullptr, FS_NOW));
  EXPECT_NEAR(age(14), 4, 1e-12);
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);  // also through get, edit, set
  OK(fs_object_get(scene.get(), "clock", &got));
  OK(fs_object_set(scene.get(), &got));
  fs_object_release(&got);
  EXPECT_NEAR(age(15), 5, 1e-12);
  OK(fs_object_remove(scene.get(), "clock"));
  OK(fs_scene_set_time(scene.get(), 20));
  OK(fs_object_set(scene.get(), &o));  // a new one
  EXPECT_NEAR(age(21), 1, 1e-12);
  o.start = 5;
  OK(fs_object_set(scene.get(), &o));
  EXPECT_NEAR(age(22), 17, 1e-12);
  o.start = 30;  // in time to come: t is negative, f(d, t) = t counts as 0
  OK(fs_object_set(scene.get(), &o));
  EXPECT_NEAR(age(23), 0, 0);
  EXPECT_NEAR(age(31), 1, 1e-12);
  OK(fs_scene_clear(scene.get()));
  o.start = 0;
  OK(fs_object_set(scene.get(), &o));
  EXPECT_NEAR(age(33), 2, 1e-12);
  EXPECT_NEAR(force_at(tool.get(), {0, 0, 1}, 35.5).z, 4.5, 1e-12);  // at the time of the state
}
END_TEST

START_TEST(lifetimes) {  // without a servo it is there or not
  Watched w(10);
  fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
  o.front = attract(1, 1e9);
  o.pose = at(1, 0, 0);
  o.lifetime = 0.5;
  OK(fs_object_set(w.scene.get(), &o));
  w.tell(10.4);
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
  w.move(2, FS_NOW);  // from here it counts anew
  w.tell(10.8);
  EXPECT_NEAR(w.where(FS_NOW), 2, 0.9);
  w.tell(11);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  ck_assert_double_eq(report_of(w.scene.get(), "a").weight, 0);  // it stays, at weight 0
  w.tell(12);
  w.move(3, FS_NOW);
  EXPECT_NEAR(w.where(FS_NOW), 3, 1e-12);
  ck_assert_double_eq(report_of(w.scene.get(), "a").weight, 1);
  w.tell(12.6);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  OK(fs_object_change(w.scene.get(), &o, FS_PART_PROFILES));
  EXPECT_NEAR(w.where(FS_NOW), 3, 1e-12);
  w.tell(13.2);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  OK(fs_object_set(w.scene.get(), &o));
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
  o.lifetime = 0;
  OK(fs_object_change(w.scene.get(), &o, FS_PART_OTHER));
  w.tell(1e6);
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
}
END_TEST

int main() {
  Suite* suite = suite_create("motion");
  add_case(suite, "twists", {given_twists, given_turns, worked_out_twists, a_stream_of_moves, a_fast_stream_of_moves,
                             jumps_make_no_twist,
                             old_moves_make_no_twist, moves_of_one_instant, older_moves_stand,
                             given_twists_count_as_last, worked_out_turns, moves_now});
  add_case(suite, "times", {the_clock, start_of_time, lifetimes});
  return run_suite(suite);
}
