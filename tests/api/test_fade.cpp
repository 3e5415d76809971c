// How long a fade takes, what is felt in the middle of it, and the clutch. test_no_step has all orders of calls.
#include <vector>

#include "api/support.h"

using namespace scenes;

static constexpr double fade = 0.2, period = 0.001;  // s

// A hand that holds still at (0.1, 0, 0), unless a test moves it, in a scene felt through a virtual servo.
struct FadeRig : Rig {
  std::vector<fs_wrench> log;

  explicit FadeRig(const char* name) : Rig(name) { fake.state.pose = at(0.1, 0, 0); }
  ~FadeRig() { fake.log = nullptr; }
  void begin(double with_fade = fade) {
    fs_servo_options options = virtual_options();
    options.fade = with_fade;
    options.ramp = -1;
    options.speed_limit = -1;
    start(options);
    step(1000);  // what was there before is steady
    fake.log = &log;
    log.push_back(fake.written);
  }
  double largest_step() const {
    double largest = 0;
    for (size_t k = 1; k < log.size(); ++k) largest = std::fmax(largest, norm(log[k].force - log[k - 1].force));
    return largest;
  }
  double smallest_force() const {
    double smallest = 1e9;
    for (const fs_wrench& w : log) smallest = std::fmin(smallest, norm(w.force));
    return smallest;
  }

  void set(const fs_object& o) { OK(fs_object_set(scene.get(), &o)); }
  void remove(const char* name) { OK(fs_object_remove(scene.get(), name)); }
};

// A force of `force` N upwards that does not depend on where the hand is.
static fs_object steady(const char* name, double force = 2) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
  o.pose = at(0, 0, -100);
  o.front = constant(FS_SENSE_REPULSIVE, force);
  return o;
}

// Attracts with 20 N/m to the origin: 2 N for the hand at 0.1 m.
static fs_object spring(const char* name) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = attract(20, 9);
  return o;
}

static Shape line_at(double z) {
  const fs_vec3 ends[]{{-5, -5, z}, {-5, 5, z}};
  return make_polyline(ends, 2, false);
}
static fs_object line(const Shape& shape) {  // a constant 2 N towards a line far away
  fs_object o = fs_object_init("a", FS_PRIMITIVE_POLYLINE);
  o.front = constant(FS_SENSE_ATTRACTIVE, 2);
  o.shape = shape.get();
  return o;
}

static const Shape& low_line() {
  static const Shape shape = line_at(0);
  return shape;
}
static const Shape& high_line() {
  static const Shape shape = line_at(5.1);
  return shape;
}

START_TEST(takes_as_long_as_it_should) {
  FadeRig rig("long");
  rig.begin();
  rig.set(steady("a"));
  rig.step(100);
  EXPECT_NEAR(rig.sent().z, 1, 0.011);  // linear in time
  rig.step(50);
  EXPECT_NEAR(rig.sent().z, 1.5, 0.011);
  rig.step(51);
  EXPECT_NEAR(rig.sent().z, 2, 1e-12);
  rig.remove("a");
  rig.step(50);
  EXPECT_NEAR(rig.sent().z, 1.5, 0.011);
  rig.set(steady("a"));  // a name set again while it fades goes on from its weight
  rig.step(10);
  EXPECT_NEAR(rig.sent().z, 1.6, 0.011);
  rig.step(42);
  EXPECT_NEAR(rig.sent().z, 2, 1e-12);
  ck_assert_double_gt(rig.smallest_force() + 1e-12, 0);
  rig.remove("a");
  rig.step(201);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 1e-12);
}
END_TEST

START_TEST(cross_fades_meet_in_the_middle) {
  FadeRig rig("cross");
  rig.set(line(low_line()));
  rig.begin();
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-2, 0, 0}), 1e-12);
  rig.set(steady("a"));
  rig.step(100);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-1, 0, 1}), 0.02);
  rig.step(102);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  // A further change during a fade: at most one old version is kept, and in the end only the newest is felt.
  rig.set(line(low_line()));
  rig.step(50);
  rig.set(line(high_line()));
  rig.step(50);
  rig.set(steady("a", 1));
  rig.step(500);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 1}), 1e-12);
  fs_response response;
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
  ck_assert_uint_eq(response.felt_count, 1);
  ck_assert_uint_eq(response.flags & FS_RESPONSE_FADING, 0);
}
END_TEST

START_TEST(fading_is_told) {
  FadeRig rig("told");
  rig.begin();
  fs_response response;
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
  ck_assert_uint_eq(response.flags & FS_RESPONSE_FADING, 0);
  rig.set(steady("a"));
  rig.step(100);
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
  ck_assert_uint_ne(response.flags & FS_RESPONSE_FADING, 0);
  rig.step(200);
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
  ck_assert_uint_eq(response.flags & FS_RESPONSE_FADING, 0);
}
END_TEST

START_TEST(the_standard_is_a_second) {
  FadeRig rig("standard");
  rig.begin(0);
  rig.set(steady("a"));
  rig.step(500);
  EXPECT_NEAR(rig.sent().z, 1, 0.003);
  rig.step(501);
  EXPECT_NEAR(rig.sent().z, 2, 1e-12);
}
END_TEST

START_TEST(no_fade_is_at_once) {
  FadeRig rig("none");
  rig.begin(-1);
  ck_assert(stats_of(rig.scene.get()).protections_off & FS_OFF_FADE);
  rig.set(steady("a"));
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 2}), 1e-12);
  rig.set(line(low_line()));
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-2, 0, 0}), 1e-12);
  rig.remove("a");
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
}
END_TEST

START_TEST(without_a_blend_poses_and_profiles_act_at_once) {
  FadeRig rig("atonce");
  rig.set(spring("a"));
  rig.begin();
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-2, 0, 0}), 1e-12);
  const fs_pose pose = at(0.05, 0, 0);
  const fs_twist still{};
  OK(fs_object_move(rig.scene.get(), "a", &pose, &still, FS_NOW));
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-1, 0, 0}), 1e-12);
  fs_object o = spring("a");
  o.pose = pose;
  o.front.gain = 40;
  rig.set(o);
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{-2, 0, 0}), 1e-12);
}
END_TEST

// The clutch: the hand moves, the tool stays.
START_TEST(clutching) {
  FadeRig rig("clutch");
  rig.set(spring("a"));
  rig.begin();
  auto hand = [&] {
    fs_state state;
    OK(fs_scene_get_hand(rig.scene.get(), &state, nullptr, nullptr));
    return state;
  };
  for (int round = 0; round < 3; ++round) {
    const fs_vec3 held = hand().pose.position;
    ck_assert_uint_eq(hand().flags & FS_STATE_CLUTCHED, 0);
    OK(fs_scene_set_clutch(rig.scene.get(), true));
    rig.step(1);
    ck_assert_uint_ne(hand().flags & FS_STATE_CLUTCHED, 0);
    for (int k = 0; k < 300; ++k) {
      rig.fake.state.pose.position = rig.fake.state.pose.position + fs_vec3{1e-4, -2e-4, 1e-4};
      rig.fake.state.pose.orientation = turn({0, 0, 1}, 0.002 * (300 * round + k));
      rig.step(1);
    }
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
    OK(fs_scene_set_clutch(rig.scene.get(), false));
    rig.step(1);
    EXPECT_VECTOR(hand().pose.position, held, 1e-12);   // the tool's position does not jump
    EXPECT_NEAR(hand().pose.orientation.z, rig.fake.state.pose.orientation.z, 1e-12);  // its orientation is the hand's
    EXPECT_NEAR(hand().pose.orientation.w, rig.fake.state.pose.orientation.w, 1e-12);
    fs_frame frame;
    OK(fs_scene_get_frame(rig.scene.get(), nullptr, &frame));  // the frame is moved, not turned
    EXPECT_VECTOR(frame.pose.position + held, rig.fake.state.pose.position, 1e-12);
    EXPECT_NEAR(std::fabs(frame.pose.orientation.w), 1, 1e-15);
    rig.fake.state.pose.position = rig.fake.state.pose.position + fs_vec3{0.01, 0, 0};
    rig.step(300);
    EXPECT_VECTOR(hand().pose.position, (held + fs_vec3{0.01, 0, 0}), 1e-12);
    EXPECT_VECTOR(rig.sent(), -20.0 * (held + fs_vec3{0.01, 0, 0}), 1e-9);
  }
  // The clutch is held and released between two ticks, held twice, released twice: nothing moves.
  const fs_vec3 before = hand().pose.position;
  OK(fs_scene_set_clutch(rig.scene.get(), true));
  OK(fs_scene_set_clutch(rig.scene.get(), false));
  rig.step(300);
  EXPECT_VECTOR(hand().pose.position, before, 1e-12);
  OK(fs_scene_set_clutch(rig.scene.get(), true));
  OK(fs_scene_set_clutch(rig.scene.get(), true));
  rig.step(300);
  OK(fs_scene_set_clutch(rig.scene.get(), false));
  OK(fs_scene_set_clutch(rig.scene.get(), false));
  rig.step(300);
  EXPECT_VECTOR(hand().pose.position, before, 1e-12);
  EXPECT_VECTOR(rig.sent(), -20.0 * before, 1e-9);
}
END_TEST

START_TEST(what_fades_under_the_clutch_stays) {  // the force where it was held, wherever the hand goes
  FadeRig rig("stays");
  rig.set(spring("a"));
  rig.begin();
  OK(fs_scene_set_clutch(rig.scene.get(), true));
  rig.step(1);
  double before = 2;
  for (int k = 0; k < 150; ++k) {
    rig.fake.state.pose.position = rig.fake.state.pose.position + fs_vec3{0, 0.001, -0.001};
    rig.step(1);
    ck_assert_double_lt(-rig.sent().x, before);
    before = -rig.sent().x;
    EXPECT_VECTOR(rig.sent(), (fs_vec3{-before, 0, 0}), 1e-12);  // still along x
    EXPECT_NEAR(before, 2 * (1 - (k + 1) * period / fade), 0.011);
  }
}
END_TEST

START_TEST(clutching_in_a_scaled_frame) {
  FadeRig rig("scaled");
  fs_frame frame = fs_frame_init();
  frame.pose = {{0.05, 0, 0}, turn({0, 0, 1}, 1.5707963267948966)};
  frame.scale = 10;
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  rig.begin();
  fs_state held, after;
  OK(fs_scene_get_hand(rig.scene.get(), &held, nullptr, nullptr));
  EXPECT_VECTOR(held.pose.position, (fs_vec3{0, -0.5, 0}), 1e-12);
  OK(fs_scene_set_clutch(rig.scene.get(), true));
  rig.step(300);
  rig.fake.state.pose = at(-0.02, 0.03, 0.01);
  rig.step(10);
  OK(fs_scene_set_clutch(rig.scene.get(), false));
  rig.step(1);
  OK(fs_scene_get_hand(rig.scene.get(), &after, nullptr, nullptr));
  EXPECT_VECTOR(after.pose.position, held.pose.position, 1e-12);
  OK(fs_scene_get_frame(rig.scene.get(), nullptr, &frame));
  ck_assert_double_eq(frame.scale, 10);
  EXPECT_VECTOR(frame.pose * (0.1 * after.pose.position), rig.fake.state.pose.position, 1e-12);
}
END_TEST

// Many points on many solids, some of which fade, while one view goes over into another: each needs room for its contacts.
START_TEST(views_share_the_room_for_contacts) {
  FadeRig rig("room");
  rig.fake.state.pose = at(0, 0, -0.001);
  std::vector<fs_vec3> points;
  for (int k = 0; k < 32; ++k) points.push_back({0.001 * k, 0, 0});
  OK(fs_scene_set_tool(rig.scene.get(), points.data(), 32));
  for (int i = 0; i < 32; ++i) {
    fs_object o = fs_object_init(("s" + std::to_string(i)).c_str(), FS_PRIMITIVE_PLANE);
    o.contact.keep = FS_KEEP_FRONT;
    o.contact.stiffness = 1 + 0.01 * i;  // unlike the others, so that none shares a proxy
    o.contact.limit = 1;
    rig.set(o);
  }
  rig.begin();
  const double all = rig.sent().z;
  ck_assert_double_gt(all, 1);
  for (int i = 0; i < 3; ++i) {
    rig.remove(("s" + std::to_string(i)).c_str());
    rig.step(10);
  }
  fs_frame frame = fs_frame_init();
  frame.pose.position.z = -1e-4;
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  rig.step(1000);
  ck_assert_double_le(rig.largest_step(), 2 * all * period / fade);
}
END_TEST

// Taken and let go while the hand moves: what damps it goes and comes over 20 ms, it does not vanish in a tick.
START_TEST(clutching_in_motion_with_damping) {
  FadeRig rig("motion");
  fs_object o = steady("a");
  o.front.limit = 10;
  o.damping = 20;
  o.pose.position.z = -0.2;
  rig.fake.on_read = [](FakeDevice& f, double) { f.state.pose.position.z -= 0.03 * period; };
  rig.set(o);
  rig.begin();
  ck_assert_double_gt(rig.sent().z, 2.59);
  for (int round = 0; round < 3; ++round) {
    OK(fs_scene_set_clutch(rig.scene.get(), true));
    rig.step(round == 1 ? 7 : 500);
    OK(fs_scene_set_clutch(rig.scene.get(), false));
    rig.step(round == 1 ? 5 : 1000);
  }
  rig.step(1000);
  EXPECT_NEAR(rig.sent().z, 2.6, 1e-9);
  const double damped = 20 * 0.03;
  ck_assert_double_le(rig.largest_step(), damped * period / 0.02 + 3 * 2.6 * period / fade + 1e-9);
}
END_TEST

// A profile that changes while another primitive fades in: the report goes on to tell how far the object has come.
START_TEST(a_report_tells_the_weight_of_a_chain) {
  Rig rig("chain");
  rig.fake.state.pose = at(0, 0, -0.01);
  fs_servo_options options = virtual_options();
  options.fade = 1;
  options.blend = 0;
  options.ramp = -1;
  rig.start(options);
  fs_object o = fs_object_init("p", FS_PRIMITIVE_PLANE);
  o.front = o.back = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 5);
  OK(fs_object_set(rig.scene.get(), &o));
  rig.step(1200);
  o.primitive = FS_PRIMITIVE_POINT;
  o.pose.position = {0.1, 0, -0.01};
  o.back = fs_profile{};
  OK(fs_object_set(rig.scene.get(), &o));
  double before = 0;
  for (int i = 1; i <= 300; ++i) {
    if (i == 100) {
      o.front.gain = 1.0001;
      OK(fs_object_change(rig.scene.get(), &o, FS_PART_PROFILES));
    }
    if (i == 130) {
      const fs_object other = fs_object_init("other", FS_PRIMITIVE_POINT);
      OK(fs_object_set(rig.scene.get(), &other));
    }
    rig.step(1);
    const fs_report report = report_of(rig.scene.get(), "p");
    EXPECT_NEAR(report.weight, before, 0.0011);
    ck_assert_int_eq(report.state, FS_OBJECT_FADING);
    before = report.weight;
  }
  EXPECT_NEAR(before, 0.3, 0.003);
}
END_TEST

int main() {
  Suite* suite = suite_create("fade");
  add_case(suite, "fades", {takes_as_long_as_it_should, cross_fades_meet_in_the_middle, fading_is_told,
                            a_report_tells_the_weight_of_a_chain,
                            the_standard_is_a_second, no_fade_is_at_once, without_a_blend_poses_and_profiles_act_at_once,
                            views_share_the_room_for_contacts});
  add_case(suite, "clutch", {clutching, what_fades_under_the_clutch_stays, clutching_in_a_scaled_frame,
                            clutching_in_motion_with_damping});
  return run_suite(suite);
}
