// Rows in lanes, which row an object gets, and planes that hold a point.
#include <cmath>
#include <cstring>
#include <set>

#include "base/processor.h"
#include "field/evaluate.h"
#include "field/lanes.h"
#include "field/proxy.h"
#include "force_fixtures.h"
#include "scene/row_space.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;
using namespace fs::test;

namespace {

Profile random_profile(Random& random) {
  Profile p;
  p.sense = random.coin(0.5) ? FS_SENSE_REPULSIVE : FS_SENSE_ATTRACTIVE;
  p.limit = std::pow(10.0, random.between(-2, 2));
  p.reach = random.coin(0.3) ? random.between(0, 0.2) : 0;
  switch (random.below(6)) {
    case 0: p.kind = FS_PROFILE_CONSTANT; p.gain = random.between(0, 3); break;
    case 1: p.kind = FS_PROFILE_LINEAR_INCREASING; p.gain = random.between(0, 300); p.offset = random.between(-5, 5); break;
    case 2: p.kind = FS_PROFILE_LINEAR_DECREASING; p.gain = random.between(-300, 0); p.offset = random.between(0, 5); break;
    case 3: p.kind = FS_PROFILE_GAUSSIAN; p.gain = random.between(0, 5); p.width = std::pow(10.0, random.between(-4, 0)); break;
    case 4: p.kind = FS_PROFILE_QUADRATIC; p.gain = random.between(-1e4, 1e4); p.offset = random.between(-1, 5); break;
    default: p.kind = FS_PROFILE_INVERSE; p.gain = random.between(0, 0.1); p.offset = random.between(-1, 1); break;
  }
  if (random.coin(0.05)) p.gain = 0;
  return p;
}

// A chunk of points with random profiles, some of them capped.
struct Points {
  Chunk chunk;
  explicit Points(Random& random) {
    const bool has_caps = random.coin();
    for (uint32_t i = 0; i < chunk_size; ++i) {
      fs_object o = fs_object_init(("p" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
      o.front = to_c(random_profile(random));
      Motion motion;
      motion.pose.position = {random.between(-0.1, 0.1), random.between(-0.1, 0.1), random.between(-0.1, 0.1)};
      chunk.own(i);
      chunk.edit_row(i).version = 1;
      const ParsedObject parsed = parse_object(o);
      Ref<const Object> felt;
      if (has_caps && random.coin()) {
        felt = bounded(*parsed.object, {.slope = random.log_between(5, 500)});
        if (random.coin(0.9)) chunk.own_caps();
      }
      const bool is_capped = felt && felt->law.front.cap;
      chunk.set(i, parsed.object, std::move(felt), motion, 1);
      if (is_capped && chunk.rows->points() >> i & 1) ++capped_count;
    }
  }
  int capped_count = 0;  // of those that are evaluated in lanes
};

}  // namespace

// Both widths give the same bits, and what they give is what one row after the other gives.
START_TEST(lanes_agree) {
  Random random(1);
  double worst = 0;
  int capped_count = 0;
  for (int run = 0; run < sanitized_times(60, 300); ++run) {
    const Points points(random);
    capped_count += points.capped_count;
    const Chunk& chunk = points.chunk;
    Weight weights[chunk_size];
    for (Weight& w : weights) w.set(random.coin(0.3) ? 1 : random.between(0, 1));
    const ToolPoints tool_points({{0, 0, 0}, {0.01, 0, 0.02}}, random.coin() ? 0 : random.log_between(1e-3, 0.1));
    fs_state state{};
    state.pose = identity_pose();
    state.pose.position = run % 5 ? Vec3{random.between(-0.1, 0.1), random.between(-0.1, 0.1), random.between(-0.1, 0.1)}
                                  : chunk.motion(7).pose.position;  // on a point
    const ToolState tool = ToolState::at(state, tool_points, 0);
    const uint64_t mask = chunk.rows->points() & (static_cast<uint64_t>(random.below(1u << 30)) << 34 | random.below(1u << 30));
    LaneSum wide, usual;
    uint64_t felt[2] = {};
    for (const bool is_wide : {true, false}) {
      allow_avx2(is_wide);
      for (unsigned k = 0; k < 2; ++k) {
        felt[is_wide] |= add_points(chunk, mask, tool.points[k].position, tool.point_radius, tool.points[k].arm, weights, 0.5,
                                     is_wide ? wide : usual);
      }
    }
    allow_avx2(true);
    ck_assert_int_eq(std::memcmp(&wide, &usual, sizeof wide), 0);
    ck_assert_uint_eq(felt[0], felt[1]);

    Wrench wrench{};
    Mat3 stiffness{};
    double size = 1e-12, stiffness_size = 1e-9;
    uint64_t felt_alone = 0;
    for (uint32_t i = 0; i < chunk_size; ++i) {
      ObjectForce one;
      if (!(mask >> i & 1) || !evaluate_object(chunk.row(i).as_felt(true), chunk.motion(i), 0, tool, nullptr, one)) continue;
      const double w = weights[i].value();
      wrench.force += w * one.wrench.force;
      wrench.torque += w * one.wrench.torque;
      stiffness += w * one.stiffness;
      size += w * norm(one.wrench.force);
      stiffness_size += std::fabs(one.stiffness.xx) + std::fabs(one.stiffness.yy) + std::fabs(one.stiffness.zz) + 1;
      if (!(one.wrench.force == Vec3{})) felt_alone |= uint64_t{1} << i;
    }
    const Vec3 difference = wide.wrench().force - wrench.force, turn = wide.wrench().torque - wrench.torque;
    worst = std::fmax(worst, norm(difference) / size);
    ck_assert_double_le(norm(difference), 1e-12 * size);
    ck_assert_double_le(norm(turn), 1e-12 * size);
    const Mat3 s = wide.stiffness() + -1.0 * stiffness;
    for (const double part : {s.xx, s.xy, s.xz, s.yx, s.yy, s.yz, s.zx, s.zy, s.zz}) {
      ck_assert_double_le(std::fabs(part), 1e-9 * stiffness_size);
    }
    ck_assert_uint_eq(felt[1], felt_alone);
  }
  ck_assert_double_gt(worst, 0);  // they are worked out differently
  ck_assert_int_gt(capped_count, 300);
}
END_TEST

// Objects of all kinds together: both widths give the same bits, and what they give is what one object
// after the other gives.
START_TEST(contacts_agree) {
  Random random(3);
  const Vec3 bend[]{{-0.03, 0, 0}, {0, 0.02, 0}, {0.03, 0, 0.01}, {0.05, 0, 0.03}};
  const Ref<const Shape> polyline = make_polyline(bend, 4, false), mesh = box({0.01, 0.02, 0.03}).shape();
  double worst = 0;
  for (int run = 0; run < sanitized_times(50, 200); ++run) {
    fs_scene* scene = nullptr;
    ck_assert_int_eq(fs_scene_create(&scene), FS_OK);
    fs_tool* tool = nullptr;
    ck_assert_int_eq(fs_tool_create(scene, nullptr, 0, &tool), FS_OK);
    fs_state state{};
    state.pose = {random.in_box(0.05), identity_quat()};
    if (run % 10 == 0) state.pose.position = {};  // on some of them
    const ToolState there = ToolState::at(state, ToolPoints(), 0);
    Wrench wrench{};
    Mat3 stiffness{};
    double size = 1e-12, stiffness_size = 1e-9;
    uint32_t felt = 0;
    ck_assert_int_eq(fs_scene_begin(scene), FS_OK);
    for (int i = 0; i < 100; ++i) {
      fs_object o = fs_object_init(("o" + std::to_string(i)).c_str(), static_cast<fs_primitive>(random.below(4)));
      o.pose = {i % 10 == 0 ? Vec3{} : random.in_box(0.05), exp_rotation(random.in_box(2))};
      o.front = to_c(random_profile(random));
      if (o.primitive == FS_PRIMITIVE_PLANE || o.primitive == FS_PRIMITIVE_MESH) o.back = to_c(random_profile(random));
      if (o.primitive == FS_PRIMITIVE_POLYLINE) o.shape = const_cast<fs_shape*>(polyline.get());
      if (o.primitive == FS_PRIMITIVE_MESH) o.shape = const_cast<fs_shape*>(mesh.get());
      ck_assert_int_eq(fs_object_set(scene, &o), FS_OK);
      const ParsedObject parsed = parse_object(o);
      Motion motion;
      motion.pose = parsed.pose;
      ObjectForce one;
      if (!evaluate_object(*parsed.object, motion, 0, there, nullptr, one)) continue;
      wrench.force += one.wrench.force;
      stiffness += one.stiffness;
      size += norm(one.wrench.force);
      stiffness_size += std::fabs(one.stiffness.xx) + std::fabs(one.stiffness.yy) + std::fabs(one.stiffness.zz) + 1;
      if (!(one.wrench.force == Vec3{})) ++felt;
    }
    ck_assert_int_eq(fs_scene_commit(scene), FS_OK);
    fs_response wide, usual;
    ck_assert_int_eq(fs_evaluate(tool, &state, &wide), FS_OK);
    allow_avx2(false);
    ck_assert_int_eq(fs_evaluate(tool, &state, &usual), FS_OK);
    allow_avx2(true);
    ck_assert_int_eq(std::memcmp(&wide, &usual, sizeof wide), 0);
    ck_assert_uint_eq(wide.felt_count, felt);
    const double deviation = norm(wide.wrench.force - wrench.force) / size;
    worst = std::fmax(worst, deviation);
    ck_assert_double_le(deviation, 1e-12);
    const Mat3 s = wide.stiffness + -1.0 * stiffness;
    for (const double part : {s.xx, s.xy, s.xz, s.yx, s.yy, s.yz, s.zx, s.zy, s.zz}) {
      ck_assert_double_le(std::fabs(part), 1e-9 * stiffness_size);
    }
    fs_tool_destroy(tool);
    fs_scene_destroy(scene);
  }
  ck_assert_double_gt(worst, 0);  // they are worked out differently
}
END_TEST

// ClosestPoints with capped profiles and others, in lanes and one by one.
START_TEST(capped_contacts_agree) {
  Random random(4);
  for (int run = 0; run < sanitized_times(100, 1000); ++run) {
    Profile profiles[chunk_size];
    const double radius = random.coin() ? 0 : random.log_between(1e-3, 0.1);
    double distances[chunk_size], wanted = 0, size = 1e-12, stiffness = 0, stiffness_size = 1e-9;
    LaneSum sums[2];
    uint64_t felt[2], felt_alone = 0;
    for (uint32_t i = 0; i < chunk_size; ++i) {
      Law law;
      law.front = random_profile(random);
      if (random.coin()) law.back = random_profile(random);
      if (random.coin()) law = capped(law, random.log_between(5, 500));
      profiles[i] = law.front;
      distances[i] = random.log_between(1e-4, 0.2);
      const Intensity f = evaluate(profiles[i], nullptr, distances[i], 0, radius);
      const double sign = profiles[i].sense == FS_SENSE_REPULSIVE ? 1 : -1;
      wanted += sign * f.force;
      size += f.force;
      stiffness += sign * f.slope;
      stiffness_size += std::fabs(f.slope);
      if (f.force > 0) felt_alone |= uint64_t{1} << i;
    }
    for (const bool is_wide : {false, true}) {
      allow_avx2(is_wide);
      ClosestPoints contacts;
      for (uint32_t i = 0; i < chunk_size; ++i) {
        contacts.add(i, {.direction = {1, 0, 0}, .tangent = {}, .distance = distances[i], .is_turning = false,
                         .law = &profiles[i], .weight = 1, .arm = {}});
      }
      felt[is_wide] = contacts.take(radius, sums[is_wide]);
    }
    allow_avx2(true);
    ck_assert_int_eq(std::memcmp(&sums[0], &sums[1], sizeof sums[0]), 0);
    ck_assert_double_le(std::fabs(sums[0].wrench().force.x - wanted), 1e-12 * size);
    ck_assert_double_le(std::fabs(sums[0].stiffness().xx - stiffness), 1e-9 * stiffness_size);
    ck_assert_uint_eq(felt[0], felt_alone);
  }
}
END_TEST

// A row is never given twice, chunks are full enough, and what was released is used again.
START_TEST(rows_are_given_among_neighbours) {
  Random random(2);
  for (int way = 0; way < 5; ++way) {
    RowSpace space;
    std::set<uint32_t> taken;
    const int count = 30000;
    const auto position = [&](int i) {
      const double x = 1e-5 * i;
      return way == 0 ? Vec3{random.between(-0.1, 0.1), random.between(-0.1, 0.1), random.between(-0.1, 0.1)}
             : way == 1 ? Vec3{-x, -x, -x} : way == 2 ? Vec3{x, 0, 0} : way == 3 ? Vec3{} : Vec3{1e300, -1e300, x};
    };
    const double size = way == 3 ? never : 0.005;
    for (int i = 0; i < count; ++i) {
      const uint32_t row = space.find(position(i), size, 0);
      ck_assert(taken.insert(row).second);
      space.take(row);
    }
    ck_assert_uint_le(space.chunks_end(), count / 64 * 5 / 4 + 1);
    const uint32_t before = space.chunks_end();
    uint64_t sequence = 0, used = 0;
    for (int i = 0; i < 3 * count; ++i) {  // some go, others come
      const auto gone = std::next(taken.begin(), random.below(20));
      space.release(*gone, ++sequence);
      taken.erase(gone);
      if (random.coin(0.1)) used = sequence;
      const uint32_t row = space.find(position(i), size, used);
      ck_assert(taken.insert(row).second);
      space.take(row);
    }
    ck_assert_uint_le(space.chunks_end(), 2 * before);
    for (const uint32_t row : taken) space.release(row, ++sequence);
    ck_assert_uint_lt(space.find({}, size, sequence), chunk_size);  // in the first chunk
  }
}
END_TEST

// The nearest allowed place is the one to which planes that touch it push, and none of them pulls.
START_TEST(planes_hold_at_the_nearest_place) {
  Random random(21);
  int held = 0;
  for (int i = 0; i < 20000; ++i) {
    Planes all;
    all.plane_count = 1 + static_cast<uint32_t>(random.below(3));
    const Vec3 hand = random.in_box(1);
    for (uint32_t k = 0; k < all.plane_count; ++k) {
      const Vec3 normal = random.direction();
      all.planes[k] = {normal, dot(normal, hand) + random.between(k == 0 ? 0 : -1, 1), 0, k};
    }
    Planes by = all;
    Vec3 goal{};
    if (!by.hold(hand, goal)) continue;
    ++held;
    ck_assert(by.plane_count >= 1 && by.plane_count <= all.plane_count);
    for (uint32_t k = 0; k < all.plane_count; ++k) ck_assert_double_ge(dot(all.planes[k].normal, goal) - all.planes[k].offset, -1e-9);
    Vec3 pushed = hand;
    for (uint32_t k = 0; k < by.plane_count; ++k) {
      ck_assert_double_ge(by.pushes[k], 0);
      ck_assert_double_eq(by.planes[k].offset, all.planes[by.planes[k].member].offset);
      pushed += by.pushes[k] * by.planes[k].normal;
      const double rounding = 1e-9 * (1 + norm(goal));
      ck_assert_double_le(std::fabs(dot(by.planes[k].normal, goal) - by.planes[k].offset), rounding);
    }
    ck_assert(pushed == goal || norm(pushed - goal) <= 1e-12 * norm(goal));
  }
  ck_assert_int_gt(held, 18000);
}
END_TEST

int main() {
  return run("field", {lanes_agree, contacts_agree, capped_contacts_agree, rows_are_given_among_neighbours,
                       planes_hold_at_the_nearest_place});
}
