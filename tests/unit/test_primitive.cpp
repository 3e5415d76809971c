// Point, plane and polyline: closest point, feature and side.
#include <limits>

#include "shape/primitive.h"
#include "shape/triangle.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr Vec3 zero{0, 0, 0};

START_TEST(point) {
  Closest hit;
  ck_assert(closest_point(FS_PRIMITIVE_POINT, nullptr, {3, 0, 4}, 5, hit));
  ck_assert(hit.distance == 5 && hit.point == zero && hit.feature == Feature::vertex);
  ck_assert_double_eq_tol(norm(hit.direction - Vec3{0.6, 0, 0.8}), 0, 1e-15);
  ck_assert(!closest_point(FS_PRIMITIVE_POINT, nullptr, {3, 0, 4}, 4.999, hit));
  ck_assert(!closest_point(FS_PRIMITIVE_POINT, nullptr, zero, -1, hit));
  ck_assert(closest_point(FS_PRIMITIVE_POINT, nullptr, zero, 0, hit));
  ck_assert(hit.distance == 0 && hit.direction == zero);
  ck_assert(closest_point(FS_PRIMITIVE_POINT, nullptr, {1e-300, 0, 0}, infinity, hit));
  ck_assert(is_finite(hit.direction) && hit.direction == zero);
  for (const double bad : {std::nan(""), infinity, -infinity}) {
    ck_assert(!closest_point(FS_PRIMITIVE_POINT, nullptr, {bad, 0, 0}, infinity, hit));
    ck_assert(!closest_point(FS_PRIMITIVE_PLANE, nullptr, {bad, 0, 0}, infinity, hit));
  }
}
END_TEST

START_TEST(plane) {
  Closest hit;
  ck_assert(closest_point(FS_PRIMITIVE_PLANE, nullptr, {1, 2, 3}, 3, hit));
  ck_assert(hit.distance == 3 && hit.point == (Vec3{1, 2, 0}) && hit.direction == (Vec3{0, 0, 1}));
  ck_assert(hit.side == Side::front && hit.feature == Feature::face && hit.tangent == zero);
  ck_assert(closest_point(FS_PRIMITIVE_PLANE, nullptr, {1, 2, -3}, infinity, hit));
  ck_assert(hit.distance == 3 && hit.direction == (Vec3{0, 0, -1}) && hit.side == Side::back);
  for (const double z : {0.0, -0.0}) {
    ck_assert(closest_point(FS_PRIMITIVE_PLANE, nullptr, {1, 2, z}, 0, hit));
    ck_assert(hit.distance == 0 && hit.direction == (Vec3{0, 0, 1}) && hit.side == Side::front);
  }
  ck_assert(!closest_point(FS_PRIMITIVE_PLANE, nullptr, {1, 2, -3}, 2.9, hit));
}
END_TEST

// The distance to a segment in 64-bit mantissas, by another formula: |ab x ax| / |ab| between the ends.
long double reference_distance(Vec3 x, Vec3 a, Vec3 b) {
  struct V {
    long double x, y, z;
  };
  const auto wide = [](Vec3 p) { return V{p.x, p.y, p.z}; };
  const auto less = [&](Vec3 p, Vec3 q) { return V{wide(p).x - q.x, wide(p).y - q.y, wide(p).z - q.z}; };
  const auto times = [](V p, V q) { return p.x * q.x + p.y * q.y + p.z * q.z; };
  const V ab = less(b, a), ax = less(x, a), bx = less(x, b);
  if (times(ab, ax) <= 0) return std::sqrt(times(ax, ax));
  if (times(ab, bx) >= 0) return std::sqrt(times(bx, bx));
  const V c{ab.y * ax.z - ab.z * ax.y, ab.z * ax.x - ab.x * ax.z, ab.x * ax.y - ab.y * ax.x};
  return std::sqrt(times(c, c) / times(ab, ab));
}

START_TEST(polyline_matches_the_reference) {
  Random random(1);
  long double worst = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 where = i % 4 == 0 ? zero : i % 4 == 1 ? Vec3{5e5, 4.6e6, 1500} : random.in_box(1e6);
    const size_t count = 2 + random.below(i % 20 == 0 ? 300 : 30);
    const bool closed = random.coin();
    std::vector<Vec3> points{where};
    while (points.size() < count) {
      const bool repeats = random.coin(0.1);  // a segment without length
      points.push_back(repeats ? points.back() : points.back() + random.log_between(1e-3, 1) * random.direction());
    }
    const Ref<const Shape> shape = make_polyline(points.data(), count, closed);
    const size_t segments = closed ? count : count - 1;
    for (int k = 0; k < 40; ++k) {
      const size_t s = random.below(count);
      Vec3 x = points[s] + random.log_between(1e-9, 10) * random.direction();
      if (k == 0) x = points[s];
      Closest hit;
      ck_assert(closest_point(FS_PRIMITIVE_POLYLINE, shape.get(), x, infinity, hit));
      double least = infinity;
      size_t index = 0;
      long double exact = infinity;
      for (size_t j = 0; j < segments; ++j) {
        const Vec3 a = points[j], b = points[(j + 1) % count];
        Nearest here;
        nearest_on_segment(a - x, b - x, Part::edge_ab, Part::corner_a, Part::corner_b, here);
        if (here.squared < least) {
          least = here.squared;
          index = j;
        }
        exact = std::min(exact, reference_distance(x, a, b));
      }
      const double rounding = coordinate_rounding(largest_coordinate(x) + 1);
      ck_assert(hit.distance == std::sqrt(least) || (hit.distance == 0 && std::sqrt(least) <= rounding));
      ck_assert_uint_eq(hit.triangle, index);
      worst = std::max(worst, std::fabs(std::sqrt(least) - exact) / (epsilon * (1 + exact)));
      ck_assert_double_eq_tol(norm(hit.direction), hit.distance > 0 ? 1 : 0, 1e-12);
      ck_assert_double_eq_tol(norm(hit.tangent), hit.feature == Feature::edge ? 1 : 0, 1e-12);
      ck_assert(hit.feature != Feature::face && hit.side == Side::front);
      Closest other;
      ck_assert(closest_point(FS_PRIMITIVE_POLYLINE, shape.get(), x, std::sqrt(least), other));
      const double nearer = std::nextafter(std::sqrt(least), 0);
      ck_assert(least == 0 || !closest_point(FS_PRIMITIVE_POLYLINE, shape.get(), x, nearer, other));
    }
  }
  ck_assert_double_le(static_cast<double>(worst), 3);
}
END_TEST

START_TEST(segment_is_the_same_both_ways) {
  Random random(2);
  for (int i = 0; i < sanitized_times(1000, 5000); ++i) {
    const Vec3 a = random.in_box(1), b = random.in_box(1);
    Nearest there, back;
    nearest_on_segment(a, b, Part::edge_ab, Part::corner_a, Part::corner_b, there);
    nearest_on_segment(b, a, Part::edge_ab, Part::corner_b, Part::corner_a, back);
    ck_assert(there.offset == back.offset && there.squared == back.squared && there.part == back.part);
  }
}
END_TEST

START_TEST(polyline_features) {
  const Vec3 points[] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}};
  Closest hit;
  Ref<const Shape> shape = make_polyline(points, 4, false);
  ck_assert(shape->is_built());
  const auto ask = [&](Vec3 x) {
    ck_assert(closest_point(FS_PRIMITIVE_POLYLINE, shape.get(), x, infinity, hit));
    return hit.feature;
  };
  ck_assert(ask({0.5, 0, 1}) == Feature::edge);
  ck_assert(hit.tangent == (Vec3{1, 0, 0}) && hit.distance == 1 && hit.point == (Vec3{0.5, 0, 0}));
  ck_assert(ask({-1, 0, 1}) == Feature::vertex);
  ck_assert(ask({1, 0, 1}) == Feature::edge);  // a joint inside a straight part
  ck_assert_uint_eq(hit.triangle, 0);          // of two segments that are equally near
  ck_assert(ask({3, -1, 1}) == Feature::vertex);
  ck_assert(ask({2, 2, 0}) == Feature::vertex);
  ck_assert(ask({0.5, 0, 0}) == Feature::edge);
  ck_assert(hit.distance == 0 && hit.direction == zero);
  ck_assert(ask({0.5, 1, 0}) == Feature::edge);
  ck_assert_double_eq(hit.distance, 1);  // open: not to the segment that would close it
  shape = make_polyline(points, 4, true);
  ask({0.5, 0.5, 0});
  ck_assert_double_lt(hit.distance, 0.3);
  ck_assert_uint_eq(hit.triangle, 3);
  ask({-1, -1, 0});
  ck_assert_uint_eq(hit.triangle, 0);  // of the first and the last

  // A straight joint where a closed one begins.
  const Vec3 ring[] = {{1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, {0, 0, 0}};
  shape = make_polyline(ring, 5, true);
  ck_assert(ask({1, -1, 0}) == Feature::edge);
  ck_assert_uint_eq(hit.triangle, 0);
  shape = make_polyline(ring, 5, false);
  ck_assert(ask({1, -1, 0}) == Feature::vertex);

  // Far away, where the last digit is not a direction.
  const Vec3 far[] = {{5e5, 4.6e6, 0}, {5e5 + 1, 4.6e6, 0}};
  shape = make_polyline(far, 2, false);
  ask({5e5 + 0.5, std::nextafter(4.6e6, 5e6), 0});
  ck_assert(hit.distance == 0 && hit.direction == zero);
  ask({5e5 + 0.5, 4.6e6 + 1e-8, 0});
  ck_assert(hit.distance > 0.5e-8 && hit.direction == (Vec3{0, 1, 0}));

  const Vec3 spot[] = {{1, 2, 3}, {1, 2, 3}};  // no length at all
  shape = make_polyline(spot, 2, true);
  ck_assert(ask({1, 2, 5}) == Feature::vertex);
  ck_assert_double_eq(hit.distance, 2);
}
END_TEST

// Where all boxes lie on one line, no tree is better than another by any heuristic.
START_TEST(many_points_on_a_line) {
  std::vector<Vec3> points(20000);
  for (size_t i = 0; i < points.size(); ++i) points[i].x = 1e-6 * static_cast<double>(i);
  const Ref<const Shape> shape = make_polyline(points.data(), points.size(), false);
  Random random(7);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 x{random.between(-0.01, 0.03), random.between(-0.001, 0.001), 0};
    Closest hit;
    ck_assert(closest_point(FS_PRIMITIVE_POLYLINE, shape.get(), x, std::numeric_limits<double>::infinity(), hit));
    ck_assert_double_eq_tol(hit.point.x, std::clamp(x.x, 0.0, points.back().x), 1e-15);
  }
}
END_TEST

START_TEST(polyline_refusals_and_info) {
  const Vec3 points[] = {{0, 1, 0}, {1, std::nan(""), 0}, {2, 0, 0}};
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_polyline(points, 1, false); }), "1 point, must have at least 2");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_polyline(points, 3, false); }), "points[1].y is nan");
  const Vec3 far[] = {{0, 1, 0}, {1, 0, 1.1e15}};
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_polyline(far, 2, false); }), "points[1].z is 1.1e+15");
  const Vec3 good[] = {{0, 1, 0}, {1, 0, -1}};
  for (const bool closed : {false, true}) {
    const Ref<const Shape> shape = make_polyline(good, 2, closed);
    fs_shape_info info = fs_shape_info_init();
    shape->get_info(info);
    ck_assert(info.built && info.closed == closed && shape->closed == closed);
    ck_assert(info.primitive == FS_PRIMITIVE_POLYLINE);
    ck_assert(info.lower == (Vec3{0, 0, -1}) && info.upper == (Vec3{1, 1, 0}) && info.struct_size == sizeof info);
    ck_assert(info.open_edges == 0 && info.odd_edges == 0 && info.degenerate == 0);
  }
}
END_TEST

}  // namespace

int main() {
  return run("primitive", {point, plane, segment_is_the_same_both_ways, polyline_matches_the_reference,
                           polyline_features, polyline_refusals_and_info, many_points_on_a_line});
}
