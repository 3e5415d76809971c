// The blend of a repulsive force at ridges: ridge.h, mixture.h, and what evaluate_near makes of them.
#include "field/evaluate.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/mixture.h"
#include "shape/ridge.h"
#include "unit/count_allocations.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

Vec3 random_direction(Random& random) {
  return normalized(Vec3{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)});
}
Vec3 random_place(Random& random, Vec3 half) {
  return {random.between(-half.x, half.x), random.between(-half.y, half.y), random.between(-half.z, half.z)};
}

// A rectangle of n * m cells, seen from u x v.
void add_wall(Mesh& mesh, Vec3 from, Vec3 u, Vec3 v, int n, int m) {
  const auto first = static_cast<uint32_t>(mesh.points.size());
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= m; ++j) mesh.points.push_back(from + (double(i) / n) * u + (double(j) / m) * v);
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      const uint32_t a = first + static_cast<uint32_t>(i * (m + 1) + j), b = a + static_cast<uint32_t>(m) + 1;
      mesh.add(a, b, b + 1);
      mesh.add(a, b + 1, a + 1);
    }
  }
}
// Two walls of 0.1 m that meet at the z axis, open towards +x and +y.
Mesh corner(int n) {
  Mesh out;
  add_wall(out, {0, 0, -0.05}, {0, 0, 0.1}, {0.1, 0, 0}, n, n);
  add_wall(out, {0, 0, -0.05}, {0, 0.1, 0}, {0, 0, 0.1}, n, n);
  return out;
}

// A shape whose force is 4 N - 40 N/m d, and on a polyline no more than `slope` d.
struct Wall {
  fs_primitive primitive;
  Ref<const Shape> shape;
  double slope;  // that is allowed, N/m

  double intensity(const Closest& closest) const {
    const double force = std::fmax(0, 4 - 40 * closest.distance);
    return primitive == FS_PRIMITIVE_POLYLINE ? std::fmin(force, slope * closest.distance) : force;
  }
  Closest closest(Vec3 x) const {
    Closest out;
    ck_assert(closest_point(primitive, shape.get(), x, infinity, out));
    return out;
  }
  Vec3 raw(Vec3 x) const {
    const Closest c = closest(x);
    return intensity(c) * c.direction;
  }
  Vec3 blended(Vec3 x, bool* is_ridge = nullptr) const {
    const Closest c = closest(x);
    const double force = intensity(c);
    Ridge ridge;
    const bool is_blended = find_ridge(primitive, shape.get(), x, c, force / slope, ridge);
    if (is_ridge) *is_ridge = is_blended;
    return force * (is_blended ? ridge.direction : c.direction);
  }
};

// Goes along random ways of 1 mm in steps of 10 um, within `half` about `middle`, as long as the side is that of the first
// place. Nowhere the force is stronger than without blend, nor changes faster than `most` times the slope; it does without.
void check_ways(const Wall& wall, Vec3 middle, Vec3 half, Side side, double most = 1.1) {
  Random random(5);
  double steepest = 0, raw_steepest = 0;
  int ridges = 0, places = 0;
  for (int run = 0; run < 150; ++run) {
    Vec3 x = middle + random_place(random, half);
    constexpr double step = 1e-5;
    const Vec3 way = step * random_direction(random);
    if (wall.closest(x).side != side) continue;
    Vec3 force = wall.blended(x), raw = wall.raw(x);
    for (int i = 0; i < 100; ++i) {
      x += way;
      if (wall.closest(x).side != side) break;
      bool is_ridge;
      const Vec3 next = wall.blended(x, &is_ridge), next_raw = wall.raw(x);
      ck_assert(is_finite(next));
      ck_assert_double_le(norm(next), norm(next_raw) * (1 + 1e-12));
      if (!is_ridge) ck_assert(next == next_raw);
      steepest = std::fmax(steepest, norm(next - force) / step);
      raw_steepest = std::fmax(raw_steepest, norm(next_raw - raw) / step);
      ridges += is_ridge;
      ++places;
      force = next;
      raw = next_raw;
    }
  }
  ck_assert_int_gt(places, 1000);
  ck_assert_int_gt(ridges, 10);
  ck_assert_msg(steepest <= most * wall.slope, "%g N/m of %g", steepest, wall.slope);
  ck_assert_msg(raw_steepest >= 4 * wall.slope, "without blend only %g N/m", raw_steepest);
}

Ref<const Shape> zigzag() {
  std::vector<Vec3> points;
  for (int i = 0; i < 30; ++i) points.push_back({0.05 * std::cos(0.5 * i), 0.05 * std::sin(0.5 * i), 0.003 * i});
  return make_polyline(points.data(), points.size(), false);
}

}  // namespace

// What is least has no direction that would lower it, and no more than four parts.
START_TEST(a_mixture_is_least) {
  Random random(3);
  for (int run = 0; run < sanitized_times(500, 100000); ++run) {
    Mixture m;
    m.size = 1 + run % Mixture::most;
    for (int i = 0; i < m.size; ++i) {
      Vec3 v = random_place(random, {1, 1, 1});
      if (run & 8) v = {std::round(v.x), std::round(v.y), std::round(v.z)};  // several are equal, opposite or in a plane
      if (run & 16) v = Vec3{1, 0, 0} + 0.01 * v;
      m.directions[i] = v == Vec3{} ? Vec3{0, 0, 1} : normalized(v);
      m.costs[i] = run & 64 ? 1 : 30 + random.between(0, run & 32 ? 0.01 : 1);
    }
    m.mix();
    double sum = 0, level = 0;
    Vec3 mean{};
    for (int i = 0; i < m.size; ++i) {
      ck_assert_double_ge(m.parts[i], 0);
      sum += m.parts[i];
      mean += m.parts[i] * m.directions[i];
    }
    ck_assert_double_eq_tol(sum, 1, 1e-12);
    ck_assert_double_le(norm(mean - m.mean), 1e-12);
    ck_assert_int_le(m.count(), 4);
    for (int i = 0; i < m.size; ++i) level += m.parts[i] * (m.costs[i] + dot(m.directions[i], mean));
    for (int i = 0; i < m.size; ++i) ck_assert_double_ge(m.costs[i] + dot(m.directions[i], mean), level - 1e-10);
  }
}
END_TEST

// In a right angle: where the ridge begins to be felt, how the force turns, and what it is on the ridge.
START_TEST(a_corner_as_a_formula) {
  const Wall wall{FS_PRIMITIVE_MESH, corner(1).shape(), 2000};
  const double h = 0.02, force = 4 - 40 * h, l = force / 2000;
  for (const double side : {-2.0, -1.001, -0.999, -0.5, 0.0, 0.3, 0.999, 1.001}) {
    // y - x is l along the nearest wall's normal until that meets the diagonal.
    const double away = side * l;
    const Vec3 x{h + std::fmax(0, away), h + std::fmax(0, -away), 0.001};
    bool is_ridge;
    const long before = allocations;
    const Vec3 found = wall.blended(x, &is_ridge);
    ck_assert_int_eq(allocations - before, 0);
    const double part = std::fmax(0, (1 - std::fabs(side)) / 2);  // of the farther wall
    ck_assert(is_ridge == (part > 0));
    const Vec3 expected = side > 0 ? Vec3{part, 1 - part, 0} : Vec3{1 - part, part, 0};
    ck_assert_double_le(norm(found - force * expected), 1e-9);
  }
}
END_TEST

START_TEST(no_step_on_any_way) {
  const Ref<const Shape> box_shape = box({0.04, 0.03, 0.02}).shape(), torus_shape = torus(0.05, 0.02, 60, 30).shape();
  for (const double slope : {600.0, 3000.0}) {
    check_ways({FS_PRIMITIVE_MESH, corner(8).shape(), slope}, {0.01, 0.01, 0}, {0.01, 0.01, 0.01}, Side::front);
    check_ways({FS_PRIMITIVE_MESH, box_shape, slope}, {}, {0.022, 0.012, 0.002}, Side::back);
    check_ways({FS_PRIMITIVE_MESH, box_shape, slope}, {0.034, 0.024, 0.014}, {0.006, 0.006, 0.006}, Side::back);
    check_ways({FS_PRIMITIVE_MESH, torus_shape, slope}, {}, {0.005, 0.005, 0.02}, Side::front);
    check_ways({FS_PRIMITIVE_MESH, torus_shape, slope}, {0.05, 0, 0}, {0.003, 0.01, 0.003}, Side::back);
    // Two walls so near to each other that l reaches beyond them.
    check_ways({FS_PRIMITIVE_MESH, box({0.03, 0.03, 0.0004}).shape(), slope}, {}, {0.01, 0.01, 0.0004}, Side::back);
  }
}
END_TEST

// All of a sphere is equally near from its centre: more directions than can be kept, and none too many.
START_TEST(the_centre_of_a_sphere) {
  for (const int levels : {1, 3, 4}) {
    for (const double slope : {600.0, 3000.0}) {
      const Wall wall{FS_PRIMITIVE_MESH, sphere(0.03, levels).shape(), slope};
      // With the softer slope the way to y takes more searches than are made: what is left are steps of some mN.
      check_ways(wall, {}, {0.003, 0.003, 0.003}, Side::back, slope < 1000 ? 2 : 1.1);
      ck_assert_double_le(norm(wall.blended({})), 1e-3 * norm(wall.raw({})));
    }
  }
}
END_TEST

// Near a line the direction turns as fast as the slope allows already: together it is half more.
START_TEST(polylines) {
  const Vec3 corner_points[] = {{0.1, 0, 0}, {0, 0, 0}, {0, 0.1, 0}};
  for (const double slope : {600.0, 3000.0}) {
    const Wall wall{FS_PRIMITIVE_POLYLINE, make_polyline(corner_points, 3, false), slope};
    check_ways(wall, {0.01, 0.01, 0}, {0.01, 0.01, 0.001}, Side::front, 1.6);
    const Vec3 on_ridge = wall.blended({0.02, 0.02, 0});
    ck_assert_double_le(norm(on_ridge - 1.6 * Vec3{1, 1, 0}), 1e-9);  // 3.2 N, half along each normal
    check_ways({FS_PRIMITIVE_POLYLINE, zigzag(), slope}, {0, 0, 0.045}, {0.05, 0.05, 0.045}, Side::front, 1.6);
  }
  // A straight one, a point and a plane have no ridge.
  const Vec3 straight[] = {{0, 0, 0}, {0.1, 0, 0}, {0.2, 0, 0}};
  const Ref<const Shape> line = make_polyline(straight, 3, false);
  for (const fs_primitive primitive : {FS_PRIMITIVE_POINT, FS_PRIMITIVE_PLANE, FS_PRIMITIVE_POLYLINE}) {
    Closest c;
    Ridge ridge;
    ck_assert(closest_point(primitive, line.get(), {0.1, 0.01, 0.01}, infinity, c));
    ck_assert(!find_ridge(primitive, line.get(), {0.1, 0.01, 0.01}, c, 0.1, ridge));
  }
}
END_TEST

// Two triangles a wall or 10,000, the same force.
START_TEST(triangles_do_not_count) {
  const Wall coarse{FS_PRIMITIVE_MESH, corner(1).shape(), 1000}, fine{FS_PRIMITIVE_MESH, corner(70).shape(), 1000};
  ck_assert_uint_ge(fine.shape->triangles.size() / 3, 10000);
  Random random(9);
  int ridges = 0;
  const int runs = scenes::is_sanitized ? 100 : scenes::times(1000, 4000);
  for (int run = 0; run < runs; ++run) {
    const Vec3 x{random.between(0.0001, 0.03), random.between(0.0001, 0.03), random.between(-0.02, 0.02)};
    bool is_ridge;
    const Vec3 a = coarse.blended(x, &is_ridge), b = fine.blended(x);
    ck_assert_double_le(norm(a - b), 1e-4 * norm(coarse.raw(x)));
    ridges += is_ridge;
  }
  ck_assert_int_gt(10 * ridges, runs);
}
END_TEST

// A wall that ends counts as far as it goes.
START_TEST(a_short_wall) {
  Mesh mesh;
  add_wall(mesh, {-0.05, 0, -0.05}, {0, 0, 0.1}, {0.1, 0, 0}, 3, 3);
  add_wall(mesh, {0, 0, -0.05}, {0, 0.01, 0}, {0, 0, 0.1}, 5, 20);  // stands on it, 10 mm high
  for (const double slope : {600.0, 3000.0}) {
    check_ways({FS_PRIMITIVE_MESH, mesh.shape(), slope}, {0.01, 0.01, 0}, {0.003, 0.004, 0.02}, Side::front, 1.2);
  }
}
END_TEST

// With too few visits the force is the plain one; what the effort tells is the search before.
START_TEST(the_effort_ends) {
  const Ref<const Shape> shape = box({0.04, 0.03, 0.02}).shape();
  const Vec3 x{0.034, 0.0241, 0.0142};  // near a corner of three walls
  Closest closest;
  ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, closest));
  Ridge whole;
  ck_assert(find_ridge(FS_PRIMITIVE_MESH, shape.get(), x, closest, 0.001, whole));
  uint32_t needed = 0;
  bool was_plain = false;
  for (uint32_t visits = 0; needed == 0; ++visits) {
    Effort effort{.visits = visits, .most = 1000, .is_cut = false, .least = 0.25};
    Ridge ridge;
    if (find_ridge(FS_PRIMITIVE_MESH, shape.get(), x, closest, 0.001, ridge, nullptr, &effort)) {
      needed = visits;
      ck_assert(ridge.direction == whole.direction);
    }
    was_plain |= needed == 0;
    ck_assert(!effort.is_cut && effort.least == 0.25);
    ck_assert_uint_le(effort.visits, visits);
  }
  ck_assert(was_plain);
  ck_assert_uint_le(needed, 200);
}
END_TEST

// What is remembered changes the force by no more than what it is known to: along a way through a corner and away from it.
START_TEST(hints_change_nothing) {
  for (const Wall& wall : {Wall{FS_PRIMITIVE_MESH, corner(30).shape(), 1000}, Wall{FS_PRIMITIVE_MESH, sphere(0.03, 4).shape(), 2000},
                           Wall{FS_PRIMITIVE_MESH, torus(0.05, 0.02, 60, 30).shape(), 2000},
                           Wall{FS_PRIMITIVE_POLYLINE, zigzag(), 1000}}) {
    Random random(4);
    Hint hint;
    int ridges = 0, searches_saved = 0;
    const bool is_corner = wall.shape->triangles.size() == size_t{3} * 2 * 2 * 30 * 30;
    Vec3 x, way{};
    const int steps = scenes::is_sanitized ? 3000 : scenes::times(10000, 20000);
    for (int i = 0; i < steps; ++i) {
      if (i % (steps / 20) == 0) {  // elsewhere
        x = is_corner ? Vec3{random.between(0.001, 0.01), random.between(0.001, 0.01), 0} : random_place(random, {0.06, 0.06, 0.02});
        way = 2e-5 * random_direction(random);
      }
      x += way;
      Closest closest, ahead;
      ck_assert(closest_point(wall.primitive, wall.shape.get(), x, 1, closest));
      ck_assert(closest_point_ahead(wall.primitive, wall.shape.get(), x, 1, ahead, &hint, nullptr));
      ck_assert_double_eq_tol(ahead.distance, closest.distance, 1e-10);
      if (is_corner && closest.side == Side::back) continue;  // there are ways round its end
      ck_assert_double_le(norm(ahead.direction - closest.direction) * wall.intensity(closest), 1e-3);
      const double l = wall.intensity(closest) / wall.slope;
      searches_saved += l <= hint.free;
      Ridge cold, warm;
      const bool is_cold = find_ridge(wall.primitive, wall.shape.get(), x, ahead, l, cold);
      const bool is_warm = find_ridge(wall.primitive, wall.shape.get(), x, ahead, l, warm, &hint);
      const Vec3 difference = (is_cold ? cold.direction : ahead.direction) - (is_warm ? warm.direction : ahead.direction);
      ck_assert_double_le(norm(difference), 1e-3);
      ridges += is_cold;
    }
    ck_assert_int_gt(100 * ridges, steps);
    if (wall.primitive == FS_PRIMITIVE_MESH) ck_assert_int_gt(100 * searches_saved, steps);
  }
}
END_TEST

namespace {

// A snapshot of one object: two walls of some triangles with a force of 3 N, constant unless it falls by `fall` N/m from 3 N at
// 20 mm. A servo bounds its slope.
struct Scene {
  Ref<const Object> object;
  Snapshot snapshot;
  Scratches scratches;
  static constexpr double bound = 1000;  // N/m
  Ref<Memory> tools = make_ref<Memory>(), servos = make_ref<Memory>(Spread{});

  explicit Scene(fs_sense sense, double damping = 0, double fall = 0) {
    const Ref<const Shape> shape = corner(8).shape();
    fs_object o = fs_object_init("wall", FS_PRIMITIVE_MESH);
    o.shape = const_cast<fs_shape*>(shape.get());
    o.damping = damping;
    o.front = {FS_PROFILE_CONSTANT, sense, 3, 0, 0, 3, 0, nullptr, {}};
    if (fall > 0) o.front = {FS_PROFILE_LINEAR_DECREASING, sense, -fall, 3 + 0.02 * fall, 0, 100, 0, nullptr, {}};
    object = parse_object(o).object;
    Ref<Chunk> chunk = make_ref<Chunk>();
    chunk->sequence = chunk->rows_sequence = 1;
    chunk->own(0);
    chunk->own_caps();
    Row& row = chunk->set(0, object, bounded(*object, {.slope = bound}), Motion{}, 1);
    row.version = 1;
    row.is_in = true;
    snapshot.sequence = 1;
    Ref<Views> views = make_ref<Views>();
    views->rows[0].version = 1;
    snapshot.views = std::move(views);
    snapshot.chunks.set(0, std::move(chunk), 1);
    scratches.set(0, Scratch::of(*object), 1);
    for (const Ref<Memory>& memory : {tools, servos}) memory->make_room(0);
    servos->weight(0).set_up(1, false, 1);
    for (const Ref<Memory>& memory : {tools, servos}) memory->absorb(snapshot, 0);
  }
  static ToolState tool(Vec3 x) {
    fs_state state{};
    state.pose = {x, identity_quat()};
    return ToolState::at(state, ToolPoints{}, 0);
  }
  fs_response near(Vec3 x, double slope) {
    Memory& memory = slope < no_slope_limit ? *servos : *tools;
    return evaluate_near(scratches, memory, 0, 1, ToolPoints{}, tool(x));
  }
  ObjectForce alone(Vec3 x, double slope) const {
    ObjectForce out;
    ck_assert(evaluate_object(*object, Motion{}, 0, tool(x), nullptr, out, nullptr, nullptr, slope));
    return out;
  }
};

}  // namespace

// The sum of a scene and the object alone; only with a slope, and only what is repulsive.
START_TEST(objects) {
  Scene repulsive(FS_SENSE_REPULSIVE), attractive(FS_SENSE_ATTRACTIVE), damped(FS_SENSE_REPULSIVE, 1);
  const double slope = Scene::bound;
  for (double away = -0.005; away < 0.005; away += 0.00037) {
    const Vec3 x{0.02 + away, 0.02, 0.001};
    const fs_response out = repulsive.near(x, slope);
    const ObjectForce one = repulsive.alone(x, slope);
    ck_assert_uint_eq(out.felt_count, 1);
    ck_assert_double_le(norm(out.wrench.force - one.wrench.force), 1e-6);
    const bool is_ridge = std::fabs(away) < 0.003;
    const Vec3 plain = away > 0 ? Vec3{0, 3, 0} : Vec3{3, 0, 0};
    ck_assert((norm(out.wrench.force - plain) > 1e-6) == is_ridge);
    // The stiffness is the derivative.
    const double h = 1e-6;
    const Vec3 ways[] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    for (const Vec3& way : ways) {
      const Vec3 change = repulsive.near(x + way, slope).wrench.force - repulsive.near(x - way, slope).wrench.force;
      ck_assert_double_le(norm((0.5 / h) * change - (1 / h) * (out.stiffness * way)), 1e-2 * slope);
      ck_assert_double_le(norm((1 / h) * (out.stiffness * way - one.stiffness * way)), 1e-6 * slope);
    }
    for (const Vec3 force : {repulsive.near(x, no_slope_limit).wrench.force, repulsive.alone(x, no_slope_limit).wrench.force}) {
      ck_assert_double_le(norm(force - plain), 1e-12);
    }
    ck_assert(attractive.near(x, slope).wrench.force == attractive.near(x, no_slope_limit).wrench.force);
    ck_assert_double_le(norm(damped.near(x, slope).wrench.force - one.wrench.force), 1e-6);  // the tool stands
    ck_assert(attractive.alone(x, slope).wrench.force == attractive.alone(x, no_slope_limit).wrench.force);
  }
}
END_TEST

// The stiffness that is told at a ridge is the symmetric half of the derivative, also where the profile is sloped: for an object
// in lanes and for one that is evaluated alone.
START_TEST(stiffness_at_a_ridge) {
  Scene in_lanes(FS_SENSE_REPULSIVE, 0, 100), alone(FS_SENSE_REPULSIVE, 1e-12, 100);
  const double h = 1e-6;
  const Vec3 axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (Scene* scene : {&in_lanes, &alone}) {
    for (double away = -0.0015; away < 0.0015; away += 0.00037) {
      const Vec3 x{0.02 + away, 0.02, 0.001};
      const Mat3 told = scene->near(x, Scene::bound).stiffness;
      Mat3 change{};
      for (const Vec3& axis : axes) {
        const Vec3 by = scene->near(x + h * axis, Scene::bound).wrench.force - scene->near(x - h * axis, Scene::bound).wrench.force;
        change += outer((0.5 / h) * by, axis);
      }
      const Mat3 difference = 0.5 * (change + transposed(change)) + -1.0 * told;
      for (const Vec3& axis : axes) ck_assert_double_le(norm(difference * axis), 1e-3 * Scene::bound);
    }
  }
}
END_TEST

int main() {
  return run("ridge", {a_mixture_is_least, a_corner_as_a_formula, no_step_on_any_way, the_centre_of_a_sphere, polylines,
                       triangles_do_not_count, a_short_wall, the_effort_ends, hints_change_nothing, objects, stiffness_at_a_ridge});
}
