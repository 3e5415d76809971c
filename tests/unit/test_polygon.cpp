// Faces with more than three corners: their triangles cover the polygon and nothing else, whatever its outline is like.
#include <charconv>
#include <set>

#include "file/binary.h"
#include "file/mesh_formats.h"
#include "math/pose.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

using Outline = std::vector<Vec3>;

// A file with one face whose corners are all points, in order.
std::string to_ply(const Outline& points) {
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                    "\nproperty double x\nproperty double y\nproperty double z\nelement face 1\n"
                    "property list uint uint vertex_indices\nend_header\n";
  for (const Vec3& p : points) {
    for (const double c : {p.x, p.y, p.z}) store(out, c);
  }
  store(out, static_cast<uint32_t>(points.size()));
  for (uint32_t i = 0; i < points.size(); ++i) store(out, i);
  return out;
}
std::string text_of(Vec3 p) {
  std::string out;
  for (const double c : {p.x, p.y, p.z}) {
    char buffer[32];
    out += std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, c).ptr) + " ";
  }
  return out + "\n";
}
std::string to_obj(const Outline& points, bool face_first) {
  std::string face = "f", vertices;
  for (size_t i = 0; i < points.size(); ++i) {
    face += " " + std::to_string(i + 1);
    vertices += "v " + text_of(points[i]);
  }
  return face_first ? face + "\n" + vertices : vertices + face + "\n";
}
std::string to_off(const Outline& points) {
  std::string out = "OFF\n" + std::to_string(points.size()) + " 1 0\n", face = std::to_string(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    out += text_of(points[i]);
    face += " " + std::to_string(i);
  }
  return out + face + "\n";
}

std::vector<uint32_t> cut(const Outline& points) { return parse_ply(to_ply(points), "a.ply").triangles; }

Vec3 doubled_area(const Outline& points) {  // Newell's: along the normal
  Vec3 sum{};
  for (size_t i = 0; i < points.size(); ++i) {
    sum += cross(points[i] - points[0], points[(i + 1) % points.size()] - points[0]);
  }
  return sum;
}
Vec3 doubled_area(const Outline& points, const uint32_t* t) {
  return cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]);
}

// n - 2 triangles; each edge of the outline is one triangle's, any other joins two: whatever the outline, one surface.
void check_joined(const std::vector<uint32_t>& triangles, size_t n, const char* what) {
  ck_assert_msg(triangles.size() == 3 * (n - 2), "%s: %zu triangles of %zu corners", what, triangles.size() / 3, n);
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (size_t i = 0; i < triangles.size(); ++i) {
    ck_assert_uint_lt(triangles[i], n);
    ++edges[{triangles[i], triangles[i % 3 == 2 ? i - 2 : i + 1]}];
  }
  for (uint32_t i = 0; i < n; ++i) {
    const auto edge = edges.find({i, static_cast<uint32_t>((i + 1) % n)});
    ck_assert_msg(edge != edges.end(), "%s: edge %u of %zu is missing", what, i, n);
    if (--edge->second == 0) edges.erase(edge);
  }
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    ck_assert_msg(back != edges.end() && back->second == count, "%s: edge %u %u is open", what, edge.first,
                  edge.second);
  }
}

// For a simple polygon, perhaps with flat or repeated corners: all triangles face the way it does, and their areas add
// to its area. tolerance: of the coordinates, m.
void check_covers(const Outline& points, const char* what, double tolerance = 0) {
  const std::vector<uint32_t> triangles = cut(points);
  check_joined(triangles, points.size(), what);
  const Vec3 whole = doubled_area(points), normal = normalized(whole);
  double sum = 0, outline = 0, least = 0;
  for (size_t i = 0; i < points.size(); ++i) outline += norm(points[(i + 1) % points.size()] - points[i]);
  for (size_t i = 0; i < triangles.size(); i += 3) {
    const double area = dot(doubled_area(points, triangles.data() + i), normal);
    sum += std::fabs(area);
    least = std::fmin(least, area);
  }
  const double noise = (tolerance + 1e-14 * outline) * outline;
  ck_assert_msg(least >= -noise, "%s: a triangle of %zu corners faces away by %g of %g", what, points.size(), least,
                norm(whole));
  ck_assert_msg(std::fabs(sum - norm(whole)) <= noise * static_cast<double>(points.size()),
                "%s: %zu corners: the triangles have %.17g, the polygon %.17g", what, points.size(), sum, norm(whole));
}

double turn_of(Vec3 a, Vec3 b, Vec3 c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

// ---- outlines in the plane z = 0, counter-clockwise

Outline star(Random& random, size_t n) {
  Outline out;
  for (size_t i = 0; i < n; ++i) {
    const double part = (static_cast<double>(i) + random.between(0, 0.9)) / static_cast<double>(n);
    const double angle = 2 * std::numbers::pi * part;
    const double r = random.log_between(0.05, 1);
    out.push_back({r * std::cos(angle), r * std::sin(angle), 0});
  }
  return out;
}

// Random points in an order without crossings: each crossing is turned over until there is none.
Outline untangled(Random& random, size_t n) {
  Outline p(n);
  for (Vec3& x : p) x = {random.between(-1, 1), random.between(-1, 1), 0};
  const auto crosses = [&](size_t i, size_t k) {
    const Vec3 a = p[i], b = p[i + 1], c = p[k], d = p[(k + 1) % n];
    return turn_of(a, b, c) * turn_of(a, b, d) < 0 && turn_of(c, d, a) * turn_of(c, d, b) < 0;
  };
  for (bool is_done = false; !is_done;) {
    is_done = true;
    for (size_t i = 0; i + 2 < n; ++i) {
      for (size_t k = i + 2; k < n; ++k) {
        if ((i == 0 && k == n - 1) || !crosses(i, k)) continue;
        std::reverse(p.begin() + static_cast<long>(i) + 1, p.begin() + static_cast<long>(k) + 1);
        is_done = false;
      }
    }
  }
  if (doubled_area(p).z < 0) std::reverse(p.begin(), p.end());
  return p;
}

Outline spiral(size_t n) {  // a band that winds inwards
  Outline out, back;
  for (size_t i = 0; i < n / 2; ++i) {
    const double angle = 0.3 * static_cast<double>(i), r = 1 + 0.02 * angle;
    out.push_back({r * std::cos(angle), r * std::sin(angle), 0});
    back.push_back({(r - 0.06) * std::cos(angle), (r - 0.06) * std::sin(angle), 0});
  }
  std::reverse(out.begin(), out.end());
  out.insert(out.end(), back.begin(), back.end());
  std::reverse(out.begin(), out.end());
  if (doubled_area(out).z < 0) std::reverse(out.begin(), out.end());
  return out;
}

Outline comb(size_t teeth) {  // their feet are flat corners in one line
  Outline out{{0, -1, 0}, {static_cast<double>(teeth), -1, 0}};
  for (size_t i = teeth; i-- > 0;) {
    const double x = static_cast<double>(i);
    for (const Vec3 p : {Vec3{x + 1, 0, 0}, Vec3{x + 0.75, 5, 0}, Vec3{x + 0.5, 0, 0}}) out.push_back(p);
  }
  out.push_back({0, 0, 0});
  return out;
}

Outline zigzag(size_t teeth) {  // a thin band of long teeth
  Outline upper, out;
  for (size_t i = 0; i < teeth; ++i) {
    const double x = static_cast<double>(i);
    for (const Vec3 p : {Vec3{x, 1, 0}, Vec3{x + 0.5, -100, 0}}) upper.push_back(p);
  }
  for (const Vec3& p : upper) out.push_back({p.x, p.y - 0.5, 0});
  std::reverse(upper.begin(), upper.end());
  out.insert(out.end(), upper.begin(), upper.end());
  return out;
}

// More corners: on the edges, and some twice.
Outline with_flat_corners(Random& random, const Outline& points, bool doubles) {
  Outline out;
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec3 a = points[i], b = points[(i + 1) % points.size()];
    out.push_back(a);
    if (doubles && random.coin(0.2)) out.push_back(a);
    if (random.coin(0.5)) out.push_back(a + random.between(0.2, 0.4) * (b - a));
    if (random.coin(0.2)) out.push_back(0.5 * (a + b));
  }
  return out;
}

Outline placed(const Outline& points, const Pose& pose, double scale) {
  Outline out;
  for (const Vec3& p : points) out.push_back(pose * (scale * p));
  return out;
}

Outline reversed(Outline points) {
  std::reverse(points.begin(), points.end());
  return points;
}

}  // namespace

START_TEST(a_fan_would_be_wrong)
{
  // An L: from its first corner a fan covers the notch.
  const Outline l{{0, 2, 0}, {0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}};
  for (size_t first = 0; first < l.size(); ++first) {
    Outline turned = l;
    std::rotate(turned.begin(), turned.begin() + static_cast<long>(first), turned.end());
    check_covers(turned, "L");
    check_covers(reversed(turned), "L reversed");
    const std::vector<uint32_t> triangles = cut(turned);
    ck_assert(parse_obj(to_obj(turned, false), "a.obj").triangles == triangles);
    ck_assert(parse_obj(to_obj(turned, true), "a.obj").triangles == triangles);
    ck_assert(parse_off(to_off(turned), "a.off").triangles == triangles);
  }
  // Several faces of one file, and those of three corners stay where they are.
  const MeshData mesh = parse_obj("v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1 1 0\nf 1 2 3\nf 1 2 3 4\nf 3 2 1\nf 1 4 3 2\n", "a");
  const std::vector<uint32_t> expected{0, 1, 2, 3, 0, 1, 3, 1, 2, 2, 1, 0, 3, 2, 1, 3, 1, 0};
  ck_assert_uint_eq(mesh.triangles.size(), expected.size());
  for (size_t face : {size_t{1}, size_t{4}}) {
    for (size_t i = 3 * face; i < 3 * face + 6; i += 3) {
      const double area = doubled_area(mesh.points, mesh.triangles.data() + i).z;
      ck_assert_double_eq(std::fabs(area), 1);
      ck_assert((area > 0) == (face == 1));
    }
  }
  ck_assert_uint_eq(mesh.triangles[9], 2);
}
END_TEST

START_TEST(convex_polygons_are_fans)
{
  Random random(1);
  for (int round = 0; round < sanitized_times(40, 200); ++round) {
    const size_t n = 3 + random.below(30);
    Outline circle;
    for (size_t i = 0; i < n; ++i) {
      const double part = (static_cast<double>(i) + random.between(0, 0.8)) / static_cast<double>(n);
      const double angle = 2 * std::numbers::pi * part;
      circle.push_back({std::cos(angle), std::sin(angle), 0});
    }
    const std::vector<uint32_t> triangles = cut(placed(circle, random.pose(100), random.log_between(1e-3, 1e3)));
    for (uint32_t i = 0; i + 2 < n; ++i) {
      ck_assert(triangles[3 * i] == 0 && triangles[3 * i + 1] == i + 1 && triangles[3 * i + 2] == i + 2);
    }
  }
}
END_TEST

START_TEST(simple_polygons_are_covered)
{
  Random random(2);
  for (int round = 0; round < times(100, 600); ++round) {
    Outline points;
    const char* what = "";
    switch (round % 5) {
      case 0: points = star(random, 4 + random.below(60)), what = "star"; break;
      case 1: points = untangled(random, 4 + random.below(40)), what = "untangled"; break;
      case 2: points = spiral(40 + 2 * random.below(100)), what = "spiral"; break;
      case 3: points = comb(1 + random.below(30)), what = "comb"; break;
      default: points = zigzag(2 + random.below(30)), what = "zigzag"; break;
    }
    if (random.coin()) points = reversed(points);
    std::rotate(points.begin(), points.begin() + static_cast<long>(random.below(points.size())), points.end());
    check_covers(points, what);
    check_covers(with_flat_corners(random, points, false), what);
    check_covers(with_flat_corners(random, points, true), what);
    // In any plane, far from the origin, of any size.
    const double scale = random.log_between(1e-6, 1e6), far = random.coin() ? 0 : random.log_between(1, 1e4) * scale;
    const double rounding = 1e-14 * (far + 100 * scale);
    check_covers(placed(points, random.pose(far), scale), what, rounding);
    check_covers(placed(with_flat_corners(random, points, true), random.pose(far), scale), what, rounding);
  }
  for (const double size : {1e-70, 1e70}) check_covers(placed(comb(5), random.pose(0), size), "of odd size", 0);
}
END_TEST

START_TEST(holes_that_are_joined_by_a_cut)
{
  // A square with a square hole; the cut between them is passed twice.
  const Outline keyhole{{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {0, 3, 0}, {0, 0, 0},
                        {1, 1, 0}, {1, 2, 0}, {2, 2, 0}, {2, 1, 0}, {1, 1, 0}};
  for (size_t first = 0; first < keyhole.size(); ++first) {
    Outline turned = keyhole;
    std::rotate(turned.begin(), turned.begin() + static_cast<long>(first), turned.end());
    check_covers(turned, "keyhole");
    check_covers(reversed(turned), "keyhole reversed");
  }
  // Many holes, all from one corner.
  Random random(3);
  for (int round = 0; round < sanitized_times(20, 100); ++round) {
    Outline points{{0, 0, 0}, {100, -1, 0}, {100, 101, 0}, {-1, 100, 0}};
    const int holes = 1 + static_cast<int>(random.below(20));
    for (int i = holes; i-- > 0;) {  // thin ones, as rays
      const double angle = (i + 0.5) / holes * std::numbers::pi / 2, width = 0.2 * std::numbers::pi / 2 / holes;
      const auto at = [&](double r, double by) { return Vec3{r * std::cos(angle + by), r * std::sin(angle + by), 0}; };
      points.push_back({0, 0, 0});
      for (const Vec3 p : {at(20, 0), at(50, width), at(80, 0), at(50, -width), at(20, 0)}) points.push_back(p);
    }
    check_covers(points, "holes");
    check_covers(placed(points, random.pose(10), 0.01), "holes", 1e-14);
  }
}
END_TEST

START_TEST(any_outline_ends_well)
{
  Random random(4);
  const auto check = [](const Outline& points, const char* what) {
    const std::vector<uint32_t> triangles = cut(points);
    check_joined(triangles, points.size(), what);
    ck_assert(cut(points) == triangles);
  };
  check({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}, "bow tie");
  check({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, "line");
  check({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 0, 0}}, "line and back");
  check(Outline(7, Vec3{1, 2, 3}), "a point");
  check({{1e308, 0, 0}, {-1e308, 0, 0}, {-1e308, -1e308, 1e308}, {1e308, 1e308, 0}, {0, 1e307, 0}}, "huge");
  check({{5e-324, 0, 0}, {0, 5e-324, 0}, {0, 0, 5e-324}, {5e-324, 5e-324, 0}, {0, 0, 0}}, "tiny");
  check({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0.5, 0.5, 0}, {0.5, 2, 0}, {0.5, 0.5, 0}, {0, 1, 0}}, "spike");
  Outline pentagram;
  for (int i = 0; i < 5; ++i) pentagram.push_back({std::cos(i * 2.513274), std::sin(i * 2.513274), 0});
  check(pentagram, "pentagram");
  for (int round = 0; round < sanitized_times(300, 1500); ++round) {
    Outline points(4 + random.below(round % 10 == 0 ? 200 : 12));
    const double step = random.coin() ? 0 : 1 + static_cast<double>(random.below(4));  // on a grid they meet often
    for (Vec3& p : points) {
      p = random.in_box(step > 0 ? step : 1);
      if (step > 0) p = {std::round(p.x), std::round(p.y), std::round(p.z)};
      if (round % 3 == 0) p.z = 0;
    }
    check(points, "tangle");
    // For outlines that cross themselves: the sum of the area vectors is the same for any triangles.
    const std::vector<uint32_t> triangles = cut(points);
    Vec3 sum{};
    for (size_t i = 0; i < triangles.size(); i += 3) sum += doubled_area(points, triangles.data() + i);
    ck_assert_double_lt(norm(sum - doubled_area(points)), 1e-10);
  }
  // Folded: a simple polygon in its plane, but not in a plane.
  for (int round = 0; round < sanitized_times(60, 300); ++round) {
    Outline points = star(random, 4 + random.below(40));
    for (Vec3& p : points) p.z = random.between(-0.02, 0.02);
    const Vec3 normal = normalized(doubled_area(points));
    const std::vector<uint32_t> triangles = cut(points);
    check_joined(triangles, points.size(), "folded");
    if (std::fabs(normal.z) < 0.999) continue;
    double least = 0;
    for (size_t i = 0; i < triangles.size(); i += 3) {
      least = std::fmin(least, dot(doubled_area(points, triangles.data() + i), normal));
    }
    ck_assert_double_ge(least, -0.01);
  }
}
END_TEST

// Fewer with a sanitizer, which makes each step slow.
#ifdef __SANITIZE_ADDRESS__
static constexpr size_t many = 3000;
#else
static const size_t many = static_cast<size_t>(times(9000, 30000));
#endif

// A face of very many corners. The reader refuses one that takes too many steps, so this bounds them.
START_TEST(large_polygons_are_cut)
{
  Random random(5);
  const std::pair<const char*, Outline> all[] = {{"star", star(random, many)},
                                                 {"spiral", spiral(many)},
                                                 {"comb", comb(many / 3)},
                                                 {"zigzag", zigzag(many / 3)},
                                                 {"flat", with_flat_corners(random, comb(many / 4), true)},
                                                 {"convex", [] {
                                                    Outline out;
                                                    for (size_t i = 0; i < many; ++i) {
                                                      const double angle = 6.2826 * static_cast<double>(i) / many;
                                                      out.push_back({std::cos(angle), std::sin(angle), 0});
                                                    }
                                                    return out;
                                                  }()}};
  for (const auto& [what, points] : all) {
    for (const double angle : {0.0, 0.4, std::numbers::pi / 4}) {
      const Pose pose{{1, 2, 3}, {std::cos(angle / 2), 0, 0, std::sin(angle / 2)}};
      check_covers(placed(points, pose, 1), what, 1e-10);
    }
  }
  const size_t most = 17 * many / 3;
  // The same three points again and again; three hundred points in any order.
  Outline points(300);
  for (Vec3& p : points) p = random.in_box(1);
  for (const uint32_t range : {3u, 300u}) {
    std::string obj;
    for (const Vec3& p : points) obj += "v " + text_of(p);
    obj += "f";
    for (size_t i = 0; i < most; ++i) obj += " " + std::to_string(range == 3 ? 1 + i % 3 : 1 + random.below(range));
    try {
      ck_assert_uint_eq(parse_obj(obj + "\n", "a.obj").triangles.size(), 3 * (most - 2));
    } catch (const Error& error) {
      ck_assert_int_eq(error.status, FS_ERROR_UNSUPPORTED);
      ck_assert_says(error.text, ("a.obj: a face of " + std::to_string(most) + " corners is too entangled").c_str());
    }
  }
}
END_TEST

int main() {
  return run("polygon", {a_fan_would_be_wrong, convex_polygons_are_fans, simple_polygons_are_covered,
                         holes_that_are_joined_by_a_cut, any_outline_ends_well, large_polygons_are_cut});
}
