// The pure functions of poses: where a motion is at a time, and what a pose of the device is in a scene and back. They give
// the bits that evaluation and the servo have, and what the header's formulas say.
#include <cmath>
#include <limits>

#include "api/world.h"

using namespace scenes;

static constexpr double nan_ = std::numeric_limits<double>::quiet_NaN();
static constexpr double infinite = std::numeric_limits<double>::infinity();

template <class T>
static bool are_same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

static fs_pose pose_at(const fs_motion& motion, double time) {
  fs_pose out{};
  OK(fs_motion_at(&motion, time, &out));
  return out;
}
static fs_pose to_scene(const fs_frame& frame, const fs_pose& pose) {
  fs_pose out{};
  OK(fs_frame_to_scene(&frame, &pose, &out));
  return out;
}
static fs_pose to_device(const fs_frame& frame, const fs_pose& pose) {
  fs_pose out{};
  OK(fs_frame_to_device(&frame, &pose, &out));
  return out;
}
static std::vector<fs_motion> motions_of(fs_scene* scene) {
  std::vector<fs_motion> list(10);
  size_t count = 0;
  OK(fs_scene_get_motions(scene, nullptr, list.data(), list.size(), &count));
  list.resize(count);
  return list;
}

// -------------------------------------------------------------------------------------------------------------- frames

// fs_scene_get_hand has the hand in the scene; the flight record has at the device the proxy that it has in the scene.
START_TEST(a_frame_as_the_servo) {
  World w(_i);
  Random random(3);
  const fs_vec3 arms[]{{0.1, 0, 0}, {0, -0.2, 0.1}};
  OK(fs_scene_set_tool(w.scene, arms, 2));
  fs_object wall = fs_wall_init("wall", {}, {1, 2, 3}, 300, 50);
  wall.contact.keep = FS_KEEP_EITHER;
  wall.contact.stiffness = 200;
  wall.contact.limit = 50;
  w.set(wall);
  for (int k = 0; k < 20; ++k) {
    const fs_frame frame{random.pose(0.2), random.log_between(0.1, 10), random.log_between(0.01, 2), {}};
    OK(fs_scene_set_frame(w.scene, &frame));
    if (k % 3 == 2) {  // the clutch moves the frame
      OK(fs_scene_set_clutch(w.scene, true));
      w.settle();
      w.fake.state.pose = random.pose(0.1);
      w.settle();
      OK(fs_scene_set_clutch(w.scene, false));
    }
    w.fake.state.pose = random.pose(0.1);
    w.settle();
    const fs_frame now = frame_of(w.scene);
    ck_assert_int_eq(are_same_bits(now, frame), k % 3 != 2);
    const fs_tick tick = record_of(w.servo.get()).back();
    fs_state state;
    fs_response response;
    OK(fs_scene_get_hand(w.scene, &state, &response, nullptr));
    ck_assert(are_same_bits(state.pose, to_scene(now, tick.state.pose)));
    if (_i == in_process) ck_assert(are_same_bits(tick.response.proxy, to_device(now, response.proxy)));
  }
}
END_TEST

START_TEST(a_frame_by_its_formula_and_back) {
  Random random(4);
  for (int k = 0; k < 1000; ++k) {
    const fs_frame frame{random.pose(2), random.log_between(1e-3, 1e3), random.between(0, 2), {}};
    const fs_pose pose = random.pose(random.log_between(1e-3, 10));
    const fs_pose device = to_device(frame, pose), scene = to_scene(frame, pose);
    const double far = norm(pose.position) + norm(frame.pose.position);
    EXPECT_VECTOR(device.position, frame.pose * ((1 / frame.scale) * pose.position), 1e-14 * (far + far / frame.scale));
    EXPECT_VECTOR(scene.position, frame.scale * rotate(inverse(frame.pose.orientation), pose.position - frame.pose.position),
                  1e-14 * far * frame.scale);
    for (const fs_vec3 axis : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
      const fs_vec3 turned = rotate(pose.orientation, axis);
      EXPECT_VECTOR(rotate(device.orientation, axis), rotate(frame.pose.orientation, turned), 1e-14);
      EXPECT_VECTOR(rotate(scene.orientation, axis), rotate(inverse(frame.pose.orientation), turned), 1e-14);
    }
    const fs_pose back = to_scene(frame, device), there = to_device(frame, scene);
    EXPECT_VECTOR(back.position, pose.position, 1e-14 * (far + norm(frame.pose.position) * frame.scale));
    EXPECT_VECTOR(there.position, pose.position, 1e-14 * far);
    for (const fs_pose& same : {back, there}) {
      EXPECT_NEAR(same.orientation.w, pose.orientation.w, 1e-14);
      EXPECT_NEAR(same.orientation.x, pose.orientation.x, 1e-14);
      EXPECT_NEAR(same.orientation.y, pose.orientation.y, 1e-14);
      EXPECT_NEAR(same.orientation.z, pose.orientation.z, 1e-14);
    }
    fs_pose in_place = pose;  // out may be pose
    OK(fs_frame_to_scene(&frame, &in_place, &in_place));
    ck_assert(are_same_bits(in_place, scene));
    in_place = pose;
    OK(fs_frame_to_device(&frame, &in_place, &in_place));
    ck_assert(are_same_bits(in_place, device));
  }
  // Orientations are taken as everywhere: all zeros are the identity, and one that is nearly of unit length is normalised.
  fs_frame frame = fs_frame_init();
  frame.pose.orientation = {};
  const fs_pose whole{{1, 2, 3}, {}};
  ck_assert(are_same_bits(to_scene(frame, whole), at(1, 2, 3)) && are_same_bits(to_device(frame, whole), at(1, 2, 3)));
  const fs_pose nearly{{1, 2, 3}, {0, 0, 1.0005, 0}}, exactly{{1, 2, 3}, {0, 0, 1, 0}};
  ck_assert(are_same_bits(to_scene(frame, nearly), to_scene(frame, exactly)));
  frame.pose.orientation = {1.0005, 0, 0, 0};
  ck_assert(are_same_bits(to_device(frame, nearly), to_device(fs_frame_init(), exactly)));
  // The ends of the scales.
  frame = fs_frame_init();
  frame.scale = 1e9;
  ck_assert_double_eq(to_scene(frame, at(1e15, 0, 0)).position.x, 1e24);
  frame.scale = 1e-9;
  EXPECT_NEAR(to_device(frame, at(1e15, 0, 0)).position.x / 1e24, 1, 1e-15);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- motions

// An object that moves gives at each time the forces of one that stands where fs_motion_at says, with the same bits.
START_TEST(a_motion_as_evaluation) {
  const Scene scene = make_scene();
  Random random(5);
  const fs_vec3 corners[]{{0, 0, 0}, {0.05, 0.01, 0}, {0.05, 0.04, 0.02}};
  const Shape line = make_polyline(corners, 3, false);
  int compared = 0;
  for (int k = 0; k < 300; ++k) {
    fs_object moving = fs_object_init("moving", FS_PRIMITIVE_POLYLINE);
    moving.shape = line.get();
    moving.front = attract(100, 1000);
    moving.pose = random.pose(0.1);
    moving.twist = {random.in_box(1), k % 4 == 0 ? fs_vec3{} : random.in_box(10)};
    moving.time = 7;
    set(scene, moving);
    const fs_motion motion = motions_of(scene.get()).front();
    ck_assert_double_eq(motion.horizon, 0.1);
    const double times[]{6, 7, 7 + random.between(0, 0.1), 7.1, 7 + random.between(0.1, 1), 1e6};
    for (const double time : times) {
      fs_object standing = moving;
      standing.pose = pose_at(motion, time);
      standing.twist = {};
      std::strcpy(standing.name, "standing");
      set(scene, standing);
      const fs_pose stands = Got(scene.get(), "standing")->pose;
      if (are_same_bits(stands, standing.pose)) {  // else it is a last bit off unit length, and was normalised
        const fs_vec3 there = random.in_box(0.2);
        fs_vec3 forces[2];
        OK(fs_evaluate_field(scene.get(), "moving", time, &there, 1, &forces[0]));
        OK(fs_evaluate_field(scene.get(), "standing", time, &there, 1, &forces[1]));
        ck_assert(norm(forces[0]) > 0 && are_same_bits(forces[0], forces[1]));
        ++compared;
      }
      OK(fs_object_remove(scene.get(), "standing"));
    }
  }
  ck_assert_int_gt(compared, 1200);
}
END_TEST

// A point is evaluated in another way while it stands, together with other standing points.
START_TEST(a_moving_point_as_a_standing_one) {
  const fs_profile profiles[]{constant(FS_SENSE_REPULSIVE, 2),
                              attract(50, 1000),
                              fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -3, 20, 1000),
                              fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 4, 0.7, 1000),
                              fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 3, 0.1, 1000),
                              fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.4, 0.1, 1000)};
  Random random(12);
  for (int k = 0; k < 1200; ++k) {
    fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
    o.front = profiles[k % 6];
    o.pose = random.pose(1);
    o.twist = {random.in_box(1), random.in_box(10)};
    o.time = 7;
    const Scene moving = make_scene(), standing = make_scene();
    set(moving, o);
    const double time = 7 + random.between(0, 0.2);
    o.pose.position = pose_at(motions_of(moving.get()).front(), time).position;
    o.twist = {};
    set(standing, o);
    const fs_vec3 there = random.in_box(1);
    const fs_response a = evaluate(make_tool(moving.get()).get(), hand_at(there, time)),
                      b = evaluate(make_tool(standing.get()).get(), hand_at(there, time));
    ck_assert(norm(a.wrench.force) > 0 && std::memcmp(&a, &b, sizeof a) == 0);
  }
}
END_TEST

// A point is reported where the servo has felt it.
START_TEST(a_motion_as_the_servo) {
  World w(_i);
  w.step(100);
  w.set(spring("a", {0.01, 0, 0}, 100));
  w.settle();
  Random random(6);
  for (int k = 0; k < 10; ++k) {
    const fs_pose pose = random.pose(0.01);
    const fs_twist twist{random.in_box(0.2), random.in_box(3)};
    OK(fs_object_move(w.scene, "a", &pose, &twist, now(w.scene)));
    OK(w.sync(w.scene));
    const fs_motion motion = motions_of(w.scene).front();
    for (int i = 0; i < 15; ++i) {
      w.step(10);
      const double tick = record_of(w.servo.get()).back().state.time;
      const fs_vec3 felt = report_of(w.scene, "a").point;
      ck_assert(are_same_bits(felt, pose_at(motion, tick).position));
    }
  }
}
END_TEST

START_TEST(a_motion_by_its_formula) {
  Random random(7);
  for (int k = 0; k < 1000; ++k) {
    fs_motion motion{};
    motion.pose = random.pose(1);
    motion.twist = {random.in_box(2), random.in_box(20)};
    motion.time = random.between(-10, 1000);
    motion.horizon = random.between(0, 0.1);
    const double time = motion.time + random.between(-0.1, 0.3);
    const double dt = std::fmin(std::fmax(time - motion.time, 0), motion.horizon);
    const fs_pose there = pose_at(motion, time);
    EXPECT_VECTOR(there.position, motion.pose.position + dt * motion.twist.linear, 1e-14);
    const fs_quat turned = turn(motion.twist.angular, dt * norm(motion.twist.angular)) * motion.pose.orientation;
    for (const fs_vec3 axis : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
      EXPECT_VECTOR(rotate(there.orientation, axis), rotate(turned, axis), 1e-14);
    }
    ck_assert(are_same_bits(pose_at(motion, motion.time), motion.pose));
    ck_assert(are_same_bits(pose_at(motion, motion.time - 1), motion.pose));
    motion.horizon = 0;
    ck_assert(are_same_bits(pose_at(motion, time), motion.pose));
  }
  // Nothing else of a motion is read, and a struct of zeros is one: it stands at the origin.
  fs_motion motion{};
  std::memset(motion.name, 'x', sizeof motion.name);
  motion.reserved[2] = nan_;
  motion.reserved_32 = 3;
  ck_assert(are_same_bits(pose_at(motion, FS_NOW), at(0, 0, 0)));
}
END_TEST

// -------------------------------------------------------------------------------------------------------------- errors

START_TEST(bad_input) {
  const fs_pose untouched{{7, 7, 7}, {7, 7, 7, 7}};
  struct Case {
    const char* sentence;  // the field, the value, the bound
    void (*spoil)(fs_frame&, fs_pose&);
  };
  const Case frames[]{
      {"frame.scale is 0, must be within 1e-9..1e9", [](fs_frame& f, fs_pose&) { f.scale = 0; }},
      {"frame.scale is -1, must be within 1e-9..1e9", [](fs_frame& f, fs_pose&) { f.scale = -1; }},
      {"frame.scale is nan, must be within 1e-9..1e9", [](fs_frame& f, fs_pose&) { f.scale = nan_; }},
      {"frame.scale is inf, must be within 1e-9..1e9", [](fs_frame& f, fs_pose&) { f.scale = infinite; }},
      {"frame.force_scale is -2, must be within 0..1e9", [](fs_frame& f, fs_pose&) { f.force_scale = -2; }},
      {"frame.reserved", [](fs_frame& f, fs_pose&) { f.reserved[1] = 1; }},
      {"frame.pose.position.y is nan, must be finite and within 1e+15", [](fs_frame& f, fs_pose&) { f.pose.position.y = nan_; }},
      {"frame.pose.orientation is (2, 0, 0, 0) of length 2, must be within 1e-3 of 1 or all 0",
       [](fs_frame& f, fs_pose&) { f.pose.orientation.w = 2; }},
      {"pose.position.z is -inf, must be finite and within 1e+15", [](fs_frame&, fs_pose& p) { p.position.z = -infinite; }},
      {"pose.position.x is 2e+15, must be finite and within 1e+15", [](fs_frame&, fs_pose& p) { p.position.x = 2e15; }},
      {"pose.orientation is (1, 0.5, 0, 0) of length 1.11803399, must be within 1e-3 of 1 or all 0",
       [](fs_frame&, fs_pose& p) { p.orientation.x = 0.5; }},
      {"pose.orientation is (1, nan, 0, 0) of length nan, must be within 1e-3 of 1 or all 0",
       [](fs_frame&, fs_pose& p) { p.orientation.x = nan_; }}};
  for (const Case& bad : frames) {
    fs_frame frame = fs_frame_init();
    fs_pose pose = at(1, 2, 3), out = untouched;
    bad.spoil(frame, pose);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_frame_to_scene(&frame, &pose, &out), bad.sentence);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_frame_to_device(&frame, &pose, &out), bad.sentence);
    ck_assert(are_same_bits(out, untouched));
  }
  const struct {
    const char* sentence;
    double time;
    void (*spoil)(fs_motion&);
  } motions[]{
      {"time is inf, must be finite", infinite, [](fs_motion&) {}},
      {"time is -inf, must be finite", -infinite, [](fs_motion&) {}},
      {"time is nan, must be finite", nan_, [](fs_motion&) {}},
      {"motion.time is nan, must be finite", 1, [](fs_motion& m) { m.time = nan_; }},
      {"motion.horizon is -1, must be within 0..0.1 s", 1, [](fs_motion& m) { m.horizon = -1; }},
      {"motion.horizon is 0.2, must be within 0..0.1 s", 1, [](fs_motion& m) { m.horizon = 0.2; }},
      {"motion.horizon is nan, must be within 0..0.1 s", 1, [](fs_motion& m) { m.horizon = nan_; }},
      {"motion.pose.position.x is nan, must be finite and within 1e+15", 1, [](fs_motion& m) { m.pose.position.x = nan_; }},
      {"motion.pose.orientation is (0, 0, 0, 3) of length 3, must be within 1e-3 of 1 or all 0", 1,
       [](fs_motion& m) { m.pose.orientation = {0, 0, 0, 3}; }},
      {"motion.twist.linear.y is inf, must be finite and within 1e+15", 1, [](fs_motion& m) { m.twist.linear.y = infinite; }},
      {"motion.twist.angular.z is nan, must be finite and within 1e+15", 1, [](fs_motion& m) { m.twist.angular.z = nan_; }}};
  for (const auto& bad : motions) {
    fs_motion motion{};
    fs_pose out = untouched;
    motion.twist.linear = {1, 2, 3};
    motion.horizon = 0.1;
    bad.spoil(motion);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_motion_at(&motion, bad.time, &out), bad.sentence);
    ck_assert(are_same_bits(out, untouched));
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("poses");
  TCase* worlds = tcase_create("worlds");
  tcase_set_timeout(worlds, 500);
  tcase_add_loop_test(worlds, a_frame_as_the_servo, 0, 2);
  tcase_add_loop_test(worlds, a_motion_as_the_servo, 0, 2);
  suite_add_tcase(suite, worlds);
  add_case(suite, "alone", {a_frame_by_its_formula_and_back, a_motion_as_evaluation, a_moving_point_as_a_standing_one, a_motion_by_its_formula, bad_input});
  return run_suite(suite);
}
