// What is felt of a scene: the same tests run on a scene in this process and on one that is connected to a server:
// objects, motion, time, groups, frame, clutch and tool.
#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "api/world.h"
#include "scenes/reference.h"

using namespace scenes;

// ---------------------------------------------------------------------------------------------------------- objects

static void expect_same_profile(const fs_profile& a, const fs_profile& b) {
  ck_assert(a.kind == b.kind && a.sense == b.sense && a.gain == b.gain && a.offset == b.offset && a.width == b.width);
  ck_assert(a.limit == b.limit && a.reach == b.reach && a.curve == b.curve);
}
// Every field comes back, and the handles are the same.
static void expect_same_object(const fs_object& a, const fs_object& b) {
  ck_assert_str_eq(a.name, b.name);
  ck_assert(a.struct_size == b.struct_size && a.primitive == b.primitive && a.shape == b.shape);
  EXPECT_VECTOR(a.pose.position, b.pose.position, 0);
  EXPECT_VECTOR(a.twist.linear, b.twist.linear, 0);
  EXPECT_VECTOR(a.twist.angular, b.twist.angular, 0);
  const fs_quat p = a.pose.orientation, q = b.pose.orientation;
  EXPECT_NEAR(std::fabs(p.w - q.w) + std::fabs(p.x - q.x) + std::fabs(p.y - q.y) + std::fabs(p.z - q.z), 0, 1e-15);
  ck_assert(a.time == b.time && a.start == b.start && a.lifetime == b.lifetime && a.damping == b.damping);
  expect_same_profile(a.front, b.front);
  expect_same_profile(a.back, b.back);
  ck_assert_int_eq(std::memcmp(&a.contact, &b.contact, sizeof a.contact), 0);
  ck_assert_uint_eq(a.tool_points, b.tool_points);
  ck_assert_int_eq(a.enabled, b.enabled);
  for (const uint8_t byte : b.reserved) ck_assert_uint_eq(byte, 0);
  ck_assert(b.owner || !b.shape);
}

// With the hand at several places, the force of the scene and the force that the device gets are those of the slow
// reference.
static void compare_with_reference(World& w, const Content& content, Random& random, int places, double half) {
  const Reference reference(content);
  const std::vector<fs_vec3> tool = tool_of(w.scene);
  double scale = 1;
  for (const fs_object& o : content.objects) scale = std::fmax(scale, std::fmax(o.front.limit, o.back.limit));
  for (int i = 0; i < places; ++i) {
    w.fake.state.twist = {random.in_box(0.5), random.in_box(4)};
    w.wrench_at(random.pose(half));
    fs_state state;
    fs_response response;
    fs_wrench sent;
    OK(fs_scene_get_hand(w.scene, &state, &response, &sent));
    const Felt felt = reference.evaluate(state, tool, false);
    EXPECT_VECTOR(response.wrench.force, felt.wrench.force, 1e-10 * scale);
    EXPECT_VECTOR(response.wrench.torque, felt.wrench.torque, 1e-10 * scale);
    ck_assert_uint_ge(response.felt_count, felt.felt_count);
    ck_assert_uint_le(response.felt_count, felt.felt_count + felt.faint_count);
    ck_assert_uint_eq(response.flags, 0);
    EXPECT_VECTOR(w.fake.written.force, response.wrench.force, 1e-12 * scale);
    EXPECT_VECTOR(w.fake.written.torque, response.wrench.torque, 1e-12 * scale);
    EXPECT_VECTOR(sent.force, w.fake.written.force, 0);
    EXPECT_VECTOR(sent.torque, w.fake.written.torque, 0);
  }
}

START_TEST(every_primitive_and_profile) {
  World w(_i);
  Content content = profiles();
  for (fs_object& o : content.objects) o.time = o.start = 1e-3;
  fill(w.scene, content);
  w.settle();
  ck_assert_uint_eq(own_reports_of(w.scene).size(), content.objects.size());
  for (const fs_object& o : content.objects) expect_same_object(o, Got(w.scene, o.name).object);
  w.step_until(2);
  Random random(1);
  compare_with_reference(w, content, random, 200, 0.09);
}
END_TEST

// Objects that move, have damping, have a mask or are disabled, felt with three points; each scene replaces the one
// before.
START_TEST(random_scenes) {
  World w(_i);
  const std::vector<fs_vec3> tool{{0, 0, 0}, {0.02, 0, -0.01}, {-0.015, 0.02, 0}};
  OK(fs_scene_set_tool(w.scene, tool.data(), tool.size()));
  for (int round = 0; round < 5; ++round) {
    Random random(100 + static_cast<uint64_t>(round));
    RandomOptions options;
    options.count = 8;
    options.mesh_triangles = 60;
    options.moves = options.damps = options.masks = options.disables = true;
    options.time = 2.0 * (round + 1);
    const Content content = random_content(random, options);
    OK(fs_scene_clear(w.scene));
    if (random.coin()) {
      fill(w.scene, content);
    } else {
      for (const fs_object& o : content.objects) w.set(o);
    }
    w.settle();
    for (const fs_object& o : content.objects) expect_same_object(o, Got(w.scene, o.name).object);
    w.step_until(options.time - 0.05);
    compare_with_reference(w, content, random, 100, 0.12);
  }
}
END_TEST

START_TEST(curves_of_time) {
  if (!has_expressions()) return;
  World w(_i);
  const Curve ramp = make_expression("1+t"), wave = make_expression("2+sin(20*t)+100*d");
  fs_object o = push("ramp");
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 0.5, 0, 1000);
  o.front.curve = ramp.get();
  w.set(o);  // t = 0 is now
  w.settle();
  const double began = Got(w.scene, "ramp")->start;
  ck_assert_double_le(began, now(w.scene));
  const auto expect_ramp = [&](double start) {
    w.step();
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{0, 0, 0.5 * (1 + now(w.scene) - start)}), 1e-12);
    ck_assert_double_eq(Got(w.scene, "ramp")->start, start);
  };
  expect_ramp(began);
  w.set(o);  // kept by later sets
  w.settle();
  expect_ramp(began);
  o.start = began - 7.5;  // given
  OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
  w.settle();
  expect_ramp(began - 7.5);
  o.start = 0;
  OK(fs_object_change(w.scene, &o, FS_PART_PROFILES | FS_PART_POSE));
  w.settle();
  expect_ramp(began - 7.5);
  OK(fs_object_move(w.scene, "ramp", &o.pose, nullptr, FS_NOW));
  w.set(Got(w.scene, "ramp").object);
  w.settle();
  expect_ramp(began - 7.5);
  o.start = now(w.scene) + 5;  // in time to come: 1 + t is below 0, which counts as 0
  w.set(o);
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  o.start = 0;
  OK(fs_object_remove(w.scene, "ramp"));
  w.settle();
  const double again = now(w.scene);
  w.set(o);  // the name is new
  w.settle();
  expect_ramp(Got(w.scene, "ramp")->start);
  ck_assert_double_ge(Got(w.scene, "ramp")->start, again);
  // d and t, in another profile of the same object.
  OK(fs_object_remove(w.scene, "ramp"));
  o = fs_object_init("wave", FS_PRIMITIVE_PLANE);
  o.front = o.back = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 1000);
  o.front.curve = wave.get();
  o.back.curve = ramp.get();
  o.start = 1e-3;
  w.set(o);
  w.settle();
  for (int i = 0; i < 50; ++i) {
    const double d = 0.001 * i, t = now(w.scene) + 1e-3 - 1e-3;
    EXPECT_NEAR(w.force_at({0.3, 0, d}).z, 2 + std::sin(20 * t) + 100 * d, 1e-10);
  }
  EXPECT_NEAR(w.force_at({0, 0, -0.1}).z, -(1 + now(w.scene) - 1e-3), 1e-10);
}
END_TEST

START_TEST(set_change_move_remove_clear) {
  World w(_i);
  const fs_vec3 x{0.02, 0, 0};
  w.fake.state.pose = at(x);
  const auto felt = [&] {
    w.settle();
    return w.fake.written.force;
  };
  EXPECT_VECTOR(felt(), (fs_vec3{}), 0);
  w.set(spring("a"));
  EXPECT_VECTOR(felt(), (fs_vec3{-2, 0, 0}), 1e-12);
  w.set(spring("b", {0.02, 0.01, 0}));
  EXPECT_VECTOR(felt(), (fs_vec3{-2, 1, 0}), 1e-12);
  w.set(spring("a", {0.03, 0, 0}, 300));  // another pose and profile
  EXPECT_VECTOR(felt(), (fs_vec3{3, 1, 0}), 1e-12);

  // Only the parts that are named.
  fs_object o = spring("a", {0.04, 0, 0}, 50);
  o.lifetime = 77;
  OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
  EXPECT_VECTOR(felt(), (fs_vec3{0.5, 1, 0}), 1e-12);
  ck_assert_double_eq(Got(w.scene, "a")->lifetime, 0);
  OK(fs_object_change(w.scene, &o, FS_PART_POSE));
  EXPECT_VECTOR(felt(), (fs_vec3{1, 1, 0}), 1e-12);
  OK(fs_object_change(w.scene, &o, 0));
  ck_assert_double_eq(Got(w.scene, "a")->lifetime, 0);
  o.lifetime = 1e6;
  OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
  ck_assert_double_eq(Got(w.scene, "a")->lifetime, 1e6);
  o = push("a", 1.5);  // becomes a plane
  OK(fs_object_change(w.scene, &o, FS_PART_SHAPE | FS_PART_POSE | FS_PART_PROFILES));
  EXPECT_VECTOR(felt(), (fs_vec3{0, 1, 1.5}), 1e-12);
  o.contact.stiffness = 123;  // kept, and not felt
  OK(fs_object_change(w.scene, &o, FS_PART_CONTACT));
  ck_assert_double_eq(Got(w.scene, "a")->contact.stiffness, 123);
  EXPECT_VECTOR(felt(), (fs_vec3{0, 1, 1.5}), 1e-12);

  const fs_pose pose{{0.02, -0.03, 0}, turn({1, 2, 3}, 0.7)};
  OK(fs_object_move(w.scene, "b", &pose, nullptr, FS_NOW));
  OK(w.sync(w.scene));
  w.step(200);  // where the twist that was worked out ends
  const fs_pose stands = at(0.02, -0.03, 0);
  OK(fs_object_move(w.scene, "b", &stands, nullptr, FS_NOW));
  w.step(250);
  OK(fs_object_move(w.scene, "b", &stands, nullptr, FS_NOW));  // none in the last 0.2 s: it stands
  EXPECT_VECTOR(felt(), (fs_vec3{0, -3, 1.5}), 1e-12);
  EXPECT_VECTOR(Got(w.scene, "b")->pose.position, stands.position, 0);

  {
    Got got(w.scene, "a");  // got, set as it is, edited and set
    w.set(got.object);
    EXPECT_VECTOR(felt(), (fs_vec3{0, -3, 1.5}), 1e-12);
    got.object.front.gain = 0.5;
    w.set(got.object);
    EXPECT_VECTOR(felt(), (fs_vec3{0, -3, 0.5}), 1e-12);
  }
  OK(fs_object_remove(w.scene, "a"));
  EXPECT_VECTOR(felt(), (fs_vec3{0, -3, 0}), 1e-12);
  ck_assert(!has(w.scene, "a") && has(w.scene, "b"));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(w.scene, "a"));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_change(w.scene, &o, FS_PART_POSE));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_change(w.scene, &o, 0));
  for (const char* name : {"c", "d", "a"}) w.set(spring(name));
  OK(fs_scene_clear(w.scene));
  EXPECT_VECTOR(felt(), (fs_vec3{}), 0);
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 0);
  OK(fs_scene_clear(w.scene));
  w.set(spring("d"));
  EXPECT_VECTOR(felt(), (fs_vec3{-2, 0, 0}), 1e-12);
}
END_TEST

START_TEST(change_takes_only_its_parts) {
  World w(_i);
  w.step(10);
  fs_object o = fs_object_init("w", FS_PRIMITIVE_PLANE);
  o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 0.01, 1);
  o.back = attract(500, 4);
  o.lifetime = 100;
  fs_object other = o;
  other.pose = {{1, 2, 3}, turn({1, 0, 0}, 1)};
  other.twist.linear = {4, 5, 6};
  other.front.gain = 2;
  other.back = fs_profile{};
  other.damping = 3;
  other.lifetime = 50;
  other.tool_points = 2;
  other.enabled = false;
  for (const uint32_t parts : {+FS_PART_POSE, +FS_PART_PROFILES, +FS_PART_CONTACT, +FS_PART_OTHER, +FS_PART_SHAPE,
                               FS_PART_POSE | FS_PART_OTHER, 31}) {
    w.set(o);
    OK(fs_object_change(w.scene, &other, parts));
    const Got got(w.scene, "w");
    const bool pose = parts & FS_PART_POSE, profiles = parts & FS_PART_PROFILES, rest = parts & FS_PART_OTHER;
    EXPECT_VECTOR(got->pose.position, pose ? other.pose.position : o.pose.position, 0);
    EXPECT_VECTOR(got->twist.linear, pose ? other.twist.linear : o.twist.linear, 0);
    ck_assert_double_eq(got->front.gain, profiles ? 2 : 1);
    ck_assert_int_eq(got->back.kind, profiles ? FS_PROFILE_NONE : FS_PROFILE_LINEAR_INCREASING);
    ck_assert_double_eq(got->damping, profiles ? 3 : 0);
    ck_assert_double_eq(got->lifetime, rest ? 50 : 100);
    ck_assert_uint_eq(got->tool_points, rest ? 2 : 0);
    ck_assert_int_eq(got->enabled, !rest);
  }
}
END_TEST

// Names come and go by the hundred: each keeps to its own object.
START_TEST(many_names) {
  World w(_i);
  Random random(7);
  std::map<std::string, double> held;  // force of each
  w.fake.state.pose = {};
  for (int round = 0; round < 6; ++round) {
    for (int i = 0; i < 120; ++i) {
      const std::string name = "n" + std::to_string(random.below(80));
      if (random.coin(0.35) && held.contains(name)) {
        OK(fs_object_remove(w.scene, name.c_str()));
        held.erase(name);
      } else if (random.coin(0.2) && held.contains(name)) {
        fs_object o = push(name.c_str(), held[name] += 1);
        OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
      } else {
        w.set(push(name.c_str(), held[name] = random.between(0.1, 1)));
      }
    }
    w.settle();
    double sum = 0;
    for (const auto& [name, force] : held) sum += force;
    EXPECT_NEAR(w.fake.written.force.z, sum, 1e-10);
    const std::vector<fs_report> reports = own_reports_of(w.scene);
    ck_assert_uint_eq(reports.size(), held.size());
    for (const fs_report& r : reports) {
      ck_assert(held.contains(r.name));
      EXPECT_NEAR(r.wrench.force.z, held[r.name], 1e-12);
    }
  }
}
END_TEST

START_TEST(shared_shapes) {
  World w(_i);
  const fs_vec3 ends[]{{-1, 0, 0}, {1, 0, 0}}, others[]{{0, -1, 0}, {0, 1, 0}};
  Shape line = make_polyline(ends, 2, false), other = make_polyline(others, 2, false);
  Shape box = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  const auto of = [](const char* name, const Shape& shape, fs_primitive primitive, fs_vec3 position) {
    fs_object o = fs_object_init(name, primitive);
    o.shape = shape.get();
    o.front = attract(100, 1000);
    o.pose = at(position);
    return o;
  };
  const auto felt = [&](fs_vec3 x) {
    w.settle();
    return w.force_at(x);
  };
  w.set(of("a", line, FS_PRIMITIVE_POLYLINE, {0, 0, 0}));
  w.set(of("b", line, FS_PRIMITIVE_POLYLINE, {0, 0.1, 0}));
  w.set(of("c", box, FS_PRIMITIVE_MESH, {0, 0, 0.2}));
  EXPECT_VECTOR(felt({0, 0.02, 0.1}), (fs_vec3{0, -2 + 8 - 1, -10 - 10 + 9}), 1e-12);
  ck_assert_ptr_eq(Got(w.scene, "a")->shape, line.get());
  ck_assert_ptr_eq(Got(w.scene, "b")->shape, line.get());
  fs_object o = of("b", other, FS_PRIMITIVE_POLYLINE, {});
  OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
  ck_assert_ptr_eq(Got(w.scene, "b")->shape, line.get());
  OK(fs_object_change(w.scene, &o, FS_PART_SHAPE));  // its own from now on
  OK(fs_object_remove(w.scene, "c"));
  EXPECT_VECTOR(felt({0.03, 0.02, 0.1}), (fs_vec3{-3, -2, -10 - 10}), 1e-12);
  OK(fs_object_remove(w.scene, "a"));  // the last that uses the line
  EXPECT_VECTOR(felt({0.03, 0.02, 0.1}), (fs_vec3{-3, 0, -10}), 1e-12);
  w.set(of("d", line, FS_PRIMITIVE_POLYLINE, {0, 0, 0}));  // the same shape is used again
  w.set(of("c", box, FS_PRIMITIVE_MESH, {0, 0, 0.2}));
  line.reset();
  box.reset();  // the objects keep the shapes
  EXPECT_VECTOR(felt({0.03, 0.02, 0.1}), (fs_vec3{-3 - 2, -2 - 1, -10 - 10 + 9}), 1e-12);
  // A shape from a getter can be used like any other.
  {
    const Got d(w.scene, "d"), c(w.scene, "c");
    o = of("e", line, FS_PRIMITIVE_POLYLINE, {0, 0, 0.1});
    o.shape = d->shape;
    w.set(o);
    OK(fs_scene_begin(w.scene));
    OK(fs_scene_clear(w.scene));
    w.set(o);
    o = of("f", line, FS_PRIMITIVE_MESH, {});
    o.shape = c->shape;
    w.set(o);
    OK(fs_scene_commit(w.scene));
  }
  EXPECT_VECTOR(felt({0.005, 0.02, 0}), (fs_vec3{0, -2 - 1, 10}), 1e-12);
  w.set(spring("f"));  // a point now, in the place of the mesh
  EXPECT_VECTOR(felt({0.005, 0.02, 0}), (fs_vec3{-0.5, -2 - 2, 10}), 1e-12);
}
END_TEST

START_TEST(enabled_or_not) {
  World w(_i);
  fs_object o = push("a");
  o.enabled = false;
  w.set(o);
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  ck_assert(!Got(w.scene, "a")->enabled);
  const fs_pose pose = o.pose;
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));  // stays so
  o.front = constant(FS_SENSE_REPULSIVE, 3);
  OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  for (int i = 0; i < 3; ++i) {
    o.enabled = true;
    OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
    w.settle();
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{0, 0, 3}), 1e-12);
    o.enabled = false;
    w.set(o);
    w.settle();
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  }
}
END_TEST

// ----------------------------------------------------------------------------------------------------- motion, time

// Where the object was along x at the ticks of the last step; worked out from the force of its spring of 100 N/m on a
// hand at the origin.
static std::vector<std::pair<double, double>> places(World& w, size_t ticks) {
  std::vector<fs_tick> record = record_of(w.servo.get());
  ck_assert_uint_ge(record.size(), ticks);
  std::vector<std::pair<double, double>> out;
  for (size_t i = record.size() - ticks; i < record.size(); ++i) {
    out.emplace_back(record[i].state.time, record[i].sent.force.x / 100);
  }
  return out;
}

START_TEST(twists_that_are_given) {
  World w(_i);
  const double t = 5;  // a move may be given before its time
  fs_object o = spring("a", {0.5, 0, 0});
  o.time = t;
  o.twist = {{2, 0, 0}, {0, 0, 9}};
  w.set(o);
  w.settle();
  w.step_until(t - 0.05);
  w.step(300);
  for (const auto& [time, x] : places(w, 300)) {  // from `time` on, never back, for 0.1 s at most
    EXPECT_NEAR(x, 0.5 + 2 * std::fmin(std::fmax(time - t, 0), 0.1), 1e-9);
  }
  const fs_pose pose = at(0.3, 0, 0);
  const fs_twist twist{{-1, 0.5, 0}, {}}, still{};
  OK(fs_object_move(w.scene, "a", &pose, &twist, t + 5));
  w.settle();
  w.step_until(t + 5 - 0.05);
  w.step(300);
  for (const auto& [time, x] : places(w, 300)) {
    EXPECT_NEAR(x, 0.3 - std::fmin(std::fmax(time - t - 5, 0), 0.1), 1e-9);
  }
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, twist.linear, 0);
  OK(fs_object_move(w.scene, "a", &pose, &still, now(w.scene)));  // a twist of zero is a twist
  w.settle();
  EXPECT_NEAR(places(w, 1)[0].second, 0.3, 1e-12);
}
END_TEST

START_TEST(twists_that_are_worked_out) {
  World w(_i);
  w.set(spring("a"));
  w.settle();
  const double t = 5;
  const fs_pose before = at(0.1, 0, 0), after = at(0.12, 0, 0);
  OK(fs_object_move(w.scene, "a", &before, nullptr, t));
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{}), 0);  // there was no move for so long
  OK(fs_object_move(w.scene, "a", &after, nullptr, t + 0.02));
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{1, 0, 0}), 1e-9);
  w.settle();
  w.step_until(t - 0.05);
  w.step(300);
  for (const auto& [time, x] : places(w, 300)) {  // used for twice the time between them
    EXPECT_NEAR(x, 0.12 + std::fmin(std::fmax(time - t - 0.02, 0), 0.04), 1e-9);
  }
  // It counts for twice the time between them, and for 0.1 s at most. A twist that was given is not looked at.
  const fs_twist given{{9, 0, 0}, {}};
  OK(fs_object_move(w.scene, "a", &before, &given, t + 2));
  OK(fs_object_move(w.scene, "a", &after, nullptr, t + 2.1));
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{0.2, 0, 0}), 1e-9);
  w.settle();
  w.step_until(t + 2.05);
  w.step(300);
  for (const auto& [time, x] : places(w, 300)) {
    if (time > t + 2.1) EXPECT_NEAR(x, 0.12 + 0.2 * std::fmin(time - t - 2.1, 0.1), 1e-9);
  }
  OK(fs_object_move(w.scene, "a", &after, nullptr, t + 2.2));  // the same pose again: it stands
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{}), 0);
  OK(fs_object_move(w.scene, "a", &before, nullptr, t + 2.41));  // nothing in the last 0.2 s
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{}), 0);
  // Of two within 1 ms the later replaces the earlier, also for the twist.
  OK(fs_object_move(w.scene, "a", &before, nullptr, t + 5));
  const fs_pose wrong = at(0.9, 0, 0), right = at(0.14, 0, 0);
  OK(fs_object_move(w.scene, "a", &wrong, nullptr, t + 5.04));
  OK(fs_object_move(w.scene, "a", &right, nullptr, t + 5.0405));
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{0.04 / 0.0405, 0, 0}), 1e-9);
  // An older time than the last is taken, with twist 0.
  OK(fs_object_move(w.scene, "a", &before, nullptr, t + 4));
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{}), 0);
  ck_assert_double_eq(Got(w.scene, "a")->time, t + 4);
  w.settle();
  w.step(300);
  for (const auto& [time, x] : places(w, 300)) EXPECT_NEAR(x, 0.1, 1e-12);
  // Rotations, too: about the object's own origin.
  const fs_vec3 ends[]{{0, 0, 0}, {1, 0, 0}};
  const Shape line = make_polyline(ends, 2, false);
  fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  o.shape = line.get();
  o.front = attract(100, 1e6);
  o.time = 20;
  OK(fs_scene_clear(w.scene));
  w.set(o);
  const fs_pose turned{{}, turn({0, 0, 1}, 0.1)};
  OK(fs_object_move(w.scene, "line", &turned, nullptr, 20.05));
  EXPECT_VECTOR(Got(w.scene, "line")->twist.angular, (fs_vec3{0, 0, 2}), 1e-9);
  w.set(o);  // q and -q are the same turn
  const fs_quat q = turned.orientation;
  const fs_pose same{{}, {-q.w, -q.x, -q.y, -q.z}};
  OK(fs_object_move(w.scene, "line", &same, nullptr, 20.05));
  EXPECT_VECTOR(Got(w.scene, "line")->twist.angular, (fs_vec3{0, 0, 2}), 1e-9);
  w.fake.state.pose = at(2, 0, 0);
  w.settle();
  w.step_until(20.2);
  const double angle = 0.1 + 2 * 0.1;  // at the end of its extrapolation
  EXPECT_VECTOR(w.fake.written.force, 100.0 * (fs_vec3{std::cos(angle), std::sin(angle), 0} - fs_vec3{2, 0, 0}), 1e-9);
}
END_TEST

START_TEST(now_and_the_past) {
  World w(_i);
  w.step(500);
  const double before = now(w.scene);
  EXPECT_NEAR(before, 0.5, 1e-12);  // the servo's virtual time
  w.set(spring("a"));
  ck_assert_double_eq(Got(w.scene, "a")->time, before);  // there was no step in between
  ck_assert_double_eq(Got(w.scene, "a")->start, before);
  w.step(10);
  const fs_pose pose = at(0.1, 0, 0);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  EXPECT_NEAR(Got(w.scene, "a")->time, before + 0.01, 1e-12);
  EXPECT_VECTOR(Got(w.scene, "a")->twist.linear, (fs_vec3{10, 0, 0}), 1e-9);
  // Times in the past: the object is where it has moved since then.
  w.settle();
  w.step(200);
  fs_object o = spring("a", {0.2, 0, 0});
  o.twist.linear.x = 1;
  o.time = now(w.scene) - 0.08;
  w.set(o);
  w.settle();
  w.step(200);
  EXPECT_NEAR(w.fake.written.force.x, 100 * 0.3, 1e-9);
  ck_assert_double_eq(Got(w.scene, "a")->time, o.time);
  o.time = -300;  // before the clock began
  o.twist.linear.x = 2;
  w.set(o);
  w.settle();
  EXPECT_NEAR(w.fake.written.force.x, 100 * 0.4, 1e-9);
  const fs_twist twist{{-1, 0, 0}, {}};
  OK(fs_object_move(w.scene, "a", &pose, &twist, now(w.scene) - 50));  // newer than the last: with its twist
  w.settle();
  EXPECT_NEAR(w.fake.written.force.x, 100 * 0.0, 1e-9);
  OK(fs_object_move(w.scene, "a", &pose, &twist, now(w.scene) - 100));  // older: without
  w.settle();
  EXPECT_NEAR(w.fake.written.force.x, 100 * 0.1, 1e-9);
}
END_TEST

START_TEST(lifetimes) {
  World w(_i);
  const double lifetime = 6;
  fs_object o = push("short");
  o.lifetime = lifetime;
  w.set(push("long", 1));
  const auto felt = [&] { return w.fake.written.force.z - 1; };
  const auto comes_back = [&](const std::function<void()>& how) {
    how();
    w.settle();
    EXPECT_NEAR(felt(), 2, 1e-12);
    ck_assert_double_eq(report_of(w.scene, "short").weight, 1);
    for (const fs_event& e : events_now(w.scene)) ck_assert_int_ne(e.kind, FS_EVENT_EXPIRED);
    w.step(static_cast<uint64_t>(1000 * (lifetime + world_fade)));
    EXPECT_NEAR(felt(), 0, 1e-12);
    const fs_event event = next_event(w.scene, FS_EVENT_EXPIRED);
    ck_assert_str_eq(event.name, "short");
    ck_assert_double_le(event.time, now(w.scene) - world_fade);
    ck_assert_double_ge(event.time, now(w.scene) - 2 * lifetime);
    const fs_report report = report_of(w.scene, "short");  // it stays, at weight 0
    ck_assert_double_eq(report.weight, 0);
    ck_assert_int_eq(report.state, FS_OBJECT_FADING);
    ck_assert(has(w.scene, "short"));
    for (const fs_vec3 x : {fs_vec3{}, fs_vec3{1, 2, 3}}) {  // an application's own tool shows the same
      fs_vec3 f{};
      OK(fs_evaluate_field(w.scene, "short", FS_NOW, &x, 1, &f));
      EXPECT_VECTOR(f, (fs_vec3{}), 0);
    }
  };
  const fs_pose pose = o.pose;
  comes_back([&] { w.set(o); });
  comes_back([&] { w.set(o); });
  comes_back([&] { OK(fs_object_move(w.scene, "short", &pose, nullptr, FS_NOW)); });
  comes_back([&] { OK(fs_object_change(w.scene, &o, FS_PART_CONTACT)); });
  comes_back([&] {  // in a group that has only moves
    OK(fs_scene_begin(w.scene));
    OK(fs_object_move(w.scene, "short", &pose, nullptr, FS_NOW));
    OK(fs_object_move(w.scene, "long", &pose, nullptr, FS_NOW));
    OK(fs_scene_commit(w.scene));
  });
  // Moved again and again, it lives on.
  w.set(o);
  for (int i = 0; i < 4; ++i) {
    OK(fs_object_move(w.scene, "short", &pose, nullptr, FS_NOW));
    OK(w.sync(w.scene));
    w.step(static_cast<uint64_t>(1000 * lifetime / 2));
    EXPECT_NEAR(felt(), 2, 1e-12);
  }
  o.lifetime = 0;  // for good
  OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
  w.settle();
  w.step(static_cast<uint64_t>(1500 * lifetime));
  EXPECT_NEAR(felt(), 2, 1e-12);
  for (const fs_event& e : events_now(w.scene)) ck_assert_int_ne(e.kind, FS_EVENT_EXPIRED);
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- groups

START_TEST(groups) {
  World w(_i);
  w.fake.state.pose = at(0, 0.1, 0);
  const auto felt = [&] {
    w.settle();
    return w.fake.written.force.y;
  };
  w.set(spring("old"));
  EXPECT_NEAR(felt(), -10, 1e-12);
  OK(fs_scene_begin(w.scene));
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_scene_begin(w.scene), "group");
  w.set(spring("a"));
  w.set(spring("b"));
  OK(fs_object_remove(w.scene, "old"));
  const fs_pose pose = at(0, 0.05, 0);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(w.scene, "old", &pose, nullptr, FS_NOW));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(w.scene, "old"));
  // Getters see the group, evaluation does not; sync does not wait for it.
  ck_assert(has(w.scene, "a") && has(w.scene, "b") && !has(w.scene, "old"));
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 2);
  EXPECT_VECTOR(Got(w.scene, "a")->pose.position, pose.position, 0);
  ck_assert_int_eq(report_of(w.scene, "a").state, FS_OBJECT_PENDING);
  EXPECT_NEAR(felt(), -10, 1e-12);
  fs_vec3 f{}, x{0, 0.1, 0};
  OK(fs_evaluate_field(w.scene, nullptr, FS_NOW, &x, 1, &f));
  EXPECT_NEAR(f.y, -10, 1e-12);
  // A call that fails adds nothing to the group.
  fs_object bad = spring("a");
  bad.front.gain = -1;
  EXPECT(FS_ERROR_INVALID, fs_object_set(w.scene, &bad));
  bad = spring("bad");
  bad.lifetime = -1;
  EXPECT(FS_ERROR_INVALID, fs_object_set(w.scene, &bad));
  EXPECT(FS_ERROR_INVALID, fs_object_change(w.scene, &bad, 32));
  bad.lifetime = 0;
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_change(w.scene, &bad, FS_PART_POSE));
  OK(fs_scene_commit(w.scene));
  EXPECT_NEAR(felt(), -15, 1e-12);
  ck_assert(has(w.scene, "a") && has(w.scene, "b") && !has(w.scene, "old") && !has(w.scene, "bad"));
  EXPECT(FS_ERROR_STATE, fs_scene_commit(w.scene));
  EXPECT(FS_ERROR_STATE, fs_scene_cancel(w.scene));

  // A cancelled group changes nothing: objects, frame, tool, and objects that it cleared.
  fs_frame frame = fs_frame_init();
  frame.scale = 7;
  const fs_vec3 point{0, 0, 1};
  OK(fs_scene_begin(w.scene));
  OK(fs_object_move(w.scene, "b", &pose, nullptr, FS_NOW));
  OK(fs_object_remove(w.scene, "a"));
  OK(fs_scene_clear(w.scene));
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 0);
  w.set(spring("c"));
  OK(fs_scene_set_frame(w.scene, &frame));
  OK(fs_scene_set_tool(w.scene, &point, 1));
  OK(fs_scene_set_clutch(w.scene, true));
  ck_assert_double_eq(frame_of(w.scene).scale, 7);
  EXPECT_VECTOR(tool_of(w.scene)[0], point, 0);
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 1);
  OK(fs_scene_cancel(w.scene));
  ck_assert(has(w.scene, "a") && has(w.scene, "b") && !has(w.scene, "c"));
  ck_assert_double_eq(frame_of(w.scene).scale, 1);
  EXPECT_VECTOR(tool_of(w.scene)[0], (fs_vec3{}), 0);
  EXPECT_NEAR(felt(), -15, 1e-12);

  // A scene replaced, with new shapes and curves; the shapes are known after the first time.
  const fs_vec3 ends[]{{-1, 0, 0}, {1, 0, 0}};
  const Shape line = make_polyline(ends, 2, false), box = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  const double table[]{3, 3, 3};
  const Curve curve = make_table(table, 3, 0.1);
  for (int i = 0; i < 2; ++i) {
    OK(fs_scene_begin(w.scene));
    OK(fs_scene_clear(w.scene));
    fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
    o.shape = line.get();
    o.front = attract(100, 100);
    w.set(o);
    o = fs_object_init("b", FS_PRIMITIVE_MESH);  // was a point
    o.shape = box.get();
    o.front = attract(100, 100);
    w.set(o);
    o = push("curve", 1, {0, 1, 0});
    o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 1000);
    o.front.curve = curve.get();
    w.set(o);
    OK(fs_object_remove(w.scene, "line"));
    o = spring("line");  // set, removed, set as another object
    w.set(o);
    OK(fs_scene_set_frame(w.scene, &frame));
    OK(fs_scene_commit(w.scene));
    EXPECT_NEAR(felt(), -70 - 69 + 3, 1e-11);
    OK(fs_scene_begin(w.scene));
    OK(fs_scene_clear(w.scene));
    w.set(spring("old"));
    const fs_frame plain = fs_frame_init();
    OK(fs_scene_set_frame(w.scene, &plain));
    OK(fs_scene_commit(w.scene));
    EXPECT_NEAR(felt(), -10, 1e-11);
  }
  OK(fs_scene_begin(w.scene));
  OK(fs_scene_commit(w.scene));  // an empty one
  OK(fs_scene_begin(w.scene));
  OK(fs_scene_cancel(w.scene));
  OK(fs_scene_begin(w.scene));
  w.set(spring("x"));
  OK(fs_object_remove(w.scene, "x"));
  OK(fs_scene_commit(w.scene));
  EXPECT_NEAR(felt(), -10, 1e-11);
  OK(fs_scene_begin(w.scene));
  OK(fs_scene_set_tool(w.scene, &x, 1));  // 0.1 m further than the hand
  EXPECT_VECTOR(tool_of(w.scene)[0], x, 0);
  EXPECT_NEAR(felt(), -10, 1e-11);
  OK(fs_scene_commit(w.scene));
  EXPECT_NEAR(felt(), -20, 1e-11);
  fs_tool* own = nullptr;  // a tool of one's own has the scene's points
  OK(fs_tool_create(w.scene, nullptr, 0, &own));
  EXPECT_NEAR(force_at(Tool(own).get(), {}).y, -10, 1e-11);
  OK(fs_scene_begin(w.scene));  // one that nobody commits goes with its scene
  w.set(spring("x"));
}
END_TEST

START_TEST(a_group_is_of_its_thread) {
  World w(_i);
  w.fake.state.pose = at(0, 0.1, 0);
  w.set(spring("ours"));
  OK(fs_scene_begin(w.scene));
  w.set(spring("in the group"));
  OK(fs_object_remove(w.scene, "ours"));
  fs_status set = FS_ERROR_INTERNAL, begin = set, cancel = set, commit = FS_OK;
  bool sees_group = true, sees_ours = false;
  std::thread([&] {
    sees_group = has(w.scene, "in the group"), sees_ours = has(w.scene, "ours");
    const fs_object o = spring("theirs"), other = spring("in their group");
    set = fs_object_set(w.scene, &o);
    commit = fs_scene_commit(w.scene);
    begin = fs_scene_begin(w.scene);
    fs_object_set(w.scene, &other);
    cancel = fs_scene_cancel(w.scene);
  }).join();
  ck_assert(!sees_group && sees_ours);
  ck_assert(set == FS_OK && commit == FS_ERROR_STATE && begin == FS_OK && cancel == FS_OK);
  ck_assert(has(w.scene, "theirs") && has(w.scene, "in the group") && !has(w.scene, "ours"));
  w.settle();
  EXPECT_NEAR(w.fake.written.force.y, -20, 1e-12);  // of ours and theirs
  OK(fs_scene_cancel(w.scene));
  ck_assert(has(w.scene, "theirs") && has(w.scene, "ours") && !has(w.scene, "in the group") && !has(w.scene, "in their group"));

  // What others have changed of an object since, the group does not undo, but where it changes the same part.
  OK(fs_scene_begin(w.scene));
  fs_object ours = spring("ours");
  ours.front.gain = 50;
  OK(fs_object_change(w.scene, &ours, FS_PART_PROFILES));
  OK(fs_object_remove(w.scene, "theirs"));
  const fs_pose pose = at(0, 0.06, 0);
  const fs_twist still{};
  std::thread([&] {
    set = fs_object_move(w.scene, "ours", &pose, &still, FS_NOW);
    begin = fs_object_move(w.scene, "theirs", &pose, &still, FS_NOW);
  }).join();
  ck_assert(set == FS_OK && begin == FS_OK);
  OK(fs_scene_commit(w.scene));
  EXPECT_VECTOR(Got(w.scene, "ours")->pose.position, pose.position, 0);
  ck_assert(!has(w.scene, "theirs"));
  w.settle();
  EXPECT_NEAR(w.fake.written.force.y, -2, 1e-12);
}
END_TEST

// Ten thousand changes in the group of one thread, while four others set, move and remove.
START_TEST(others_change_meanwhile) {
  World w(_i);
  constexpr int count = 2500;
  const auto name_of = [](int i) { return "grouped " + std::to_string(i); };
  std::atomic<bool> is_done{false};
  std::atomic<int> bad{0}, rounds{0};
  std::vector<std::thread> others;
  for (int k = 0; k < 4; ++k) {
    others.emplace_back([&, k] {
      const std::string name = "other " + std::to_string(k);
      const fs_object o = spring(name.c_str());
      for (int i = 0; !is_done; ++i) {
        const fs_pose pose = at(1e-3 * (i % 10), 0, 0);
        bad += fs_object_set(w.scene, &o) != FS_OK;
        for (int n = 0; n < 20; ++n) bad += fs_object_move(w.scene, name.c_str(), &pose, nullptr, FS_NOW) < 0;
        fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
        bad += fs_object_get(w.scene, name.c_str(), &out) != FS_OK || out.pose.position.x != pose.position.x;
        fs_object_release(&out);
        bad += fs_object_get(w.scene, name_of(1).c_str(), &out) != FS_ERROR_NOT_FOUND && !is_done;
        fs_object_release(&out);
        if (i % 2) bad += fs_object_remove(w.scene, name.c_str()) != FS_OK;
        ++rounds;
      }
      const fs_pose last = at(0, 0, 1e-3 * k);
      bad += fs_object_set(w.scene, &o) != FS_OK;
      bad += fs_object_move(w.scene, name.c_str(), &last, nullptr, FS_NOW) < 0;
    });
  }
  OK(fs_scene_begin(w.scene));
  for (int i = 0; i < count; ++i) {
    const std::string name = name_of(i);
    fs_object o = spring(name.c_str());
    w.set(o);
    const fs_pose pose = at(1e-4 * i, 0, 0);
    OK(fs_object_move(w.scene, name.c_str(), &pose, nullptr, FS_NOW));
    o.front.gain = 60;
    OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
    if (i % 5 == 0) OK(fs_object_remove(w.scene, name.c_str()));
    else OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
  }
  while (rounds < 100) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  is_done = true;
  OK(fs_scene_commit(w.scene));
  for (std::thread& other : others) other.join();
  ck_assert_int_eq(bad, 0);
  ck_assert_uint_eq(own_reports_of(w.scene).size(), 4 * count / 5 + 4);
  for (int i = 1; i < count; i += 500) {
    ck_assert_double_eq(Got(w.scene, name_of(i).c_str())->pose.position.x, 1e-4 * i);
    ck_assert_double_eq(Got(w.scene, name_of(i).c_str())->front.gain, 60);
  }
  for (int k = 0; k < 4; ++k) ck_assert_double_eq(Got(w.scene, ("other " + std::to_string(k)).c_str())->pose.position.z, 1e-3 * k);
}
END_TEST

// A servo that runs meanwhile has all of a group in one tick, or nothing of it: what the group moves, sets or removes
// keeps a sum that no half of it has.
static void one_tick(int variant, fs_servo_options options, bool moves_only, bool sets) {
  options.fade = -1;
  std::vector<fs_wrench> log;
  World w(variant, options);
  const char* names[]{"a", "b", "c", "d"};
  const fs_vec3 directions[]{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  OK(fs_scene_begin(w.scene));
  for (size_t i = 0; i < 4; ++i) w.set(spring(names[i], directions[i]));
  OK(fs_scene_commit(w.scene));
  OK(w.sync(w.scene));
  {
    const std::lock_guard lock(w.fake.mutex);
    w.fake.log = &log;
  }
  const Shape box = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  Random random(3);
  fs_status status = FS_OK;
  const auto also = [&](fs_status other) { status = std::min(status, other); };
  std::unique_ptr<Stepper> stepper;
  if (w.is_virtual) stepper = std::make_unique<Stepper>(w.servo.get());
  for (int k = 0; k < 400; ++k) {
    const double far = random.between(0.1, 2);
    also(fs_scene_begin(w.scene));
    for (size_t i = 0; i < 4; ++i) {
      const fs_pose pose = at(far * directions[i]);
      const fs_twist still{};
      const fs_object o = spring(names[i], pose.position);
      const bool is_moved = moves_only || (!sets && random.coin());
      also(is_moved ? fs_object_move(w.scene, names[i], &pose, &still, FS_NOW) : fs_object_set(w.scene, &o));
    }
    if (sets) {  // and a pair whose forces cancel, which is set, changed and removed
      for (const char* name : {"up", "down"}) {
        fs_object o = push(name, 5, {0, 0, name[0] == 'u' ? 1.0 : -1.0});
        if (k % 3 == 0) {
          o.primitive = FS_PRIMITIVE_MESH;
          o.front = fs_profile{};
          o.shape = box.get();
        }
        also(k % 3 == 2 ? fs_object_remove(w.scene, name) : fs_object_set(w.scene, &o));
      }
    }
    also(fs_scene_commit(w.scene));
    if (k % 50 == 49) also(fs_scene_sync(w.scene, long_enough));
    if (k % 3 == 0) wait_a_little();
  }
  stepper.reset();
  EXPECT(FS_OK, status);
  const std::lock_guard lock(w.fake.mutex);
  w.fake.log = nullptr;
  ck_assert_uint_gt(log.size(), 20);
  for (const fs_wrench& tick : log) EXPECT_VECTOR(tick.force, (fs_vec3{}), 1e-9);
  size_t looked_at = 0;
  for (const fs_tick& tick : record_of(w.servo.get())) {
    EXPECT_VECTOR(tick.response.wrench.force, (fs_vec3{}), 1e-9);
    looked_at += tick.response.felt_count >= 4;
  }
  ck_assert_uint_gt(looked_at, 0);
}
static fs_servo_options thread_options() {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  options.priority = -1;
  return options;
}

// So many moves that a tick could come in the middle: the springs pull against each other in pairs, so half of the
// moves would show.
START_TEST(a_thousand_moves_are_one_tick) {
  const size_t count = 1000;
  fs_servo_options options = world_options();
  options.fade = -1;
  std::vector<fs_wrench> log;
  World w(_i, options);
  std::vector<std::string> names;
  OK(fs_scene_begin(w.scene));
  for (size_t i = 0; i < count; ++i) {
    names.push_back("o" + std::to_string(i));
    w.set(spring(names[i].c_str()));
  }
  OK(fs_scene_commit(w.scene));
  OK(w.sync(w.scene));
  w.fake.log = &log;
  Random random(5);
  fs_status status = FS_OK;
  size_t ticks = 0;
  {
    const Stepper stepper(w.servo.get());
    while (ticks < 200 && status == FS_OK) {
      const double x = random.between(-1, 1);
      const fs_twist still{};
      status = fs_scene_begin(w.scene);
      for (size_t i = 0; i < count; ++i) {
        const fs_pose pose = at(i < count / 2 ? x : -x, 0, 0);
        status = std::min(status, fs_object_move(w.scene, names[i].c_str(), &pose, &still, FS_NOW));
      }
      status = std::min(status, fs_scene_commit(w.scene));
      const std::lock_guard lock(w.fake.mutex);
      ticks = log.size();
    }
  }
  w.fake.log = nullptr;
  EXPECT(FS_OK, status);
  for (const fs_wrench& tick : log) EXPECT_VECTOR(tick.force, (fs_vec3{}), 1e-8);
}
END_TEST

START_TEST(moves_are_one_tick) { one_tick(_i, world_options(), true, false); }
END_TEST
START_TEST(moves_and_sets_are_one_tick) { one_tick(_i, world_options(), false, false); }
END_TEST
START_TEST(all_kinds_are_one_tick) { one_tick(_i, world_options(), false, true); }
END_TEST
START_TEST(one_tick_of_a_thread) {
  one_tick(_i, thread_options(), true, false);
  one_tick(_i, thread_options(), false, true);
}
END_TEST

// ----------------------------------------------------------------------------------------------- frame, clutch, tool

static fs_vec3 to_scene(const fs_frame& f, fs_vec3 x) {
  fs_pose pose = at(x);
  OK(fs_frame_to_scene(&f, &pose, &pose));
  return pose.position;
}

START_TEST(frames) {
  World w(_i);
  Random random(5);
  const fs_vec3 arms[]{{0.1, 0, 0}, {0, -0.2, 0.1}};
  OK(fs_scene_set_tool(w.scene, arms, 2));
  w.set(spring("a", {0.3, 0.1, -0.2}, 10));
  for (int k = 0; k < 10; ++k) {
    fs_frame frame{random.pose(0.2), random.log_between(0.1, 10), random.log_between(0.01, 2), {}};
    OK(fs_scene_set_frame(w.scene, &frame));
    const fs_frame got = frame_of(w.scene);
    EXPECT_VECTOR(got.pose.position, frame.pose.position, 0);
    ck_assert(got.scale == frame.scale && got.force_scale == frame.force_scale);
    const fs_pose hand = random.pose(0.1);
    w.fake.state.pose = hand;
    w.settle();
    // Worked out by hand: the places of the points in the scene, the mean of their forces, rotated back.
    const fs_quat turned = inverse(frame.pose.orientation) * hand.orientation;
    fs_vec3 force{}, torque{};
    for (const fs_vec3 arm : arms) {
      const fs_vec3 r = rotate(turned, arm);
      const fs_vec3 f = 0.5 * 10.0 * (fs_vec3{0.3, 0.1, -0.2} - (to_scene(frame, hand.position) + r));
      force = force + f;
      torque = torque + cross(r, f);
    }
    EXPECT_VECTOR(w.fake.written.force, frame.force_scale * rotate(frame.pose.orientation, force), 1e-10);
    EXPECT_VECTOR(w.fake.written.torque,
                  (frame.force_scale / frame.scale) * rotate(frame.pose.orientation, torque), 1e-10);
    fs_state state;
    fs_response response;
    fs_wrench sent;
    OK(fs_scene_get_hand(w.scene, &state, &response, &sent));
    EXPECT_VECTOR(state.pose.position, to_scene(frame, hand.position), 1e-12 * (1 + frame.scale));
    EXPECT_VECTOR(response.wrench.force, force, 1e-10);
    EXPECT_VECTOR(response.wrench.torque, torque, 1e-10);
    EXPECT_VECTOR(sent.force, rotate(inverse(frame.pose.orientation), w.fake.written.force), 1e-12);
    const fs_report report = report_of(w.scene, "a");
    EXPECT_NEAR(report.stiffness_wanted, INFINITY, INFINITY);
    EXPECT_VECTOR(report.point, (fs_vec3{0.3, 0.1, -0.2}), 1e-12);
    EXPECT_VECTOR(report.wrench.force, force, 1e-10);
  }
  fs_frame none = fs_frame_init();
  none.force_scale = 0;
  OK(fs_scene_set_frame(w.scene, &none));
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
}
END_TEST

START_TEST(clutch) {
  World w(_i);
  fs_frame frame = fs_frame_init();
  frame.scale = 4;
  frame.force_scale = 0.5;
  frame.pose = {{0.01, 0.02, 0.03}, turn({0, 1, 1}, 0.6)};
  OK(fs_scene_set_frame(w.scene, &frame));
  w.set(spring("a", {}, 10));
  const fs_vec3 first{0.03, 0.02, 0.01}, second{0.1, -0.05, 0.02};
  w.fake.state.pose = at(first);
  w.settle();
  const fs_vec3 tool = to_scene(frame, first);
  const fs_vec3 felt = 0.5 * rotate(frame.pose.orientation, -10.0 * tool);
  EXPECT_VECTOR(w.fake.written.force, felt, 1e-12);
  for (int k = 0; k < 2; ++k) {
    OK(fs_scene_set_clutch(w.scene, true));
    w.settle();
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
    OK(fs_scene_set_clutch(w.scene, true));  // it is held already
    fs_state state;
    w.fake.state.pose = at(k ? first : second);  // the hand moves, the tool stays
    w.settle();
    OK(fs_scene_get_hand(w.scene, &state, nullptr, nullptr));
    ck_assert_uint_eq(state.flags, FS_STATE_READY | FS_STATE_CLUTCHED);
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
    const fs_report report = report_of(w.scene, "a");
    ck_assert(std::isinf(report.distance));
    EXPECT_VECTOR(report.wrench.force, (fs_vec3{}), 0);
    OK(fs_scene_set_clutch(w.scene, false));
    w.settle();
    EXPECT_VECTOR(w.fake.written.force, felt, 1e-12);  // the tool is where it was held
    OK(fs_scene_get_hand(w.scene, &state, nullptr, nullptr));
    EXPECT_VECTOR(state.pose.position, tool, 1e-12);
    ck_assert_uint_eq(state.flags, FS_STATE_READY);
    const fs_frame moved = frame_of(w.scene);  // the frame has come along
    EXPECT_VECTOR(to_scene(moved, (k ? first : second)), tool, 1e-12);
    EXPECT_NEAR(moved.pose.orientation.w, frame.pose.orientation.w, 1e-15);
    ck_assert(moved.scale == 4 && moved.force_scale == 0.5);
  }
  // A new frame applies to the held tool, and after the release.
  OK(fs_scene_set_clutch(w.scene, true));
  OK(fs_scene_set_frame(w.scene, &frame));
  w.fake.state.pose = at(second);
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  OK(fs_scene_begin(w.scene));  // and as a part of a group
  OK(fs_scene_set_clutch(w.scene, false));
  OK(fs_scene_set_frame(w.scene, &frame));
  w.set(spring("a", {}, 20));
  OK(fs_scene_commit(w.scene));
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, 0.5 * rotate(frame.pose.orientation, -20.0 * to_scene(frame, second)), 1e-12);
  EXPECT_VECTOR(frame_of(w.scene).pose.position, frame.pose.position, 0);
}
END_TEST

START_TEST(tools) {
  World w(_i);
  EXPECT_VECTOR(tool_of(w.scene)[0], (fs_vec3{}), 0);  // by default one
  ck_assert_uint_eq(tool_of(w.scene).size(), 1);
  std::vector<fs_vec3> points(FS_TOOL_POINTS_MAX);
  for (size_t i = 0; i < points.size(); ++i) points[i] = {0.01 * static_cast<double>(i), 0, 0};
  OK(fs_scene_set_tool(w.scene, points.data(), points.size()));
  for (size_t i = 0; i < points.size(); ++i) EXPECT_VECTOR(tool_of(w.scene)[i], points[i], 0);
  w.set(push("a", 3.2));
  w.settle();
  // The mean over the points that feel the object: the limit is the same, and the torque has the mean of their lever
  // arms.
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{0, 0, 3.2}), 1e-12);
  EXPECT_VECTOR(w.fake.written.torque, (fs_vec3{0, -3.2 * 0.155, 0}), 1e-12);
  const struct {
    uint32_t mask;
    double arm;
  } cases[]{{1, 0}, {1u << 31, 0.31}, {0x80000001u, 0.155}, {0x6, 0.015}, {0, 0.155}};
  for (const auto& c : cases) {
    fs_object o = push("a", 3.2);
    o.tool_points = c.mask;
    if (c.mask & 1) {
      OK(fs_object_change(w.scene, &o, FS_PART_OTHER));
    } else {
      w.set(o);
    }
    w.settle();
    EXPECT_VECTOR(w.fake.written.force, (fs_vec3{0, 0, 3.2}), 1e-12);
    EXPECT_VECTOR(w.fake.written.torque, (fs_vec3{0, -3.2 * c.arm, 0}), 1e-12);
    fs_vec3 f{}, x{};
    OK(fs_evaluate_field(w.scene, "a", FS_NOW, &x, 1, &f));  // masks are ignored there
    EXPECT_VECTOR(f, (fs_vec3{0, 0, 3.2}), 1e-12);
  }
  fs_object o = push("a", 3.2);
  o.tool_points = 4;
  w.set(o);
  OK(fs_scene_set_tool(w.scene, points.data() + 1, 2));  // the tool has no point 2 now
  w.settle();
  EXPECT_VECTOR(w.fake.written.force, (fs_vec3{}), 0);
  w.fake.state.pose = {{}, turn({0, 0, 1}, 1)};
  o.tool_points = 2;
  w.set(o);
  w.settle();
  EXPECT_VECTOR(w.fake.written.torque, (3.2 * 0.02 * fs_vec3{std::sin(1), -std::cos(1), 0}), 1e-12);
}
END_TEST

int main() {
  Suite* suite = suite_create("scenario");
  add_on_both(suite, "objects", {every_primitive_and_profile, random_scenes, curves_of_time,
                                 set_change_move_remove_clear, change_takes_only_its_parts, many_names, shared_shapes,
                                 enabled_or_not});
  add_on_both(suite, "time", {twists_that_are_given, twists_that_are_worked_out, now_and_the_past, lifetimes});
  add_on_both(suite, "groups", {groups, a_group_is_of_its_thread, others_change_meanwhile, a_thousand_moves_are_one_tick, moves_are_one_tick,
                                moves_and_sets_are_one_tick, all_kinds_are_one_tick, one_tick_of_a_thread},
              OwnThreads::yes);
  add_on_both(suite, "view", {frames, clutch, tools});
  return run_suite(suite);
}
