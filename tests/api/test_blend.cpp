// What is felt when objects are moved and changed under a servo that blends: no step of the force, and after the blend what
// a tool feels. test_no_step has everything that fades.
#include <functional>
#include <utility>

#include "api/hand.h"
#include "api/world.h"

using namespace scenes;

namespace {

constexpr double period = 1e-3, fade = 0.1, blend = 0.02;  // s
constexpr fs_twist still{};

fs_servo_options blending(double the_blend = blend) {
  fs_servo_options options = virtual_options();
  options.fade = fade;
  options.blend = the_blend;
  options.ramp = options.speed_limit = -1;
  return options;
}

// A servo whose hand is where a function of time puts it, and the largest change of the force from tick to tick.
struct Felt : ServoRig {
  fs_scene* scene = base.get();
  std::function<fs_vec3(double)> hand = [](double) { return fs_vec3{}; };
  double largest = 0;  // N
  fs_vec3 last{};

  explicit Felt(double the_blend = blend) : Felt(blending(the_blend)) {}
  explicit Felt(const fs_servo_options& options) : ServoRig(options) {
    fake.on_read = [this](FakeDevice& f, double time) {
      const fs_vec3 x = hand(time);
      f.state.twist.linear = (1 / period) * (x - f.state.pose.position);
      f.state.pose.position = x;
    };
  }
  void set(const fs_object& o) { OK(fs_object_set(scene, &o)); }
  void move(const char* name, const fs_pose& pose, const fs_twist* twist = &still) {
    OK(fs_object_move(scene, name, &pose, twist, FS_NOW));
  }
  void change(const fs_object& o, uint32_t parts) { OK(fs_object_change(scene, &o, parts)); }
  fs_vec3 force() const { return fake.written.force; }
  // Ticks; the change at each is looked at.
  void run(double seconds) {
    for (auto ticks = static_cast<int>(seconds / period + 0.5); ticks > 0; --ticks) {
      step();
      largest = std::fmax(largest, norm(force() - last));
      last = force();
    }
  }
  // So that the next change is seen alone.
  void settle() {
    run(3 * fade);
    largest = 0;
  }
  double take_largest() { return std::exchange(largest, 0); }
};

// A wall whose front pushes a hand at the origin; its surface is `above` m over it.
fs_object wall(double above, double stiffness = 1000, double damping = 0) {
  fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  o.pose = at(0, 0, above);
  o.back = attract(stiffness, 1000);
  o.damping = damping;
  return o;
}

enum class Twists { none, derived, given };

// The largest step in force, N, under a wall that moves by +-10 mm at 1 Hz, with an update every 40 ms.
double stream(Twists twists, double the_blend, double damping, double& rms) {
  Felt s(the_blend);
  const auto place = [](double t) { return 0.02 + 0.01 * std::sin(2 * std::numbers::pi * t); };
  s.set(wall(place(0), 1000, damping));
  s.settle();
  const double begin = now(s.scene);
  double sum = 0;
  int ticks = 0;
  for (int k = 0; k < 50; ++k) {
    const double t = now(s.scene) - begin;
    const fs_twist twist{{0, 0, 0.01 * 2 * std::numbers::pi * std::cos(2 * std::numbers::pi * t)}, {}};
    s.move("wall", at(0, 0, place(t)), twists == Twists::given ? &twist : twists == Twists::none ? &still : nullptr);
    for (int i = 0; i < 40; ++i) {
      s.run(period);
      if (k < 3) s.largest = 0;  // a worked-out twist needs two moves
      const double wrong = s.force().z - 1000 * place(now(s.scene) - begin);
      if (k >= 3 && damping == 0) sum += wrong * wrong;
      ticks += k >= 3;
    }
  }
  rms = std::sqrt(sum / ticks);
  return s.largest;
}

}  // namespace

// ---- Poses

START_TEST(streams_make_no_step) {
  // What the way of the wall itself explains: 1000 N/m times 63 mm/s times 1 ms.
  const double way = 1000 * 0.01 * 2 * std::numbers::pi * period;
  const char* const names[]{"a twist of 0", "worked out", "given"};
  std::printf("  a wall of 1000 N/m that moves by +-10 mm at 1 Hz, 25 moves a second: N in the largest step (N rms error)\n");
  for (const Twists twists : {Twists::none, Twists::derived, Twists::given}) {
    double rms, raw_rms;
    const double blended = stream(twists, blend, 0, rms), raw = stream(twists, -1, 0, raw_rms);
    std::printf("  twist: %-13s at once %.3f (%.2f), blended %.3f (%.2f)\n", names[static_cast<int>(twists)], raw, raw_rms,
                blended, rms);
    // At once the whole error of the prediction is one step; a cubic spreads it, and has 1.5 times the mean speed.
    const double error = std::fmax(0, raw - way);
    ck_assert_double_le(blended, way + 1.6 * error * period / blend + 0.07);
    if (twists == Twists::none) ck_assert_double_gt(raw, 2);
    if (twists == Twists::none) ck_assert_double_lt(blended, 0.25);
  }
  double rms;
  for (const Twists twists : {Twists::none, Twists::derived, Twists::given}) {
    const double blended = stream(twists, blend, 20, rms), raw = stream(twists, -1, 20, rms);
    std::printf("  with 20 N s/m, %-13s at once %.3f, blended %.3f\n", names[static_cast<int>(twists)], raw, blended);
    // Damping makes a force of the velocity, so the velocity may not jump either: 6 times the way over the blend squared.
    ck_assert_double_le(blended, 0.25 + 6 * 20 * 0.0026 / (blend * blend) * period);
    ck_assert_double_lt(blended, raw);
  }
}
END_TEST

START_TEST(a_move_takes_the_blend) {  // and ends exactly where it was told to
  Felt s;
  s.set(wall(0.01));
  s.settle();
  s.move("wall", at(0, 0, 0.03));
  double last = 10;
  for (int i = 1; i <= 20; ++i) {
    s.run(period);
    const double u = i / 20.0, expected = 30 - 20 * (1 - u) * (1 - u) * (1 + 2 * u);
    EXPECT_NEAR(s.force().z, expected, 1e-9);
    ck_assert_double_gt(s.force().z, last);
    last = s.force().z;
  }
  s.run(period);
  ck_assert_double_eq(s.force().z, force_at(make_tool(s.scene).get(), {}).z);
  // A wall that another move finds on its way goes on from there, as fast as it is.
  s.move("wall", at(0, 0, 0.01));
  s.run(0.01);
  const double speed = s.force().z;
  s.run(period);
  s.take_largest();
  s.move("wall", at(0, 0, 0.02));
  const double before = s.force().z;
  s.run(period);
  EXPECT_NEAR(s.force().z - before, before - speed, 0.2);  // 150 m/s2 at most
  s.run(0.03);
  EXPECT_NEAR(s.force().z, 20, 1e-9);
  // As fast as a hand can send: it follows, and comes to rest where the last one puts it.
  s.take_largest();
  for (int i = 1; i <= 200; ++i) {
    s.move("wall", at(0, 0, 0.02 + 1e-4 * i));
    s.run(period);
  }
  ck_assert_double_gt(s.force().z, 36);  // 2 mm behind a wall of 100 mm/s
  ck_assert_double_le(s.take_largest(), 0.15);
  s.run(0.025);
  EXPECT_NEAR(s.force().z, 40, 1e-9);
}
END_TEST

START_TEST(turns_are_blended) {
  // A wall that is tilted about an axis 0.5 m away: its surface over the hand moves by 10 mm.
  Felt s;
  fs_object o = wall(0);
  OK(fs_pose_from_z({-0.5, 0, 0.02}, {0, 0, 1}, &o.pose));
  s.set(o);
  s.settle();
  EXPECT_NEAR(s.force().z, 20, 1e-9);
  OK(fs_pose_from_z({-0.5, 0, 0.02}, {-std::sin(0.02), 0, std::cos(0.02)}, &o.pose));
  s.move("wall", o.pose);
  s.run(blend + 2 * period);
  ck_assert_double_le(s.take_largest(), 1.6 * 1000 * 0.5 * 0.02 * period / blend);
  EXPECT_VECTOR(s.force(), force_at(make_tool(s.scene).get(), {}), 1e-9);
  // A mesh about its own middle, by a right angle: it fades, as its corners would sweep through the hand.
  Felt box;
  Shape shape = make_mesh(box_mesh({0.1, 0.02, 0.02}));
  fs_object b = solid("box", shape, 500);
  box.set(b);
  box.hand = [](double) { return fs_vec3{0.01, 0.1, 0}; };
  box.settle();
  const double from = norm(box.force());
  b.pose.orientation = turn({0, 0, 1}, std::numbers::pi / 2);
  box.move("box", b.pose);
  box.run(2 * fade);
  const double to = norm(force_at(make_tool(box.scene).get(), {0.01, 0.1, 0}));
  ck_assert_double_gt(std::fabs(to - from), 5);
  ck_assert_double_le(box.largest, (from + to) * period / fade * (1 + 1e-6));
}
END_TEST

START_TEST(streams_that_end_carry_on) {
  const double v = 0.05;
  for (const bool is_given : {false, true}) {
    for (const double the_blend : {-1.0, blend}) {
      Felt s(the_blend);
      s.set(wall(0.02));
      s.settle();
      const fs_twist twist{{0, 0, v}, {}};
      const double begin = now(s.scene);
      double end = 0;
      for (int k = 0; k < 10; ++k) {
        end = 0.02 + v * (now(s.scene) - begin);
        s.move("wall", at(0, 0, end), is_given ? &twist : nullptr);
        s.run(k < 9 ? 0.04 : 0.001);
      }
      s.take_largest();
      s.run(0.5);
      // 0.1 s with a twist that is given, twice the 40 ms with one that is worked out.
      EXPECT_NEAR(s.force().z, 1000 * (end + v * (is_given ? 0.1 : 0.08)), 1e-6);
      ck_assert_double_le(s.largest, 1000 * v * period * (1 + 1e-6));
    }
  }
  // Damping makes a force of the velocity: that does not end in a step either.
  Felt s;
  s.set(wall(0.02, 1000, 30));
  s.settle();
  const fs_twist twist{{0, 0, v}, {}};
  s.move("wall", at(0, 0, 0.02), &twist);
  s.run(0.5);
  EXPECT_NEAR(s.force().z, 25, 1e-6);
  ck_assert_double_le(s.largest, 1000 * v * period + 6 * 30 * v * period / blend);
}
END_TEST

START_TEST(jumps_fade) {  // what is put elsewhere does not sweep through the hand on its way
  Felt s;
  fs_object o = spring("a", {-0.05, 0, 0});
  o.front = constant(FS_SENSE_ATTRACTIVE, 3);
  s.set(o);
  s.settle();
  const uint64_t revision = report_of(s.scene, "a").revision;
  s.move("a", at(0, 0, 0.05));
  s.run(fade / 2);
  EXPECT_VECTOR(s.force(), (fs_vec3{-1.5, 0, 1.5}), 0.1);
  EXPECT_NEAR(report_of(s.scene, "a").weight, 0.5, 0.02);
  ck_assert_uint_eq(report_of(s.scene, "a").revision, revision);
  s.run(fade);
  EXPECT_VECTOR(s.force(), (fs_vec3{0, 0, 3}), 1e-9);
  ck_assert_double_le(s.take_largest(), 2 * 3 * period / fade * (1 + 1e-6));
  // A limit of speed of its own moves the bound: 0.01 m here.
  fs_servo_options options = blending();
  options.speed_limit = 0.5;
  ServoRig slow(options);
  slow.step();
  o.pose = at(-0.005, 0, 0);
  OK(fs_object_set(slow.base.get(), &o));
  slow.step(200);
  for (const double x : {0.0049, -0.006}) {
    const fs_pose to = at(x, 0, 0);
    OK(fs_object_move(slow.base.get(), "a", &to, &still, FS_NOW));
    slow.step(22);
    EXPECT_NEAR(slow.fake.written.force.x, x > 0 ? 3 : 3 - 6 * 21 * period / fade, 0.2);
  }
  // It is counted at the device: 40 mm there are 4 m in a scene of 100 times the size.
  Felt large;
  fs_frame frame = fs_frame_init();
  frame.scale = 100;
  OK(fs_scene_set_frame(large.scene, &frame));
  large.set(spring("b", {1, 0, 0}, 1));
  large.settle();
  large.move("b", at(3, 0, 0));
  large.run(blend + 2 * period);
  EXPECT_VECTOR(large.force(), (fs_vec3{3, 0, 0}), 1e-9);
  large.move("b", at(-3, 0, 0));
  large.run(blend + 2 * period);
  ck_assert_double_gt(large.force().x, 1);
  // A stream of jumps is a chain of cross-fades, and leaves nothing behind.
  Felt chain;
  chain.set(o);
  chain.settle();
  Random random(7);
  for (int i = 0; i < 200; ++i) {
    chain.move("a", at(random.between(-0.2, 0.2), random.between(-0.2, 0.2), 0.1));
    chain.run(period * static_cast<double>(random.below(30)));
  }
  chain.move("a", at(0, 0.1, 0));
  chain.run(5 * fade);
  EXPECT_VECTOR(chain.force(), (fs_vec3{0, 3, 0}), 1e-9);
  ck_assert_double_le(chain.largest, 2 * 3 * period / fade * (1 + 1e-6));
  ck_assert_uint_eq(object_count(chain.scene), 1);
}
END_TEST

START_TEST(moves_and_then_changes) {  // the server takes them when it comes to it
  World world(_i, blending());
  fs_object o = wall(0.01);
  world.set(o);
  world.settle();
  world.step(300);
  double largest = 0;
  fs_vec3 last = world.fake.written.force;
  EXPECT_NEAR(last.z, 10, 1e-9);
  world.fake.on_write = [&](FakeDevice& f) {
    largest = std::fmax(largest, norm(f.written.force - last));
    last = f.written.force;
  };
  for (int k = 0; k < 10; ++k) {
    const fs_pose to = at(0, 0, k % 2 ? 0.01 : 0.02);
    OK(fs_object_move(world.scene, "wall", &to, &still, FS_NOW));
    OK(world.sync(world.scene));
    world.step(40);
    EXPECT_NEAR(last.z, 1000 * to.position.z, 1e-9);
  }
  ck_assert_double_le(largest, 1.6 * 10 * period / blend);
  largest = 0;
  o.back.gain = 3000;
  OK(fs_object_change(world.scene, &o, FS_PART_PROFILES));
  OK(world.sync(world.scene));
  world.step(40);
  EXPECT_NEAR(last.z, 30, 1e-9);
  ck_assert_double_le(largest, 20 * period / blend * (1 + 1e-6));
  world.fake.on_write = nullptr;
}
END_TEST

// ---- Profiles

START_TEST(profiles_are_blended) {
  Felt s;
  fs_object o = wall(0.01);
  s.set(o);
  s.settle();
  EXPECT_NEAR(s.force().z, 10, 1e-9);
  const auto expect = [&](double force, const char* what) {
    const double before = norm(s.force());
    s.run(period);
    ck_assert_int_eq(report_of(s.scene, "wall").state, FS_OBJECT_FELT);  // a change is no fading
    EXPECT_NEAR(report_of(s.scene, "wall").weight, 1, 1e-12);
    s.run(blend / 2);
    EXPECT_NEAR(norm(s.force()), 0.5 * (before + force), 0.6 * std::fabs(force - before) / 10);
    s.run(blend);
    EXPECT_NEAR(norm(s.force()), force, 1e-9);
    const double bound = std::fabs(force - before) * period / blend * (1 + 1e-6);
    ck_assert_msg(s.largest <= bound, "%s: a step of %g N, %g are allowed", what, s.largest, bound);
    s.largest = 0;
  };
  o.back.gain = 3000;
  s.set(o);
  expect(30, "set");
  o.back.limit = 5;
  s.change(o, FS_PART_PROFILES);
  expect(5, "change");
  // As fast as a slider: a chain of cross-fades, each of which takes the blend.
  for (int i = 0; i < 40; ++i) {
    o.back.limit = 5 + 0.25 * i;
    s.change(o, FS_PART_PROFILES);
    if (i % 3) s.run(3 * period);
  }
  s.run(3 * blend);
  EXPECT_NEAR(s.force().z, 14.75, 1e-9);
  ck_assert_double_le(s.take_largest(), 9.75 * period / blend);
  // The same again is no change: no other row, nothing moves.
  s.set(o);
  s.run(blend);
  ck_assert_double_eq(s.take_largest(), 0);
}
END_TEST

START_TEST(a_blend_goes_on_from_the_weight) {  // of what is fading
  Felt s;
  fs_object o = wall(0.01);
  s.set(o);
  s.run(0.3 * fade + period);
  const double weight = s.force().z / 10;
  EXPECT_NEAR(weight, 0.3, 0.02);
  o.back.gain = 2000;
  s.change(o, FS_PART_PROFILES);
  s.run(period);
  const double begun = s.force().z / 10;
  s.run(blend);
  ck_assert_double_ge(s.force().z, 20 * begun);
  ck_assert_double_le(s.force().z, 20 * (begun + blend / fade));  // it does not come in at once
  ck_assert_double_le(s.largest, 20 * (period / blend + period / fade));
  s.run(fade);
  EXPECT_NEAR(s.force().z, 20, 1e-9);
  // Removed while it is blended: it goes out within the fade.
  s.take_largest();
  o.back.gain = 1000;
  s.change(o, FS_PART_PROFILES);
  s.run(0.5 * blend);
  OK(fs_object_remove(s.scene, "wall"));
  s.run(blend);
  ck_assert_double_gt(s.force().z, 7);
  s.run(fade);
  ck_assert_double_eq(s.force().z, 0);
  // Set again while it fades out, and changed: it goes on from there.
  s.set(o);
  s.run(2 * fade);
  OK(fs_object_remove(s.scene, "wall"));
  s.run(0.5 * fade);
  EXPECT_NEAR(s.force().z, 5, 0.2);
  s.take_largest();
  o.back.gain = 3000;
  s.set(o);
  s.run(blend + 2 * period);
  EXPECT_NEAR(s.force().z, 30 * (0.5 + (blend + 2 * period) / fade), 1);  // it takes over the half, and goes on meanwhile
  s.run(fade);
  EXPECT_NEAR(s.force().z, 30, 1e-9);
  ck_assert_double_le(s.largest, 30 * (period / blend + period / fade));
  // While another shape fades in, the profile is blended at once, not only when that is in full.
  fs_object line = fs_object_init("wall", FS_PRIMITIVE_POINT);
  line.pose = at(0, 0, 0.01);
  line.front = constant(FS_SENSE_ATTRACTIVE, 10);
  s.set(line);
  s.run(0.5 * fade);
  line.front = constant(FS_SENSE_ATTRACTIVE, 20);
  s.set(line);
  s.run(blend + 2 * period);
  const double part = 0.5 + (blend + 2 * period) / fade;
  EXPECT_NEAR(s.force().z, 20 * part + 30 * (1 - part), 3);
  s.run(fade);
  EXPECT_NEAR(s.force().z, 20, 1e-9);
  ck_assert_uint_eq(object_count(s.scene), 1);
}
END_TEST

START_TEST(changes_that_go_on_hold_up_no_fade) {  // a slider is moved while its object fades in
  Felt s;
  fs_object o = wall(0.01);
  s.set(o);
  const int count = static_cast<int>(fade / (5 * period)) + 5;
  for (int i = 0; i < count; ++i) {
    o.back.limit = 100 + i;
    s.change(o, FS_PART_PROFILES);
    s.run(5 * period);
  }
  EXPECT_NEAR(s.force().z, 10, 1e-9);
}
END_TEST

START_TEST(curves_and_their_time_are_blended) {
  Felt s;
  fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
  o.pose = at(0, 0, 0.01);
  fs_curve* made = nullptr;
  OK(fs_curve_create_expression("2+sin(3*t)", &made));
  const Curve curve(made);
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 10);
  o.front.curve = curve.get();
  s.set(o);
  s.settle();
  o.start = now(s.scene) - 4;
  s.change(o, FS_PART_PROFILES);
  s.run(2 * blend);
  ck_assert_double_le(s.largest, 2 * period / blend + 3 * period);
  EXPECT_VECTOR(s.force(), force_at(make_tool(s.scene).get(), {}), 1e-9);
}
END_TEST

// ---- Contacts

namespace {

// A solid floor, kept at its front, that a hand presses 5 mm into.
struct Pressed : Felt {
  fs_object floor;
  std::vector<Shape> kept;
  explicit Pressed(const char* what, double the_blend = blend) : Felt(the_blend) {
    floor = fs_object_init("floor", FS_PRIMITIVE_PLANE);
    if (std::strcmp(what, "plane")) {
      const fs_vec3 corners[4]{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
      const uint32_t triangles[6]{0, 1, 2, 0, 2, 3};
      fs_shape* sheet = nullptr;
      OK(fs_shape_create_mesh(corners, 4, triangles, 2, &sheet));
      kept.push_back(Shape(sheet));
      if (std::strcmp(what, "sheet")) kept.push_back(make_mesh(box_mesh({0.5, 0.5, 0.05})));
      floor.primitive = FS_PRIMITIVE_MESH;
      floor.shape = kept.back().get();
      if (std::strcmp(what, "sheet")) floor.pose = at(0, 0, -0.05);
    }
    floor.contact = scenes::solid(std::strcmp(what, "either") ? FS_KEEP_FRONT : FS_KEEP_EITHER, 1000, 1000);
    set(floor);
    const double begin = now(scene);
    hand = [begin](double t) {
      return fs_vec3{0, 0, std::fmax(-0.005, 0.01 - 0.05 * std::fmax(0, t - begin - 2 * fade))};
    };
    run(1);
    largest = 0;
    EXPECT_NEAR(force().z, 5, 1e-6);
  }
};

}  // namespace

START_TEST(contacts_are_blended) {  // and keep the hand on its side
  for (const char* const what : {"plane", "box", "sheet", "either"}) {
    Pressed s(what);
    const auto expect = [&](fs_vec3 force, double most) {
      s.run(3 * blend);
      EXPECT_VECTOR(s.force(), force, 1e-6);
      const double bound = most * period / blend * (1 + 1e-6) + 1e-9;
      ck_assert_msg(s.largest <= bound, "%s: a step of %g N, %g are allowed", what, s.largest, bound);
      s.largest = 0;
    };
    s.floor.contact.stiffness = 3000;
    s.change(s.floor, FS_PART_CONTACT);
    expect({0, 0, 15}, 10);
    s.floor.contact.limit = 7;
    s.change(s.floor, FS_PART_CONTACT);
    expect({0, 0, 7}, 8);
    s.floor.contact.limit = 1000;
    s.floor.contact.stiffness = 500;
    s.change(s.floor, FS_PART_CONTACT);
    expect({0, 0, 2.5}, 4.5);
    s.floor.front = constant(FS_SENSE_ATTRACTIVE, 1);
    s.floor.back = constant(FS_SENSE_REPULSIVE, 1);
    s.change(s.floor, FS_PART_PROFILES);
    expect({0, 0, 1.5}, 1);
    // A stream of changes.
    for (int i = 0; i < 60; ++i) {
      s.floor.contact.stiffness = 500 + 25 * i;
      s.change(s.floor, FS_PART_CONTACT);
      if (i % 2) s.run(5 * period);
    }
    expect({0, 0, 1975 * 0.005 - 1}, 1475 * 0.005);
  }
}
END_TEST

START_TEST(friction_is_blended) {  // the hand, dragged aside, is held by more or less of it
  for (const double from : {0.8, 0.1, 0.8, 0.8, 0.8, 0.8}) {
    static int changes = 0;  // before, so that the versions stand in any order
    Pressed s("plane");
    s.floor.contact.friction = from;
    for (int k = 0; k <= changes; ++k) {
      s.floor.contact.damping = k;
      s.change(s.floor, FS_PART_CONTACT);
      s.run(3 * blend);
    }
    ++changes;
    const double begin = now(s.scene);
    s.hand = [begin](double t) { return fs_vec3{std::fmin(0.003, 0.05 * (t - begin)), 0, -0.005}; };
    s.run(0.2);
    const double before = s.force().x;
    EXPECT_NEAR(before, -std::fmin(3, 5 * from), 0.1);
    s.largest = 0;
    s.floor.contact.friction = 0.9 - from;
    s.change(s.floor, FS_PART_CONTACT);
    s.run(3 * blend);
    if (from > 0.5) EXPECT_NEAR(s.force().x, -0.5, 0.1);
    ck_assert_msg(s.largest <= 3 * period / blend, "from %g: a step of %g N", from, s.largest);
  }
}
END_TEST

START_TEST(a_floor_that_moves_carries_the_hand) {  // without a step, at 25 Hz and without a twist
  for (const char* const what : {"plane", "box", "sheet"}) {
    Pressed s(what);
    const double z = s.floor.pose.position.z;
    for (int k = 1; k <= 50; ++k) {
      s.move("floor", at(0, 0, z + 0.002 * std::sin(0.4 * k)));
      s.run(0.04);
    }
    // 0.8 mm a move, 1.5 times as fast as the mean over 20 ms; a turn in between adds to that.
    ck_assert_msg(s.largest <= 1000 * 0.0008 * 1.6 * period / blend, "%s: a step of %g N", what, s.largest);
    EXPECT_NEAR(s.force().z, 5 + 2 * std::sin(0.4 * 50), 1e-6);
  }
}
END_TEST

// ---- All of it

START_TEST(tools_feel_changes_at_once) {  // also beside a servo that blends
  Felt s;
  const Tool tool = make_tool(s.scene);
  fs_object o = wall(0.01);
  s.set(o);
  s.run(3 * fade);
  EXPECT_NEAR(force_at(tool.get(), {}).z, 10, 1e-12);
  s.move("wall", at(0, 0, 0.02));
  EXPECT_NEAR(force_at(tool.get(), {}).z, 20, 1e-12);
  s.run(0.01);
  EXPECT_NEAR(force_at(tool.get(), {}).z, 20, 1e-12);
  s.move("wall", at(0, 0, 0.5));
  EXPECT_NEAR(force_at(tool.get(), {}).z, 500, 1e-12);
  s.run(0.01);
  o.pose = at(0, 0, 0.5);
  o.back.gain = 10;
  s.set(o);
  EXPECT_NEAR(force_at(tool.get(), {}).z, 5, 1e-12);
  s.run(0.01);
  EXPECT_NEAR(force_at(tool.get(), {}).z, 5, 1e-12);
  fs_vec3 plotted;
  const fs_vec3 origin{};
  OK(fs_evaluate_field(s.scene, nullptr, FS_NOW, &origin, 1, &plotted));
  EXPECT_NEAR(plotted.z, 5, 1e-12);
}
END_TEST

// A pose may have been measured before the object was moved: a tool extrapolates never back, and blends nothing.
START_TEST(tools_ask_for_times_before_a_move) {
  Felt s;
  const Tool tool = make_tool(s.scene);
  fs_object o = wall(0.01);
  o.damping = 5;
  s.set(o);
  s.run(0.1);
  s.move("wall", at(0, 0, 0.02));
  fs_state state = hand_at({});
  for (const double ago : {0.0, 1e-6, 1e-3, 0.05, 10.0}) {
    state.time = now(s.scene) - ago;
    fs_response response;
    OK(fs_evaluate(tool.get(), &state, &response));
    EXPECT_NEAR(response.wrench.force.z, 20, 1e-12);
    fs_vec3 plotted;
    OK(fs_evaluate_field(s.scene, nullptr, state.time, &state.pose.position, 1, &plotted));
    EXPECT_NEAR(plotted.z, 20, 1e-12);
  }
}
END_TEST

START_TEST(large_groups_are_blended) {  // from the tick that feels them, however long the commit takes
  Felt s;
  const int count = times(4000, 20000);
  std::string name;
  const auto for_all = [&](double x) {
    OK(fs_scene_begin(s.scene));
    for (int i = 0; i < count; ++i) {
      name = "o" + std::to_string(i);
      if (x == 0) {
        s.set(spring(name.c_str(), {0, 0, 0}, 0.1));
      } else {
        s.move(name.c_str(), at(x, 0, 0));
      }
    }
    OK(fs_scene_commit(s.scene));
  };
  for_all(0);
  s.settle();
  for_all(0.01);
  s.run(2 * blend);
  EXPECT_NEAR(s.force().x, 0.1 * 0.01 * count, 1e-6);
  ck_assert_double_le(s.largest, 1.6 * 0.1 * 0.01 * count * period / blend);
}
END_TEST

// Moves, jumps, changes, removals, groups and ticks in any order: the force of each name changes by no more than its fade, its
// blend and the speed of its blended motion explain; and in the end all is as told.
START_TEST(any_order) {
  for (uint64_t run = 0; run < 20; ++run) {
    const uint64_t seed = 20 * static_cast<uint64_t>(_i) + run;
    Random random(seed);
    Felt s;
    const bool moves = random.coin();
    if (moves) s.hand = [](double t) { return fs_vec3{0.01 * std::sin(9 * t), 0.01 * std::sin(7 * t), 0}; };
    constexpr int names = 3;
    constexpr double most = 2, slope = 200;  // N, N/m, of each
    const auto object = [&](int i) {
      const std::string name(1, static_cast<char>('a' + i));
      fs_object o = fs_object_init(name.c_str(), random.coin(0.8) ? FS_PRIMITIVE_PLANE : FS_PRIMITIVE_POINT);
      o.front = attract(random.between(0, slope), random.between(0.5, most));
      if (o.primitive == FS_PRIMITIVE_PLANE) o.back = o.front;
      o.pose = at(random.between(-0.02, 0.02), random.between(-0.02, 0.02), random.between(-0.02, 0.02));
      if (random.coin()) o.pose.orientation = turn({1, 2, 3}, random.between(-0.2, 0.2));
      o.enabled = random.coin(0.9);
      return o;
    };
    // 40 mm at most within a blend, a cubic from any velocity that the one before can have.
    const double speed = 3 * 0.04 / blend;
    const double bound = names * (2 * most * (period / fade + period / blend) + slope * period * (speed + 0.2));
    bool has_group = false;
    std::string done;
    for (int k = 0; k < 300; ++k) {
      const int i = static_cast<int>(random.below(names));
      const fs_object o = object(i);
      const fs_twist twist{{random.between(-0.1, 0.1), 0, 0}, {0, random.between(-0.2, 0.2), 0}};
      switch (random.below(12)) {
        case 0: case 1: s.set(o); done += "set "; break;
        case 2: case 3: case 4: case 5:
          fs_object_move(s.scene, o.name, &o.pose, random.coin() ? &still : random.coin() ? &twist : nullptr, FS_NOW);
          done += "move ";
          break;
        case 6: case 7: fs_object_change(s.scene, &o, FS_PART_PROFILES); done += "change "; break;
        case 8: fs_object_change(s.scene, &o, FS_PART_OTHER); done += "enable "; break;
        case 9: fs_object_remove(s.scene, o.name); done += "remove "; break;
        case 10:
          if (has_group) {
            OK(fs_scene_commit(s.scene));
          } else {
            OK(fs_scene_begin(s.scene));
          }
          has_group = !has_group;
          done += "group ";
          break;
        default: break;
      }
      const int ticks = static_cast<int>(random.below(3) ? random.below(4) : random.below(60));
      s.run(ticks * period);
      done += "[" + std::to_string(ticks) + "] ";
      ck_assert_msg(s.largest <= bound, "seed %llu: a step of %g N, %g are allowed: %s",
                    static_cast<unsigned long long>(seed), s.largest, bound, done.c_str());
    }
    if (has_group) OK(fs_scene_commit(s.scene));
    s.run(0.2 + 5 * fade);
    const Tool tool = make_tool(s.scene);
    EXPECT_VECTOR(s.force(), force_at(tool.get(), s.fake.state.pose.position), 1e-9);
  }
}
END_TEST

// ---- Bounds

// A wall of 2000 N/m has the whole bound while it is alone, and half of it beside another.
fs_servo_options bounding() {
  fs_servo_options options = blending();
  options.max_stiffness = 2000;
  options.damping = 0;  // the default
  return options;
}
struct Bounded : Felt {
  double slope_of(const char* name) {  // N/m, as it is applied
    fs_report report{};
    OK(fs_scene_get_report(scene, name, &report));
    return report.stiffness_applied;
  }
  Bounded() : Felt(bounding()) {}
};

START_TEST(shares_are_blended) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0}; };
  s.set(wall(0.002, 2000));
  s.settle();
  EXPECT_NEAR(s.force().z, 4, 1e-6);
  fs_object other = wall(-0.01, 2000);  // not felt here, but where the hand can soon be
  std::snprintf(other.name, sizeof other.name, "other");
  s.set(other);
  s.run(0.1);
  EXPECT_NEAR(s.slope_of("wall"), 1000, 40);
  EXPECT_NEAR(s.force().z, 2, 0.1);
  ck_assert_double_le(s.take_largest(), 1.5 * 2 * period / blend);
  OK(fs_object_remove(s.scene, "other"));
  s.run(3 * fade);
  EXPECT_NEAR(s.force().z, 4, 1e-6);
  ck_assert_double_le(s.take_largest(), 1.5 * 2 * period / blend);
}
END_TEST

START_TEST(what_changes_all_the_time_gets_its_share) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0}; };
  fs_object other = wall(0.002, 2000);
  std::snprintf(other.name, sizeof other.name, "other");
  s.set(other);
  s.settle();
  for (int k = 0; k < 300; ++k) {
    s.set(wall(0.002, 1800 + k % 2));
    s.run(period);
  }
  ck_assert_double_le(s.slope_of("wall") + s.slope_of("other"), 1.03 * 2000);
  ck_assert_double_ge(s.slope_of("wall"), 0.3 * 2000);
}
END_TEST

// The bound of an object that shares with none is that of one alone, whatever it wanted before: a change is felt at once.
START_TEST(who_shares_with_none_is_not_held_back) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0}; };
  s.set(wall(0.002, 10, 1000));
  s.settle();
  s.set(wall(0.002, 1000, 1000));
  s.run(1.5 * blend);
  EXPECT_NEAR(s.force().z, 2, 1e-6);
}
END_TEST

// A frame that was another for a while, and has faded out, bounds nothing any more.
START_TEST(a_frame_that_is_gone_does_not_count) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0}; };
  s.set(wall(0.002, 1000));
  s.settle();
  fs_frame frame, far;
  OK(fs_scene_get_frame(s.scene, nullptr, &frame));
  far = frame;
  far.scale = 150000;
  OK(fs_scene_set_frame(s.scene, &far));
  s.run(1);
  OK(fs_scene_set_frame(s.scene, &frame));
  s.run(1);
  EXPECT_NEAR(s.slope_of("wall"), 1000, 1);
  EXPECT_NEAR(s.force().z, 2, 1e-6);
}
END_TEST

// A wall that one point of eight feels has the whole bound.
START_TEST(points_that_do_not_feel_have_no_share) {
  for (const uint32_t mask : {0u, 1u}) {
    Bounded s;
    fs_vec3 points[8]{};
    for (int i = 0; i < 8; ++i) points[i].x = 0.001 * i;
    OK(fs_scene_set_tool(s.scene, points, 8));
    fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
    o.pose.position.z = -1;
    o.contact.keep = FS_KEEP_FRONT;
    o.contact.stiffness = 1e6;
    o.contact.limit = 20;
    o.tool_points = mask;
    s.set(o);
    s.run(0.1);
    EXPECT_NEAR(s.slope_of("wall"), mask ? 2000 : 2000.0 / 8, 1);
  }
}
END_TEST

// Points whose steep parts lie apart: about each the saturated pull of the others turns, which is a slope too.
START_TEST(the_turn_of_a_force_counts) {
  Bounded s;
  for (int i = 0; i < 8; ++i) {
    fs_object o = fs_object_init(("p" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    o.front = attract(2000, 10);
    o.pose.position = {0.0105 * (i & 1), 0.0105 * (i >> 1 & 1), 0.0105 * (i >> 2 & 1)};
    s.set(o);
  }
  double begin = 0;
  const double speed = 0.02;
  s.hand = [&](double t) { return fs_vec3{speed * (t - begin) - 0.002, 0.00525, 0.00525}; };
  begin = now(s.scene) + 3 * fade;
  s.settle();
  s.run(0.7);
  ck_assert_double_le(s.take_largest(), 1.001 * 2000 * speed * period);
}
END_TEST

// Versions of one object that cross-fade do not share with each other.
START_TEST(versions_share_nothing) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0.049}; };
  const Shape shapes[]{make_mesh(box_mesh({0.05, 0.05, 0.05})), make_mesh(box_mesh({0.06, 0.06, 0.05}))};
  for (int k = 0; k < 20; ++k) {
    fs_object o = fs_object_init("box", FS_PRIMITIVE_MESH);
    o.shape = shapes[k % 2].get();
    o.contact = scenes::solid(FS_KEEP_FRONT, 1800, 20);
    s.set(o);
    s.run(0.06);
    EXPECT_NEAR(s.slope_of("box"), 1800, 1e-6);
    // Both versions hold the hand, and what they are together is told.
    fs_response response;
    OK(fs_scene_get_hand(s.scene, nullptr, &response, nullptr));
    EXPECT_NEAR(response.wrench.force.z, 1.8 * (k > 1), 1.8 * (k <= 1) + 1e-3);  // the first fades in
    if (k > 1) EXPECT_NEAR(response.stiffness.zz, -1800, 1e-3);
  }
}
END_TEST

// Every object that is bounded is told, each by itself.
START_TEST(bounds_are_told) {
  Bounded s;
  s.hand = [](double) { return fs_vec3{0, 0, 0}; };
  for (const char* const name : {"a", "b", "c"}) {
    fs_object o = wall(-0.01, 20000);
    std::snprintf(o.name, sizeof o.name, "%s", name);
    s.set(o);
  }
  s.run(2);
  std::string told;
  for (fs_event event; fs_scene_next_event(s.scene, 0, &event) == FS_OK && event.kind != FS_EVENT_NONE;) {
    if (event.kind != FS_EVENT_CAPPED) continue;
    told += event.name;
    EXPECT_NEAR(event.value, 2000.0 / 3, 1);
    const std::string with = event.name[0] == 'a' ? "b, c" : event.name[0] == 'b' ? "a, c" : "a, b";
    const std::string text = "its slope is bounded to 666.7 N/m at the device, of 2e+04; it shares with " + with;
    ck_assert_str_eq(event.text, text.c_str());
    const fs_report report = report_of(s.scene, event.name);
    ck_assert_str_eq(report.shares_with, with.c_str());
  }
  std::sort(told.begin(), told.end());
  ck_assert_str_eq(told.c_str(), "abc");
  // Of many the first, as they fit; nobody shares who gets what he wants.
  for (int i = 0; i < 20; ++i) {
    fs_object o = wall(-0.01, 20000);
    std::snprintf(o.name, sizeof o.name, "w%02d", i);
    s.set(o);
  }
  s.set(wall(-0.01, 10));
  s.run(1);
  for (const char* const name : {"a", "w07"}) {  // 23 others
    const std::string with = report_of(s.scene, name).shares_with;
    const auto before = with.find(" and ");
    ck_assert_msg(before != std::string::npos && with.ends_with(" more"), "%s shares with '%s'", name, with.c_str());
    ck_assert_int_eq(std::count(with.begin(), with.end(), ',') + 1 + std::atoi(with.c_str() + before + 5), 23);
  }
  const std::string with_whom = report_of(s.scene, "wall").shares_with;
  ck_assert_str_eq(with_whom.c_str(), "");
}
END_TEST

// A device that is not ready yet tells nothing about the hand: the sheet keeps the side on which it is first known to be.
START_TEST(a_hand_is_where_a_ready_device_says) {
  Bounded s;
  double z = 0;
  s.hand = [&z](double) { return fs_vec3{0, 0, z}; };
  s.fake.state.flags = 0;
  fs_object sheet = fs_object_init("sheet", FS_PRIMITIVE_PLANE);
  sheet.pose = at(0, 0, 0.02);
  sheet.contact = scenes::solid(FS_KEEP_EITHER, 500, 10);
  s.set(sheet);
  s.run(0.01);
  fs_report report;
  OK(fs_scene_get_report(s.scene, "sheet", &report));
  s.fake.state.flags = FS_STATE_READY;
  z = 0.03;
  s.run(1);
  EXPECT_VECTOR(s.force(), (fs_vec3{}), 0);
}
END_TEST

// Two solids that get the same stiffness while the hand is held by both go on pushing as they did.
START_TEST(solids_that_become_alike_keep_their_hold) {
  Felt s;
  s.hand = [](double) { return fs_vec3{-0.00714, -0.0241, 0.00203}; };
  fs_object a = fs_object_init("a", FS_PRIMITIVE_PLANE), b = fs_object_init("b", FS_PRIMITIVE_PLANE);
  OK(fs_pose_from_z({0.0131493, 0.0281621, -0.0137495}, {-0.948766, 0.217839, 0.228886}, &a.pose));
  OK(fs_pose_from_z({-0.0229314, 0.00406967, -0.00665026}, {-0.300705, 0.878083, 0.372218}, &b.pose));
  a.contact = scenes::solid(FS_KEEP_BACK, 2080, 5);
  b.contact = scenes::solid(FS_KEEP_FRONT, 853, 5);
  s.set(a);
  s.set(b);
  s.settle();
  const fs_vec3 before = s.force();
  a.contact.stiffness = b.contact.stiffness = 700;
  OK(fs_scene_begin(s.scene));
  s.change(a, FS_PART_CONTACT);
  s.change(b, FS_PART_CONTACT);
  OK(fs_scene_commit(s.scene));
  s.run(1);
  EXPECT_VECTOR(s.force(), before, 1e-9);
  ck_assert_double_le(s.take_largest(), 1e-9);
}
END_TEST

// A groove of two walls at 90 degrees along y, which holds the hand and also repels it from afar. Where both walls are equally
// near the direction of that force turns: under a bound over some way, not at once.
START_TEST(ridges_of_solids_are_blended) {
  const fs_vec3 corners[6]{{-0.1, -0.1, 0.1}, {-0.1, 0.1, 0.1}, {0, -0.1, 0}, {0, 0.1, 0}, {0.1, -0.1, 0.1}, {0.1, 0.1, 0.1}};
  const uint32_t triangles[12]{0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5};
  Shape groove;
  {
    fs_shape* made;
    OK(fs_shape_create_mesh(corners, 6, triangles, 4, &made));
    groove.reset(made);
  }
  for (const bool is_solid : {false, true}) {
    Bounded s;
    fs_object o = fs_object_init("groove", FS_PRIMITIVE_MESH);
    o.shape = groove.get();
    o.front.kind = FS_PROFILE_CONSTANT;
    o.front.sense = FS_SENSE_REPULSIVE;
    o.front.gain = o.front.limit = 4;
    o.front.reach = 0.05;
    o.back = o.front;
    if (is_solid) o.contact.keep = FS_KEEP_EITHER, o.contact.limit = 20;
    s.set(o);
    const double speed = 0.01;
    double begin = 0;
    s.hand = [&](double t) { return fs_vec3{-0.005 + speed * (t - begin), 0, 0.02}; };
    begin = now(s.scene);
    s.run(0.2);
    s.take_largest();
    const fs_vec3 before = s.force();
    s.run(0.7);
    ck_assert_double_gt(norm(s.force() - before), 4);  // it has turned
    ck_assert_double_le(s.take_largest(), 1.1 * 2000 * speed * period);
    fs_response response;
    OK(fs_scene_get_hand(s.scene, nullptr, &response, nullptr));
    ck_assert_uint_ne(response.flags & FS_RESPONSE_CAPPED, 0);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("blend");
  add_case(suite, "poses", {streams_make_no_step, a_move_takes_the_blend, turns_are_blended, streams_that_end_carry_on,
                            jumps_fade});
  add_on_both(suite, "both", {moves_and_then_changes});
  add_case(suite, "profiles", {profiles_are_blended, a_blend_goes_on_from_the_weight, changes_that_go_on_hold_up_no_fade,
                            curves_and_their_time_are_blended});
  add_case(suite, "contacts", {contacts_are_blended, friction_is_blended, a_floor_that_moves_carries_the_hand});
  add_case(suite, "all", {tools_feel_changes_at_once, tools_ask_for_times_before_a_move, large_groups_are_blended});
  add_case(suite, "bounds", {shares_are_blended, what_changes_all_the_time_gets_its_share,
                             who_shares_with_none_is_not_held_back, a_frame_that_is_gone_does_not_count, points_that_do_not_feel_have_no_share,
                             the_turn_of_a_force_counts, versions_share_nothing, bounds_are_told,
                             a_hand_is_where_a_ready_device_says, solids_that_become_alike_keep_their_hold,
                             ridges_of_solids_are_blended});
  TCase* test_case = new_case(suite, "any order");
  tcase_add_loop_test(test_case, any_order, 0, is_sanitized ? 1 : 5);
  return run_suite(suite);
}
