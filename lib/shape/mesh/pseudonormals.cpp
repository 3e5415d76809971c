#include "shape/mesh/pseudonormals.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "shape/triangle.h"

namespace fs {
namespace {

constexpr double flat_angle = 1e-7;        // rad
constexpr double cancelled = 1e-12;        // relative to the weights of a sum of unit normals
constexpr Vec3 no_normal{0, 0, 0};
constexpr Vec3 last_resort{0, 0, 1};

// The points that corners use, where those at equal coordinates are one vertex.
struct Welded {
  std::vector<uint32_t> vertices;  // of each point; empty: each point is a vertex of its own
  std::vector<uint32_t> corners;   // the vertex of each corner; empty: its point
  uint32_t count = 0;              // of the vertices
};

// Sorts, because n points then never take more than n log n steps, however they were chosen.
Welded weld(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted) {
  constexpr uint32_t none = UINT32_MAX;
  struct Place {
    Vec3 position;
    uint32_t point;
  };
  std::vector<uint32_t> vertices(points.size(), none);
  std::vector<Place> places;
  places.reserve(std::min(points.size(), corners.size()));
  for (const uint32_t point : corners) {
    wanted.step();
    if (vertices[point] != none) continue;
    vertices[point] = point;
    places.push_back({points[point], point});
  }
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) {
    wanted.step();
    if (a.position.x != b.position.x) return a.position.x < b.position.x;
    if (a.position.y != b.position.y) return a.position.y < b.position.y;
    if (a.position.z != b.position.z) return a.position.z < b.position.z;
    return a.point < b.point;
  });
  bool are_different = true;
  for (size_t i = 1; i < places.size(); ++i) {
    if (!(places[i].position == places[i - 1].position)) continue;
    vertices[places[i].point] = vertices[places[i - 1].point];
    are_different = false;
  }
  if (are_different) return {};
  // Vertices are numbered in the order in which corners first use them.
  Welded welded;
  std::vector<uint32_t> number_of(points.size(), none);
  welded.corners.reserve(corners.size());
  for (const uint32_t point : corners) {
    wanted.step();
    uint32_t& number = number_of[vertices[point]];
    if (number == none) number = welded.count++;
    welded.corners.push_back(number);
  }
  // Nobody asks for that of an unused point.
  for (uint32_t& vertex : vertices) vertex = vertex == none ? 0 : number_of[vertex];
  welded.vertices = std::move(vertices);
  return welded;
}

double angle_between(Vec3 u, Vec3 v) { return std::atan2(norm(cross(u, v)), dot(u, v)); }

// The normal of the edge between two triangles with these normals.
Pseudonormals::Normal between(Vec3 lower, Vec3 higher) {
  const Vec3 normal = normalized(lower + higher);
  return {normal, norm(lower - normal) <= flat_angle && norm(higher - normal) <= flat_angle};
}

// That of an edge with one triangle.
Pseudonormals::Normal alone(Vec3 face) { return {normalized(face), false}; }

}  // namespace

Vec3 Pseudonormals::face(uint32_t triangle) const noexcept {
  const uint32_t* v = corners_.data() + size_t{3} * triangle;
  return triangle_normal(points_[v[0]], points_[v[1]], points_[v[2]]);
}

Pseudonormals::Normal Pseudonormals::side(uint32_t triangle, int k) const noexcept {
  const uint32_t across = across_[size_t{3} * triangle + k];
  if (across >= triangle_count()) return kept_[across - triangle_count()];
  if (across == triangle) return alone(face(triangle));
  return between(face(std::min(triangle, across)), face(std::max(triangle, across)));
}

Pseudonormals::Normal Pseudonormals::corner(uint32_t triangle, int k) const noexcept {
  const uint32_t point = corners_[size_t{3} * triangle + k];
  const uint32_t vertex = vertices_.empty() ? point : vertices_[point];
  if (vertex == vertex_normals_.size()) return alone_at(triangle, k);
  return {vertex_normals_[vertex], vertex_is_flat_[vertex]};
}

// The same sum as that of a vertex with more triangles, so that it has the same bits.
Pseudonormals::Normal Pseudonormals::alone_at(uint32_t triangle, int k) const noexcept {
  const uint32_t* v = corners_.data() + size_t{3} * triangle;
  const Vec3 p = points_[v[k]];
  const double angle = angle_between(points_[v[(k + 1) % 3]] - p, points_[v[(k + 2) % 3]] - p);
  Vec3 sum{};
  sum += angle * face(triangle);
  return {normalized(sum), false};
}

size_t Pseudonormals::size() const noexcept {
  return across_.size() + kept_.size() * sizeof(Normal) + vertices_.size() + vertex_normals_.size() * sizeof(Vec3) +
         vertex_is_flat_.size() / 8;
}

Pseudonormals::Pseudonormals(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> known,
                             Wanted& wanted)
    : points_(points), corners_(corners) {
  const auto point_count = static_cast<double>(points.size()), corner_count = static_cast<double>(corners.size());
  wanted.begin_part(0.65, corner_count + 1.4 * point_count * std::log2(point_count));
  Welded welded = weld(points, corners, wanted);
  const std::span<const uint32_t> vertices = welded.corners.empty() ? corners : std::span<const uint32_t>(welded.corners);
  const size_t vertex_count = welded.corners.empty() ? points.size() : welded.count;
  const auto corner = [&](uint32_t t, int k) { return points[corners[size_t{3} * t + k]]; };

  wanted.begin_part(0.68, 4.2 * corner_count);
  if (!known || !welded.corners.empty()) known = std::make_unique<MeshEdges>(vertices, vertex_count, wanted);
  wanted.begin_part(0.97, 8.6 * corner_count);
  MeshEdges& edges = *known;
  // A mesh can be flat only at regular edges.
  std::vector<uint8_t> edge_is_flat(edges.kinds.size());
  vertex_is_flat_.assign(vertex_count, true);
  for (size_t e = 0; e < edges.kinds.size(); ++e) edge_is_flat[e] = edges.kinds[e] == MeshEdges::Kind::regular;
  for (uint32_t i = 0; i < corners.size(); ++i) {
    wanted.step();
    if (edges.kinds[edges.of_side[i]] != MeshEdges::Kind::irregular) continue;
    vertex_is_flat_[vertices[i]] = false;
    vertex_is_flat_[vertices[i % 3 < 2 ? i + 1 : i - 2]] = false;
  }

  // Sum the normals. A face has the weight pi at its edges (here 1) and its angle at its vertices.
  std::vector<Vec3> faces(triangle_count());
  std::vector<double> vertex_weights(vertex_count, 0);
  std::vector<Vec3> edge_normals(edge_is_flat.size(), no_normal);
  vertex_normals_.assign(vertex_count, no_normal);
  std::vector<uint32_t> without_area;
  for (uint32_t t = 0; t < triangle_count(); ++t) {
    wanted.step();
    if (edges.is_twin[t]) continue;
    const Vec3 p[3] = {corner(t, 0), corner(t, 1), corner(t, 2)};
    faces[t] = triangle_normal(p[0], p[1], p[2]);
    if (faces[t] == no_normal) {
      if (!is_collapsed(vertices, t)) without_area.push_back(t);
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      const double angle = angle_between(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
      edge_normals[edges.of_side[size_t{3} * t + k]] += faces[t];
      vertex_normals_[vertices[size_t{3} * t + k]] += angle * faces[t];
      vertex_weights[vertices[size_t{3} * t + k]] += angle;
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
    const auto sum = [&](int side) { return edge_normals[edges.of_side[size_t{3} * t + side % 3]]; };
    stand_ins.push_back({t, k, normalized(sum(k)), normalized(sum(k + 1) + sum(k + 2))});
  }
  for (const StandIn& s : stand_ins) {
    const size_t first = size_t{3} * s.triangle;
    edge_normals[edges.of_side[first + s.long_side]] += s.across_short;
    for (int i = 1; i < 3; ++i) edge_normals[edges.of_side[first + (s.long_side + i) % 3]] += s.across_long;
    // Where it has no neighbour to pass on, the surface ends.
    const auto end_at = [&](int side) {
      edge_is_flat[edges.of_side[first + side % 3]] = 0;
      vertex_is_flat_[vertices[first + side % 3]] = vertex_is_flat_[vertices[first + (side + 1) % 3]] = false;
    };
    if (s.across_short == no_normal) end_at(s.long_side);
    if (s.across_long == no_normal) end_at(s.long_side + 1), end_at(s.long_side + 2);
    const uint32_t vertex = vertices[first + (s.long_side + 2) % 3];
    vertex_normals_[vertex] += std::numbers::pi * s.across_long;
    vertex_weights[vertex] += std::numbers::pi;
  }

  // Scale to unit length; where normals cancel, take the first triangle's. Then mark what deviates from it: a normal is flat
  // when no triangle there does.
  const auto finish = [&](std::vector<Vec3>& normals, std::span<const uint32_t> ids, auto weight, auto& is_flat) {
    for (size_t i = 0; i < normals.size(); ++i) {
      normals[i] = norm(normals[i]) > cancelled * weight(i) ? normalized(normals[i]) : no_normal;
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      wanted.step();
      if (normals[ids[i]] == no_normal) normals[ids[i]] = faces[i / 3];
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      wanted.step();
      const Vec3 face = faces[i / 3];
      if (!(face == no_normal) && norm(face - normals[ids[i]]) > flat_angle) is_flat[ids[i]] = false;
    }
    for (size_t i = 0; i < normals.size(); ++i) {
      if (normals[i] == no_normal) {
        normals[i] = last_resort;
        is_flat[i] = false;
      }
    }
  };
  finish(edge_normals, edges.of_side, [](size_t) { return 2.0; }, edge_is_flat);
  finish(vertex_normals_, vertices, [&](size_t i) { return vertex_weights[i]; }, vertex_is_flat_);

  // Keep the normals of those edges only whose two triangles do not tell them.
  constexpr uint32_t none = UINT32_MAX;
  std::vector<uint32_t> first(edge_is_flat.size(), none), second(edge_is_flat.size(), none), place(edge_is_flat.size(), none);
  for (uint32_t t = 0; t < triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      uint32_t& one = first[edges.of_side[size_t{3} * t + k]];
      (one == none ? one : second[edges.of_side[size_t{3} * t + k]]) = t;
    }
  }
  std::vector<uint32_t> across = std::move(edges.of_side);  // and is replaced side by side
  for (uint32_t i = 0; i < corners.size(); ++i) {
    wanted.step();
    const uint32_t edge = across[i], t = i / 3, low = first[edge], high = second[edge] == none ? low : second[edge];
    const Normal normal{edge_normals[edge], edge_is_flat[edge] != 0};
    if ((t == low || t == high) && !(faces[low] == no_normal) && !(faces[high] == no_normal)) {
      const Normal told = low == high ? alone(faces[low]) : between(faces[low], faces[high]);
      if (told.vector == normal.vector && told.is_flat == normal.is_flat) {
        across[i] = t == low ? high : low;
        continue;
      }
    }
    if (place[edge] == none) {
      place[edge] = static_cast<uint32_t>(kept_.size());
      kept_.push_back(normal);
    }
    across[i] = triangle_count() + place[edge];
  }
  kept_.shrink_to_fit();
  across_ = PackedNumbers(across, triangle_count() + static_cast<uint32_t>(kept_.size()), wanted);
  keep_vertices(std::move(welded.vertices), vertices, wanted);
}

void Pseudonormals::keep_vertices(std::vector<uint32_t> of_points, std::span<const uint32_t> of_corners, Wanted& wanted) {
  constexpr uint32_t unused = UINT32_MAX, shared = UINT32_MAX - 1;
  std::vector<uint32_t> users(vertex_normals_.size(), unused);  // the only corner at each vertex, or one of these
  for (uint32_t i = 0; i < of_corners.size(); ++i) {
    wanted.step();
    uint32_t& user = users[of_corners[i]];
    user = user == unused ? i : shared;
  }
  size_t told = 0;
  for (size_t vertex = 0; vertex < users.size(); ++vertex) {
    wanted.step();
    uint32_t& user = users[vertex];
    if (user != unused && user != shared) {
      const Normal normal = alone_at(user / 3, static_cast<int>(user % 3));
      if (!(normal.vector == vertex_normals_[vertex]) || vertex_is_flat_[vertex]) user = shared;
    }
    told += user != shared;
  }
  // Where each point is a vertex of its own, numbers for them all take more memory than a few normals do.
  if (of_points.empty()) {
    if (told * sizeof(Vec3) <= points_.size() * sizeof(uint32_t)) return;
    of_points.resize(points_.size());
    for (uint32_t i = 0; i < of_points.size(); ++i) of_points[i] = i;
  }
  const auto kept = static_cast<uint32_t>(users.size() - told);
  uint32_t count = 0;
  for (size_t vertex = 0; vertex < users.size(); ++vertex) {
    wanted.step();
    if (users[vertex] != shared) {
      users[vertex] = kept;  // from here on: their new numbers
      continue;
    }
    vertex_normals_[count] = vertex_normals_[vertex];
    vertex_is_flat_[count] = vertex_is_flat_[vertex];
    users[vertex] = count++;
  }
  vertex_normals_.resize(kept);
  vertex_normals_.shrink_to_fit();
  vertex_is_flat_.resize(kept);
  for (uint32_t& vertex : of_points) {
    wanted.step();
    vertex = users[vertex];
  }
  vertices_ = PackedNumbers(of_points, kept, wanted);
}

}  // namespace fs
