#include "force/mesh_tree.h"

#include <cmath>

#include "force/triangle.h"

namespace fs {
namespace {

constexpr uint32_t no_triangle = UINT32_MAX;

std::vector<Box> triangle_boxes(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted) {
  std::vector<Box> boxes(corners.size() / 3);
  for (size_t i = 0; i < corners.size(); ++i) {
    wanted.step();
    boxes[i / 3].add(points[corners[i]]);
  }
  return boxes;
}

}  // namespace

MeshTree::MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted)
    : boxes_(triangle_boxes(points, corners, wanted), wanted), normals_(points, corners, wanted) {
  triangles_.reserve(corners.size() / 3);
  faces_.reserve(corners.size() / 3);
  for (const uint32_t i : boxes_.order()) {
    wanted.step();
    const uint32_t* v = corners.data() + size_t{3} * i;
    const Triangle& t = triangles_.emplace_back(Triangle{points[v[0]], points[v[1]], points[v[2]]});
    faces_.push_back(triangle_normal(t.a, t.b, t.c));
  }
}

bool MeshTree::closest(Vec3 x, double max_distance, Closest& out) const noexcept {
  // The bound is squared and slightly enlarged; the exact comparison comes at the end.
  Nearest best;
  uint32_t best_index = no_triangle, best_position = 0;
  boxes_.nearest(x, max_distance * max_distance * (1 + 1e-15) + std::numeric_limits<double>::min(),
                 [&](uint32_t first, uint32_t count, double& bound) {
                   for (uint32_t i = first; i < first + count; ++i) {
                     const Triangle& t = triangles_[i];
                     const Nearest here = nearest_on_triangle(t.a - x, t.b - x, t.c - x);
                     if (here.squared > bound) continue;
                     const uint32_t index = boxes_.order()[i];
                     if (here.squared == best.squared && index > best_index) continue;
                     best = here;
                     best_index = index;
                     best_position = i;
                     bound = here.squared;
                   }
                 });
  if (best_index == no_triangle) return false;
  double distance = std::sqrt(best.squared);
  if (!(distance <= max_distance)) return false;

  const Triangle& t = triangles_[best_position];
  const Vec3 corners[3] = {t.a, t.b, t.c};
  const int part = static_cast<int>(best.part);
  const bool on_edge = best.part == Part::edge_ab || best.part == Part::edge_bc || best.part == Part::edge_ca;
  Pseudonormals::Normal normal{{}, true};
  if (on_edge) {
    normal = normals_.side(best_index, part - 1);
  } else if (best.part != Part::face) {
    normal = normals_.corner(best_index, part - static_cast<int>(Part::corner_a));
  }
  if (normal.is_flat) {
    const Vec3 face = faces_[best_position];
    const bool has_face = !(face == Vec3{0, 0, 0});
    // A point "inside" a triangle without area counts as on its first edge; any edge would do.
    if (!has_face && best.part == Part::face) normal = normals_.side(best_index, 0);
    if (has_face) normal.vector = face;
  }
  const bool on_face = normal.is_flat;

  Closest hit;
  hit.point = x + best.offset;
  hit.triangle = best_index;
  if (on_face) {
    hit.feature = Feature::face;
  } else if (on_edge) {
    hit.feature = Feature::edge;
    hit.tangent = normalized(corners[part % 3] - corners[part - 1]);
  } else {
    hit.feature = Feature::vertex;
  }
  double largest = largest_coordinate(x);
  for (const Vec3& corner : corners) largest = std::max(largest, largest_coordinate(corner));
  if (distance <= coordinate_rounding(largest)) {
    distance = 0;
    hit.direction = normal.vector;
  } else {
    hit.side = dot(best.offset, normal.vector) <= 0 ? Side::front : Side::back;
    // At a tiny distance the offset is mostly rounding error; on a face the normal is exact.
    if (!on_face) {
      hit.direction = normalized(-best.offset);
    } else {
      hit.direction = hit.side == Side::front ? normal.vector : -normal.vector;
    }
  }
  hit.distance = distance;
  out = hit;
  return true;
}

}  // namespace fs
