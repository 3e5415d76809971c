#include "shape/primitive.h"

#include <algorithm>
#include <cmath>

#include "shape/mesh/mesh_tree.h"
#include "shape/mesh/wide_search.h"
#include "shape/triangle.h"

namespace fs {
namespace {

constexpr double largest_query = 1e150;  // m: its square is finite

bool closest_on_point(Vec3 x, double max_distance, Closest& out) noexcept {
  const double distance = norm(x);
  if (!(distance <= max_distance)) return false;
  out = Closest{};
  out.distance = distance;
  if (distance > 0) out.direction = normalized(x);
  return true;
}

bool closest_on_plane(Vec3 x, double max_distance, Closest& out) noexcept {
  const double distance = std::fabs(x.z);
  if (!(distance <= max_distance)) return false;
  out = Closest{};
  out.point = {x.x, x.y, 0};
  out.distance = distance;
  out.side = x.z < 0 ? Side::back : Side::front;
  out.direction = {0, 0, x.z < 0 ? -1.0 : 1.0};
  out.feature = Feature::face;
  return true;
}

// Calls ask(segment, range) for all segments that may be as near as the range (m^2), which ask lowers.
template <class From, class Ask>
void ask_near(const Segments& segments, Vec3 at, double range, Ask&& ask) noexcept {
  const WideTree& tree = *segments.tree;
  const double scale = segments.frame.scale;
  const auto local = [&] { return wide::rounded_up<From>(range * scale * scale); };
  uint32_t visits = UINT32_MAX;
  wide::search(
      tree, From{at}, local(), visits,
      [&](uint32_t leaf, auto& local_bound) {
        const auto [begin, end] = tree.leaves()[leaf];
        for (uint32_t i = begin; i < end; ++i) ask(tree.items()[i], range);
        local_bound = local();
      },
      [](uint32_t) {});
}

bool closest_on_polyline(const Shape& shape, Vec3 x, double max_distance, Closest& out) noexcept {
  const std::vector<Vec3>& points = shape.points;
  const Segments& segments = shape.segments();
  const size_t count = segments.count();
  const auto start = [&](size_t i) { return points[i]; };
  const auto end = [&](size_t i) { return points[i + 1 < points.size() ? i + 1 : 0]; };
  Nearest best;
  size_t best_segment = count;
  // The range is squared and slightly enlarged; the exact comparison comes at the end.
  double range = max_distance * max_distance * (1 + 1e-15) + std::numeric_limits<double>::min();
  const auto ask = [&](size_t segment, double& range) {
    Nearest here;
    nearest_on_segment(start(segment) - x, end(segment) - x, Part::edge_ab, Part::corner_a, Part::corner_b, here);
    if (here.squared > range || (here.squared == best.squared && segment > best_segment)) return;
    best = here;
    best_segment = segment;
    range = here.squared;
  };
  if (segments.tree) {
    const Vec3 at = segments.frame.local(x);
    if (largest_coordinate(at) < wide::far) {
      ask_near<wide::Near>(segments, at, range, ask);
    } else {
      ask_near<wide::Far>(segments, at, range, ask);
    }
  } else {
    for (size_t i = 0; i < count; ++i) ask(i, range);
  }
  if (best_segment == count) return false;
  const double distance = std::sqrt(best.squared);
  if (!(distance <= max_distance)) return false;

  out = Closest{};
  out.point = x + best.offset;
  out.triangle = static_cast<uint32_t>(best_segment);
  bool on_edge = best.part == Part::edge_ab;
  if (best.part == Part::corner_a) {
    on_edge = segments.goes_straight_on[best_segment > 0 ? best_segment - 1 : count - 1];
  } else if (best.part == Part::corner_b) {
    on_edge = segments.goes_straight_on[best_segment];
  }
  if (on_edge) {
    out.feature = Feature::edge;
    out.tangent = segments.tangents[best_segment];
  }
  const double largest =
      std::max(largest_coordinate(x), std::max(largest_coordinate(start(best_segment)), largest_coordinate(end(best_segment))));
  if (distance > coordinate_rounding(largest)) {
    out.distance = distance;
    out.direction = normalized(-best.offset);
  }
  return true;
}

bool closest_on_mesh(const MeshTree& tree, Vec3 x, double max_distance, Closest& out, Hint* hint, Effort* effort) noexcept {
  MeshTree::Query query{.x = x, .range = max_distance};
  if (hint) {
    // A distance changes by no more than the way. As long as that tells that the shape is out of range, nothing is searched.
    const double way = norm(x - hint->from) * (1 + 1e-14) + coordinate_rounding(2 * largest_coordinate(x));
    if (hint->gap - way > max_distance) return false;
    query.hint = hint->triangle;
    if (hint->gap >= max_distance) query.range += std::min(32 * way, max_distance);  // to know more for the next times
  }
  if (effort) query.visits = std::min(effort->visits, effort->most);
  const MeshTree::Found found = tree.find(query);
  if (effort) {
    effort->visits -= found.visits;
    effort->is_cut = found.is_cut;
    effort->least = found.least;
  }
  if (hint) {
    hint->triangle = found.triangle;
    hint->from = x;
    hint->gap = found.least;
  }
  if (found.triangle == MeshTree::no_triangle || !(std::sqrt(found.nearest.squared) <= max_distance)) return false;
  out = tree.tell(x, found, effort);
  return true;
}

}  // namespace

bool closest_point(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out, Hint* hint,
                   Effort* effort) noexcept {
  if (effort) effort->is_cut = false;
  if (!(max_distance >= 0) || !is_finite(x) || largest_coordinate(x) > largest_query) return false;
  switch (primitive) {
    case FS_PRIMITIVE_POINT: return closest_on_point(x, max_distance, out);
    case FS_PRIMITIVE_POLYLINE: return closest_on_polyline(*shape, x, max_distance, out);
    case FS_PRIMITIVE_PLANE: return closest_on_plane(x, max_distance, out);
    case FS_PRIMITIVE_MESH: return closest_on_mesh(*shape->tree(), x, max_distance, out, hint, effort);
    default: return false;
  }
}

}  // namespace fs
