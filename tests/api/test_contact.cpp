// Solid objects: the proxy of each tool point stays on the kept side, whatever the hand and the objects do, and the force is
// that of a spring to it.
#include <cmath>
#include <numbers>
#include <random>

#include "api/hand.h"

using namespace scenes;

namespace {

constexpr double pi = std::numbers::pi;
START_TEST(a_plane_holds_the_hand) {
  Hand hand;
  hand.plane("wall", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT, 2000, 5));
  EXPECT_VECTOR(hand.go({0, 0, 0.01}), (fs_vec3{}), 0);
  ck_assert(!hand.touches());
  EXPECT_VECTOR(hand.proxy(), (fs_vec3{0, 0, 0.01}), 0);
  EXPECT_VECTOR(hand.slide({0.003, 0, -0.002}), (fs_vec3{0, 0, 4}), 1e-9);
  ck_assert(hand.touches());
  ck_assert_uint_eq(hand.felt.felt_count, 1);
  EXPECT_VECTOR(hand.proxy(), (fs_vec3{0.003, 0, 0}), 1e-12);
  ck_assert(hand.proxy().z > 0);
  EXPECT_NEAR(hand.felt.stiffness.zz, -2000, 1e-6);
  EXPECT_NEAR(hand.felt.stiffness.xx, 0, 1e-6);
  EXPECT_VECTOR(hand.slide({0.003, 0, -0.2}), (fs_vec3{0, 0, 5}), 1e-12);  // the limit
  EXPECT_NEAR(hand.felt.stiffness.zz, 0, 1e-9);
  EXPECT_VECTOR(hand.slide({0.003, 0.01, 0.001}), (fs_vec3{}), 0);
  ck_assert(!hand.touches());
}
END_TEST

// The slope that a response tells is that of the force, also where a profile acts at the proxy, which follows the hand only along
// the surface.
START_TEST(the_slope_beside_a_profile) {
  int behind = 0;
  for (const bool is_plane : {true, false}) {
    Hand hand;
    const Shape ball = make_mesh(sphere_mesh(0.02, 80));
    fs_object o = fs_object_init("o", is_plane ? FS_PRIMITIVE_PLANE : FS_PRIMITIVE_MESH);
    if (!is_plane) o.shape = ball.get();
    o.pose.orientation = {0.8, 0.36, 0, 0.48};
    o.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0.5, 100);
    hand.put(o, solid(FS_KEEP_FRONT, 500, 1e6));
    hand.go({0, 0, 0.1});
    Random random(7);
    for (int i = 0; i < 60; ++i) {
      const fs_vec3 x = random.in_box(0.03);
      hand.slide(x);
      behind += hand.touches();
      const fs_mat3 k = hand.felt.stiffness;
      const fs_vec3 here = hand.felt.wrench.force;
      for (const fs_vec3 way : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}}) {
        constexpr double step = 1e-7;
        const fs_vec3 ahead = hand.go(x + step * way) - here, back = here - hand.go(x - step * way);
        hand.go(x);
        if (norm(ahead - back) > 1e-3 * (norm(ahead) + norm(back)) + 1e-9) continue;  // over an edge
        const fs_vec3 told{k.xx * way.x + k.xy * way.y + k.xz * way.z, k.yx * way.x + k.yy * way.y + k.yz * way.z,
                           k.zx * way.x + k.zy * way.y + k.zz * way.z};
        EXPECT_VECTOR((1 / step) * ahead, told, 0.5);
      }
    }
  }
  ck_assert_int_gt(behind, 30);
}
END_TEST

START_TEST(each_side_can_be_kept) {
  Hand back;
  back.plane("roof", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_BACK));
  back.go({0, 0, -0.01});
  EXPECT_VECTOR(back.slide({0, 0, 0.002}), (fs_vec3{0, 0, -2}), 1e-9);
  for (const double side : {1.0, -1.0}) {
    Hand either;
    either.plane("sheet", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_EITHER));
    either.go({0, 0, 0.01 * side});
    EXPECT_VECTOR(either.slide({0, 0, -0.002 * side}), (fs_vec3{0, 0, 2 * side}), 1e-9);
    EXPECT_VECTOR(either.slide({0, 0, 0.01 * side}), (fs_vec3{}), 0);
    EXPECT_VECTOR(either.slide({0, 0, -0.003 * side}), (fs_vec3{0, 0, 3 * side}), 1e-9);
    OK(fs_tool_reset(either.tool.get()));  // the hand was put there
    EXPECT_VECTOR(either.go({0, 0, -0.003 * side}), (fs_vec3{}), 0);
    EXPECT_VECTOR(either.slide({0, 0, 0.002 * side}), (fs_vec3{0, 0, -2 * side}), 1e-9);
  }
}
END_TEST

// It comes from far away, goes round the box and over its edges, and is never let in.
START_TEST(a_box_is_solid) {
  const fs_vec3 half{0.02, 0.03, 0.01};
  for (const fs_vec3 where : {fs_vec3{0, 0, 0}, fs_vec3{5e5, 4.6e6, 1500}}) {
    Hand hand;
    hand.mesh("box", box_mesh(half), solid(FS_KEEP_FRONT), where);
    const double rounding = 1e-9 + 1e-12 * norm(where);
    const auto outside = [&] {
      const fs_vec3 p = hand.proxy() - where;
      return std::max({std::fabs(p.x) - half.x, std::fabs(p.y) - half.y, std::fabs(p.z) - half.z});
    };
    hand.go(where + fs_vec3{0, 0, 0.1});
    EXPECT_VECTOR(hand.slide(where + fs_vec3{0.005, 0.002, 0.007}), (fs_vec3{0, 0, 3}), 1e6 * rounding);
    EXPECT_VECTOR(hand.proxy() - where, (fs_vec3{0.005, 0.002, 0.01}), rounding);
    Random random(3);
    for (int i = 0; i < times(200, 2000); ++i) {
      hand.slide(where + random.in_box(0.04), 0.0005 * random.between(0.2, 4));
      ck_assert_double_ge(outside(), -rounding);
    }
  }
}
END_TEST

// Hands that rush through closed meshes at up to 0.5 m/s.
START_TEST(nothing_lets_through) {
  Random random(5);
  const MeshData meshes[] = {box_mesh({0.03, 0.03, 0.0005}), wedge(20), wedge(90), wedge(170), sphere_mesh(0.03, 500),
                             torus_mesh(0.03, 0.01, 600)};
  int touches = 0;
  for (const MeshData& mesh : meshes) {
    ck_assert_double_lt(std::fabs(winding(mesh, {0.5, 0.4, 0.3})), 1e-9);
    Hand hand;
    hand.mesh("it", mesh, solid(FS_KEEP_FRONT));
    hand.go({0, 0, 0.1});
    for (int i = 0; i < times(60, 1000); ++i) {
      const fs_vec3 from = hand.x, to = random.in_box(0.05);
      const double step = 0.0005 * random.between(0.1, 1);
      const int count = static_cast<int>(std::ceil(norm(to - from) / step));
      for (int k = 1; k <= count; ++k) {
        hand.go(from + (static_cast<double>(k) / count) * (to - from));
        touches += hand.touches();
        if (k % 20 == 0 || k == count) ck_assert_double_lt(std::fabs(winding(mesh, hand.proxy())), 0.6);
        // The proxy is free of force where it is not at the surface.
        if (!hand.touches()) EXPECT_VECTOR(hand.proxy(), hand.x, 1e-12);
      }
    }
  }
  ck_assert_int_gt(touches, 10000);
}
END_TEST

START_TEST(a_hand_that_begins_inside_is_led_out) {
  Hand hand;
  hand.mesh("box", box_mesh({0.02, 0.02, 0.02}), solid(FS_KEEP_FRONT));
  EXPECT_VECTOR(hand.go({0.001, 0.002, 0.015}), (fs_vec3{0, 0, 5}), 1e-9);
  EXPECT_VECTOR(hand.slide({0.001, 0.002, 0.03}), (fs_vec3{}), 1e-9);
  Hand envelope;
  envelope.mesh("reach", box_mesh({0.02, 0.02, 0.02}), solid(FS_KEEP_BACK));
  EXPECT_VECTOR(envelope.go({0.022, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-9);
  EXPECT_VECTOR(envelope.slide({0, 0, 0}), (fs_vec3{}), 1e-9);
  EXPECT_VECTOR(envelope.slide({0, 0, 0.025}), (fs_vec3{0, 0, -5}), 1e-9);
}
END_TEST

// A mesh whose triangles face inwards is a room: a hand outside of it is led back from however far, as by an envelope.
START_TEST(a_hand_outside_of_a_room_is_led_back) {
  MeshData room = box_mesh({0.02, 0.02, 0.02});
  for (size_t i = 0; i < room.triangles.size(); i += 3) std::swap(room.triangles[i], room.triangles[i + 1]);
  Hand hand;
  hand.mesh("room", room, solid(FS_KEEP_FRONT, 1000, 5));
  const fs_vec3 far{0.5, 0.001, 0.002};
  EXPECT_VECTOR(hand.go(far), (fs_vec3{-5, 0, 0}), 1e-9);
  fs_vec3 force;
  OK(fs_evaluate_field(hand.scene.get(), nullptr, FS_NOW, &far, 1, &force));
  EXPECT_VECTOR(force, (fs_vec3{-5, 0, 0}), 1e-9);
  for (double x = 0.5; x > 0.0255; x -= 0.0005) EXPECT_VECTOR(hand.slide({x, 0.001, 0.002}), (fs_vec3{-5, 0, 0}), 1e-9);
  EXPECT_VECTOR(hand.slide({0.022, 0.001, 0.002}), (fs_vec3{-2, 0, 0}), 1e-9);
  EXPECT_VECTOR(hand.slide({0, 0, 0}), (fs_vec3{}), 1e-9);
}
END_TEST

// An export for flat shading has corners of its own for each triangle: what is closed by their places is as solid as if they were
// shared.
START_TEST(a_mesh_with_split_corners_is_solid) {
  Hand hand;
  hand.mesh("box", split_corners(box_mesh({0.02, 0.02, 0.02})), solid(FS_KEEP_FRONT));
  EXPECT_VECTOR(hand.go({0.001, 0.002, 0.015}), (fs_vec3{0, 0, 5}), 1e-9);
  EXPECT_VECTOR(hand.slide({0.001, 0.002, 0.03}), (fs_vec3{}), 1e-9);
  EXPECT_VECTOR(hand.slide({0.001, 0.002, 0.018}), (fs_vec3{0, 0, 2}), 1e-9);
}
END_TEST

// Also where the nearest place is an edge at which parts of a mesh cross: (20, 0, -20) mm here.
START_TEST(a_hand_that_begins_where_parts_cross_is_led_out) {
  MeshData mesh = box_mesh({0.04, 0.03, 0.03});
  for (fs_vec3& p : mesh.points) p.x -= 0.02;
  const MeshData other = box_mesh({0.035, 0.03, 0.035});
  const auto first = static_cast<uint32_t>(mesh.points.size());
  for (const fs_vec3& p : other.points) mesh.points.push_back(p + fs_vec3{0.025, 0, 0.015});
  for (const uint32_t i : other.triangles) mesh.triangles.push_back(first + i);
  Hand hand;
  hand.mesh("two", mesh, solid(FS_KEEP_FRONT, 200));
  EXPECT_VECTOR(hand.go({0.005, 0, 0}), (fs_vec3{3, 0, -4}), 1e-9);
  EXPECT_VECTOR(hand.go(hand.x), (fs_vec3{3, 0, -4}), 1e-9);
}
END_TEST

// A box that stands on another one, a little tilted and sunk in: from inside the way out leads into a wedge of 0.003 to 0.1 rad.
START_TEST(a_hand_that_begins_below_a_narrow_wedge_is_led_out) {
  for (const double tilt : {0.003, 0.01, 0.03, 0.1}) {
    for (const double overlap : {2e-5, 6e-5, 2e-4}) {
      MeshData mesh = moved(box_mesh({0.03, 0.03, 0.02}), at({0, 0, -0.02}));
      const MeshData other = moved(box_mesh({0.01, 0.01, 0.02}), {{0, 0, 0.02 - overlap}, turn({1, 0.3, 0}, tilt)});
      for (const uint32_t i : other.triangles) mesh.triangles.push_back(8 + i);
      mesh.points.insert(mesh.points.end(), other.points.begin(), other.points.end());
      Random random(1);
      Hand hand;
      hand.mesh("two", mesh, solid(FS_KEEP_FRONT));
      for (int i = 0; i < (is_sanitized ? 20 : times(200, 3000)); ++i) {
        if (hand.tool) OK(fs_tool_reset(hand.tool.get()));
        const fs_vec3 x{random.between(-0.009, 0.009), random.between(-0.009, 0.009), random.between(-0.005, -1e-6)};
        ck_assert_msg(norm(hand.go(x)) > 0, "tilt %g, overlap %g: free at (%.17g, %.17g, %.17g)", tilt, overlap, x.x, x.y, x.z);
      }
    }
  }
}
END_TEST

// The same for random boxes that cross: the hand is led to the nearest place of what they are together, as a field tells it.
START_TEST(a_hand_that_begins_in_a_body_of_parts_is_led_out) {
  for (int scene = 0; scene < (is_sanitized ? 2 : times(12, 400)); ++scene) {
    Random random(700 + static_cast<uint64_t>(scene));
    MeshData mesh;
    std::vector<std::pair<fs_pose, fs_vec3>> boxes;  // and half their sizes
    for (uint64_t n = 2 + random.below(8); boxes.size() < n;) {
      const fs_vec3 half{random.between(0.005, 0.04), random.between(0.005, 0.04), random.between(0.005, 0.04)};
      const fs_pose pose = random.pose(0.02);
      const MeshData box = box_mesh(half);
      const auto first = static_cast<uint32_t>(mesh.points.size());
      for (const fs_vec3& p : box.points) mesh.points.push_back(pose.position + rotate(pose.orientation, p));
      for (const uint32_t i : box.triangles) mesh.triangles.push_back(first + i);
      boxes.emplace_back(pose, half);
    }
    const auto depth = [&](fs_vec3 x) {  // m, in the box in which it is deepest; negative: outside
      double most = -1;
      for (const auto& [pose, half] : boxes) {
        const fs_quat q = pose.orientation;
        const fs_vec3 in = rotate({q.w, -q.x, -q.y, -q.z}, x - pose.position);
        most = std::max(most, std::min({half.x - std::fabs(in.x), half.y - std::fabs(in.y), half.z - std::fabs(in.z)}));
      }
      return most;
    };
    Hand hand;
    hand.mesh("body", mesh, solid(FS_KEEP_FRONT));
    hand.go({1, 0, 0});
    for (int i = 0; i < 400; ++i) {
      const fs_vec3 x = random.in_box(0.04);
      if (!(depth(x) > 1e-5)) continue;
      OK(fs_tool_reset(hand.tool.get()));
      hand.is_placed = false;
      hand.go(x);
      fs_vec3 field;
      OK(fs_evaluate_field(hand.scene.get(), "body", 0, &x, 1, &field));
      ck_assert_msg(depth(hand.proxy()) < 1e-7, "scene %d: the hand at (%.17g, %.17g, %.17g) has its proxy %g m deep in a box", scene,
                    x.x, x.y, x.z, depth(hand.proxy()));
      EXPECT_NEAR(norm(hand.felt.wrench.force), norm(field), 1e-4);
    }
  }
}
END_TEST

// From exactly a vertex, edge or face it goes in, and is held; also where the nearest place is the bottom of a groove.
START_TEST(a_hand_that_begins_on_the_surface_is_held) {
  const MeshData meshes[] = {box_mesh({0.02, 0.02, 0.02}), sphere_mesh(0.03, 300), torus_mesh(0.03, 0.01, 300)};
  Random random(11);
  for (const MeshData& mesh : meshes) {
    for (const double friction : {0.0, 0.7}) {
      Hand hand;
      fs_contact contact = solid(FS_KEEP_FRONT);
      contact.friction = friction;
      hand.mesh("it", mesh, contact);
      hand.go({0.1, 0, 0});
      for (int i = 0; i < 300; ++i) {
        const size_t t = 3 * random.below(mesh.triangles.size() / 3);
        const fs_vec3 a = mesh.points[mesh.triangles[t]], b = mesh.points[mesh.triangles[t + 1]],
                      c = mesh.points[mesh.triangles[t + 2]];
        const double u = i % 3 == 0 ? 0 : random.between(0, 0.9), v = i % 3 == 2 ? random.between(0, 1 - u) : 0;
        const fs_vec3 on = a + u * (b - a) + v * (c - a), n = cross(b - a, c - a), inward = (-1 / norm(n)) * n;
        if (hand.tool) OK(fs_tool_reset(hand.tool.get()));
        hand.is_placed = false;
        hand.go(on);
        for (int k = 1; k <= 5; ++k) {
          hand.go(on + (0.0005 * k) * inward);
          ck_assert(hand.touches());
          ck_assert_double_gt(norm(hand.felt.wrench.force), 0.1);
          const fs_vec3 out = (1e-9 / norm(hand.felt.wrench.force)) * hand.felt.wrench.force;  // rounding tells nothing of a surface
          ck_assert_double_lt(std::fabs(winding(mesh, hand.proxy() + out)), 0.1);
        }
      }
    }
  }
}
END_TEST

// A vertex belongs to all its faces; a proxy that stands exactly on it can still go along any of them.
START_TEST(a_vertex_does_not_hold) {
  Hand hand;
  hand.mesh("box", box_mesh({0.02, 0.02, 0.02}), solid(FS_KEEP_FRONT));
  hand.go({0.02, 0.02, 0.02});
  hand.slide({0.015, 0.015, 0.015});
  EXPECT_NEAR(norm(hand.felt.wrench.force), 5, 1e-9);  // to the nearest face
  EXPECT_NEAR(norm(hand.proxy() - hand.x), 0.005, 1e-12);
}
END_TEST

START_TEST(corners_hold_with_every_wall) {
  Hand hand;
  hand.plane("x", {0, 0, 0}, {1, 0, 0}, solid(FS_KEEP_FRONT));
  hand.plane("y", {0, 0, 0}, {0, 1, 0}, solid(FS_KEEP_FRONT));
  hand.plane("z", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT));
  hand.go({0.01, 0.01, 0.01});
  EXPECT_VECTOR(hand.slide({-0.001, -0.002, -0.003}), (fs_vec3{1, 2, 3}), 1e-9);
  EXPECT_VECTOR(hand.proxy(), (fs_vec3{}), 1e-12);
  EXPECT_VECTOR(hand.slide({-0.001, 0.004, -0.003}), (fs_vec3{1, 0, 3}), 1e-9);
  // Walls at an angle of 20 degrees: in the valley between them the spring acts once.
  for (const double degrees : {20.0, 90.0, 160.0}) {
    Hand valley;
    const double a = 0.5 * degrees * pi / 180;
    valley.plane("left", {0, 0, 0}, {std::cos(a), 0, std::sin(a)}, solid(FS_KEEP_FRONT));
    valley.plane("right", {0, 0, 0}, {-std::cos(a), 0, std::sin(a)}, solid(FS_KEEP_FRONT));
    valley.go({0, 0, 0.02});
    EXPECT_VECTOR(valley.slide({0, 0, -0.004}), (fs_vec3{0, 0, 4}), 1e-9);
    EXPECT_VECTOR(valley.proxy(), (fs_vec3{}), 1e-11);
  }
}
END_TEST

START_TEST(the_softest_wall_has_a_proxy) {
  Hand hand;
  hand.plane("a", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT, 1e-310));
  hand.go({0, 0, 0.01});
  hand.slide({0.001, 0, -0.002});
  EXPECT_VECTOR(hand.proxy(), (fs_vec3{0.001, 0, 0}), 1e-9);
}
END_TEST

// Equal walls in one place act once, others add; neither makes energy.
START_TEST(shared_proxies) {
  for (const double other : {1000.0, 300.0}) {
    Hand hand;
    hand.plane("a", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT));
    hand.plane("b", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT, other));
    hand.go({0, 0, 0.01});
    EXPECT_VECTOR(hand.slide({0, 0, -0.002}), (fs_vec3{0, 0, other == 1000 ? 2 : 2.6}), 1e-9);
  }
  for (const double other : {1000.0, 300.0}) {
    Hand hand;
    hand.plane("a", {0, 0, 0}, {0.8, 0, 0.6}, solid(FS_KEEP_FRONT));
    hand.plane("b", {0, 0, 0}, {-0.6, 0, 0.8}, solid(FS_KEEP_FRONT, other));
    hand.plane("c", {0, 0, 0}, {0.1, 0.2, 1}, solid(FS_KEEP_FRONT, other));
    hand.go({0, 0, 0.01});
    // Round and round, with the trapezium rule; halving the step takes a quarter of the error.
    double errors[2];
    for (const int i : {0, 1}) {
      const int count = 2000 << i;
      double work = 0, size = 0;
      fs_vec3 before{}, from{};
      for (int k = -count / 4; k <= count; ++k) {
        const double a = 2 * pi * k / count;
        const fs_vec3 to{0.004 * std::cos(a), 0.003 * std::sin(2 * a), -0.001 + 0.004 * std::sin(a)};
        const fs_vec3 force = hand.go(to);
        if (k > 0) {
          const double part = 0.5 * dot(force + before, to - from);
          work += part;
          size += std::fabs(part);
        }
        before = force;
        from = to;
      }
      errors[i] = std::fabs(work);
      ck_assert_double_gt(size, 1e-3);
    }
    ck_assert_double_lt(errors[1], 1e-8);
    ck_assert_double_lt(errors[1], 0.5 * errors[0] + 1e-12);
  }
}
END_TEST

// Where springs in a corner reach their limits, the hand gains nothing on its way round. With the trapezium rule.
START_TEST(limits_in_a_corner_make_no_energy) {
  std::mt19937 random(23);
  const auto number = [&](double least, double most) { return std::uniform_real_distribution<double>(least, most)(random); };
  const auto direction = [&] {
    const fs_vec3 way{number(-1, 1), number(-1, 1), number(0.1, 1)};
    return (1 / norm(way)) * way;
  };
  double worst = 0;
  for (int scene = 0; scene < 60; ++scene) {
    Hand hand;
    const int planes = 2 + scene % 3;
    const bool is_one_limit = scene % 2 == 0, is_one_stiffness = scene % 4 < 2;
    const double limit = number(0.5, 4);
    for (int i = 0; i < planes; ++i) {
      hand.plane(("plane " + std::to_string(i)).c_str(), {0, 0, number(-0.001, 0.001)}, direction(),
                 solid(FS_KEEP_FRONT, is_one_stiffness ? 1000 : number(300, 1000), is_one_limit ? limit : number(0.5, 4)));
    }
    hand.go({0, 0, 0.05});
    const fs_vec3 middle{number(-0.003, 0.003), number(-0.003, 0.003), number(-0.004, 0.002)};
    const fs_vec3 u = number(0.002, 0.006) * direction(), v = number(0.002, 0.006) * unit(cross(u, direction()));
    double work = 0, size = 0;
    fs_vec3 before{}, from{};
    constexpr int count = 4000;
    for (int k = -count / 4; k <= count; ++k) {
      const double a = 2 * pi * k / count;
      const fs_vec3 to = middle + std::cos(a) * u + std::sin(a) * v;
      const fs_vec3 force = hand.go(to);
      if (k > 0) {
        work += 0.5 * dot(force + before, to - from);
        size += 0.5 * std::fabs(dot(force + before, to - from));
      }
      before = force;
      from = to;
    }
    worst = std::max(worst, work / std::max(size, 1e-3));
  }
  ck_assert_double_lt(worst, 1e-4);
}
END_TEST

// Over the edges of a convex mesh a proxy falls from one facet to the next, which takes some energy from the hand; the finer
// the mesh the less. It never gives any.
START_TEST(sliding_over_a_mesh_makes_no_energy) {
  double lost[3];
  for (const int i : {0, 1, 2}) {
    Hand hand;
    hand.mesh("ball", sphere_mesh(0.03, 500 << (4 * i)), solid(FS_KEEP_FRONT));
    hand.go({0.1, 0, 0});
    hand.slide({0.026, 0, 0});
    double work = 0, size = 0;
    fs_vec3 before{}, from{};
    constexpr int count = 8000;
    for (int k = 0; k <= 2 * count; ++k) {  // once round to get there, and once round again
      const double a = 2 * pi * k / count, r = 0.026 + 0.003 * std::sin(3 * a);
      const fs_vec3 to{r * std::cos(a), r * std::sin(a) * 0.8, r * std::sin(a) * 0.6};
      const fs_vec3 force = hand.go(to);
      if (k > count) {
        work += 0.5 * dot(force + before, to - from);
        size += std::fabs(0.5 * dot(force + before, to - from));
      }
      before = force;
      from = to;
    }
    lost[i] = -work / size;
    if (std::getenv("VERBOSE")) std::printf("  %d triangles: %.3g of the work is lost\n", 500 << (4 * i), lost[i]);
    ck_assert_double_gt(lost[i], -1e-4);  // the rounding of the steps
  }
  ck_assert_double_lt(lost[1], 0.5 * lost[0]);
  ck_assert_double_lt(lost[2], 0.5 * lost[1]);
}
END_TEST

START_TEST(friction_sticks_and_slips) {
  for (const double friction : {0.3, 1.0}) {
    Hand hand;
    fs_contact contact = solid(FS_KEEP_FRONT);
    contact.friction = friction;
    hand.plane("table", {0, 0, 0}, {0, 0, 1}, contact);
    hand.go({0, 0, 0.01});
    EXPECT_VECTOR(hand.slide({0, 0, -0.002}), (fs_vec3{0, 0, 2}), 1e-9);
    const fs_vec3 stuck = hand.proxy();
    const double cone = 0.002 * friction;
    for (int i = 0; i < 3000; ++i) {  // within the cone nothing moves
      const double a = 0.01 * i;
      hand.go({0.99 * cone * std::cos(a), 0.99 * cone * std::sin(a), -0.002});
    }
    ck_assert(hand.proxy() == stuck);
    EXPECT_VECTOR(hand.slide({0.5 * cone, 0, -0.002}), (fs_vec3{-500 * cone, 0, 2}), 1e-9);
    EXPECT_NEAR(hand.felt.stiffness.xx, -1000, 1e-6);
    // Beyond it: the force is on the cone, and what it does is lost.
    const fs_vec3 force = hand.slide({0.02, 0, -0.002});
    EXPECT_NEAR(force.z, 2, 1e-9);
    EXPECT_NEAR(force.x, -2 * friction, 1e-6);
    EXPECT_NEAR(force.y, 0, 1e-9);
    EXPECT_NEAR(hand.felt.stiffness.xx, 0, 1e-6);
  }
  // An inclined plane: a weight that hangs on the hand's place slides where tan(angle) exceeds the coefficient.
  for (const double degrees : {25.0, 35.0}) {
    Hand hand;
    const double a = degrees * pi / 180;
    const fs_vec3 normal{std::sin(a), 0, std::cos(a)}, down{std::cos(a), 0, -std::sin(a)};
    fs_contact contact = solid(FS_KEEP_FRONT);
    contact.friction = std::tan(30 * pi / 180);
    hand.plane("slope", {0, 0, 0}, normal, contact);
    hand.go(0.01 * normal);
    hand.slide(-0.0001 * normal);
    const fs_vec3 begin = hand.proxy();
    for (int i = 0; i < 500; ++i) hand.go(hand.proxy() + fs_vec3{0, 0, -0.002});  // 2 N, straight down
    const double way = dot(hand.proxy() - begin, down);
    if (degrees < 30) {
      EXPECT_NEAR(way, 0, 1e-12);
    } else {
      ck_assert_double_gt(way, 0.01);
    }
  }
}
END_TEST

START_TEST(damping_acts_on_approach_only) {
  Hand hand;
  fs_contact contact = solid(FS_KEEP_FRONT, 1000, 100);
  contact.damping = 10;
  hand.plane("wall", {0, 0, 0}, {0, 0, 1}, contact);
  hand.go({0, 0, 0.001});
  hand.slide({0, 0, -0.001});
  EXPECT_VECTOR(hand.go({0, 0, -0.0012}), (fs_vec3{0, 0, 1.2 + 2}), 1e-9);  // at 0.2 m/s
  EXPECT_VECTOR(hand.go({0, 0, -0.001}), (fs_vec3{0, 0, 1}), 1e-9);
  EXPECT_VECTOR(hand.go({0.0005, 0, -0.001}), (fs_vec3{0, 0, 1}), 1e-9);
  const fs_pose pose = at({0, 0, 0});  // the wall itself comes up, from this very moment on
  const fs_twist up{{0, 0, 0.1}, {}};
  OK(fs_object_move(hand.scene.get(), "wall", &pose, nullptr, hand.time));  // it was set at another time
  OK(fs_object_move(hand.scene.get(), "wall", &pose, &up, hand.time + dt));
  EXPECT_VECTOR(hand.go({0.0005, 0, -0.001}), (fs_vec3{0, 0, 1 + 1}), 1e-9);
}
END_TEST

// Whatever moves, the proxy stays on its side.
START_TEST(moving_objects_push) {
  for (const bool has_twist : {true, false}) {
    Hand hand;  // a slab of 1 mm that sweeps through the hand at 0.5 m/s
    fs_object slab = hand.mesh("slab", box_mesh({0.05, 0.05, 0.0005}), solid(FS_KEEP_FRONT, 1000, 20), {0, 0, 0.02});
    for (int i = 0; i < 80; ++i) {
      const double z = 0.02 - 0.0005 * i;
      if (i % 40 == 0 || !has_twist) {  // at 25 Hz, or at every tick
        const fs_pose pose = at({0, 0, z});
        const fs_twist twist{{0, 0, has_twist ? -0.5 : 0.0}, {}};
        OK(fs_object_move(hand.scene.get(), "slab", &pose, &twist, hand.time + dt));
      }
      const fs_vec3 force = hand.go({0.003, 0.001, 0});
      if (z < -0.0006) {
        EXPECT_VECTOR(hand.proxy(), (fs_vec3{0.003, 0.001, z - 0.0005}), 1e-9);
        EXPECT_VECTOR(force, (fs_vec3{0, 0, 1000 * (z - 0.0005)}), 1e-6);
      }
    }
    (void)slab;
  }
  // A table with friction carries the hand's proxy with it, also when it turns.
  Hand hand;
  fs_contact contact = solid(FS_KEEP_FRONT);
  contact.friction = 2;
  hand.plane("table", {0, 0, 0}, {0, 0, 1}, contact);
  hand.go({0.01, 0, 0.01});
  hand.slide({0.01, 0, -0.01});
  for (int i = 1; i <= 100; ++i) {
    const double a = 0.002 * i;
    const fs_pose pose{{0.00001 * i, 0, 0}, {std::cos(a / 2), 0, 0, std::sin(a / 2)}};
    OK(fs_object_move(hand.scene.get(), "table", &pose, nullptr, hand.time + dt));
    hand.go({0.01, 0, -0.01});
    EXPECT_VECTOR(hand.proxy(), (fs_vec3{0.00001 * i + 0.01 * std::cos(a), 0.01 * std::sin(a), 0}), 1e-9);
  }
}
END_TEST

// What carries a proxy along and comes back has it exactly where it was.
START_TEST(a_proxy_is_carried_without_rounding) {
  Hand hand;
  fs_contact contact = solid(FS_KEEP_FRONT);
  contact.friction = 2;
  const fs_object table = hand.plane("table", {0, 0, 0}, {0.1, 0.2, 0.97}, contact);
  const fs_twist still{};
  hand.go({0.01, 0, 0.01});
  hand.slide({0.01, 0, -0.01});
  const fs_vec3 before = hand.go(hand.x);
  Random random(8);
  for (int i = 0; i <= 200; ++i) {
    fs_pose pose = table.pose;
    if (i < 200) {
      pose.position = random.in_box(0.001);
      OK(fs_pose_from_z(pose.position, fs_vec3{0.1, 0.2, 0.97} + random.in_box(0.01), &pose));
    }
    OK(fs_object_move(hand.scene.get(), "table", &pose, &still, hand.time + dt));
    hand.go(hand.x);
  }
  EXPECT_VECTOR(hand.felt.wrench.force, before, 0);
}
END_TEST

// A hand at rest that is crushed between a floor that rises and a ceiling that comes down feels both; when they part they share
// a proxy again. How they are tilted makes no step.
START_TEST(a_crushed_hand_feels_each) {
  for (const double friction : {0.0, 0.8}) {
    for (const double tilt : {0.0, 1e-6, 0.01, 0.1, 0.4}) {
      Hand hand;
      fs_contact contact = solid(FS_KEEP_FRONT);
      contact.friction = friction;
      const double c = std::cos(tilt), s = std::sin(tilt), aside = friction > 0 ? 2 * s + 1e-6 : 1e-6;
      hand.plane("floor", {0, 0, -0.01}, {0, 0, 1}, contact);
      hand.plane("ceiling", {0, 0, 0.01}, {s, 0, -c}, contact);
      hand.go({});
      const auto go = [&](const char* name, fs_vec3 normal, double from, double to) {
        constexpr int count = 100;
        for (int i = 1; i <= count; ++i) {
          fs_pose pose;
          OK(fs_pose_from_z({0, 0, from + (to - from) * i / count}, normal, &pose));
          OK(fs_object_move(hand.scene.get(), name, &pose, nullptr, 0));
          const fs_vec3 before = hand.felt.wrench.force;
          ck_assert_double_le(norm(hand.go(hand.x) - before), 2 * 1000 * std::fabs(to - from) / count + 1e-6);
        }
        for (int i = 0; i < 30; ++i) hand.go(hand.x);
      };
      const fs_vec3 up{0, 0, 1}, down{s, 0, -c};
      go("floor", up, -0.01, 0.002);
      EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{0, 0, 2}), 1e-6);
      go("ceiling", down, 0.01, -0.001);  // past the proxy, and then past the hand
      EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{0, 0, 2} + c * down), aside);
      go("floor", up, 0.002, 0.001);
      EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{0, 0, 1} + c * down), aside);
      go("ceiling", down, -0.001, 0.01);
      EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{0, 0, 1}), aside);
      go("floor", up, 0.001, -0.01);
      EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{}), 1e-9);
      // They share a proxy: in the valley between them the spring acts once.
      if (tilt == 0.4) {
        const fs_vec3 valley{-0.02 * c / s, 0, -0.01};
        hand.slide({});
        hand.slide(valley + fs_vec3{0.01, 0, 0.001});
        hand.slide(valley + fs_vec3{-0.002, 0, 0.0002});
        EXPECT_VECTOR(hand.proxy(), valley, friction > 0 ? 0.001 : 1e-9);
      }
    }
  }
}
END_TEST

START_TEST(open_meshes_have_rims) {
  MeshData fin;  // one triangle, in the plane z = 0, its front up
  fin.points = {{0, 0, 0}, {0.02, 0, 0}, {0, 0.02, 0}};
  fin.triangles = {0, 1, 2};
  Hand hand;
  hand.mesh("fin", fin, solid(FS_KEEP_FRONT));
  hand.go({0.004, 0.004, 0.01});
  EXPECT_VECTOR(hand.slide({0.004, 0.004, -0.003}), (fs_vec3{0, 0, 3}), 1e-9);
  // Over the rim it falls off, round it comes from below, and through its back nothing holds it.
  hand.slide({-0.01, 0.004, -0.003});
  for (int i = 0; i < 40; ++i) hand.go(hand.x);
  EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{}), 1e-9);
  EXPECT_VECTOR(hand.slide({0.004, 0.004, -0.003}), (fs_vec3{}), 0);
  EXPECT_VECTOR(hand.slide({0.004, 0.004, 0.003}), (fs_vec3{}), 0);
  EXPECT_VECTOR(hand.slide({0.004, 0.004, -0.001}), (fs_vec3{0, 0, 1}), 1e-9);
  // As a sheet it holds from either side.
  Hand sheet;
  sheet.mesh("sheet", fin, solid(FS_KEEP_EITHER));
  sheet.go({0.004, 0.004, -0.01});
  EXPECT_VECTOR(sheet.slide({0.004, 0.004, 0.003}), (fs_vec3{0, 0, -3}), 1e-9);
  // Triangles of any size count: one of 1e-12 m^2.
  for (fs_vec3& p : fin.points) p = 7e-5 * p;
  Hand tiny;
  tiny.mesh("tiny", fin, solid(FS_KEEP_FRONT));
  tiny.go({3e-7, 3e-7, 0.01});
  EXPECT_VECTOR(tiny.slide({3e-7, 3e-7, -0.001}), (fs_vec3{0, 0, 1}), 1e-9);
}
END_TEST

// A jump that neither the hand nor an object explains is spread over 20 ms.
START_TEST(letting_go_is_no_step) {
  Hand hand;  // deep below a shelf's edge the proxy is far from the hand until it slides off
  hand.mesh("shelf", box_mesh({0.02, 0.02, 0.001}), solid(FS_KEEP_FRONT));
  hand.go({0, 0, 0.01});
  hand.slide({0, 0, -0.008});
  double before = norm(hand.felt.wrench.force), most = 0;
  EXPECT_NEAR(before, 9, 1e-6);
  for (int i = 0; i < 400; ++i) {
    const double now = norm(hand.go({0.0001 * i, 0, -0.008}));
    most = std::max(most, std::fabs(now - before));
    before = now;
  }
  for (int i = 0; i < 25; ++i) {
    const double now = norm(hand.go(hand.x));
    most = std::max(most, std::fabs(now - before));
    before = now;
  }
  EXPECT_NEAR(before, 0, 1e-12);
  ck_assert_double_lt(most, 9 * dt / 0.02 + 0.3);
  ck_assert_double_gt(most, 0.1);

  Hand limited;  // the spread is of what was felt
  limited.mesh("shelf", box_mesh({0.02, 0.02, 0.001}), solid(FS_KEEP_FRONT, 1000, 5));
  limited.go({0, 0, 0.01});
  limited.slide({0, 0, -0.05});
  EXPECT_NEAR(norm(limited.felt.wrench.force), 5, 1e-6);
  before = 5;
  for (int i = 0; i < 600; ++i) {
    const double now = norm(limited.go({0.0001 * std::min(i, 300), 0, -0.05}));
    ck_assert_double_lt(std::fabs(now - before), 5 * dt / 0.02 + 0.3);
    before = now;
  }
  EXPECT_NEAR(before, 0, 1e-12);
}
END_TEST

// What is left of a jump, and a force that has turned meanwhile, are together within the limit; and that is no step either.
START_TEST(what_is_left_of_a_jump_stays_within_the_limit) {
  Random random(12);
  for (int round = 0; round < times(40, 400); ++round) {
    Hand hand;
    fs_contact contact = solid(random.coin() ? FS_KEEP_FRONT : FS_KEEP_BACK, 1000, 2);
    contact.friction = random.coin() ? random.between(0.2, 2) : 0;
    hand.mesh("box", box_mesh({0.02, 0.02, 0.02}), contact);
    fs_vec3 phase = random.in_box(3), speed = {random.between(2, 5), random.between(2, 5), random.between(2, 5)};
    fs_vec3 before{};
    for (int i = 0; i < 2000; ++i) {
      const double t = i * dt;
      const fs_vec3 x = {std::sin(speed.x * t + phase.x), std::sin(speed.y * t + phase.y), std::sin(speed.z * t + phase.z)};
      const fs_vec3 now = hand.go(0.03 * x);
      ck_assert_double_le(norm(now), 2 * (1 + 1e-9));
      // The way of a tick is at most 0.26 mm.
      if (i > 0) ck_assert_double_lt(norm(now - before), 2 * 0.26 * (1 + contact.friction) + 2 * 2 * dt / 0.02);
      before = now;
    }
  }
}
END_TEST

// Very far from the origin a place is known to millimetres only; but the limit holds.
START_TEST(the_limit_holds_at_any_place) {
  for (const double y : {1e6, 1e9, 1e11, 9e11}) {
    Hand hand;
    hand.plane("floor", {}, {0, 0, 1}, solid(FS_KEEP_FRONT, 500, 8));
    hand.go({0, 0, 0.001});
    ck_assert_double_le(norm(hand.go({0, y, -0.002})), 8 * (1 + 1e-9));
  }
}
END_TEST

// So is a jump of a profile's force, which acts at the proxy.
START_TEST(a_profile_at_an_edge_is_no_step) {
  Hand hand;
  hand.shapes.push_back(make_mesh(box_mesh({0.02, 0.02, 0.001})));
  fs_object shelf = fs_object_init("shelf", FS_PRIMITIVE_MESH);
  shelf.shape = hand.shapes.back().get();
  shelf.front = attract(200, 100);
  hand.put(shelf, solid(FS_KEEP_FRONT, 10));  // hardly stiff: it is the profile that jumps
  hand.go({0, 0, 0.01});
  hand.slide({0.0195, 0, -0.02});
  EXPECT_NEAR(hand.felt.wrench.force.z, 0.21, 1e-6);
  const double jump = 200 * 0.019;  // N: from 0 on top of the shelf to that of the hand below it
  fs_vec3 before = hand.felt.wrench.force;
  double most = 0;
  for (int i = 0; i < 200; ++i) {
    const fs_vec3 now = hand.go({0.0195 + 1e-5 * i, 0, -0.02});
    most = std::max(most, norm(now - before));
    before = now;
  }
  ck_assert_double_gt(norm(before), 0.9 * jump);
  ck_assert_double_gt(most, 0.5 * jump * dt / 0.02);
  ck_assert_double_lt(most, 1.1 * jump * dt / 0.02);
}
END_TEST

START_TEST(tools_of_several_points) {
  Hand hand;
  hand.plane("table", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT, 1000, 3));
  const fs_vec3 points[] = {{0.01, 0, 0}, {-0.01, 0, 0}, {0, 0.01, 0}, {0, -0.01, 0}};
  fs_tool* tool = nullptr;
  OK(fs_tool_create(hand.scene.get(), points, 4, &tool));
  hand.tool = Tool(tool);
  hand.go({0, 0, 0.01});
  hand.slide({0, 0, -0.0005});
  EXPECT_VECTOR(hand.felt.wrench.force, (fs_vec3{0, 0, 2}), 1e-9);  // the sum
  EXPECT_VECTOR(hand.felt.wrench.torque, (fs_vec3{}), 1e-12);
  EXPECT_VECTOR(hand.slide({0, 0, -0.002}), (fs_vec3{0, 0, 3}), 1e-9);  // the limit is that of the sum
  EXPECT_NEAR(hand.felt.stiffness.zz, 0, 1e-9);
  // Tilted about y only one point touches; the proxy turns with it.
  fs_state state = hand_at({0, 0, 0.0009}, hand.time + dt);
  const double a = 0.1;
  state.pose.orientation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
  const fs_response felt = evaluate(hand.tool.get(), state);
  const double depth = 0.01 * std::sin(a) - 0.0009;
  EXPECT_VECTOR(felt.wrench.force, (fs_vec3{0, 0, 1000 * depth}), 1e-9);
  EXPECT_NEAR(felt.wrench.torque.y, -0.01 * std::cos(a) * 1000 * depth, 1e-9);
  EXPECT_NEAR(felt.proxy.position.z, 0.0009 + depth / 4, 1e-9);
  ck_assert_double_lt(felt.proxy.orientation.y, state.pose.orientation.y);
}
END_TEST

// A hand that is pressed into a slope goes to and fro beside a wall that drives it away and shares the slope's proxy.
START_TEST(a_profile_beside_a_slope_makes_no_energy) {
  const fs_vec3 up{0, 0.6, 0.8}, along{0, -0.8, 0.6};
  for (const double stiffness : {500.0, 300.0}) {  // of the wall: they share a proxy, or they do not
    Hand hand;
    hand.plane("slope", {0, 0, 0}, up, solid(FS_KEEP_FRONT, 500, 100));
    fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
    OK(fs_pose_from_z({0, -0.025, 0}, {0, 1, 0}, &wall.pose));
    wall.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -100, 3, 3);
    hand.put(wall, solid(FS_KEEP_FRONT, stiffness, 100));
    const fs_vec3 corners[] = {-0.02 * along + 0.001 * up, -0.02 * along - 0.01 * up, 0.02 * along - 0.01 * up, 0.02 * along + 0.001 * up};
    for (const bool is_back : {false, true}) {
      hand.go(corners[0]);
      double work = 0;  // J, on the hand
      for (int side = 1; side <= 4; ++side) {
        const fs_vec3 from = hand.x, to = corners[(is_back ? 4 - side : side) % 4];
        constexpr int ticks = 2000;
        for (int i = 1; i <= ticks; ++i) {
          const fs_vec3 before = hand.felt.wrench.force, at = hand.x;
          hand.go(from + (1.0 * i / ticks) * (to - from));
          work += 0.5 * dot(before + hand.felt.wrench.force, hand.x - at);
        }
      }
      ck_assert_msg(std::fabs(work) < 2e-5, "stiffness %g: %g J in a loop", stiffness, work);
    }
  }
}
END_TEST

START_TEST(profiles_act_at_the_proxy) {
  Hand hand;
  fs_object o = fs_object_init("magnet", FS_PRIMITIVE_PLANE);
  o.front = constant(FS_SENSE_ATTRACTIVE, 0.7);
  o.front.reach = 0.005;
  o.back = constant(FS_SENSE_REPULSIVE, 50);  // where the hand is, but not the proxy
  hand.put(o, solid(FS_KEEP_FRONT));
  EXPECT_VECTOR(hand.go({0, 0, 0.01}), (fs_vec3{}), 0);
  EXPECT_VECTOR(hand.slide({0, 0, 0.004}), (fs_vec3{0, 0, -0.7}), 1e-12);
  EXPECT_VECTOR(hand.slide({0, 0, -0.002}), (fs_vec3{0, 0, 2 - 0.7}), 1e-9);
  Hand back;
  fs_object b = fs_object_init("roof", FS_PRIMITIVE_PLANE);
  b.back = constant(FS_SENSE_REPULSIVE, 0.5);
  back.put(b, solid(FS_KEEP_BACK));
  back.go({0, 0, -0.01});
  EXPECT_VECTOR(back.slide({0, 0, 0.002}), (fs_vec3{0, 0, -2 - 0.5}), 1e-9);
}
END_TEST

// A field has no memory: a plane or closed mesh leads to its nearest place.
START_TEST(fields_of_solids) {
  Hand hand;
  hand.plane("wall", {0, 0, 0}, {0, 0, 1}, solid(FS_KEEP_FRONT, 1000, 5));
  hand.mesh("box", box_mesh({0.01, 0.01, 0.01}), solid(FS_KEEP_FRONT), {0, 0, 0.1});
  hand.plane("sheet", {0, 0, 0.2}, {0, 0, 1}, solid(FS_KEEP_EITHER));
  const fs_vec3 positions[] = {{0, 0, 0.05}, {0, 0, -0.002}, {0, 0, -1}, {0, 0.002, 0.108}, {0, 0, 0.3}};
  fs_vec3 forces[5];
  OK(fs_evaluate_field(hand.scene.get(), nullptr, FS_NOW, positions, 5, forces));
  EXPECT_VECTOR(forces[0], (fs_vec3{}), 0);
  EXPECT_VECTOR(forces[1], (fs_vec3{0, 0, 2}), 1e-9);
  EXPECT_VECTOR(forces[2], (fs_vec3{0, 0, 5}), 1e-9);
  EXPECT_VECTOR(forces[3], (fs_vec3{0, 0, 2}), 1e-9);
  EXPECT_VECTOR(forces[4], (fs_vec3{}), 0);
  OK(fs_evaluate_field(hand.scene.get(), "wall", FS_NOW, positions, 5, forces));
  EXPECT_VECTOR(forces[1], (fs_vec3{0, 0, 2}), 1e-9);
}
END_TEST

// --- Under a servo.

// A virtual servo at 1 kHz with a fade of 50 ms; the hand stands where the test puts it.
struct Held : Rig {
  std::vector<Shape> shapes;
  explicit Held(const char* name, double blend = -1) : Rig(name) {
    fake.state.pose = at({0, 0, 0.01});
    fs_servo_options options = virtual_options();
    options.fade = 0.05;
    options.blend = blend;
    options.ramp = -1;
    start(options);
    step(1);
  }
  void put(fs_object o, fs_contact contact) {
    o.contact = contact;
    OK(fs_object_set(scene.get(), &o));
  }
  fs_object solid_mesh(const char* name, const MeshData& data) {
    shapes.push_back(make_mesh(data));
    fs_object o = fs_object_init(name, FS_PRIMITIVE_MESH);
    o.shape = shapes.back().get();
    return o;
  }
  void place(fs_vec3 to, int ticks = 20) {  // in a straight line
    const fs_vec3 from = fake.state.pose.position;
    for (int i = 1; i <= ticks; ++i) {
      fake.state.pose.position = from + (static_cast<double>(i) / ticks) * (to - from);
      step(1);
    }
  }
  // Runs these ticks; the greatest change of the force from one to the next, N.
  double most_change(int ticks, const std::function<void(int)>& each = nullptr) {
    double most = 0;
    for (int i = 0; i < ticks; ++i) {
      if (each) each(i);
      const fs_vec3 before = sent();
      step(1);
      most = std::max(most, norm(sent() - before));
    }
    return most;
  }
};

START_TEST(solids_come_and_go_without_a_step) {
  Held held("contact_fade");
  held.place({0, 0, -0.004});
  const fs_object wall = [] {
    fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
    return o;
  }();
  held.put(wall, solid(FS_KEEP_FRONT));  // it appears on the hand
  ck_assert_double_le(held.most_change(80), 4 * dt / 0.05 + 1e-9);
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 4}), 1e-9);
  const fs_report report = report_of(held.scene.get(), "wall");
  EXPECT_VECTOR(report.wrench.force, (fs_vec3{0, 0, 4}), 1e-9);
  EXPECT_VECTOR(report.point, (fs_vec3{}), 1e-12);
  EXPECT_NEAR(report.distance, 0.004, 1e-12);
  EXPECT_NEAR(report.stiffness_wanted, 1000, 1e-9);
  fs_frame frame = fs_frame_init();
  frame.pose.position = {0, 0, 0.001};  // another frame cross-fades: 1 mm less
  OK(fs_scene_set_frame(held.scene.get(), &frame));
  ck_assert_double_le(held.most_change(120), 6 * dt / 0.05 + 1e-9);
  EXPECT_NEAR(std::fabs(held.sent().z - 4), 1, 1e-9);
  OK(fs_object_remove(held.scene.get(), "wall"));
  ck_assert_double_le(held.most_change(80), 5 * dt / 0.05 + 1e-9);
  EXPECT_VECTOR(held.sent(), (fs_vec3{}), 0);
}
END_TEST

// What one leaves, the others hold.
START_TEST(solids_that_share_a_proxy_fade) {
  Held held("contact_shared");
  for (const char* name : {"a", "b", "c"}) held.put(fs_object_init(name, FS_PRIMITIVE_PLANE), solid(FS_KEEP_FRONT));
  held.step(80);
  held.place({0, 0, -0.003});
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 3}), 1e-9);
  for (const char* name : {"a", "c"}) {
    OK(fs_object_remove(held.scene.get(), name));
    ck_assert_double_lt(held.most_change(80), 1e-9);
    EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 3}), 1e-9);
  }
  held.put(fs_object_init("d", FS_PRIMITIVE_PLANE), solid(FS_KEEP_FRONT));
  ck_assert_double_lt(held.most_change(80), 1e-9);
  fs_object tilted = fs_object_init("e", FS_PRIMITIVE_PLANE);
  OK(fs_pose_from_z({0, 0, 0}, {0.6, 0, 0.8}, &tilted.pose));
  held.put(tilted, solid(FS_KEEP_FRONT));
  ck_assert_double_le(held.most_change(80), 5 * dt / 0.05);
  OK(fs_object_remove(held.scene.get(), "e"));
  ck_assert_double_le(held.most_change(80), 5 * dt / 0.05);
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 3}), 1e-9);
}
END_TEST

// More solids that come or go at once than can be told apart: the change of their mean is spread.
START_TEST(a_hundred_solids_come_and_go_at_once) {
  Held held("contact_crowd");
  held.place({0, 0, -0.001});
  constexpr int count = 100;
  double force = 0;  // N
  for (const bool is_coming : {true, false}) {
    OK(fs_scene_begin(held.scene.get()));
    for (int i = 0; i < count; ++i) {  // each has a proxy of its own
      const std::string name = "plane " + std::to_string(i);
      if (is_coming) held.put(fs_object_init(name.c_str(), FS_PRIMITIVE_PLANE), solid(FS_KEEP_FRONT, 20 + i));
      if (is_coming) force += 1e-3 * (20 + i);
      if (!is_coming) OK(fs_object_remove(held.scene.get(), name.c_str()));
    }
    OK(fs_scene_commit(held.scene.get()));
    const double most = held.most_change(100);
    ck_assert_msg(most < 1.01 * force * dt / 0.02, "%s: a step of %g N, of %g", is_coming ? "they come" : "they go", most, force);
    held.step(100);
    EXPECT_NEAR(held.sent().z, is_coming ? force : 0, 1e-9);
  }
}
END_TEST

// A solid of which only the profile is felt, as the hand does not touch it.
START_TEST(a_profile_above_a_solid_fades) {
  Held held("contact_above");
  fs_object magnet = fs_object_init("magnet", FS_PRIMITIVE_PLANE);
  magnet.front = constant(FS_SENSE_ATTRACTIVE, 2);
  magnet.front.reach = 0.02;
  const auto is_steady = [&](double felt) {
    ck_assert_double_le(held.most_change(80), 2 * dt / 0.05 + 1e-9);
    EXPECT_NEAR(held.sent().z, felt, 1e-9);
  };
  for (int i = 0; i < 2; ++i) {
    held.put(magnet, solid(FS_KEEP_FRONT));
    is_steady(-2);
    fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);  // another one fades meanwhile
    wall.pose.position.z = -0.05;
    held.put(wall, solid(FS_KEEP_FRONT));
    OK(fs_object_remove(held.scene.get(), "magnet"));
    is_steady(0);
    OK(fs_object_remove(held.scene.get(), "wall"));
  }
}
END_TEST

// A mesh that is replaced again and again stays felt, and does not let the hand in.
START_TEST(a_mesh_is_replaced_while_it_is_touched) {
  Held held("contact_mesh");
  held.place({0, 0, 0.03});
  held.put(held.solid_mesh("box", box_mesh({0.02, 0.02, 0.01})), solid(FS_KEEP_FRONT));
  held.step(80);
  held.place({0.003, 0.001, 0.005}, 60);
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 5}), 1e-9);
  const double most = held.most_change(400, [&](int i) {
    if (i < 300) held.put(held.solid_mesh("box", box_mesh({0.02, 0.02 + 1e-4 * (i % 3), 0.01})), solid(FS_KEEP_FRONT));
  });
  ck_assert_double_lt(most, 1e-6);
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 5}), 1e-9);
}
END_TEST

// A surface that sinks under a proxy that friction holds does not leave it in the air, nor makes it a step.
START_TEST(a_mesh_that_sinks_takes_the_proxy_along) {
  for (const double friction : {0.0, 0.4, 1.0}) {
    for (const int gap : {30, 100}) {
      Held held("contact_sink");
      fs_contact contact = solid(FS_KEEP_FRONT);
      contact.friction = friction;
      const auto put = [&](double top) { held.put(held.solid_mesh("box", box_mesh({0.05, 0.05, 0.02 + top})), contact); };
      held.place({0, 0, 0.03});
      put(0);
      held.step(80);
      held.place({0, 0, 0.018});
      held.place({0.0005, 0, 0.017});  // friction holds the proxy back
      const double most = held.most_change(5 * gap, [&](int i) {
        if (i % gap == 0) put(-0.0003 * (1 + i / gap));
      });
      ck_assert_double_le(std::max(most, held.most_change(100)), 4 * dt / 0.05);
      EXPECT_NEAR(held.sent().z, 1.5, 1e-6);
      EXPECT_NEAR(report_of(held.scene.get(), "box").point.z, 0.0185, 1e-9);
    }
  }
}
END_TEST

// A sheet that rises under the hand takes it along.
START_TEST(a_sheet_that_rises_keeps_the_hand) {
  Held held("contact_rise");
  const auto put = [&](double z, size_t triangles) {
    MeshData sheet = terrain_mesh(0.05, 0, triangles);
    for (fs_vec3& p : sheet.points) p.z = z;
    held.put(held.solid_mesh("sheet", sheet), solid(FS_KEEP_FRONT));
  };
  put(0, 200);
  held.step(80);
  held.place({0.001, 0.002, -0.002});
  EXPECT_NEAR(held.sent().z, 2, 1e-9);
  put(0.001, 300);
  ck_assert_double_le(held.most_change(80), 2 * dt / 0.05);
  EXPECT_NEAR(held.sent().z, 3, 1e-9);
}
END_TEST

// The search of a mesh that has no end comes to one, and tells how wrong the force may be.
START_TEST(a_tick_has_an_end) {
  Held held("contact_centre");
  fs_object o = held.solid_mesh("ball", sphere_mesh(0.03, 300000));
  o.back = constant(FS_SENSE_ATTRACTIVE, 3);
  held.put(o, fs_contact{});
  held.place({0, 0, 0});
  held.step(60);
  fs_response felt{};
  OK(fs_scene_get_hand(held.scene.get(), nullptr, &felt, nullptr));
  ck_assert_double_gt(felt.error_bound, 0);
  ck_assert_double_ge(felt.error_bound, 3);
  ck_assert_uint_gt(stats_of(held.scene.get()).approximated, 0);
  const uint64_t before = stats_of(held.scene.get()).approximated;
  held.place({0.028, 0, 0});
  OK(fs_scene_get_hand(held.scene.get(), nullptr, &felt, nullptr));
  ck_assert_double_eq(felt.error_bound, 0);
  held.step(100);
  ck_assert_uint_le(stats_of(held.scene.get()).approximated, before + 20);
  const Tool tool = make_tool(held.scene.get());  // a tool of one's own is exact
  ck_assert_double_eq(evaluate(tool.get(), hand_at({0, 0, 0})).error_bound, 0);
}
END_TEST

// A hand behind an open sheet that lets it go feels nothing, and the report says so.
START_TEST(a_report_has_what_is_felt) {
  Held held("contact_report");
  held.place({0, 0, -0.004});
  held.put(held.solid_mesh("sheet", terrain_mesh(0.05, 0, 200)), solid(FS_KEEP_FRONT));
  held.step(80);
  EXPECT_VECTOR(held.sent(), (fs_vec3{}), 0);
  EXPECT_VECTOR(report_of(held.scene.get(), "sheet").wrench.force, (fs_vec3{}), 0);
  held.put(held.solid_mesh("box", box_mesh({0.05, 0.05, 0.02})), solid(FS_KEEP_FRONT, 500));
  held.step(80);
  EXPECT_NEAR(norm(held.sent()), 8, 1e-6);
  EXPECT_NEAR(norm(report_of(held.scene.get(), "box").wrench.force), 8, 1e-6);
  // Another that shares its proxy, and does not reach it: only one of them gives the force.
  held.put(held.solid_mesh("smaller box", box_mesh({0.05, 0.05, 0.01})), solid(FS_KEEP_FRONT, 500));
  held.step(80);
  EXPECT_NEAR(norm(held.sent()), 8, 1e-6);
  EXPECT_NEAR(norm(report_of(held.scene.get(), "box").wrench.force), 8, 1e-6);
  EXPECT_VECTOR(report_of(held.scene.get(), "smaller box").wrench.force, (fs_vec3{}), 1e-9);
}
END_TEST

// Another side to keep is felt within the blend, as if it had been kept from the start; also by a tool of one's own.
START_TEST(another_side_is_kept) {
  for (const bool is_plane : {true, false}) {
    for (const fs_keep before : {FS_KEEP_FRONT, FS_KEEP_BACK, FS_KEEP_EITHER}) {
      for (const fs_keep after : {FS_KEEP_FRONT, FS_KEEP_BACK}) {
        for (const double z : {0.004, -0.004}) {
          Held held("contact_sides", 0.02);
          fs_object o = is_plane ? fs_object_init("it", FS_PRIMITIVE_PLANE) : held.solid_mesh("it", box_mesh({0.05, 0.05, 0.02}));
          if (!is_plane) o.pose = at(0, 0, -0.02);
          held.place({0, 0, z});
          o.contact = solid(before, 500);
          held.put(o, o.contact);
          const Tool tool = make_tool(held.scene.get());
          evaluate(tool.get(), hand_at({0, 0, z}));
          held.step(80);
          o.contact.keep = after;
          OK(fs_object_change(held.scene.get(), &o, FS_PART_CONTACT));
          ck_assert_double_le(held.most_change(80), 1.1 * 2 / 0.02 * dt + 2 * dt / 0.05);
          const double force = after == FS_KEEP_FRONT ? std::max(0.0, -500 * z) : std::min(0.0, -500 * z);
          EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, force}), 1e-6);
          EXPECT_VECTOR(force_at(tool.get(), {0, 0, z}), (fs_vec3{0, 0, force}), 1e-6);
          held.place({0, 0, -z});
          held.step(40);
          const double other = after == FS_KEEP_FRONT ? std::max(0.0, 500 * z) : std::min(0.0, 500 * z);
          EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, other}), 1e-6);
        }
      }
    }
  }
}
END_TEST

// With more solids near than can be felt, those that hold the hand stay: another one that comes takes nothing from it.
START_TEST(of_too_many_solids_those_stay_that_hold) {
  Held held("contact_many");
  held.place({0, 0, 0.01});
  const auto add = [&](int i) {  // a plane far below, that never touches
    fs_object o = fs_object_init(("far " + std::to_string(i)).c_str(), FS_PRIMITIVE_PLANE);
    o.pose = at(0, 0, -1 - 0.001 * i);
    held.put(o, solid(FS_KEEP_FRONT));
  };
  for (int i = 0; i < 256; ++i) add(i);
  held.put(fs_object_init("floor", FS_PRIMITIVE_PLANE), solid(FS_KEEP_FRONT));
  held.step(80);
  for (int i = 128; i < 158; ++i) OK(fs_object_remove(held.scene.get(), ("far " + std::to_string(i)).c_str()));
  held.step(80);
  held.place({0, 0, -0.003});
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 3}), 1e-9);
  const double most = held.most_change(300, [&](int i) { add(300 + i); });  // some of them get rows that are free again
  ck_assert_double_le(most, 1e-9);
  EXPECT_VECTOR(held.sent(), (fs_vec3{0, 0, 3}), 1e-9);
  EXPECT_NEAR(report_of(held.scene.get(), "floor").wrench.force.z, 3, 1e-9);
}
END_TEST

// A mesh of very many triangles on a short way: the tests of the way have an end, and nothing lets the hand through meanwhile.
START_TEST(a_tick_among_solids_has_an_end) {
  Rig rig("contact_stack");
  MeshData stack;
  constexpr uint32_t sheets = 30000;
  for (uint32_t i = 0; i < sheets; ++i) {
    const double z = -1e-3 * i / sheets;
    for (const fs_vec3 p : {fs_vec3{-0.1, -0.1, z}, fs_vec3{0.1, -0.1, z}, fs_vec3{0, 0.1, z}}) stack.points.push_back(p);
    stack.triangles.insert(stack.triangles.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Shape shape = make_mesh(stack);
  fs_object o = fs_object_init("stack", FS_PRIMITIVE_MESH);
  o.shape = shape.get();
  o.contact = solid(FS_KEEP_FRONT);
  OK(fs_object_set(rig.scene.get(), &o));
  fs_servo_options options = virtual_options();
  options.rate = 20000;  // so a tick may test few ways
  options.fade = options.ramp = options.speed_limit = -1;
  rig.fake.state.pose = at(0, 0, 0.001);
  rig.start(options);
  rig.step(100);
  double least = 1e9;
  for (int i = 0; i < 50; ++i) {
    rig.fake.state.pose = at(1e-5 * i, 0, -0.002);
    rig.step(1);
    fs_response felt{};
    OK(fs_scene_get_hand(rig.scene.get(), nullptr, &felt, nullptr));
    least = std::min(least, felt.proxy.position.z);
  }
  ck_assert_double_ge(least, 0);
  ck_assert_double_ge(rig.sent().z, 2 - 1e-6);
  ck_assert_double_le(rig.sent().z, 3 + 1e-6);
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("contact");
  add_case(suite, "planes", {a_plane_holds_the_hand, the_slope_beside_a_profile, the_limit_holds_at_any_place,
                             each_side_can_be_kept, corners_hold_with_every_wall, the_softest_wall_has_a_proxy, shared_proxies});
  add_case(suite, "meshes", {a_box_is_solid, nothing_lets_through, a_hand_that_begins_inside_is_led_out,
                             a_hand_outside_of_a_room_is_led_back, a_mesh_with_split_corners_is_solid,
                             a_hand_that_begins_where_parts_cross_is_led_out,
                             a_hand_that_begins_below_a_narrow_wedge_is_led_out,
                             a_hand_that_begins_in_a_body_of_parts_is_led_out,
                             a_hand_that_begins_on_the_surface_is_held, a_vertex_does_not_hold,
                             limits_in_a_corner_make_no_energy, a_profile_beside_a_slope_makes_no_energy, sliding_over_a_mesh_makes_no_energy, open_meshes_have_rims,
                             letting_go_is_no_step, what_is_left_of_a_jump_stays_within_the_limit, a_profile_at_an_edge_is_no_step});
  add_case(suite, "forces", {friction_sticks_and_slips, damping_acts_on_approach_only, tools_of_several_points,
                             profiles_act_at_the_proxy, fields_of_solids});
  add_case(suite, "motion", {moving_objects_push, a_proxy_is_carried_without_rounding, a_crushed_hand_feels_each});
  add_case(suite, "servo", {solids_come_and_go_without_a_step, solids_that_share_a_proxy_fade,
                            a_hundred_solids_come_and_go_at_once, a_profile_above_a_solid_fades,
                            a_mesh_is_replaced_while_it_is_touched, a_mesh_that_sinks_takes_the_proxy_along,
                            a_sheet_that_rises_keeps_the_hand, a_tick_has_an_end, a_report_has_what_is_felt, another_side_is_kept,
                            of_too_many_solids_those_stay_that_hold, a_tick_among_solids_has_an_end});
  return run_suite(suite);
}
