#include "force/pseudonormals.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "force/mesh_edges.h"
#include "force/triangle.h"

namespace fs {
namespace {

constexpr double flat_angle = 1e-7;        // rad
constexpr double cancelled = 1e-12;        // relative to the weights of a sum of unit normals
constexpr Vec3 no_normal{0, 0, 0};
constexpr Vec3 last_resort{0, 0, 1};

// The number of the vertex of each corner. Points at equal coordinates are one vertex; vertices are numbered in the
// order in which corners first use them.
struct Welded {
  std::vector<uint32_t> corners;
  size_t count = 0;
};

// Sorts, because n points then never take more than n log n steps, however they were chosen.
Welded weld(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted) {
  constexpr uint32_t none = UINT32_MAX;
  struct Place {
    Vec3 position;
    uint32_t point;
  };
  std::vector<uint32_t> first_of(points.size(), none);  // the first point at the same place; none: no corner uses it
  std::vector<Place> places;
  places.reserve(std::min(points.size(), corners.size()));
  for (const uint32_t point : corners) {
    wanted.step();
    if (first_of[point] != none) continue;
    first_of[point] = point;
    places.push_back({points[point], point});
  }
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) {
    wanted.step();
    if (a.position.x != b.position.x) return a.position.x < b.position.x;
    if (a.position.y != b.position.y) return a.position.y < b.position.y;
    return a.position.z < b.position.z;
  });
  for (size_t i = 1; i < places.size(); ++i) {
    if (places[i].position == places[i - 1].position) first_of[places[i].point] = first_of[places[i - 1].point];
  }
  places = {};
  std::vector<uint32_t> vertex_of(points.size(), none);
  Welded welded;
  welded.corners.reserve(corners.size());
  for (const uint32_t point : corners) {
    wanted.step();
    uint32_t& vertex = vertex_of[first_of[point]];
    if (vertex == none) vertex = static_cast<uint32_t>(welded.count++);
    welded.corners.push_back(vertex);
  }
  return welded;
}

double angle_between(Vec3 u, Vec3 v) { return std::atan2(norm(cross(u, v)), dot(u, v)); }

}  // namespace

Pseudonormals::Pseudonormals(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted) {
  const Welded welded = weld(points, corners, wanted);
  vertices_ = welded.corners;
  edges_.resize(corners.size());
  const uint32_t triangle_count = static_cast<uint32_t>(corners.size() / 3);
  const auto corner = [&](uint32_t t, int k) { return points[corners[size_t{3} * t + k]]; };

  // A regular edge joins two triangles that run along it in opposite directions; a mesh can be flat only at such edges.
  std::vector<uint8_t> is_twin(triangle_count, 0), edge_is_flat, vertex_is_flat(welded.count, 1);
  struct Candidate {
    uint64_t key;  // equal for triangles on this edge with the same vertices and orientation
    uint32_t triangle;
  };
  std::vector<Candidate> candidates;
  for_each_edge(welded.corners, welded.count, wanted, [&](std::span<const HalfEdge> edge) {
    candidates.clear();
    for (const HalfEdge h : edge) {
      wanted.step();
      edges_[h.id] = static_cast<uint32_t>(edge_is_flat.size());
      if (is_collapsed(welded.corners, h.triangle())) continue;
      const uint64_t opposite = welded.corners[size_t{3} * h.triangle() + (h.side() + 2) % 3];
      candidates.push_back({opposite << 1 | runs_up(welded.corners, h), h.triangle()});
    }
    size_t count = candidates.size();
    if (count > 2) {
      std::sort(candidates.begin(), candidates.end(), [&](const Candidate& a, const Candidate& b) {
        wanted.step();
        return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
      });
    }
    for (size_t i = 1; i < candidates.size(); ++i) {
      if (candidates[i].key != candidates[i - 1].key) continue;
      is_twin[candidates[i].triangle] = 1;
      --count;
    }
    const bool is_regular = count == 2 && (candidates.front().key & 1) != (candidates.back().key & 1);
    edge_is_flat.push_back(is_regular);
    if (!is_regular && count > 0) {
      const HalfEdge h = edge.front();
      const int lower = (h.side() + (runs_up(welded.corners, h) ? 0 : 1)) % 3;
      vertex_is_flat[h.other] = 0;
      vertex_is_flat[welded.corners[size_t{3} * h.triangle() + lower]] = 0;
    }
  });

  // Sum the normals. A face has the weight pi at its edges (here 1) and its angle at its vertices.
  std::vector<Vec3> faces(triangle_count);
  std::vector<double> vertex_weights(welded.count, 0);
  edge_normals_.assign(edge_is_flat.size(), no_normal);
  vertex_normals_.assign(welded.count, no_normal);
  std::vector<uint32_t> without_area;
  for (uint32_t t = 0; t < triangle_count; ++t) {
    wanted.step();
    if (is_twin[t]) continue;
    const Vec3 p[3] = {corner(t, 0), corner(t, 1), corner(t, 2)};
    faces[t] = triangle_normal(p[0], p[1], p[2]);
    if (faces[t] == no_normal) {
      if (!is_collapsed(welded.corners, t)) without_area.push_back(t);
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      const double angle = angle_between(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
      edge_normals_[edges_[size_t{3} * t + k]] += faces[t];
      vertex_normals_[vertices_[size_t{3} * t + k]] += angle * faces[t];
      vertex_weights[vertices_[size_t{3} * t + k]] += angle;
    }
  }

  // A triangle without area lies along its longest side. To its short sides it stands in for the triangle across the
  // long side, and the other way round; at the corner between the short sides its angle is pi.
  struct StandIn {
    uint32_t triangle;
    int long_side;
    Vec3 across_long, across_short;
  };
  std::vector<StandIn> stand_ins;
  for (const uint32_t t : without_area) {
    int k = 0;
    double longest = -1;
    for (int i = 0; i < 3; ++i) {
      const double length = norm(corner(t, (i + 1) % 3) - corner(t, i));
      if (length > longest) {
        longest = length;
        k = i;
      }
    }
    const auto sum = [&](int side) { return edge_normals_[edges_[size_t{3} * t + side % 3]]; };
    stand_ins.push_back({t, k, normalized(sum(k)), normalized(sum(k + 1) + sum(k + 2))});
  }
  for (const StandIn& s : stand_ins) {
    const size_t first = size_t{3} * s.triangle;
    edge_normals_[edges_[first + s.long_side]] += s.across_short;
    for (int i = 1; i < 3; ++i) edge_normals_[edges_[first + (s.long_side + i) % 3]] += s.across_long;
    const uint32_t vertex = vertices_[first + (s.long_side + 2) % 3];
    vertex_normals_[vertex] += std::numbers::pi * s.across_long;
    vertex_weights[vertex] += std::numbers::pi;
  }

  // Scale to unit length; where normals cancel, take the first triangle's.
  const auto finish = [&](std::vector<Vec3>& normals, const std::vector<uint32_t>& ids, auto weight) {
    for (size_t i = 0; i < normals.size(); ++i) {
      normals[i] = norm(normals[i]) > cancelled * weight(i) ? normalized(normals[i]) : no_normal;
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      wanted.step();
      if (normals[ids[i]] == no_normal) normals[ids[i]] = faces[i / 3];
    }
  };
  finish(edge_normals_, edges_, [](size_t) { return 2.0; });
  finish(vertex_normals_, vertices_, [&](size_t i) { return vertex_weights[i]; });

  // A normal is flat when no triangle there deviates from it.
  const auto mark = [&](std::vector<Vec3>& normals, std::vector<uint32_t>& ids, std::vector<uint8_t>& is_flat) {
    for (size_t i = 0; i < ids.size(); ++i) {
      wanted.step();
      const Vec3 face = faces[i / 3];
      if (!(face == no_normal) && norm(face - normals[ids[i]]) > flat_angle) is_flat[ids[i]] = 0;
    }
    for (size_t i = 0; i < normals.size(); ++i) {
      if (normals[i] == no_normal) {
        normals[i] = last_resort;
        is_flat[i] = 0;
      }
    }
    for (uint32_t& id : ids) {
      if (is_flat[id]) id |= flat_bit;
    }
  };
  mark(edge_normals_, edges_, edge_is_flat);
  mark(vertex_normals_, vertices_, vertex_is_flat);
}

}  // namespace fs
