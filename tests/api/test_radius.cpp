// Tool points with a radius: each is a ball. Profiles of all primitives at random: test_evaluate.cpp.
#include <algorithm>
#include <cmath>
#include <vector>

#include "api/hand.h"
#include "api/world.h"

using namespace scenes;

namespace {

constexpr double r = 0.004;  // m

void set_radius(fs_scene* scene, double radius) { OK(fs_scene_set_tool_radius(scene, radius)); }
double radius_of(fs_scene* scene) {
  double out = -1;
  OK(fs_scene_get_tool_radius(scene, &out));
  return out;
}
fs_object box(const Shape& shape, fs_keep keep = FS_KEEP_FRONT) {
  fs_object o = fs_object_init("box", FS_PRIMITIVE_MESH);
  o.shape = shape.get();
  o.contact = solid(keep);
  return o;
}

// ------------------------------------------------------------------------------------------------------------- profiles

// Under a servo the slope is bounded: what is felt is the largest function below f(max(0, |s| - r)) that has its sign, and is
// nowhere steeper, also across s = 0. Here it is found by brute force from the force without the bound.
START_TEST(the_cap_is_that_of_the_shifted_law) {
  Random random(11);
  for (int round = 0; round < times(60, 600); ++round) {
    Content content;
    Rig rig("radius");
    fs_object o = fs_object_init("wall", random.coin(0.7) ? FS_PRIMITIVE_PLANE : FS_PRIMITIVE_POINT);
    o.front = random_profile(random, content);
    if (o.primitive == FS_PRIMITIVE_PLANE) o.back = random_profile(random, content);
    o.start = 1;  // curves do not depend on time
    const double radius = random.log_between(1e-3, 0.02), most = random.log_between(50, 2000);
    set_radius(rig.scene.get(), radius);
    OK(fs_object_set(rig.scene.get(), &o));
    const Tool tool = make_tool(rig.scene.get());
    const double step = random.log_between(1e-5, 1e-4);
    constexpr int half = 600;
    std::vector<double> raw;  // N along z, from -half to half steps
    for (int i = -half; i <= half; ++i) raw.push_back(force_at(tool.get(), {0, 0, (i + 0.5) * step}).z);
    OK(fs_scene_set_max_stiffness(rig.scene.get(), most));
    fs_servo_options options = virtual_options();
    options.max_stiffness = 0;  // that of the scene
    options.ramp = -1;
    options.speed_limit = options.damping = -1;
    rig.fake.info.force_max = 1000;
    rig.fake.info.mass = 0.3;
    rig.fake.info.damping = 5;
    rig.fake.state.pose.position = {0, 0, 0.5 * step};
    rig.start(options);
    rig.step(300);
    const double granted = report_of(rig.scene.get(), "wall").stiffness_applied;
    double before = 0;
    for (int i = -half / 2; i <= half / 2; ++i) {
      rig.fake.state.pose.position.z = (i + 0.5) * step;
      rig.step(1);
      const double felt = rig.sent().z, exact = raw[i + half];
      // No force is raised, and none turns over.
      ck_assert_msg(felt * exact >= 0 && std::fabs(felt) <= std::fabs(exact) + 2e-3, "round %d, %d: %g N of %g", round, i, felt, exact);
      if (i > -half / 2) {
        ck_assert_msg(std::fabs(felt - before) <= std::min(granted, most) * step * 1.001 + 2e-3, "round %d, %d: a step of %g N", round, i,
                      felt - before);
      }
      before = felt;
      // Nothing more is lost than has to be.
      double largest = std::fabs(exact);
      for (int k = 0; k <= 2 * half; ++k) {
        const double way = std::abs(k - half - i) * step;
        largest = std::min(largest, (raw[k] * exact > 0 ? std::fabs(raw[k]) : 0) + std::min(granted, most) * way);
      }
      const bool is_known = largest < std::min(granted, most) * half / 2 * step;  // all that matters was looked at
      if (is_known && exact != 0) {
        ck_assert_msg(std::fabs(felt) >= largest - most * step - 2e-3, "round %d, %d (%g m, r %g): %g N, %g are possible", round, i,
                      (i + 0.5) * step, radius, felt, largest);
      }
    }
  }
}
END_TEST

START_TEST(distances_are_told_from_the_skin) {
  World world(in_process);
  fs_object o = fs_object_init("post", FS_PRIMITIVE_POINT);
  o.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -100, 1, 10);  // felt within 10 mm
  world.set(o);
  set_radius(world.scene, r);
  world.settle();
  EXPECT_VECTOR(world.force_at({0.01, 0, 0}), (fs_vec3{0.4, 0, 0}), 1e-9);
  EXPECT_NEAR(report_of(world.scene, "post").distance, 0.006, 1e-12);
  EXPECT_VECTOR(world.force_at({0, 0.0139, 0}), (fs_vec3{0, 0.01, 0}), 1e-9);  // felt within 14 mm
  EXPECT_VECTOR(world.force_at({0, 0.0141, 0}), (fs_vec3{}), 0);
  EXPECT_VECTOR(world.force_at({0, 0, 0.003}), (fs_vec3{0, 0, 1}), 1e-9);  // the ball is over the post
  EXPECT_NEAR(report_of(world.scene, "post").distance, 0, 0);
  // Fields are those of a point.
  const fs_vec3 x{0.009, 0, 0};
  fs_vec3 field{};
  OK(fs_evaluate_field(world.scene, nullptr, FS_NOW, &x, 1, &field));
  EXPECT_VECTOR(field, (fs_vec3{0.1, 0, 0}), 1e-12);
}
END_TEST

// On a solid plane a bounded profile goes on from where it was when the ball touched.
START_TEST(a_bounded_profile_goes_on_where_it_touches) {
  for (const double radius : {0.0, 0.008}) {
    for (const double side : {1.0, -1.0}) {
      Rig rig("radius");
      fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
      (side > 0 ? o.front : o.back) = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -200, 1, 10);
      o.contact = solid(side > 0 ? FS_KEEP_FRONT : FS_KEEP_BACK, 100, 5);
      OK(fs_object_set(rig.scene.get(), &o));
      set_radius(rig.scene.get(), radius);
      OK(fs_scene_set_max_stiffness(rig.scene.get(), 100));
      fs_servo_options options = virtual_options();
      options.max_stiffness = 0;
      options.ramp = options.speed_limit = options.damping = -1;
      rig.fake.info.mass = 0.3;
      rig.fake.info.damping = 5;
      rig.fake.state.pose.position.z = side * (radius + 0.01);
      rig.start(options);
      rig.step(300);
      double before = rig.sent().z;
      for (int i = 0; i < 1100; ++i) {
        rig.fake.state.pose.position.z -= side * 1e-5;
        rig.step(1);
        ck_assert_msg(std::fabs(rig.sent().z - before) <= 200 * 1e-5 + 1e-6, "radius %g, %g from touching: a step of %g N", radius,
                      side * rig.fake.state.pose.position.z - radius, rig.sent().z - before);
        before = rig.sent().z;
      }
      // 1 mm deep: the spring, and what the profile may have at d = radius.
      rig.step(100);
      ck_assert_double_gt(side * rig.sent().z, (radius > 0 ? 0.2 : 0.04));
    }
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- planes

// A ball that planes hold is as a point that planes hold which are nearer by the radius: with friction, stick and slip, texture,
// impact, profiles, and planes that move.
START_TEST(planes_are_shifted) {
  Random random(21);
  for (int round = 0; round < times(60, 600); ++round) {
    Hand ball, point;
    const double radius = random.log_between(1e-4, 0.03);
    set_radius(ball.scene.get(), radius);
    std::vector<Surface> surfaces;
    struct Wall {
      fs_object object;
      fs_vec3 normal, velocity;
    };
    std::vector<Wall> walls;
    const int count = 1 + static_cast<int>(random.below(3));
    for (int i = 0; i < count; ++i) {
      fs_object o = fs_object_init(("w" + std::to_string(i)).c_str(), FS_PRIMITIVE_PLANE);
      const fs_vec3 normal = i == 0 ? fs_vec3{0, 0, 1} : random.direction();
      OK(fs_pose_from_z(-0.01 * normal, normal, &o.pose));
      o.contact = solid(FS_KEEP_FRONT, random.coin() ? 1000 : random.between(100, 2000), random.coin() ? 1000 : 3);
      o.contact.friction = random.coin() ? random.between(0, 1) : 0;
      o.contact.damping = random.coin() ? random.between(0, 3) : 0;
      if (random.coin()) o.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -50, 1, 10);
      fs_surface_settings settings = fs_surface_settings_init();
      if (random.coin()) {
        o.contact.friction = 0;
        settings.static_friction = 0.6, settings.dynamic_friction = 0.3, settings.slip_distance = 0.002;
      }
      if (random.coin()) settings.impact_gain = 5, settings.impact_frequency = 60, settings.impact_decay = 40;
      std::vector<double> heights;
      if (random.coin(0.3)) {
        settings.columns = settings.rows = 4;
        settings.column_width = settings.row_width = 5e-4;
        settings.repeats = true;
        for (int k = 0; k < 16; ++k) heights.push_back(-random.between(0, 1e-4));
      }
      surfaces.push_back(heights.empty() ? make_surface(settings) : make_texture(settings, heights));
      o.surface = surfaces.back().get();
      walls.push_back({o, normal, random.coin(0.3) ? 0.05 * random.direction() : fs_vec3{}});
    }
    const auto put = [&] {
      for (const Wall& w : walls) {
        fs_object o = w.object;
        o.time = ball.time;
        o.twist.linear = w.velocity;
        OK(fs_object_set(ball.scene.get(), &o));
        o.pose.position = o.pose.position + radius * w.normal;
        OK(fs_object_set(point.scene.get(), &o));
      }
    };
    put();
    fs_vec3 x{0, 0, radius + 0.05}, way{};
    for (const Wall& w : walls) x = x + 0.06 * w.normal;
    double most = 0;
    for (int tick = 0; tick < 600; ++tick) {
      if (random.coin(0.02)) way = random.coin(0.2) ? fs_vec3{} : random.between(0, 0.3) * random.direction() - 3 * x;
      if (norm(way) > 0.4) way = (0.4 / norm(way)) * way;
      if (random.coin(0.01)) {
        for (Wall& w : walls) {
          w.object.pose.position = w.object.pose.position + 1e-3 * random.direction();
        }
        put();
      }
      x = x + dt * way;
      const fs_vec3 a = ball.go(x), b = point.go(x);
      most = std::max(most, norm(b));
      ck_assert_msg(norm(a - b) <= 1e-6 * (1 + norm(b)), "round %d, tick %d: (%g, %g, %g) N, not (%g, %g, %g)", round, tick, a.x, a.y,
                    a.z, b.x, b.y, b.z);
      EXPECT_VECTOR(ball.proxy(), point.proxy(), 1e-9);
    }
  }
}
END_TEST

START_TEST(either_side_of_a_plane_keeps_the_ball) {
  for (const double side : {1.0, -1.0}) {
    Hand hand;
    set_radius(hand.scene.get(), r);
    hand.plane("wall", {}, {0, 0, 1}, solid(FS_KEEP_EITHER));
    hand.slide({0, 0, side * 0.02});
    EXPECT_VECTOR(hand.slide({0, 0, side * (r + 1e-6)}), (fs_vec3{}), 0);
    EXPECT_VECTOR(hand.slide({0.01, 0, side * 0.001}), (fs_vec3{0, 0, side * 3}), 1e-6);  // 3 mm deep
    EXPECT_VECTOR(hand.slide({0, 0, -side * 0.01}), (fs_vec3{0, 0, side * 14}), 1e-6);    // through it, and not through
    EXPECT_NEAR(hand.proxy().z, side * r, 1e-9);
    EXPECT_NEAR(hand.felt.stiffness.zz, -1000, 1e-6);
  }
  // One that begins within the ball holds it on the side of its middle.
  Hand hand;
  set_radius(hand.scene.get(), r);
  hand.plane("wall", {}, {0, 0, 1}, solid(FS_KEEP_EITHER));
  EXPECT_VECTOR(hand.go({0, 0, -0.001}), (fs_vec3{0, 0, -3}), 1e-6);
  // A corner of two planes holds it in the corner.
  hand.plane("other", {}, {1, 0, 0}, solid(FS_KEEP_FRONT));
  hand.slide({0.02, 0, -0.02});
  EXPECT_VECTOR(hand.slide({0, 0, 0}), (fs_vec3{4, 0, -4}), 1e-6);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- the scene

START_TEST(bad_radii) {
  const Scene scene = make_scene();
  for (const double bad : {-1.0, -1e-300, std::nan(""), HUGE_VAL, 2e15}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_set_tool_radius(scene.get(), bad), "radius is");
  }
  EXPECT_NEAR(radius_of(scene.get()), 0, 0);
  for (const double good : {0.0, 1e-12, 1e15}) {
    set_radius(scene.get(), good);
    EXPECT_NEAR(radius_of(scene.get()), good, 0);
  }
}
END_TEST

START_TEST(solid_meshes_refuse_it) {
  World world(_i);
  const Shape shape = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  fs_object o = box(shape);
  world.set(o);
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_scene_set_tool_radius(world.scene, r), "'box' is a solid mesh");
  EXPECT_NEAR(radius_of(world.scene), 0, 0);
  set_radius(world.scene, 0);
  OK(fs_object_remove(world.scene, "box"));
  set_radius(world.scene, r);
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_object_set(world.scene, &o), "radius of 0.004 m");
  ck_assert(!has(world.scene, "box"));
  o.contact = {};
  o.front = attract(100, 1);
  world.set(o);  // one that is not solid
  o.contact = solid(FS_KEEP_BACK);
  EXPECT(FS_ERROR_UNSUPPORTED, fs_object_change(world.scene, &o, FS_PART_CONTACT));
  // In a group: as the group has it.
  OK(fs_scene_begin(world.scene));
  set_radius(world.scene, 0);
  OK(fs_object_change(world.scene, &o, FS_PART_CONTACT));
  EXPECT(FS_ERROR_UNSUPPORTED, fs_scene_set_tool_radius(world.scene, r));
  OK(fs_scene_commit(world.scene));
  EXPECT_NEAR(radius_of(world.scene), 0, 0);
  EXPECT(FS_ERROR_UNSUPPORTED, fs_scene_set_tool_radius(world.scene, r));
  world.settle();
}
END_TEST

// Two threads, each with a group that is right by itself: the second is refused as a whole.
START_TEST(groups_that_contradict) {
  World world(_i);
  const Shape shape = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  OK(fs_scene_begin(world.scene));
  const fs_object o = box(shape);
  OK(fs_object_set(world.scene, &o));
  std::thread([&] { set_radius(world.scene, r); }).join();
  EXPECT(FS_ERROR_UNSUPPORTED, fs_scene_commit(world.scene));
  ck_assert(has(world.scene, "box"));  // in the group, which is open still
  OK(fs_scene_cancel(world.scene));
  ck_assert(!has(world.scene, "box"));
  OK(world.sync(world.scene));  // nothing of it was sent
  EXPECT_NEAR(radius_of(world.scene), r, 0);
}
END_TEST

// One thread makes a plane solid while another makes it a mesh: together that would be a solid mesh.
START_TEST(parts_that_contradict) {
  const Scene scene = make_scene();
  const Shape shape = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  set_radius(scene.get(), r);
  fs_object plane = fs_object_init("box", FS_PRIMITIVE_PLANE);
  OK(fs_object_set(scene.get(), &plane));
  OK(fs_scene_begin(scene.get()));
  plane.contact = solid(FS_KEEP_FRONT);
  OK(fs_object_change(scene.get(), &plane, FS_PART_CONTACT));
  std::thread([&] {
    const fs_object mesh = box(shape, FS_KEEP_NONE);
    fs_object plain = mesh;
    plain.contact = {};
    OK(fs_object_set(scene.get(), &plain));
  }).join();
  OK(fs_scene_commit(scene.get()));  // it is what the group has made of it
  const Got got(scene.get(), "box");
  ck_assert(got->primitive == FS_PRIMITIVE_PLANE && got->contact.keep == FS_KEEP_FRONT);
}
END_TEST

START_TEST(it_is_in_files_and_views) {
  World world(_i);
  Folder folder;
  const std::string path = folder / "scene.json";
  set_radius(world.scene, 0.1 + 0.2);
  OK(fs_scene_save(world.scene, path.c_str()));
  set_radius(world.scene, 0);
  OK(fs_scene_load(world.scene, path.c_str()));
  EXPECT_NEAR(radius_of(world.scene), 0.1 + 0.2, 0);
  fs_view view;
  OK(fs_scene_get_view(world.scene, nullptr, &view));
  EXPECT_NEAR(view.point_radius, 0.1 + 0.2, 0);
  // It stays when the points change, and they stay when it does.
  const std::vector<fs_vec3> points{{0, 0, 0}, {0, 0, 0.01}};
  OK(fs_scene_set_tool(world.scene, points.data(), points.size()));
  EXPECT_NEAR(radius_of(world.scene), 0.1 + 0.2, 0);
  set_radius(world.scene, r);
  ck_assert_uint_eq(tool_of(world.scene).size(), 2);
  // In an open group, too.
  OK(fs_scene_begin(world.scene));
  set_radius(world.scene, 2 * r);
  OK(fs_scene_get_view(world.scene, nullptr, &view));
  EXPECT_NEAR(view.point_radius, 2 * r, 0);
  OK(fs_scene_cancel(world.scene));
  EXPECT_NEAR(radius_of(world.scene), r, 0);
  // A file with a solid mesh and without a radius takes the place of one.
  const Scene other = make_scene();
  const Shape shape = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  const fs_object o = box(shape);
  OK(fs_object_set(other.get(), &o));
  OK(fs_scene_save(other.get(), path.c_str()));
  OK(fs_scene_load(world.scene, path.c_str()));
  OK(world.sync(world.scene));
  EXPECT_NEAR(radius_of(world.scene), 0, 0);
  ck_assert(has(world.scene, "box"));
  OK(fs_object_remove(world.scene, "box"));
  set_radius(world.scene, r);
  // A file with a solid mesh and a radius is refused as a whole.
  std::ifstream in(path);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  text.insert(text.find("\"objects\""), "\"tool_radius\": 0.001, ");
  std::ofstream(path) << text;
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_scene_load(world.scene, path.c_str()), "solid mesh");
  EXPECT_NEAR(radius_of(world.scene), r, 0);
  ck_assert(!has(world.scene, "box"));
  text.replace(text.find("0.001"), 5, "-1.00");
  std::ofstream(path) << text;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_load(world.scene, path.c_str()), "radius is -1 m");
}
END_TEST

// Another radius fades in as another version, in process and connected, and no force steps.
START_TEST(it_fades_in) {
  World world(_i);
  fs_object o = fs_object_init("floor", FS_PRIMITIVE_PLANE);
  o.contact = solid(FS_KEEP_FRONT, 1000, 1000);
  world.set(o);
  world.fake.state.pose = at(0, 0, 0.002);
  world.settle();
  EXPECT_NEAR(world.force_at({0, 0, 0.002}).z, 0, 0);
  Random random(3);
  double radius = 0;
  fs_vec3 before{};
  for (int round = 0; round < 20; ++round) {
    radius = random.coin(0.3) ? 0 : random.between(0, 0.01);
    set_radius(world.scene, radius);
    OK(world.sync(world.scene));
    before = world.force_at({0, 0, 0.002});
    const int ticks = random.coin() ? 20 : 150;
    for (int i = 0; i < ticks; ++i) {
      const fs_vec3 force = world.force_at({0, 0, 0.002});
      // Two versions of at most 8 N, each within the time of the fade.
      ck_assert_msg(norm(force - before) <= 2 * 8 * 0.001 / world_fade * 1.01, "round %d, tick %d: %g N", round, i, norm(force - before));
      before = force;
    }
    // Each version waits for the one before it, and for the server's thread, while virtual time flies.
    const double wanted = 1000 * std::max(0.0, radius - 0.002);
    const auto is_felt = [&] { return std::fabs(world.force_at({0, 0, 0.002}).z - wanted) <= 1e-6; };
    if (ticks == 150) ck_assert_msg(eventually(is_felt), "round %d: %g N, not %g", round, world.fake.written.force.z, wanted);
  }
}
END_TEST

// A tool of one's own, with points of its own, has it too; and begins anew when it changes.
START_TEST(own_tools_have_it) {
  for (const bool has_own_points : {false, true}) {
    Hand hand;
    const fs_vec3 point{0, 0, -0.1};
    fs_tool* tool = nullptr;
    OK(fs_tool_create(hand.scene.get(), has_own_points ? &point : nullptr, has_own_points, &tool));
    hand.tool = Tool(tool);
    if (!has_own_points) OK(fs_scene_set_tool(hand.scene.get(), &point, 1));
    hand.plane("floor", {0, 0, -0.1}, {0, 0, 1}, solid(FS_KEEP_FRONT));
    hand.slide({0, 0, 0.01});
    EXPECT_VECTOR(hand.slide({0, 0, 0.001}), (fs_vec3{}), 0);
    set_radius(hand.scene.get(), r);
    EXPECT_VECTOR(hand.go({0, 0, 0.001}), (fs_vec3{0, 0, 3}), 1e-6);
    set_radius(hand.scene.get(), 2 * r);
    EXPECT_VECTOR(hand.go({0, 0, -0.001}), (fs_vec3{0, 0, 9}), 1e-6);
    set_radius(hand.scene.get(), 0);
    EXPECT_VECTOR(hand.go({0, 0, 0.001}), (fs_vec3{}), 0);
    EXPECT_VECTOR(hand.slide({0, 0, -0.001}), (fs_vec3{0, 0, 1}), 1e-6);
  }
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("radius");
  add_once(suite, "profiles", {the_cap_is_that_of_the_shifted_law, distances_are_told_from_the_skin,
                                a_bounded_profile_goes_on_where_it_touches});
  add_once(suite, "planes", {planes_are_shifted, either_side_of_a_plane_keeps_the_ball});
  add_once(suite, "scene", {bad_radii, parts_that_contradict, own_tools_have_it});
  add_on_both(suite, "both", {solid_meshes_refuse_it, groups_that_contradict, it_is_in_files_and_views, it_fades_in});
  return run_suite(suite);
}
