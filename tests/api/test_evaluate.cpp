// What a tool feels, against the slow reference of tests/scenes, which itself is first checked by hand.
#include <algorithm>
#include <cstdio>
#include <numbers>

#include "api/support.h"
#include "scenes/longer.h"
#include "scenes/reference.h"

using namespace scenes;

static constexpr double pi = std::numbers::pi;
static const std::vector<fs_vec3> one_point{{0, 0, 0}};

// The reference against values worked out by hand. All objects at time 0; the hand at rest unless stated.

static Felt refer(const Content& content, fs_vec3 x, double time = 1) {
  return Reference(content).evaluate(hand_at(x, time), one_point, true);
}

START_TEST(reference_profiles) {
  const Function ramp = [](long double d, long double t) { return 100 * d - 1 + t; };
  Content content;
  fs_profile custom = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 2, 0, 5);
  const struct {
    fs_profile profile;
    double d, force;
  } cases[]{{constant(FS_SENSE_ATTRACTIVE, 2), 7, 2},
            {attract(200, 3), 0.01, 2},
            {attract(200, 3), 0.1, 3},
            {fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -100, 2, 3), 0.005, 1.5},
            {fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -100, 2, 3), 0.03, 0},
            {fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 4, 0.01, 3), 0.02, 4 * std::exp(-2.0)},
            {fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 1000, 0.1, 3), 0.03, 1},
            {fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_ATTRACTIVE, 0.02, 0.5, 9), 0.01, 2.5},
            {fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_ATTRACTIVE, 0.02, 0.5, 9), 0, 9},
            {custom, 0.02, 6 - 1},   // 2*(2 - 1 + 3) = 8, above the limit of 5
            {custom, 0.0, 4}};
  for (const auto& c : cases) {
    EXPECT_NEAR(static_cast<double>(profile_force(c.profile, &ramp, c.d, 3)), c.force, 1e-15);
  }
  EXPECT_NEAR(static_cast<double>(profile_force(custom, &ramp, 0, -3)), 0, 0);  // below 0 counts as 0
  fs_profile near = constant(FS_SENSE_ATTRACTIVE, 2);
  near.reach = 0.01;
  EXPECT_NEAR(static_cast<double>(profile_force(near, nullptr, 0.011, 0)), 0, 0);
  EXPECT_NEAR(static_cast<double>(profile_force(near, nullptr, 0.009, 0)), 2, 0);
  EXPECT_NEAR(static_cast<double>(profile_force(fs_profile{}, nullptr, 0.009, 0)), 0, 0);
  // Monotone cubic: 0 1 3 3, step 1. Slopes: 0.5, 4/3, 0, 0 (ends: (3*1 - 2)/2, and 0 where the curve is flat).
  const Function cubic = monotone_cubic({0, 1, 3, 3}, 1);
  EXPECT_NEAR(static_cast<double>(cubic(1, 0)), 1, 1e-18);
  EXPECT_NEAR(static_cast<double>(cubic(0.5, 0)), 0.5 + (0.5 - 4.0 / 3) / 8, 1e-15);
  EXPECT_NEAR(static_cast<double>(cubic(1.5, 0)), 2 + (4.0 / 3) / 8, 1e-15);
  EXPECT_NEAR(static_cast<double>(cubic(2.5, 0)), 3, 1e-15);
  EXPECT_NEAR(static_cast<double>(cubic(7, 0)), 3, 0);
}
END_TEST

START_TEST(reference_primitives) {
  {  // a point at (0, 0, 1): 0.05 m away along x; k*(x - p), so dF/dx is -k in all directions
    Content content;
    content.add("a", FS_PRIMITIVE_POINT, {0, 0, 1}).front = attract(100, 9);
    const Felt f = refer(content, {0.05, 0, 1});
    EXPECT_VECTOR(f.wrench.force, (fs_vec3{-5, 0, 0}), 1e-14);
    EXPECT_NEAR(f.stiffness.xx, -100, 1e-9);
    EXPECT_NEAR(f.stiffness.yy, -100, 1e-9);
    EXPECT_NEAR(f.stiffness.xy, 0, 1e-9);
    EXPECT_VECTOR(refer(content, {0, 0, 1}).wrench.force, (fs_vec3{}), 0);
    ck_assert_uint_eq(f.felt_count, 1);
  }
  {  // a constant repulsion: no slope along the line to p, F/d across it
    Content content;
    content.add("a", FS_PRIMITIVE_POINT).front = constant(FS_SENSE_REPULSIVE, 3);
    const Felt f = refer(content, {0, 0.1, 0});
    EXPECT_VECTOR(f.wrench.force, (fs_vec3{0, 3, 0}), 1e-14);
    EXPECT_NEAR(f.stiffness.yy, 0, 1e-6);
    EXPECT_NEAR(f.stiffness.zz, 30, 1e-6);
  }
  {  // a plane turned a quarter about x: its front is -y
    Content content;
    fs_object& o = content.add("a", FS_PRIMITIVE_PLANE, {0, 1, 0});
    o.pose.orientation = turn({1, 0, 0}, pi / 2);
    o.front = constant(FS_SENSE_REPULSIVE, 1);
    o.back = attract(10, 9);
    EXPECT_VECTOR(refer(content, {5, 0.7, 5}).wrench.force, (fs_vec3{0, -1, 0}), 1e-14);
    EXPECT_VECTOR(refer(content, {5, 1.2, 5}).wrench.force, (fs_vec3{0, -2, 0}), 1e-14);
  }
  {  // an L: nearest to the corner, to a segment, and with the third side closed
    const fs_vec3 corner[]{{1, 0, 0}, {0, 0, 0}, {0, 1, 0}};
    for (bool closed : {false, true}) {
      Content content;
      content.add_shape("a", make_polyline(corner, 3, closed)).front = attract(1, 9);
      EXPECT_VECTOR(refer(content, {-3, -4, 0}).wrench.force, (fs_vec3{3, 4, 0}), 1e-14);
      EXPECT_VECTOR(refer(content, {0.3, -2, 0}).wrench.force, (fs_vec3{0, 2, 0}), 1e-14);
      const fs_vec3 expected = closed ? fs_vec3{-0.3, -0.3, 0} : fs_vec3{-0.3, 0.5, 0};
      const fs_vec3 x = closed ? fs_vec3{0.8, 0.8, 0} : fs_vec3{1.3, -0.5, 0};
      EXPECT_VECTOR(refer(content, x).wrench.force, expected, 1e-14);
    }
  }
  {  // a box: a face, an edge, a corner from outside; from within; on the face
    Content content;
    fs_object& o = content.add_shape("a", make_mesh(box_mesh({1, 2, 3})));
    o.front = attract(1, 9);
    o.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_REPULSIVE, 10, 0, 9);
    EXPECT_VECTOR(refer(content, {3, 0.3, 0.1}).wrench.force, (fs_vec3{-2, 0, 0}), 1e-14);
    EXPECT_VECTOR(refer(content, {4, 6, 0.1}).wrench.force, (fs_vec3{-3, -4, 0}), 1e-14);
    EXPECT_VECTOR(refer(content, {2, 4, 5}).wrench.force, (fs_vec3{-1, -2, -2}), 1e-14);
    EXPECT_VECTOR(refer(content, {0.9, 0.2, 0.1}).wrench.force, (fs_vec3{-1, 0, 0}), 1e-13);
    o.front = constant(FS_SENSE_REPULSIVE, 3);
    EXPECT_VECTOR(refer(content, {1, 0.2, 0.3}).wrench.force, (fs_vec3{3, 0, 0}), 1e-14);
  }
  {  // the reflex edge of an open strip: sides come from its angle-weighted normals
    MeshData mesh{{{-1, -1, 0}, {-1, 1, 0}, {0, -1, 0}, {0, 1, 0}, {0, -1, 1}, {0, 1, 1}},
                  {0, 2, 3, 0, 3, 1, 2, 4, 5, 2, 5, 3}};
    Content content;
    fs_object& o = content.add_shape("a", make_mesh(mesh));
    o.front = constant(FS_SENSE_REPULSIVE, 1);
    o.back = constant(FS_SENSE_REPULSIVE, 2);
    EXPECT_NEAR(norm(refer(content, {-0.5, 0, 0.2}).wrench.force), 1, 1e-14);
    EXPECT_NEAR(norm(refer(content, {0.3, 0, -0.2}).wrench.force), 2, 1e-14);
  }
}
END_TEST

START_TEST(reference_tools_and_motion) {
  Content content;
  fs_object& o = content.add("a", FS_PRIMITIVE_PLANE);
  o.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_REPULSIVE, 10, 0, 100);
  o.back = attract(10, 100);
  fs_state state = hand_at({0, 0, 1}, 1);
  state.pose.orientation = turn({0, 0, 1}, pi / 2);  // points at (0, 1, 1) and (0, -1, 3)
  const std::vector<fs_vec3> two{{1, 0, 0}, {-1, 0, 2}};
  Felt f = Reference(content).evaluate(state, two, true);
  EXPECT_VECTOR(f.wrench.force, (fs_vec3{0, 0, 20}), 1e-13);             // (10 + 30)/2
  EXPECT_VECTOR(f.wrench.torque, (fs_vec3{0.5 * (10 - 30), 0, 0}), 1e-13);
  EXPECT_NEAR(f.stiffness.zz, 10, 1e-9);
  o.tool_points = 2;  // the second only
  f = Reference(content).evaluate(state, two, false);
  EXPECT_VECTOR(f.wrench.force, (fs_vec3{0, 0, 30}), 1e-13);
  EXPECT_VECTOR(f.wrench.torque, (fs_vec3{-30, 0, 0}), 1e-13);
  o.tool_points = 4;  // no point of the tool
  ck_assert_uint_eq(Reference(content).evaluate(state, two, false).felt_count, 0);
  o.tool_points = 0;

  // The plane rises with 1 m/s since 0.98 s: 0.02 at 1 s, 0.1 at most.
  o.time = 0.98;
  o.twist.linear = {0, 0, 1};
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 1).wrench.force, (fs_vec3{0, 0, 4.8}), 1e-13);
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 5).wrench.force, (fs_vec3{0, 0, 4}), 1e-13);
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 0.5).wrench.force, (fs_vec3{0, 0, 5}), 1e-13);
  // A still hand, moved at by 1 m/s, is dragged along with b*1; after 0.1 s the plane stands.
  o.damping = 3;
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 1).wrench.force, (fs_vec3{0, 0, 7.8}), 1e-13);
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 5).wrench.force, (fs_vec3{0, 0, 4}), 1e-13);
  o.front.limit = 6;  // limit of force and damping together
  EXPECT_VECTOR(refer(content, {0, 0, 0.5}, 1).wrench.force, (fs_vec3{0, 0, 6}), 1e-13);
  // Turning about x with 2 rad/s: after 0.05 s the normal is (0, -sin 0.1, cos 0.1), away from the axis.
  o.front.limit = 100;
  o.damping = 0;
  o.time = 0.95;
  o.twist = {{0, 0, 0}, {2, 0, 0}};
  EXPECT_VECTOR(refer(content, {0, 0, 1}, 1).wrench.force,
                10 * std::cos(0.1) * (fs_vec3{0, -std::sin(0.1), std::cos(0.1)}), 1e-13);
  o.enabled = false;
  ck_assert_uint_eq(refer(content, {0, 0, 1}, 1).felt_count, 0);
}
END_TEST

// The library against the reference.

struct Worst {
  double force = 0, torque = 0, stiffness = 0;
  size_t compared = 0, compared_stiffness = 0;

  void print(const char* what) const {
    std::printf("  %-28s %6zu places: force within %.1e N, torque %.1e N m; %6zu slopes within %.1e (relative)\n", what,
                compared, force, torque, compared_stiffness, stiffness);
  }
};

static double mat_norm(const fs_mat3& m) {
  const double* v = &m.xx;
  double sum = 0;
  for (int i = 0; i < 9; ++i) sum += v[i] * v[i];
  return std::sqrt(sum);
}
static fs_mat3 difference(fs_mat3 a, const fs_mat3& b) {
  for (int i = 0; i < 9; ++i) (&a.xx)[i] -= (&b.xx)[i];
  return a;
}

// One place. Tolerance in N for each N of the largest limit about.
static void compare(const Content& content, const Reference& reference, fs_tool* tool, const fs_state& state,
                    const std::vector<fs_vec3>& points, bool with_stiffness, double tolerance, Worst& worst, double radius = 0) {
  const Felt felt = reference.evaluate(state, points, with_stiffness, radius);
  fs_response response;
  OK(fs_evaluate(tool, &state, &response));
  double scale = 1;
  for (const fs_object& o : content.objects) scale = std::fmax(scale, std::fmax(o.front.limit, o.back.limit));
  const double force_error = norm(response.wrench.force - felt.wrench.force) / scale;
  const double torque_error = norm(response.wrench.torque - felt.wrench.torque) / scale;
  worst.force = std::fmax(worst.force, force_error);
  worst.torque = std::fmax(worst.torque, torque_error);
  ++worst.compared;
  if (force_error > tolerance || torque_error > tolerance) {
    for (const fs_object& o : content.objects) {
      std::printf("    %s: primitive %d, front %d, back %d, damping %g, enabled %d\n", o.name, o.primitive,
                  o.front.kind, o.back.kind, o.damping, o.enabled);
    }
    std::fflush(stdout);
  }
  ck_assert_msg(force_error <= tolerance,
                "at (%.17g, %.17g, %.17g): force (%.17g, %.17g, %.17g), reference (%.17g, %.17g, %.17g)",
                state.pose.position.x, state.pose.position.y, state.pose.position.z, response.wrench.force.x,
                response.wrench.force.y, response.wrench.force.z, felt.wrench.force.x, felt.wrench.force.y,
                felt.wrench.force.z);
  ck_assert_msg(torque_error <= tolerance, "torque (%.17g, %.17g, %.17g), reference (%.17g, %.17g, %.17g)",
                response.wrench.torque.x, response.wrench.torque.y, response.wrench.torque.z, felt.wrench.torque.x,
                felt.wrench.torque.y, felt.wrench.torque.z);
  ck_assert_uint_ge(response.felt_count, felt.felt_count);
  ck_assert_uint_le(response.felt_count, felt.felt_count + felt.faint_count);
  ck_assert_double_eq(response.error_bound, 0);
  ck_assert_uint_eq(response.flags & (FS_RESPONSE_CONTACT | FS_RESPONSE_CAPPED | FS_RESPONSE_FADING), 0);
  const double size = mat_norm(felt.stiffness) + 1;
  // here the nearest feature changes, so there is no slope
  if (!with_stiffness || felt.roughness > 1e-3 * size) return;
  const double slope_error = mat_norm(difference(response.stiffness, felt.stiffness)) / size;
  worst.stiffness = std::fmax(worst.stiffness, slope_error);
  ++worst.compared_stiffness;
  ck_assert_msg(slope_error < 1e-5,
                "stiffness off by %g of %g N/m at (%.17g, %.17g, %.17g): xx %g, %g; yy %g, %g; zz %g, %g",
                slope_error * size, size, state.pose.position.x, state.pose.position.y, state.pose.position.z,
                response.stiffness.xx, felt.stiffness.xx, response.stiffness.yy, felt.stiffness.yy,
                response.stiffness.zz, felt.stiffness.zz);
}

static const std::vector<fs_vec3> hand_points{{0, 0, 0}, {0.02, 0, -0.01}, {-0.015, 0.02, 0}};

static void random_scenes(const char* what, uint64_t seed, int scenes_count, RandomOptions options, bool many_points,
                          bool has_radius = false) {
  Worst worst;
  const std::vector<fs_vec3>& points = many_points ? hand_points : one_point;
  for (int i = 0; i < scenes_count; ++i) {
    Random random(seed + i);
    options.count = 1 + random.below(6);
    const Content content = random_content(random, options);
    const Scene scene = make_scene();
    fill(scene.get(), content);
    const double radius = has_radius ? random.log_between(1e-3, 0.1) : 0;
    OK(fs_scene_set_tool_radius(scene.get(), radius));
    fs_tool* raw = nullptr;
    OK(fs_tool_create(scene.get(), points.data(), points.size(), &raw));
    const Tool tool(raw);
    const Reference reference(content);
    for (int k = 0; k < 12; ++k) {
      fs_state state{};
      state.pose = random.pose(1.2 * options.half);
      state.time = options.time;
      if (options.damps) state.twist = {random.in_box(0.5), random.in_box(4)};
      compare(content, reference, tool.get(), state, points, !options.damps, 1e-10, worst, radius);
    }
  }
  worst.print(what);
}

START_TEST(random_still) { random_scenes("still, one point", 1000, 150, {}, false); }
END_TEST
START_TEST(random_tools) {
  RandomOptions options;
  options.masks = options.disables = true;
  random_scenes("three points, masks", 2000, 60, options, true);
}
END_TEST
START_TEST(random_moving) {
  RandomOptions options;
  options.masks = options.disables = options.moves = true;
  random_scenes("moving", 3000, 60, options, true);
}
END_TEST
START_TEST(random_damped) {
  RandomOptions options;
  options.masks = options.disables = options.moves = options.damps = true;
  random_scenes("moving and damped", 4000, 200, options, true);
}
END_TEST

START_TEST(random_radius) {
  RandomOptions options;
  options.masks = options.disables = options.moves = true;
  random_scenes("points with a radius", 4500, 150, options, true, true);
  options.damps = true;
  random_scenes("points with a radius, damped", 4700, 60, options, true, true);
}
END_TEST

// Near a surface, where the force is made: at distances from 1e-9 m.
START_TEST(near_surfaces) {
  Worst worst;
  for (uint64_t seed = 0; seed < 30; ++seed) {
    Random random(5000 + seed);
    RandomOptions options;
    options.count = 1;
    const Content content = random_content(random, options);
    const fs_object& o = content.objects[0];
    const Scene scene = make_scene();
    fill(scene.get(), content);
    const Tool tool = make_tool(scene.get());
    const Reference reference(content);
    for (int k = 0; k < 20; ++k) {
      fs_vec3 on{0, 0, 0};
      if (o.primitive == FS_PRIMITIVE_PLANE) on = {random.between(-0.1, 0.1), random.between(-0.1, 0.1), 0};
      size_t count = 0;
      if (o.shape) {
        const fs_vec3* p = fs_shape_get_points(o.shape, &count);
        on = p[random.below(count)];
        if (const uint32_t* t = fs_shape_get_triangles(o.shape, &count)) {
          const size_t i = 3 * random.below(count);
          const double u = random.unit_interval(), v = (1 - u) * random.unit_interval();
          on = u * p[t[i]] + v * p[t[i + 1]] + (1 - u - v) * p[t[i + 2]];
        }
      }
      const double distance = random.log_between(1e-6, 1e-2);
      const fs_state state = hand_at(o.pose * (on + distance * random.direction()), options.time);
      compare(content, reference, tool.get(), state, one_point, false, 1e-8, worst);
    }
  }
  worst.print("1e-6..1e-2 m from p");
}
END_TEST

// The scene and the hand are rotated and moved together: the force rotates with them.
START_TEST(rigid_motion) {
  double worst = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Random random(6000 + seed);
    RandomOptions options;
    options.masks = options.moves = options.damps = true;
    const Content content = random_content(random, options);
    const fs_pose motion = random.pose(0.3);
    const Scene here = make_scene(), there = make_scene();
    fill(here.get(), content);
    for (fs_object o : content.objects) {
      o.pose = motion * o.pose;
      o.twist = {rotate(motion.orientation, o.twist.linear), rotate(motion.orientation, o.twist.angular)};
      OK(fs_object_set(there.get(), &o));
    }
    fs_tool *a = nullptr, *b = nullptr;
    OK(fs_tool_create(here.get(), hand_points.data(), 3, &a));
    OK(fs_tool_create(there.get(), hand_points.data(), 3, &b));
    const Tool tool_here(a), tool_there(b);
    for (int k = 0; k < 10; ++k) {
      fs_state state{};
      state.pose = random.pose(0.1);
      state.twist = {random.in_box(0.5), random.in_box(3)};
      state.time = options.time;
      fs_state moved_state = state;
      moved_state.pose = motion * state.pose;
      moved_state.twist.linear = rotate(motion.orientation, state.twist.linear);
      moved_state.twist.angular = rotate(motion.orientation, state.twist.angular);
      const fs_wrench first = evaluate(tool_here.get(), state).wrench;
      const fs_wrench second = evaluate(tool_there.get(), moved_state).wrench;
      const double error = norm(rotate(motion.orientation, first.force) - second.force) +
                           norm(rotate(motion.orientation, first.torque) - second.torque);
      worst = std::fmax(worst, error);
      ck_assert_double_lt(error, 1e-9);
    }
  }
  std::printf("  rigid motion: within %.1e N\n", worst);
}
END_TEST

// Far from the origin: what is near the hand is felt as at the origin, to what the coordinates hold (1e-9 m at 5e6 m).
START_TEST(far_from_the_origin) {
  const fs_vec3 places[]{{1e6, -1e6, 1e6}, {5e5, 4.6e6, 350}, {448262.75, 4600000.25, 1200.5}};
  for (const fs_vec3& place : places) {
    Worst worst;
    for (uint64_t seed = 0; seed < 25; ++seed) {
      Random random(7000 + seed);
      RandomOptions options;
      options.moves = true;
      Content content = random_content(random, options);
      // Half of the meshes by their pose, half with the coordinates of the map in their points.
      for (fs_object& o : content.objects) {
        if (o.primitive == FS_PRIMITIVE_MESH && random.coin()) {
          MeshData mesh;
          size_t count = 0;
          const fs_vec3* p = fs_shape_get_points(o.shape, &count);
          mesh.points.assign(p, p + count);
          const uint32_t* t = fs_shape_get_triangles(o.shape, &count);
          mesh.triangles.assign(t, t + 3 * count);
          fs_pose map = o.pose;
          map.position = place + map.position;
          content.shapes.push_back(make_mesh(moved(mesh, map)));
          o.shape = content.shapes.back().get();
          o.pose = at(0, 0, 0);
          o.twist = {};
        } else {
          o.pose.position = place + o.pose.position;
        }
      }
      const Scene scene = make_scene();
      fill(scene.get(), content);
      const Tool tool = make_tool(scene.get());
      const Reference reference(content);
      for (int k = 0; k < 8; ++k) {
        const fs_state state = hand_at(place + random.in_box(0.1), options.time);
        compare(content, reference, tool.get(), state, one_point, false, 1e-5, worst);
      }
    }
    worst.print("far away");
  }
}
END_TEST

// What the headers say about d = 0.
START_TEST(at_distance_zero) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  const fs_profile kinds[]{constant(FS_SENSE_REPULSIVE, 2), constant(FS_SENSE_ATTRACTIVE, 2),
                           fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.01, 0, 2),
                           fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -10, 2, 2),
                           fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_REPULSIVE, 10, 2, 2)};
  const Shape box = make_mesh(box_mesh({0.1, 0.2, 0.3}));
  const fs_vec3 ends[]{{-0.1, 0, 0}, {0.1, 0, 0}, {0.1, 0.1, 0}};
  const Shape line = make_polyline(ends, 3, false);
  const fs_vec3 p{0.3, -0.2, 0.1};
  for (const fs_profile& profile : kinds) {
    const double sign = profile.sense == FS_SENSE_REPULSIVE ? 1 : -1;
    for (int primitive = FS_PRIMITIVE_POINT; primitive <= FS_PRIMITIVE_MESH; ++primitive) {
      fs_object o = fs_object_init("o", static_cast<fs_primitive>(primitive));
      o.pose = at(p);
      o.front = profile;
      if (primitive >= FS_PRIMITIVE_PLANE) o.back = constant(FS_SENSE_REPULSIVE, 9);
      o.shape = primitive == FS_PRIMITIVE_MESH ? box.get() : primitive == FS_PRIMITIVE_POLYLINE ? line.get() : nullptr;
      OK(fs_object_set(scene.get(), &o));
      fs_vec3 x = p, expected{};  // a point or line gives nothing there
      if (primitive == FS_PRIMITIVE_PLANE) {
        x = p + fs_vec3{0.5, 0.25, 0};
        expected = {0, 0, 2 * sign};
      }
      if (primitive == FS_PRIMITIVE_MESH) {
        o.pose = at(0, 0, 0);
        OK(fs_object_set(scene.get(), &o));
        x = {0.1, 0.05, 0.06};
        expected = {2 * sign, 0, 0};
      }
      const fs_response r = evaluate(tool.get(), hand_at(x));
      EXPECT_VECTOR(r.wrench.force, expected, 1e-15);
      ck_assert_uint_eq(r.felt_count, primitive >= FS_PRIMITIVE_PLANE);
      for (int i = 0; i < 9; ++i) ck_assert(!std::isnan((&r.stiffness.xx)[i]));
    }
  }
}
END_TEST

// Extreme values give finite forces.
START_TEST(extremes_stay_finite) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  const fs_profile kinds[]{fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 1e300, 0, 1e9),
                           fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 1e300, -1e300, 1e9),
                           fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 1e-300, 1),
                           fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 1e300, 1), attract(1e300, 1e9),
                           fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 1e-300, -1e-300, 1)};
  const double scales[]{0, 5e-324, 1e-160, 1e-9, 1, 1e7, 1e15};
  for (const fs_profile& profile : kinds) {
    for (int primitive : {FS_PRIMITIVE_POINT, FS_PRIMITIVE_PLANE}) {
      fs_object o = fs_object_init("o", static_cast<fs_primitive>(primitive));
      o.front = profile;
      if (primitive == FS_PRIMITIVE_PLANE) o.back = profile;
      OK(fs_object_set(scene.get(), &o));
      for (double s : scales) {
        for (const fs_vec3& d : {fs_vec3{1, 0.5, -0.3}, fs_vec3{0, 0, 1}, fs_vec3{0, 0, -1}}) {
          const fs_response r = evaluate(tool.get(), hand_at(s * unit(d)));
          ck_assert_msg(std::isfinite(norm(r.wrench.force)), "kind %d, primitive %d at %g", profile.kind, primitive, s);
          ck_assert_double_le(norm(r.wrench.force), profile.limit * (1 + 1e-12));
          for (int i = 0; i < 9; ++i) {
            ck_assert_msg(!std::isnan((&r.stiffness.xx)[i]), "stiffness of kind %d at %g", profile.kind, s);
          }
        }
      }
    }
  }
  // Bad states are refused, and out is zeros then.
  struct {
    void (*spoil)(fs_state&);
  } bad[]{{[](fs_state& s) { s.pose.position.x = NAN; }},       {[](fs_state& s) { s.pose.position.x = 2e15; }},
          {[](fs_state& s) { s.pose.orientation.y = 0.5; }},    {[](fs_state& s) { s.twist.angular.z = INFINITY; }},
          {[](fs_state& s) { s.time = NAN; }},                  {[](fs_state& s) { s.reserved[2] = 1; }}};
  for (const auto& b : bad) {
    fs_state state = hand_at({0, 0, 1});
    b.spoil(state);
    fs_response r;
    std::memset(&r, 0x55, sizeof r);
    EXPECT(FS_ERROR_INVALID, fs_evaluate(tool.get(), &state, &r));
    const fs_response zeros{};
    ck_assert_int_eq(std::memcmp(&r, &zeros, sizeof r), 0);
    std::memset(&r, 0x55, sizeof r);
    EXPECT(FS_ERROR_INVALID, fs_evaluate(nullptr, &state, &r));
    ck_assert_int_eq(std::memcmp(&r, &zeros, sizeof r), 0);
  }
}
END_TEST

START_TEST(response_without_contacts) {
  const Scene scene = make_scene();
  fill(scene.get(), hello());
  const Tool tool = make_tool(scene.get());
  fs_state state = hand_at({0.01, 0, 0});
  state.pose.orientation = turn({1, 2, 3}, 0.7);
  const fs_response r = evaluate(tool.get(), state);
  ck_assert_uint_eq(r.flags, 0);
  EXPECT_VECTOR(r.proxy.position, state.pose.position, 1e-15);  // there is no contact
  EXPECT_NEAR(std::fabs(r.proxy.orientation.x), std::fabs(state.pose.orientation.x), 1e-12);
  OK(fs_tool_reset(tool.get()));
}
END_TEST

START_TEST(forces_add) {
  double worst = 0;
  for (uint64_t seed = 0; seed < 30; ++seed) {
    Random random(8000 + seed);
    RandomOptions options;
    options.moves = options.damps = options.masks = true;
    const Content content = random_content(random, options);
    const Scene all = make_scene();
    fill(all.get(), content);
    const Tool tool = make_tool(all.get());
    for (int k = 0; k < 5; ++k) {
      fs_state state = hand_at(random.in_box(0.1), options.time);
      state.twist.linear = random.in_box(0.4);
      fs_vec3 sum{};
      for (const fs_object& o : content.objects) {
        const Scene single = make_scene();
        OK(fs_object_set(single.get(), &o));
        sum = sum + evaluate(make_tool(single.get()).get(), state).wrench.force;
      }
      const double error = norm(sum - evaluate(tool.get(), state).wrench.force);
      worst = std::fmax(worst, error);
      ck_assert_double_lt(error, 1e-12);
    }
  }
  std::printf("  forces add: within %.1e N\n", worst);
}
END_TEST

static std::vector<fs_response> walk(const Content& content, bool backwards) {
  const Scene scene = make_scene();
  fill(scene.get(), content);
  fs_tool* raw = nullptr;
  OK(fs_tool_create(scene.get(), hand_points.data(), 3, &raw));
  const Tool tool(raw);
  std::vector<fs_state> states;
  Random random(99);
  for (int k = 0; k < 300; ++k) {
    fs_state state{};
    state.pose = random.pose(0.1);
    state.time = 100;
    states.push_back(state);
  }
  std::vector<fs_response> responses(states.size());
  for (size_t k = 0; k < states.size(); ++k) {
    const size_t i = backwards ? states.size() - 1 - k : k;
    responses[i] = evaluate(tool.get(), states[i]);
  }
  return responses;
}

START_TEST(same_input_same_bits) {  // regardless of what was felt before: caches do not change a bit
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Random random(9000 + seed);
    RandomOptions options;
    options.moves = true;
    const Content content = random_content(random, options);
    const std::vector<fs_response> first = walk(content, false);
    const std::vector<fs_response> again = walk(content, false), backwards = walk(content, true);
    ck_assert_int_eq(std::memcmp(first.data(), again.data(), first.size() * sizeof first[0]), 0);
    ck_assert_int_eq(std::memcmp(first.data(), backwards.data(), first.size() * sizeof first[0]), 0);
  }
  // Ties between triangles: on the axis of a sphere all of them are equally near.
  const Content content = ball(500);
  const Scene scene = make_scene();
  fill(scene.get(), content);
  const Tool tool = make_tool(scene.get()), warm = make_tool(scene.get());
  for (int i = 0; i < 50; ++i) force_at(warm.get(), {0.001 * i, -0.02, 0.03});
  for (const fs_vec3& x : {fs_vec3{0, 0, 0}, fs_vec3{0, 0, 0.01}, fs_vec3{0, 0, -0.02}}) {
    const fs_vec3 a = force_at(tool.get(), x), b = force_at(warm.get(), x);
    ck_assert(a == b);
  }
}
END_TEST

START_TEST(a_field_is_a_tool_at_each_point) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Random random(10000 + seed);
    RandomOptions options;
    options.moves = options.damps = true;
    const Content content = random_content(random, options);
    const Scene scene = make_scene();
    fill(scene.get(), content);
    const Tool tool = make_tool(scene.get());
    std::vector<fs_vec3> places(50), forces(50), sum(50);
    for (fs_vec3& x : places) x = random.in_box(0.12);
    OK(fs_evaluate_field(scene.get(), nullptr, options.time, places.data(), places.size(), forces.data()));
    for (size_t i = 0; i < places.size(); ++i) {
      const fs_vec3 f = force_at(tool.get(), places[i], options.time);
      ck_assert_msg(f == forces[i], "field %.17g, tool %.17g", forces[i].x, f.x);
    }
    for (const fs_object& o : content.objects) {
      std::vector<fs_vec3> alone(50);
      OK(fs_evaluate_field(scene.get(), o.name, options.time, places.data(), places.size(), alone.data()));
      for (size_t i = 0; i < places.size(); ++i) sum[i] = sum[i] + alone[i];
    }
    for (size_t i = 0; i < places.size(); ++i) EXPECT_VECTOR(sum[i], forces[i], 1e-12);
  }
  const Scene scene = make_scene();
  fs_vec3 x{}, f{1, 2, 3};
  EXPECT(FS_ERROR_NOT_FOUND, fs_evaluate_field(scene.get(), "none", FS_NOW, &x, 1, &f));
  EXPECT_VECTOR(f, (fs_vec3{1, 2, 3}), 0);
  x.z = NAN;
  EXPECT(FS_ERROR_INVALID, fs_evaluate_field(scene.get(), nullptr, FS_NOW, &x, 1, &f));
  EXPECT(FS_ERROR_INVALID, fs_evaluate_field(scene.get(), nullptr, NAN, &x, 0, &f));
  EXPECT_VECTOR(f, (fs_vec3{1, 2, 3}), 0);
  OK(fs_evaluate_field(scene.get(), nullptr, FS_NOW, nullptr, 0, nullptr));
}
END_TEST

START_TEST(tool_points) {
  const Scene scene = make_scene();
  fill(scene.get(), hello());
  const fs_vec3 points[]{{0.01, 0, 0}, {0.03, 0, 0}};
  fs_tool* raw = nullptr;
  OK(fs_tool_create(scene.get(), points, 2, &raw));
  const Tool own(raw);
  EXPECT_VECTOR(force_at(own.get(), {}), (fs_vec3{-2.5, 0, 0}), 1e-12);  // (2 + 3)/2
  // With null and 0 the tool has the scene's points.
  OK(fs_scene_set_tool(scene.get(), points, 1));
  OK(fs_tool_create(scene.get(), nullptr, 0, &raw));
  const Tool of_scene(raw);
  EXPECT_VECTOR(force_at(of_scene.get(), {}), (fs_vec3{-2, 0, 0}), 1e-12);
  raw = nullptr;
  const std::vector<fs_vec3> many(33);
  EXPECT(FS_ERROR_INVALID, fs_tool_create(scene.get(), many.data(), 33, &raw));
  const fs_vec3 bad{0, NAN, 0};
  EXPECT(FS_ERROR_INVALID, fs_tool_create(scene.get(), &bad, 1, &raw));
  EXPECT(FS_ERROR_INVALID, fs_tool_create(scene.get(), nullptr, 1, &raw));
  ck_assert_ptr_null(raw);
  // All 32, and the mask reaches the last.
  std::vector<fs_vec3> all(32);
  for (int i = 0; i < 32; ++i) all[i] = {0.001 * i, 0, 0};
  OK(fs_tool_create(scene.get(), all.data(), 32, &raw));
  const Tool big(raw);
  fs_object o = hello().objects[0];
  o.tool_points = 0x80000000u;
  OK(fs_object_set(scene.get(), &o));
  EXPECT_VECTOR(force_at(big.get(), {-0.03, 0, 0}), (fs_vec3{-0.2, 0, 0}), 1e-12);
}
END_TEST

START_TEST(profile_evaluate) {
  Random random(11000);
  double worst = 0;
  for (int i = 0; i < 300; ++i) {
    Content content;
    const fs_profile p = random_profile(random, content);
    const Function* curve = p.curve ? &content.functions.at(p.curve) : nullptr;
    std::vector<double> distances(40), forces(40);
    for (double& d : distances) d = random.coin(0.1) ? 0 : random.log_between(1e-6, 1);
    OK(fs_profile_evaluate(&p, 0, 1.5, distances.data(), distances.size(), forces.data()));
    for (size_t k = 0; k < distances.size(); ++k) {
      const double error = std::fabs(forces[k] - static_cast<double>(profile_force(p, curve, distances[k], 1.5)));
      worst = std::fmax(worst, error);
      ck_assert_msg(error < 1e-12, "kind %d at d %.17g: %.17g", p.kind, distances[k], forces[k]);
    }
  }
  std::printf("  profiles: within %.1e N\n", worst);
  if (has_expressions()) {
    fs_profile p = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 0.5, 0, 2);
    const struct {
      const char* text;
      double (*f)(double d, double t);
    } texts[]{{"3*(1+sin(12*t))*exp(-d/0.01)",
               [](double d, double t) { return 3 * (1 + std::sin(12 * t)) * std::exp(-d / 0.01); }},
              {"t", [](double, double t) { return t; }},
              {"d*d", [](double d, double) { return d * d; }},
              {"1/d", [](double d, double) { return 1 / d; }},
              {"sqrt(0-1)", [](double, double) { return 0.0; }},
              {"0-d", [](double d, double) { return -d; }},
              {"min(d,t)*2^3", [](double d, double t) { return std::fmin(d, t) * 8; }}};
    const double distances[]{0, 1e-3, 0.01, 0.4};
    for (const auto& text : texts) {
      const Curve curve = make_expression(text.text);
      p.curve = curve.get();
      double forces[4];
      OK(fs_profile_evaluate(&p, 0, 0.7, distances, 4, forces));
      for (int k = 0; k < 4; ++k) {
        double value = text.f(distances[k], 0.7);
        value = std::isfinite(value) && value > 0 ? value : 0;  // below 0 or not finite counts as 0
        EXPECT_NEAR(forces[k], std::fmin(0.5 * value, 2), 1e-12);
      }
    }
  }
  const fs_profile p = attract(100, 2);
  const double one = 0.01, negative = -0.01;
  double out = 7;
  OK(fs_profile_evaluate(&p, 0, 0, nullptr, 0, nullptr));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_profile_evaluate(&p, -1, 0, &one, 1, &out), "max_stiffness is -1");
  EXPECT(FS_ERROR_INVALID, fs_profile_evaluate(&p, NAN, 0, &one, 1, &out));
  EXPECT(FS_ERROR_INVALID, fs_profile_evaluate(&p, INFINITY, 0, &one, 1, &out));
  EXPECT(FS_ERROR_INVALID, fs_profile_evaluate(&p, 0, NAN, &one, 1, &out));
  EXPECT(FS_ERROR_INVALID, fs_profile_evaluate(&p, 0, 0, &negative, 1, &out));
  const fs_profile bad = attract(-100, 2);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_profile_evaluate(&bad, 0, 0, &one, 1, &out), "gain");
  EXPECT_NEAR(out, 7, 0);
  const fs_profile none{};
  OK(fs_profile_evaluate(&none, 0, 0, &one, 1, &out));
  EXPECT_NEAR(out, 0, 0);
  // With a limit the force begins as a spring, as it turns over at d = 0. A high one changes nothing but that.
  OK(fs_profile_evaluate(&p, 50, 0, &one, 1, &out));
  EXPECT_NEAR(out, 0.5, 1e-12);
  OK(fs_profile_evaluate(&p, 100, 0, &one, 1, &out));
  EXPECT_NEAR(out, 1, 0);
}
END_TEST

// Both sides of an object over signed distances, without a limit of the slope and with one.
START_TEST(object_evaluate_law) {
  const std::vector<double> places{-0.05, -0.011, -0.01, -1e-3, -0.0, 0, 1e-3, 0.01, 0.011, 0.05};
  const size_t count = places.size();
  std::vector<double> raw(count), slow(count);
  Random random(11001);
  for (int i = 0; i < 300; ++i) {
    // What fs_evaluate gives above and below a plane.
    Content content;
    fs_object& o = content.add("plane", FS_PRIMITIVE_PLANE, {});
    o.front = random_profile(random, content);
    o.back = random_profile(random, content);
    const Scene scene = make_scene();
    fill(scene.get(), content);
    o.start = 0.25;
    OK(fs_scene_set_time(scene.get(), 1.5));
    OK(fs_object_set(scene.get(), &o));
    OK(fs_object_evaluate_law(&o, 0, 1.25, places.data(), count, raw.data()));
    OK(fs_object_evaluate_law(&o, 70, 1.25, places.data(), count, slow.data()));
    for (size_t k = 0; k < count; ++k) {
      const fs_vec3 x{0, 0, places[k]};
      fs_vec3 force;
      OK(fs_evaluate_field(scene.get(), "plane", 1.5, &x, 1, &force));
      EXPECT_NEAR(raw[k], force.z, 1e-12 + 1e-12 * std::fabs(force.z));
      ck_assert(std::fabs(slow[k]) <= std::fabs(raw[k]) && slow[k] * raw[k] >= 0);
      if (k > 0) ck_assert_double_le(std::fabs(slow[k] - slow[k - 1]), 70 * (places[k] - places[k - 1]) + 1e-9);
    }
  }
  // Through a point: the force turns over.
  fs_object point = fs_object_init("point", FS_PRIMITIVE_POINT);
  point.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 3, 0, 5);
  point.front.reach = 0.0105;
  OK(fs_object_evaluate_law(&point, 0, 0, places.data(), count, raw.data()));
  OK(fs_object_evaluate_law(&point, 1000, 0, places.data(), count, slow.data()));
  const double raw_wanted[]{0, 0, 3, 3, 0, 0, -3, -3, 0, 0}, slow_wanted[]{0, 0, 0.5, 1, 0, 0, -1, -0.5, 0, 0};
  for (size_t k = 0; k < count; ++k) {
    EXPECT_NEAR(raw[k], raw_wanted[k], 0);
    EXPECT_NEAR(slow[k], slow_wanted[k], 1e-12);
  }
  fs_object theirs = point;  // as fs_object_get gives another client's object
  std::snprintf(theirs.name, sizeof theirs.name, "alice/point");
  OK(fs_object_evaluate_law(&theirs, 0, 0, places.data(), count, slow.data()));
  ck_assert_mem_eq(slow.data(), raw.data(), count * sizeof(double));
  std::snprintf(theirs.name, sizeof theirs.name, "alice/");
  EXPECT(FS_ERROR_INVALID, fs_object_evaluate_law(&theirs, 0, 0, places.data(), count, slow.data()));

  double out = 7;
  const double one = 1, bad = INFINITY;
  OK(fs_object_evaluate_law(&point, 0, 0, nullptr, 0, nullptr));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_evaluate_law(&point, -1, 0, &one, 1, &out), "max_stiffness is -1");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_evaluate_law(&point, 0, NAN, &one, 1, &out), "t is nan");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_evaluate_law(&point, 0, 0, &bad, 1, &out), "distances[0] is inf");
  point.front.gain = -1;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_evaluate_law(&point, 0, 0, &one, 1, &out), "'point': front.gain is -1");
  const Longer longer(point, 1);
  EXPECT(FS_ERROR_VERSION, fs_object_evaluate_law(&longer.known, 0, 0, &one, 1, &out));
  EXPECT_NEAR(out, 7, 0);
}
END_TEST

int main() {
  Suite* suite = suite_create("evaluate");
  add_case(suite, "reference", {reference_profiles, reference_primitives, reference_tools_and_motion});
  add_case(suite, "random", {random_still, random_tools, random_moving, random_damped, random_radius, near_surfaces, rigid_motion,
                             far_from_the_origin, forces_add});
  add_case(suite, "rules", {at_distance_zero, extremes_stay_finite, response_without_contacts, same_input_same_bits,
                            a_field_is_a_tool_at_each_point, tool_points, profile_evaluate,
                            object_evaluate_law});
  return run_suite(suite);
}
