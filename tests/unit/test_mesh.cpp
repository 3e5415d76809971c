// The closest point of a mesh against every triangle in 113-bit arithmetic, and its sides.
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <thread>

#include "base/processor.h"
#include "math/quad.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/mesh/mesh_union.h"
#include "shape/primitive.h"
#include "shape/triangle.h"
#include "unit/count_allocations.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double epsilon = std::numeric_limits<double>::epsilon();

// --- The reference: another method than the library's, in numbers of 113 bits.

namespace reference {

struct Quad3 {
  Quad x, y, z;
};
Quad3 wide(Vec3 v) { return {v.x, v.y, v.z}; }
Quad3 operator-(Quad3 a, Quad3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Quad dot(Quad3 a, Quad3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Quad3 cross(Quad3 a, Quad3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

Quad squared_to_segment(Quad3 x, Quad3 a, Quad3 b) {
  const Quad3 ab = b - a, ax = x - a;
  const Quad length = dot(ab, ab);
  Quad t = length > 0 ? dot(ax, ab) / length : Quad(0);
  t = t < 0 ? Quad(0) : t > 1 ? Quad(1) : t;
  const Quad3 r{ax.x - t * ab.x, ax.y - t * ab.y, ax.z - t * ab.z};
  return dot(r, r);
}

Quad squared_to_triangle(Quad3 x, Quad3 a, Quad3 b, Quad3 c) {
  const Quad3 n = cross(b - a, c - a);
  const Quad area = dot(n, n);
  if (area > 0 && dot(cross(b - a, x - a), n) >= 0 && dot(cross(c - b, x - b), n) >= 0 &&
      dot(cross(a - c, x - c), n) >= 0) {
    const Quad height = dot(x - a, n);
    return height * height / area;
  }
  Quad least = squared_to_segment(x, a, b);
  for (const Quad other : {squared_to_segment(x, b, c), squared_to_segment(x, c, a)}) {
    if (other < least) least = other;
  }
  return least;
}

}  // namespace reference

double reference_distance(const Mesh& m, Vec3 x) {
  using namespace reference;
  Quad least = -1;
  for (size_t t = 0; t < m.count(); ++t) {
    const auto [a, b, c] = m.corners(t);
    const Quad here = squared_to_triangle(wide(x), wide(a), wide(b), wide(c));
    if (least < 0 || here < least) least = here;
  }
  return static_cast<double>(std::sqrt(static_cast<long double>(least)));
}

// All triangles in order with the library's own distance function: the tree must give the same bits and index.
std::pair<double, uint32_t> all_in_order(const Mesh& m, Vec3 x) {
  double least = infinity;
  uint32_t index = 0;
  for (size_t i = 0; i < m.count(); ++i) {
    const auto [a, b, c] = m.corners(i);
    const Nearest here = nearest_on_triangle(a - x, b - x, c - x);
    if (here.squared < least) {
      least = here.squared;
      index = static_cast<uint32_t>(i);
    }
  }
  return {std::sqrt(least), index};
}

double size_of(const Mesh& m) {
  double longest = 0;
  for (size_t t = 0; t < m.count(); ++t) {
    const auto [a, b, c] = m.corners(t);
    longest = std::fmax(longest, std::fmax(std::fmax(norm(b - a), norm(c - b)), norm(a - c)));
  }
  return longest;
}

void check_hit(const Closest& hit, Vec3 x, double scale) {
  ck_assert(is_finite(hit.point) && is_finite(hit.direction) && is_finite(hit.tangent));
  ck_assert_double_eq_tol(norm(hit.direction), 1, 1e-12);
  ck_assert_double_eq_tol(norm(hit.tangent), hit.feature == Feature::edge ? 1 : 0, 1e-12);
  ck_assert(hit.distance > 0 || hit.side == Side::front);
  if (hit.distance > 1e-3 * scale) {
    // Point, distance and direction agree with each other.
    const Vec3 back = hit.point + hit.distance * hit.direction;
    ck_assert_double_le(norm(back - x), 1e-9 * scale + 8 * epsilon * largest_coordinate(x));
  }
}

void ck_assert_same(const Closest& a, const Closest& b) {
  ck_assert(a.point == b.point && a.distance == b.distance && a.direction == b.direction && a.tangent == b.tangent);
  ck_assert(a.side == b.side && a.feature == b.feature && a.triangle == b.triangle);
}

// The closest point does not depend on the width of the vectors, on a hint or on the range within which it is searched.
void check_ways(const Shape& shape, Vec3 x, const Closest& hit, Random& random) {
  Closest other;
  allow_avx2(false);
  ck_assert(closest_point(FS_PRIMITIVE_MESH, &shape, x, infinity, other));
  allow_avx2(true);
  ck_assert_same(hit, other);
  Hint hint;
  hint.triangle = static_cast<uint32_t>(random.below(shape.triangles.size() / 3));
  const double range = std::fmax(hit.distance, 1e-15 * largest_coordinate(x)) * random.between(1, 1.5);
  if (hit.distance > 0) {  // else the distance that is compared with the range is what was rounded to 0
    ck_assert(closest_point(FS_PRIMITIVE_MESH, &shape, x, range, other, &hint));
    ck_assert_same(hit, other);
    ck_assert_uint_eq(hint.triangle, hit.triangle);
  }
}

// Compares the tree with the reference for points near and far from the mesh; returns the largest deviation in units of
// the rounding of the sizes involved.
double compare(const Mesh& m, uint64_t seed, int count) {
  Random random(seed);
  const Ref<const Shape> shape = m.shape();
  const double size = size_of(m);
  double worst = 0;
  for (int i = 0; i < count; ++i) {
    const size_t t = random.below(m.count());
    const double u = random.between(0, 1), v = random.between(0, 1 - u);
    const auto [a, b, c] = m.corners(t);
    const double away = size * std::pow(10, random.between(-9, 1.5));
    Vec3 x = a + u * (b - a) + v * (c - a) + away * random.direction();
    if (i % 10 == 0) x = a;
    if (i % 10 == 1) x = a + 0.5 * (c - a);
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    const auto [distance, index] = all_in_order(m, x);
    const double zero = coordinate_rounding(std::fmax(largest_coordinate(x), largest_coordinate(a)) + size);
    ck_assert_msg(hit.distance == distance || (hit.distance == 0 && distance <= zero), "%.17g is not %.17g",
                  hit.distance, distance);
    ck_assert_uint_eq(hit.triangle, index);
    check_hit(hit, x, size);
    check_ways(*shape, x, hit, random);
    const double exact = reference_distance(m, x);
    worst = std::fmax(worst, std::fabs(distance - exact) / (epsilon * (size + exact)));
  }
  return worst;
}

Mesh random_triangles(Random& random, size_t count, double spread, double size) {
  Mesh m;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 center = random.in_box(spread);
    for (int k = 0; k < 3; ++k) m.points.push_back(center + random.in_box(size));
    m.add(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return m;
}

Mesh needles(Random& random, size_t count, double width) {
  Mesh m;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 a = random.in_box(1), b = a + random.direction();
    const Vec3 middle = i % 2 ? a : a + random.between(0, 1) * (b - a);  // needles and caps
    m.points.insert(m.points.end(), {a, b, middle + width * random.direction()});
    m.add(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return m;
}

// --- Tests.

START_TEST(matches_the_reference) {
  Random random(1);
  double worst = compare(sphere(0.1, 3), 2, times(100, 400));
  worst = std::fmax(worst, compare(torus(0.1, 0.03, 24, 12), 3, times(80, 300)));
  worst = std::fmax(worst, compare(box({0.1, 0.2, 0.3}), 4, times(500, 2000)));
  worst = std::fmax(worst, compare(random_triangles(random, 300, 1, 0.2), 5, times(100, 400)));
  worst = std::fmax(worst, compare(random_triangles(random, 5, 1, 1), 6, times(500, 2000)));
  for (const double width : {1e-3, 1e-6, 1e-9, 1e-12, 1e-15}) {
    worst = std::fmax(worst, compare(needles(random, 60, width), 7, times(250, 1000)));
  }
  if (std::getenv("VERBOSE")) std::printf("largest deviation: %.2f rounding units\n", worst);
  ck_assert_double_le(worst, 4);
}
END_TEST

START_TEST(matches_the_reference_far_away) {
  Random random(11);
  double worst = 0;
  for (const Vec3 where : {Vec3{1e6, 0, 0}, Vec3{5e5, 4.6e6, 1500}, Vec3{-1e6, 1e6, 1e6}, Vec3{1e9, 0, 1e9}}) {
    worst = std::fmax(worst, compare(moved(sphere(0.1, 2), where), 12, times(100, 300)));
    worst = std::fmax(worst, compare(moved(box({0.1, 0.2, 0.3}), where), 13, times(150, 500)));
    worst = std::fmax(worst, compare(moved(random_triangles(random, 100, 1, 0.2), where), 14, times(70, 200)));
  }
  if (std::getenv("VERBOSE")) std::printf("largest deviation: %.2f rounding units\n", worst);
  ck_assert_double_le(worst, 4);
}
END_TEST

START_TEST(takes_bad_meshes) {
  Random random(21);
  Mesh m = random_triangles(random, 60, 1, 0.3);
  const uint32_t count = static_cast<uint32_t>(m.points.size());
  for (int i = 0; i < 40; ++i) {
    const auto any = [&] { return static_cast<uint32_t>(random.below(count)); };
    const uint32_t a = any(), b = any();
    switch (i % 4) {
      case 0: m.add(a, b, any()); break;                               // non-manifold
      case 1: m.add(a, a, b); break;                                   // a segment
      case 2: m.add(a, a, a); break;                                   // a point
      case 3: m.repeat(10); break;                                     // duplicates
    }
  }
  for (int i = 0; i < 10; ++i) {  // collinear, by different points
    const uint32_t a = static_cast<uint32_t>(m.points.size());
    const Vec3 p = random.in_box(1), q = random.in_box(1);
    m.points.insert(m.points.end(), {p, p + 0.25 * q, p + q});
    m.add(a, a + 1, a + 2);
    m.add(a, a + 2, a + 1);
  }
  ck_assert_double_le(compare(m, 22, times(250, 800)), 4);

  Mesh only_degenerate;
  only_degenerate.points = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  only_degenerate.triangles = {0, 1, 2, 0, 0, 1, 1, 1, 1};
  ck_assert_double_le(compare(only_degenerate, 23, 300), 4);
  Closest hit;
  ck_assert(closest_point(FS_PRIMITIVE_MESH, only_degenerate.shape().get(), {0.5, 0, 0}, infinity, hit));
  ck_assert_double_eq(hit.distance, 0);
  ck_assert_double_eq(hit.direction.z, 1);

  Mesh tiny;  // whose squares underflow
  tiny.points = {{0, 0, 0}, {1e-170, 0, 0}, {0, 1e-200, 0}, {1e-320, 1e-310, 1e-170}};
  tiny.triangles = {0, 1, 2, 1, 2, 3, 0, 1, 3};
  const Ref<const Shape> shape = tiny.shape();
  for (int i = 0; i < 300; ++i) {
    const Vec3 x = std::pow(10, random.between(-200, 149)) * random.direction();
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    check_hit(hit, x, infinity);
  }
}
END_TEST

START_TEST(all_sizes_in_one_mesh) {
  Random random(25);
  for (const Vec3 where : {Vec3{0, 0, 0}, Vec3{5e5, 4.6e6, 1500}}) {
    Mesh m;
    for (uint32_t i = 0; i < 300; ++i) {
      const Vec3 a = where + random.log_between(1e-6, 1) * random.direction();
      const double size = random.log_between(1e-9, 3);
      m.points.insert(m.points.end(), {a, a + size * random.direction(), a + random.log_between(1e-3, 1) * size * random.direction()});
      m.add(3 * i, 3 * i + 1, 3 * i + 2);
    }
    ck_assert_double_le(compare(m, 26, times(300, 1000)), 4);
  }
}
END_TEST

// A hint tells for how long nothing has to be searched; that changes nothing either.
START_TEST(hints_make_no_difference) {
  Random random(27);
  const Ref<const Shape> shape = moved(sphere(0.1, 5), {0.3, 0.2, 0.1}).shape();
  int near = 0, searched = 0;
  const int count = times(20000, 200000);
  Hint hint;
  Vec3 x{0.3, 0.2, 0.35}, velocity{};
  for (int i = 0; i < count; ++i) {
    velocity = 0.99 * velocity + 1e-5 * random.direction();
    x += velocity + 1e-3 * (Vec3{0.3, 0.2, 0.1} - x);
    if (i % 1000 == 0) x = Vec3{0.3, 0.2, 0.1} + random.in_box(0.3);  // it jumps
    const double range = i / 5000 % 2 ? 0.01 : 0.03;
    Closest cold, warm;
    const Vec3 before = hint.from;
    const bool is_near = closest_point(FS_PRIMITIVE_MESH, shape.get(), x, range, cold);
    ck_assert(is_near == closest_point(FS_PRIMITIVE_MESH, shape.get(), x, range, warm, &hint));
    if (is_near) ck_assert_same(cold, warm);
    near += is_near;
    searched += !is_near && !(hint.from == before);
  }
  if (std::getenv("VERBOSE")) std::printf("near %d, searched %d of the others, of %d\n", near, searched, count);
  ck_assert_int_gt(near, count / 20);
  ck_assert_int_lt(near, count * 19 / 20);
  ck_assert_int_lt(searched, (count - near) / 5);
}
END_TEST

START_TEST(a_search_can_be_cut) {
  const Ref<const Shape> shape = sphere(1, 6).shape();
  Random random(28);
  const int count = scenes::is_sanitized ? 200 : 2000;
  int cut = 0;
  for (int i = 0; i < count; ++i) {
    const Vec3 x = i % 4 == 0 ? 1e-6 * random.direction() : random.in_box(1.5);
    Closest exact, hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, exact));
    const auto visits = static_cast<uint32_t>(random.below(60));
    Effort effort{.visits = visits};
    const bool is_found = closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit, nullptr, &effort);
    ck_assert_double_le(effort.least, exact.distance * (1 + 1e-12));
    if (effort.is_cut) {
      ck_assert_uint_eq(effort.visits, 0);
      if (is_found) ck_assert_double_ge(hit.distance, exact.distance);
      ++cut;
    } else {
      ck_assert(is_found);
      ck_assert_same(hit, exact);
      ck_assert_double_eq(effort.least, exact.distance);
    }
  }
  ck_assert_int_gt(cut, count / 4);
  ck_assert_int_lt(cut, count);
}
END_TEST

START_TEST(ties_go_to_the_lowest_index) {
  // The centre of a sphere whose triangles occur twice; a vertex that all triangles share; copies of one triangle.
  Mesh m = sphere(1, 3);
  const std::vector<uint32_t> once = m.triangles;
  m.repeat(m.count());
  const Ref<const Shape> shape = m.shape();
  Random random(31);
  for (int i = 0; i < 300; ++i) {
    Vec3 x = i == 0 ? Vec3{0, 0, 0} : random.in_box(2);
    if (i % 3 == 1) x = 1.5 * m.points[random.below(m.points.size())];
    if (i % 3 == 2) {
      const size_t t = random.below(once.size() / 3);
      x = 1.5 * (0.5 * (m.points[once[3 * t]] + m.points[once[3 * t + 1]]));
    }
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    ck_assert_uint_eq(hit.triangle, all_in_order(m, x).second);
    ck_assert_uint_lt(hit.triangle, once.size() / 3);
  }
  Mesh fan;
  fan.points = {{0, 0, 0}};
  for (uint32_t i = 0; i < 100; ++i) {
    const double u = 0.06 * (99 - i);
    fan.points.push_back({std::cos(u), std::sin(u), -1});
    if (i > 0) fan.add(0, i, i + 1);
  }
  Closest hit;
  ck_assert(closest_point(FS_PRIMITIVE_MESH, fan.shape().get(), {0, 0, 1}, infinity, hit));
  ck_assert_uint_eq(hit.triangle, 0);
  ck_assert(hit.feature == Feature::vertex);

  // The box of the second triangle is nearer than that of the first, but the triangles are equally near.
  Mesh two;
  two.points = {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}, {3, 0, 4}, {1, 0, 6}, {1, 1, 6}};
  two.triangles = {0, 1, 2, 3, 4, 5};
  ck_assert(closest_point(FS_PRIMITIVE_MESH, two.shape().get(), {0, 0, 0}, infinity, hit));
  ck_assert_double_eq(hit.distance, 5);
  ck_assert_uint_eq(hit.triangle, 0);
}
END_TEST

START_TEST(respects_the_largest_distance) {
  const Ref<const Shape> shape = sphere(1, 3).shape();
  Random random(41);
  for (int i = 0; i < 300; ++i) {
    const Vec3 x = random.in_box(2);
    Closest hit, other;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, hit.distance, other));
    ck_assert(other.distance == hit.distance && other.triangle == hit.triangle && other.direction == hit.direction);
    other.distance = -7;
    ck_assert(!closest_point(FS_PRIMITIVE_MESH, shape.get(), x, std::nextafter(hit.distance, 0), other));
    ck_assert(!closest_point(FS_PRIMITIVE_MESH, shape.get(), x, -1, other));
    ck_assert_double_eq(other.distance, -7);
  }
  Closest hit;
  for (const double bad : {std::nan(""), infinity, -infinity, 1e200}) {
    ck_assert(!closest_point(FS_PRIMITIVE_MESH, shape.get(), {0, bad, 0}, infinity, hit));
  }
}
END_TEST

void check_sides(const Mesh& m, uint64_t seed, double size, const std::function<double(Vec3)>& outside) {
  const Ref<const Shape> shape = m.shape();
  Random random(seed);
  for (int i = 0; i < sanitized_times(1000, 4000); ++i) {
    // About half of the points over an edge or a vertex.
    const auto [a, b, c] = m.corners(random.below(m.count()));
    const double u = random.between(0, 1), v = random.between(0, 1 - u), w = random.between(0, 1);
    const Vec3 base = i % 4 == 0 ? a : i % 4 == 1 ? a + w * (b - a) : a + u * (b - a) + v * (c - a);
    const Vec3 x = base + size * std::pow(10, random.between(-6, 0)) * random.direction();
    const double level = outside(x);
    if (std::fabs(level) < 1e-12) continue;
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    ck_assert_msg((hit.side == Side::front) == (level > 0), "wrong side at %.17g %.17g %.17g: level %g, feature %d",
                  x.x, x.y, x.z, level, static_cast<int>(hit.feature));
  }
}

// How far x is outside of a convex mesh, by the planes of its triangles; below 0: inside.
double outside_planes(const Mesh& m, Vec3 x) {
  double level = -infinity;
  for (size_t t = 0; t < m.count(); ++t) {
    const auto [a, b, c] = m.corners(t);
    level = std::fmax(level, dot(x - a, triangle_normal(a, b, c)));
  }
  return level;
}

double outside_box(Vec3 half, Vec3 x) {
  return std::fmax(std::fmax(std::fabs(x.x) - half.x, std::fabs(x.y) - half.y), std::fabs(x.z) - half.z);
}

// Inside when the solid angle of the triangles is 4 pi (Van Oosterom & Strackee 1983): positive outside.
double by_solid_angle(const Mesh& m, Vec3 x) {
  double angle = 0;
  for (size_t t = 0; t < m.count(); ++t) {
    const Mesh::Corners at = m.corners(t);
    const Vec3 a = at.a - x, b = at.b - x, c = at.c - x;
    const double la = norm(a), lb = norm(b), lc = norm(c);
    angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return 0.5 - std::fabs(angle) / (4 * std::numbers::pi);
}

START_TEST(sides_of_closed_meshes) {
  const Mesh cube = box({1, 2, 3});
  const auto outside_cube = [](Vec3 x) { return outside_box({1, 2, 3}, x); };
  check_sides(cube, 51, 1, outside_cube);
  check_sides(soup(cube), 52, 1, outside_cube);
  for (const double height : {1.0, 0.1, 0.01}) {  // edges of down to 1 degree
    const Mesh sharp = blade(height);
    const auto outside = [&](Vec3 x) { return outside_planes(sharp, x); };
    check_sides(sharp, 53, 1, outside);
    check_sides(soup(sharp), 54, 1, outside);
  }
  const Mesh ring = turned(torus(1, 0.4, 16, 7), normalized(Quat{1, 2, 3, 4}));
  check_sides(ring, 55, 0.5, [&](Vec3 x) {
    const double level = by_solid_angle(ring, x);
    return std::fabs(level) > 0.4 ? level : 0;  // nearer than the angle can tell
  });
  const Mesh ball = sphere(1, 3);
  check_sides(ball, 56, 0.5, [&](Vec3 x) {
    const double level = by_solid_angle(ball, x);
    return std::fabs(level) > 0.4 ? level : 0;
  });
}
END_TEST

START_TEST(sides_with_degenerate_and_duplicate_triangles) {
  const auto outside_cube = [](Vec3 x) { return outside_box({1, 1, 1}, x); };
  Mesh m = box({1, 1, 1});
  // A triangle twice and one collapsed to an edge, before all the others.
  const uint32_t more[] = {0, 2, 1, 0, 2, 2, 5, 7, 6};
  m.triangles.insert(m.triangles.begin(), more, more + 9);
  check_sides(m, 61, 1, outside_cube);

  // Two triangles with a repeated corner, one of them on an edge of the cube or on a way through it, the other on any such way.
  for (const uint32_t other : {1u, 3u, 7u}) {
    for (uint32_t third = 1; third < 8; ++third) {
      Mesh needles = box({1, 1, 1});
      for (const uint32_t corner : {0u, 0u, other, 0u, 0u, third}) needles.triangles.push_back(corner);
      check_sides(needles, 65, 1, outside_cube);
      check_sides(soup(needles), 66, 1, outside_cube);
    }
  }

  // A blade whose sharpest edge is split on one side only; a triangle without area fills the gap.
  const Mesh sharp = blade(0.05);
  const auto outside = [&](Vec3 x) { return outside_planes(sharp, x); };
  for (uint32_t turn = 0; turn < 3; ++turn) {
    Mesh split = sharp;
    split.points.push_back({0.25, 0, 0});  // on the edge 0-1
    // The one without area runs 0-1 against the bottom's 1-0, and 1-4, 4-0 against the top's 4-1, 0-4.
    const uint32_t flat[] = {0, 1, 4};
    split.triangles = {flat[turn], flat[(turn + 1) % 3], flat[(turn + 2) % 3],
                       0, 2, 1, 0, 4, 3, 4, 1, 3, 1, 2, 3, 2, 0, 3};
    fs_shape_info info = fs_shape_info_init();
    split.shape()->get_info(info);
    ck_assert(info.closed);
    ck_assert_uint_eq(info.degenerate, 1);
    check_sides(split, 62, 1, outside);
    check_sides(soup(split), 63, 1, outside);
    // Right over the point within the edge.
    const Ref<const Shape> shape = split.shape();
    for (double angle = 0.01; angle < 6.28; angle += 0.01) {
      const Vec3 x{0.25, 0.1 * std::cos(angle), 0.1 * std::sin(angle)};
      Closest hit;
      ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
      ck_assert((hit.side == Side::front) == (outside(x) > 0));
    }
  }
  Mesh twice = sharp;
  twice.repeat(2);
  twice.repeat(1);
  check_sides(twice, 64, 1, outside);
}
END_TEST

// A triangle without area on the rim of a surface does not continue it.
START_TEST(a_rim_with_a_degenerate_triangle) {
  for (const Vec3 third : {Vec3{0.04, 0, 0}, Vec3{0.15, 0, 0}, Vec3{0.1, 0, 0}}) {
    Mesh m;
    m.points = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, third};
    m.triangles = {0, 1, 2, 1, 0, 3};
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, m.shape().get(), {0.05, -0.01, 0.01}, infinity, hit));
    ck_assert(hit.feature == Feature::edge);
    ck_assert_double_eq_tol(norm(hit.direction - normalized(Vec3{0, -1, 1})), 0, 1e-12);
  }
}
END_TEST

START_TEST(sheet_of_two_faces) {
  // Its normals cancel, so the first triangle decides.
  Mesh m;
  m.points = {{0, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  m.triangles = {0, 1, 2, 0, 2, 1};
  const Ref<const Shape> shape = m.shape();
  Closest hit;
  for (const Vec3 x : {Vec3{0, 0.5, 0}, Vec3{0, 0, 0}, Vec3{0, 0.2, 0.2}}) {
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, hit));
    ck_assert(hit.distance == 0 && hit.triangle == 0 && hit.direction == (Vec3{1, 0, 0}));
  }
  for (const double side : {1.0, -1.0}) {
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), {side, 0.5, -1}, infinity, hit));
    ck_assert(hit.feature == Feature::edge && hit.side == (side > 0 ? Side::front : Side::back));
  }
}
END_TEST

// The property by which the tree needs no margin for rounding.
START_TEST(closest_point_stays_in_the_box) {
  Random random(81);
  for (int i = 0; i < sanitized_times(20000, 100000); ++i) {
    const double size = random.log_between(1e-6, 1);
    const Vec3 a = random.in_box(1), b = a + size * random.direction();
    Vec3 c = a + random.log_between(1e-6, 1) * random.direction();
    if (i % 2) c = random.log_between(1e-20, 1e-14) * random.direction();  // near a corner rounding shows
    const Vec3 p = nearest_on_triangle(a, b, c).offset;
    Box box;
    for (const Vec3& v : {a, b, c}) box.add(v);
    const Box before = box;
    box.add(p);
    ck_assert(box.lower == before.lower && box.upper == before.upper);
  }
}
END_TEST

START_TEST(features) {
  const Ref<const Shape> cube = box({1, 1, 1}).shape();
  Closest hit;
  const auto ask = [&](Vec3 x) {
    ck_assert(closest_point(FS_PRIMITIVE_MESH, cube.get(), x, infinity, hit));
    return hit.feature;
  };
  ck_assert(ask({0.3, 0.2, 1.5}) == Feature::face);
  ck_assert(hit.direction == (Vec3{0, 0, 1}));
  ck_assert(ask({0.25, -0.25, 1.5}) == Feature::face);  // over the diagonal, an edge between two halves of a face
  ck_assert(ask({0.3, 1.5, 1.5}) == Feature::edge);
  ck_assert_double_eq_tol(std::fabs(hit.tangent.x), 1, 1e-15);
  ck_assert(ask({1.5, 1.5, 1.5}) == Feature::vertex);
  ck_assert(ask({0.3, 0.2, 0.9}) == Feature::face);
  ck_assert(hit.side == Side::back && hit.direction == (Vec3{0, 0, -1}));

  // On the surface: front, along the normal there; just beside it the normal still, not rounding.
  ck_assert(ask({0.3, 0.2, 1}) == Feature::face);
  ck_assert(hit.distance == 0 && hit.side == Side::front && hit.direction == (Vec3{0, 0, 1}));
  ask({1, 1, 1});
  ck_assert_double_eq(hit.distance, 0);
  ck_assert_double_eq_tol(norm(hit.direction - normalized(Vec3{1, 1, 1})), 0, 1e-15);
  ask({1, 0.5, 1});
  ck_assert_double_eq_tol(norm(hit.direction - normalized(Vec3{1, 0, 1})), 0, 1e-15);
  const Quat turn = normalized(Quat{1, 2, 3, 4});
  const Ref<const Shape> turned_cube = turned(box({1, 1, 1}), turn).shape();
  const Vec3 normal = rotate(turn, {0, 0, 1});
  for (double d = 1e-2; d > 1e-15; d /= 3) {
    const Vec3 x = rotate(turn, {0.3, 0.2, 1}) + d * normal;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, turned_cube.get(), x, infinity, hit));
    ck_assert(hit.feature == Feature::face && hit.side == Side::front);
    ck_assert_double_eq_tol(norm(hit.direction - normal), 0, 1e-14);
  }

  // A flat square of four triangles: its middle is face, its border is not.
  Mesh flat;
  flat.points = {{0, 0, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}};
  flat.triangles = {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1};
  const Ref<const Shape> square = flat.shape();
  const auto of_square = [&](Vec3 x) {
    ck_assert(closest_point(FS_PRIMITIVE_MESH, square.get(), x, infinity, hit));
    return hit.feature;
  };
  ck_assert(of_square({0, 0, -1}) == Feature::face && hit.side == Side::back);
  ck_assert(of_square({0.5, 0.5, 1}) == Feature::face);
  ck_assert(of_square({0.5, 2, 0.5}) == Feature::edge);
  ck_assert(of_square({2, 2, 0.5}) == Feature::vertex);
}
END_TEST

START_TEST(info_and_refusals) {
  const auto info_of = [](const Mesh& m) {
    fs_shape_info info = fs_shape_info_init();
    const Ref<const Shape> shape = m.shape(false);
    shape->get_info(info);
    ck_assert(!info.built && !shape->is_built());
    shape->build();
    shape->get_info(info);
    ck_assert(info.built && info.struct_size == sizeof info && info.primitive == FS_PRIMITIVE_MESH);
    ck_assert(info.has_inside == shape->closed);
    return info;
  };
  fs_shape_info info = info_of(box({1, 2, 3}));
  ck_assert(info.closed && info.open_edges == 0 && info.odd_edges == 0 && info.degenerate == 0);
  ck_assert(info.lower == (Vec3{-1, -2, -3}) && info.upper == (Vec3{1, 2, 3}));
  info = info_of(soup(box({1, 2, 3})));
  ck_assert(!info.closed && info.open_edges == 36);
  Mesh m = box({1, 2, 3});
  std::swap(m.triangles[0], m.triangles[1]);
  info = info_of(m);  // one triangle turned round
  ck_assert(!info.closed && info.open_edges == 0 && info.odd_edges == 3);
  m = box({1, 2, 3});
  m.triangles.resize(33);
  info = info_of(m);
  ck_assert(!info.closed && info.open_edges == 3 && info.odd_edges == 0);
  m = box({1, 2, 3});
  m.add(0, 2, 1);
  info = info_of(m);
  ck_assert(!info.closed && info.odd_edges == 3);
  m = box({1, 2, 3});
  m.add(0, 0, 1);
  info = info_of(m);
  ck_assert(info.closed && info.degenerate == 1);

  Random random(91);
  Mesh collinear;  // but for the rounding of its points
  for (uint32_t i = 0; i < 100; ++i) {
    const Vec3 p = random.in_box(0.1), q = random.direction();
    collinear.points.insert(collinear.points.end(), {p, p + random.between(0.3, 0.7) * q, p + q});
    collinear.add(3 * i, 3 * i + 1, 3 * i + 2);
  }
  info = info_of(collinear);
  ck_assert_uint_eq(info.degenerate, 100);

  m = box({1, 2, 3});
  m.points[5].y = std::nan("");
  std::string text = refusal(FS_ERROR_INVALID, [&] { m.shape(); });
  ck_assert_says(text, "points[5].y is nan");
  m.points[5].y = -2e15;
  text = refusal(FS_ERROR_INVALID, [&] { m.shape(); });
  ck_assert_says(text, "points[5].y is -2e+15, must be finite and within +-1e+15 m");
  m = box({1, 2, 3});
  m.triangles[7] = 8;
  text = refusal(FS_ERROR_INVALID, [&] { m.shape(); });
  ck_assert_says(text, "triangles[2] has point 8 as corner 1, must be below the 8 points");
  m.triangles.clear();
  text = refusal(FS_ERROR_INVALID, [&] { m.shape(); });
  ck_assert_says(text, "no triangle");
  text = refusal(FS_ERROR_INVALID, [&] { make_mesh(nullptr, 0, box({1, 1, 1}).triangles.data(), 12); });
  ck_assert_says(text, "0 points");
}
END_TEST

// Counted in steps, not in time. These points fall into one slot of a table by one well-known way to hash doubles (each
// coordinate's bits, multiplied by the golden ratio): a table of them would take n^2 steps.
std::vector<Vec3> colliding_points(size_t n) {
  constexpr uint64_t factor = 0x9e3779b97f4a7c15u;
  uint64_t inverse = factor;
  for (int i = 0; i < 6; ++i) inverse *= 2 - factor * inverse;
  const auto hash = [](uint64_t h, double c) {
    h = (h ^ std::bit_cast<uint64_t>(c + 0.0)) * factor;
    return h ^ h >> 32;
  };
  Random random(8);
  std::vector<Vec3> points;
  while (points.size() < n) {
    const size_t i = points.size();
    const double x = 1e-3 * static_cast<double>(i % 1000), y = 1e-3 * static_cast<double>(i / 1000);
    const uint64_t high = random.below(1u << 31), low = (high ^ (random.below(1u << 10) << 20)) & 0xffffffff;
    const double z = std::bit_cast<double>(((high << 32 | low) * inverse) ^ hash(hash(0, x), y));
    if (std::fabs(z) < 1e3 && std::fabs(z) > 1e-300) points.push_back({x, y, z});
  }
  return points;
}

START_TEST(no_mesh_takes_many_steps) {
  const auto steps = [](const Mesh& mesh) {
    StopToken stop;
    make_mesh(mesh.points.data(), mesh.points.size(), mesh.triangles.data(), mesh.count(), stop)->build(stop);
    return static_cast<double>(stop.steps());
  };
  constexpr uint32_t n = 3 * 4000;
  Random random(9);
  std::map<std::string, Mesh> meshes;
  meshes["colliding"].points = colliding_points(n);
  for (uint32_t i = 0; i < n; ++i) {
    meshes["ordinary"].points.push_back({random.between(0, 1), random.between(0, 1), random.between(0, 1)});
    meshes["at one place"].points.push_back({1, 2, 3});
    meshes["on a line"].points.push_back({std::ldexp(1.0, static_cast<int>(i % 90) - 45), 0, 0});
    meshes["one after another"].points.push_back({static_cast<double>(i), 0, 0});
  }
  for (auto& [name, mesh] : meshes) {
    for (uint32_t i = 0; i < n; ++i) mesh.triangles.push_back(i);
  }
  Mesh& fan = meshes["all at one edge"];
  fan.points = meshes["ordinary"].points;
  for (uint32_t i = 2; i < n / 3; ++i) fan.add(0, 1, i);
  const double ordinary = steps(meshes["ordinary"]);
  for (const auto& [name, mesh] : meshes) {
    const double here = steps(mesh);
    std::printf("  %-20s %9.0f steps\n", name.c_str(), here);
    ck_assert_msg(here < 5 * ordinary, "%s: %g steps, an ordinary mesh takes %g", name.c_str(), here, ordinary);
  }
}
END_TEST

// Two cones with one base, of many narrow triangles.
Mesh spindle(double size, uint32_t corners) {
  Mesh m;
  m.points = {{0, 0, size}, {0, 0, -size}};
  for (uint32_t i = 0; i < corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / corners;
    m.points.push_back({size * std::cos(angle), size * std::sin(angle), 0});
    const uint32_t here = 2 + i, next = 2 + (i + 1) % corners;
    m.add(0, here, next);
    m.add(1, next, here);
  }
  return m;
}

// Parts that cross each other have no end of pieces, or no end of triangles that may cross: their union is given up after a
// number of steps.
START_TEST(unions_take_no_end_of_steps) {
  Random random(10);
  std::map<std::string, Mesh> meshes;
  const auto add = [&](const std::string& name, const Mesh& part, const Pose& pose) {
    Mesh& mesh = meshes[name];
    const auto first = static_cast<uint32_t>(mesh.points.size());
    for (const Vec3& p : part.points) mesh.points.push_back(pose * p);
    for (const uint32_t corner : part.triangles) mesh.triangles.push_back(first + corner);
  };
  const auto any_pose = [&] {
    return Pose{random.in_box(0.05), normalized(Quat{1, random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)})};
  };
  for (int i = 0; i < (scenes::is_sanitized ? 40 : 160); ++i) add("boxes about one place", box({1, 1, 1}), any_pose());
  for (int i = 0; i < (scenes::is_sanitized ? 3000 : 12000); ++i) add("rods side by side", box({1, 1e-5, 1e-5}), {{0, 1e-4 * i, 0}, {1, 0, 0, 0}});
  for (const double size : {1.0, 1.01}) add("one spindle in another", spindle(size, scenes::is_sanitized ? 1000 : 4000), {});
  for (const auto& [name, mesh] : meshes) {
    StopToken stop, of_union;
    auto edges = std::make_unique<MeshEdges>(mesh.triangles, mesh.points.size(), stop);
    const MeshParts parts(mesh.triangles, *edges, stop);
    const MeshTree tree(mesh.points, mesh.triangles, std::move(edges), {}, stop);
    MeshUnion::of(tree, mesh.points, mesh.triangles, parts, of_union);
    const auto steps = static_cast<double>(of_union.steps()), most = 3e6 + 420.0 * static_cast<double>(mesh.count());
    std::printf("  %-24s %9.0f steps, of %9.0f\n", name.c_str(), steps, most);
    ck_assert_msg(steps < most, "%s: its union takes %g steps", name.c_str(), steps);
  }
}
END_TEST

START_TEST(a_build_can_be_abandoned) {
  const Mesh mesh = sphere(1, 6);
  const Ref<const Shape> shape = mesh.shape(false);
  const std::atomic<bool> is_stopped{true};
  StopToken stop(is_stopped);
  bool is_thrown = false;
  try {
    shape->build(stop);
  } catch (const Stopped&) {
    is_thrown = true;
  }
  ck_assert(is_thrown && !shape->is_built() && stop.steps() <= 1024);
  ck_assert_double_eq(shape->progress(), 0);
  shape->build();
  ck_assert(shape->is_built());
  ck_assert_double_eq(shape->progress(), 1);
  // The abandoned build took the edges that were known, so this one sorted them again: that makes no difference.
  const Ref<const Shape> other = mesh.shape();
  Random random(72);
  for (int i = 0; i < 300; ++i) {
    const Vec3 x = i % 2 ? random.in_box(2) : mesh.points[random.below(mesh.points.size())];
    Closest first, second;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), x, infinity, first));
    ck_assert(closest_point(FS_PRIMITIVE_MESH, other.get(), x, infinity, second));
    ck_assert(first.point == second.point && first.direction == second.direction && first.side == second.side);
    ck_assert(first.feature == second.feature && first.triangle == second.triangle);
  }
}
END_TEST

// At any point, also in Embree: then the next build begins again. A build that was quicker than that is as good.
START_TEST(a_build_can_be_abandoned_anywhere) {
  const Mesh mesh = sphere(1, scenes::is_sanitized ? 5 : 6);
  int count = 0;
  for (const double part : {0.02, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}) {
    const Ref<const Shape> shape = mesh.shape(false);
    std::atomic<bool> is_stopped{false}, is_over{false};
    std::thread watcher([&] {
      while (shape->progress() < part && !is_over) {}
      is_stopped = true;
    });
    bool is_thrown = false;
    StopToken stop(is_stopped);
    try {
      shape->build(stop);
    } catch (const Stopped&) {
      is_thrown = true;
    }
    is_over = true;
    watcher.join();
    count += is_thrown;
    ck_assert(shape->is_built() != is_thrown);
    ck_assert_double_eq(shape->progress(), is_thrown ? 0 : 1);
    shape->build();
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), {2, 0, 0}, infinity, hit));
    ck_assert_double_eq_tol(hit.distance, 1, 1e-3);
  }
  std::printf("  %d of 10 builds were abandoned\n", count);
}
END_TEST

// The parts of work move on by their steps, never beyond their ends.
START_TEST(parts_of_work_are_shown) {
  std::atomic<double> progress{0};
  StopToken stop;
  const auto step = [&](int count) {
    for (int i = 0; i < count; ++i) stop.check();
    return progress.load();
  };
  stop.begin_part(0.9, 10);  // shown to nobody
  step(2048);
  stop.show(&progress);
  stop.begin_part(0.5, 4096);
  ck_assert_double_eq(step(2048), 0.25);
  ck_assert_double_eq(step(8192), 0.5);
  stop.begin_part(0.75, infinity);
  ck_assert_double_eq(step(8192), 0.5);
  stop.show_part(0.5);
  ck_assert_double_eq(progress, 0.625);
  stop.begin_part(1, 0);
  ck_assert_double_eq(progress, 0.75);
  ck_assert_double_eq(step(1024), 1);
  stop.show(nullptr);
  stop.begin_part(0.1, 1);
  ck_assert_double_eq(step(4096), 1);
}
END_TEST

// However the triangles share their points: also where no two do, and where no two triangles touch.
START_TEST(a_tree_is_small) {
  Random random(10);
  const Mesh connected = sphere(1, 6);
  const std::pair<const char*, Mesh> meshes[] = {{"connected", connected},
                                                 {"a soup", soup(connected)},
                                                 {"loose", random_triangles(random, 80'000, 1, 0.01)}};
  for (const auto& [name, mesh] : meshes) {
    const Ref<const Shape> shape = mesh.shape();
    const double bytes = static_cast<double>(shape->tree()->size()) / static_cast<double>(mesh.count());
    std::printf("  %-10s %.1f bytes a triangle\n", name, bytes);
    ck_assert(bytes <= 64);
  }
}
END_TEST

START_TEST(built_by_many_threads) {
  const Ref<const Shape> shape = sphere(1, 5).shape(false);
  std::vector<std::thread> threads;
  std::atomic<int> good{0};
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      shape->build();
      Closest hit;
      if (shape->is_built() && closest_point(FS_PRIMITIVE_MESH, shape.get(), {2, 0, 0}, infinity, hit)) ++good;
      // And each its own.
      for (int k = 0; k < 5; ++k) {
        const Ref<const Shape> mine = sphere(1, 4).shape();
        good += closest_point(FS_PRIMITIVE_MESH, mine.get(), {2, 0, 0}, infinity, hit);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ck_assert_int_eq(good, 8 * 6);
}
END_TEST

START_TEST(a_query_does_not_allocate) {
  const Ref<const Shape> shape = sphere(1, 4).shape();
  Random random(71);
  const long before = allocations;
  for (int i = 0; i < 1000; ++i) {
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_MESH, shape.get(), random.in_box(2), infinity, hit));
  }
  ck_assert_int_eq(allocations, before);
}
END_TEST

}  // namespace

int main() {
  if (seeks_races) return run("mesh", {built_by_many_threads});
  return run("mesh", {matches_the_reference, matches_the_reference_far_away, takes_bad_meshes, all_sizes_in_one_mesh,
                      hints_make_no_difference, a_search_can_be_cut,
                      ties_go_to_the_lowest_index, respects_the_largest_distance, sides_of_closed_meshes,
                      sides_with_degenerate_and_duplicate_triangles, sheet_of_two_faces, a_rim_with_a_degenerate_triangle,
                      closest_point_stays_in_the_box, features, info_and_refusals, no_mesh_takes_many_steps,
                      unions_take_no_end_of_steps,
                      a_build_can_be_abandoned, a_build_can_be_abandoned_anywhere, parts_of_work_are_shown, a_tree_is_small,
                      built_by_many_threads, a_query_does_not_allocate});
}
