#include "shape/shape.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/hash.h"
#include "shape/mesh/mesh_edges.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/mesh/mesh_union.h"
#include "shape/mesh/weld.h"
#include "shape/mesh/wide_tree.h"
#include "shape/triangle.h"

namespace fs {
namespace {

constexpr size_t most_points = 4'000'000'000;  // an index is a uint32_t
constexpr size_t most_triangles = 500'000'000; // so is the number of a half-edge, 3 per triangle

void check_points(const Vec3* points, size_t count, size_t least, StopToken& stop) {
  if (count < least)
    fail(FS_ERROR_INVALID, "the shape has %zu %s, must have at least %zu", count, count == 1 ? "point" : "points", least);
  if (count > most_points) fail(FS_ERROR_INVALID, "the shape has %zu points, must be at most %zu", count, most_points);
  for (size_t i = 0; i < count; ++i) {
    stop.check();
    const double coordinates[] = {points[i].x, points[i].y, points[i].z};
    for (int k = 0; k < 3; ++k) {
      if (std::fabs(coordinates[k]) <= coordinate_limit) continue;
      fail(FS_ERROR_INVALID, "points[%zu].%c is %.9g, must be finite and within +-%.9g m", i, "xyz"[k], coordinates[k],
           coordinate_limit);
    }
  }
}

fs_shape_info bounds_of(const std::vector<Vec3>& points, StopToken& stop) {
  fs_shape_info info = fs_shape_info_init();
  Box box;
  for (const Vec3& p : points) {
    stop.check();
    box.add(p);
  }
  info.lower = box.lower;
  info.upper = box.upper;
  return info;
}

uint64_t count_degenerate(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles, StopToken& stop) {
  uint64_t count = 0;
  for (size_t i = 0; i < triangles.size(); i += 3) {
    stop.check();
    const Vec3 n = triangle_normal(points[triangles[i]], points[triangles[i + 1]], points[triangles[i + 2]]);
    if (n == Vec3{0, 0, 0}) ++count;
  }
  return count;
}

double radius_of(const std::vector<Vec3>& points, StopToken& stop) {
  double largest = 0;
  for (const Vec3& p : points) {
    stop.check();
    largest = std::fmax(largest, dot(p, p));
  }
  return std::sqrt(largest) * (1 + 1e-12);
}

bool are_on_a_line(const std::vector<Vec3>& points, StopToken& stop) {
  const Vec3 begin = points.front();
  Vec3 along{};
  for (const Vec3& p : points) {
    stop.check();
    if (norm(p - begin) > norm(along)) along = p - begin;
  }
  const Vec3 direction = normalized(along);
  return std::all_of(points.begin(), points.end(),
                     [&](const Vec3& p) { return norm(cross(p - begin, direction)) <= 1e-6 * norm(along); });
}

// The edges of a mesh, and in `info` how many are open or odd. Where some are, equal places of these edges' ends are joined, and
// the edges are found anew: if that closes the mesh, it has an inside.
std::unique_ptr<MeshEdges> joined_edges(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles,
                                        fs_shape_info& info, StopToken& stop) {
  const auto is_closed = [](const MeshEdges& edges) { return edges.open == 0 && edges.odd == 0 && edges.has_any(); };
  auto edges = std::make_unique<MeshEdges>(triangles, points.size(), stop);
  info.open_edges = edges->open;
  info.odd_edges = edges->odd;
  info.closed = info.has_inside = is_closed(*edges);
  if (info.closed || edges->open == 0) return edges;
  std::vector<uint32_t> ends;  // of irregular edges, each once
  std::vector<bool> is_end(points.size());
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    stop.check();
    if (edges->kinds[edges->of_side[i]] != MeshEdges::Kind::irregular) continue;
    for (const uint32_t end : {triangles[i], triangles[i % 3 < 2 ? i + 1 : i - 2]}) {
      if (!is_end[end]) ends.push_back(end);
      is_end[end] = true;
    }
  }
  std::vector<uint32_t> joined(points.size());
  std::iota(joined.begin(), joined.end(), 0u);
  if (!join_equal_places(points, ends, joined, stop)) return edges;
  std::vector<uint32_t> corners;
  corners.reserve(triangles.size());
  for (const uint32_t i : triangles) corners.push_back(joined[i]);
  auto all = std::make_unique<MeshEdges>(corners, points.size(), stop);
  if (!is_closed(*all)) return edges;
  info.has_inside = true;
  return all;
}

// Whether a part is turned inwards, by its volume, and lies in the box of no part that is turned outwards.
bool has_inward_parts(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles, const MeshEdges& edges,
                      StopToken& stop) {
  const MeshParts parts(triangles, edges, stop);
  struct Part {
    double volume = 0;  // m^3, six times
    Box box;
    uint32_t first = UINT32_MAX;  // a point, from which the volume is measured
  };
  std::vector<Part> all(parts.count);
  for (size_t i = 0; i < triangles.size(); i += 3) {
    stop.check();
    Part& part = all[parts.of.empty() ? 0 : parts.of[i / 3]];
    if (part.first == UINT32_MAX) part.first = triangles[i];
    const Vec3 from = points[part.first];
    Vec3 corner[3];
    for (size_t k = 0; k < 3; ++k) part.box.add(corner[k] = points[triangles[i + k]]);
    part.volume += dot(corner[0] - from, cross(corner[1] - from, corner[2] - from));
  }
  constexpr size_t most_pairs = 10'000'000;  // of parts that are compared; beyond that it is not looked for hollows
  std::vector<const Part*> inward;
  for (const Part& part : all) {
    if (part.volume < 0) inward.push_back(&part);
  }
  if (inward.size() * all.size() > most_pairs) return true;
  return std::any_of(inward.begin(), inward.end(), [&](const Part* hollow) {
    stop.check();
    return std::none_of(all.begin(), all.end(),
                        [&](const Part& part) { return part.volume > 0 && hollow->box.is_inside(part.box); });
  });
}

}  // namespace

Segments::Segments(const std::vector<Vec3>& points, bool closed, StopToken& stop) {
  constexpr double straight_angle = 1e-7;  // rad
  const size_t count = closed ? points.size() : points.size() - 1;
  const auto next = [&](size_t i) { return i + 1 < points.size() ? i + 1 : 0; };
  for (size_t i = 0; i < count; ++i) {
    stop.check();
    tangents.push_back(normalized(points[next(i)] - points[i]));
  }
  for (size_t i = 0; i < count; ++i) {
    stop.check();
    const size_t beyond = i + 1 < count ? i + 1 : closed ? 0 : i;
    goes_straight_on.push_back(beyond != i && !(tangents[i] == Vec3{}) && norm(tangents[beyond] - tangents[i]) <= straight_angle);
  }
  if (count <= few) return;
  Box all;
  for (const Vec3& p : points) all.add(p);
  frame = LocalFrame(all);
  std::vector<Box> boxes(count);
  for (size_t i = 0; i < count; ++i) {
    stop.check();
    boxes[i].add(frame.local(points[i]));
    boxes[i].add(frame.local(points[next(i)]));
  }
  tree = std::make_unique<const WideTree>(std::move(boxes), stop);
}

Segments::~Segments() = default;

// What is worked out from the points and triangles does not count: a later version may do that otherwise.
static std::array<uint64_t, 2> content_of(const Shape& shape) noexcept {
  ContentHash hash;
  hash.add(static_cast<uint64_t>(shape.primitive));
  hash.add(shape.primitive == FS_PRIMITIVE_POLYLINE && shape.closed);
  hash.add(shape.points.size());
  hash.add(shape.triangles.size());
  for (const Vec3& p : shape.points) {
    for (const double x : {p.x, p.y, p.z}) hash.add(std::bit_cast<uint64_t>(x));
  }
  const std::vector<uint32_t>& corners = shape.triangles;
  for (size_t i = 0; i + 1 < corners.size(); i += 2) hash.add(corners[i] | uint64_t{corners[i + 1]} << 32);
  if (corners.size() % 2) hash.add(corners.back());
  return hash.get();
}

Ref<const Shape> make_polyline(const Vec3* points, size_t count, bool closed, StopToken& stop) {
  check_points(points, count, 2, stop);
  std::vector<Vec3> copy(points, points + count);
  fs_shape_info info = bounds_of(copy, stop);
  info.primitive = FS_PRIMITIVE_POLYLINE;
  info.closed = closed;
  return make_ref<const Shape>(info, std::move(copy), std::vector<uint32_t>(), nullptr, stop);
}

namespace {
void check_triangle_count(size_t count) {
  if (count < 1) fail(FS_ERROR_INVALID, "the mesh has no triangle, must have at least one");
  if (count > most_triangles) fail(FS_ERROR_INVALID, "the mesh has %zu triangles, must be at most %zu", count, most_triangles);
}
}  // namespace

Ref<const Shape> make_mesh(const Vec3* points, size_t point_count, const uint32_t* triangles, size_t triangle_count,
                           StopToken& stop) {
  check_triangle_count(triangle_count);
  check_points(points, point_count, 1, stop);
  return make_mesh({points, points + point_count}, {triangles, triangles + 3 * triangle_count}, stop);
}

Ref<const Shape> make_mesh(std::vector<Vec3> points, std::vector<uint32_t> triangles, StopToken& stop) {
  check_triangle_count(triangles.size() / 3);
  check_points(points.data(), points.size(), 1, stop);
  for (size_t i = 0; i < triangles.size(); ++i) {
    stop.check();
    if (triangles[i] < points.size()) continue;
    fail(FS_ERROR_INVALID, "triangles[%zu] has point %u as corner %zu, must be below the %zu points there are", i / 3,
         triangles[i], i % 3, points.size());
  }
  points.shrink_to_fit();
  triangles.shrink_to_fit();
  fs_shape_info info = bounds_of(points, stop);
  info.primitive = FS_PRIMITIVE_MESH;
  info.degenerate = count_degenerate(points, triangles, stop);
  auto edges = joined_edges(points, triangles, info, stop);
  return make_ref<const Shape>(info, std::move(points), std::move(triangles), std::move(edges), stop);
}

}  // namespace fs

fs_shape::fs_shape(const fs_shape_info& info, std::vector<fs::Vec3> the_points, std::vector<uint32_t> the_triangles,
                   std::unique_ptr<fs::MeshEdges> edges, fs::StopToken& stop)
    : primitive(info.primitive), points(std::move(the_points)), triangles(std::move(the_triangles)),
      closed(primitive == FS_PRIMITIVE_MESH ? info.has_inside : info.closed), radius(fs::radius_of(points, stop)),
      has_inward_parts(edges && info.has_inside && fs::has_inward_parts(points, triangles, *edges, stop)),
      is_straight(primitive == FS_PRIMITIVE_POLYLINE && fs::are_on_a_line(points, stop)), info_(info), edges_(std::move(edges)) {
  if (primitive == FS_PRIMITIVE_POLYLINE) {
    segments_ = std::make_unique<const fs::Segments>(points, closed, stop);
  }
}

fs_shape::~fs_shape() { delete tree_.load(std::memory_order_relaxed); }

void fs_shape::build(fs::StopToken& stop) const {
  if (is_built()) return;
  const std::lock_guard lock(build_mutex_);
  if (is_built()) return;
  stop.show(&progress_);
  try {
    fs_shape_info info = fs_shape_info_init();
    if (closed && !edges_) edges_ = fs::joined_edges(points, triangles, info, stop);
    const fs::MeshParts parts = closed ? fs::MeshParts(triangles, *edges_, stop) : fs::MeshParts();
    tree_.store(new fs::MeshTree(points, triangles, std::move(edges_), parts, stop), std::memory_order_release);
  } catch (...) {
    stop.show(nullptr);
    progress_ = 0;
    throw;
  }
  stop.show(nullptr);
}

bool fs_shape::is_built() const noexcept { return primitive == FS_PRIMITIVE_POLYLINE || tree() != nullptr; }

bool fs_shape::is_united() const noexcept { return tree() && tree()->is_union(); }

void fs_shape::get_info(fs_shape_info& out) const {
  const uint32_t struct_size = out.struct_size;
  out = info_;
  out.struct_size = struct_size;
  out.built = is_built();
  out.united = is_united();
}

// No lock is held: threads that ask at the same time all work it out.
std::array<uint64_t, 2> fs_shape::content() const noexcept {
  if (!has_content_.load(std::memory_order_acquire)) {
    const std::array<uint64_t, 2> found = fs::content_of(*this);
    for (size_t i = 0; i < found.size(); ++i) content_[i].store(found[i], std::memory_order_relaxed);
    has_content_.store(true, std::memory_order_release);
  }
  return {content_[0].load(std::memory_order_relaxed), content_[1].load(std::memory_order_relaxed)};
}
