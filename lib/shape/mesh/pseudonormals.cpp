#include "shape/mesh/pseudonormals.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "shape/mesh/weld.h"
#include "shape/triangle.h"

namespace fs {
namespace {

constexpr double flat_angle = 1e-7;        // rad
constexpr double cancelled = 1e-12;        // relative to the weights of a sum of unit normals
constexpr Vec3 no_normal{0, 0, 0};
constexpr Vec3 last_resort{0, 0, 1};

// The points that corners use, where those at equal coordinates are one vertex.
struct Vertices {
  std::vector<uint32_t> vertices;  // of each point; empty: each point is a vertex of its own
  std::vector<uint32_t> corners;   // the vertex of each corner; empty: its point
  uint32_t count = 0;              // of the vertices
};

Vertices weld(std::span<const Vec3> points, std::span<const uint32_t> corners, StopToken& stop) {
  constexpr uint32_t none = UINT32_MAX;
  std::vector<uint32_t> vertices(points.size(), none), used;
  used.reserve(std::min(points.size(), corners.size()));
  for (const uint32_t point : corners) {
    stop.check();
    if (vertices[point] != none) continue;
    vertices[point] = point;
    used.push_back(point);
  }
  if (!join_equal_places(points, used, vertices, stop)) return {};
  // Vertices are numbered in the order in which corners first use them.
  Vertices welded;
  std::vector<uint32_t> number_of(points.size(), none);
  welded.corners.reserve(corners.size());
  for (const uint32_t point : corners) {
    stop.check();
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

// The normals of all edges and vertices of a mesh: sums of those of its faces.
class NormalSums {
 public:
  // vertices: of each corner. All that is referred to lives as long.
  NormalSums(std::span<const Vec3> points, std::span<const uint32_t> corners, std::span<const uint32_t> vertices,
             size_t vertex_count, const MeshEdges& edges, StopToken& stop)
      : of_edges(edges.kinds.size(), no_normal), of_vertices(vertex_count, no_normal), edge_is_flat(edges.kinds.size()),
        vertex_is_flat(vertex_count, true), points_(points), corners_(corners), vertices_(vertices), edges_(edges), stop_(stop),
        weights_(vertex_count, 0) {
    note_irregular();
    add_faces();
    add_stand_ins();
    scale(of_edges, edges_.of_side, [](size_t) { return 2.0; }, edge_is_flat);
    scale(of_vertices, vertices_, [this](size_t i) { return weights_[i]; }, vertex_is_flat);
  }

  std::vector<Vec3> faces;  // the normal of each triangle
  std::vector<Vec3> of_edges, of_vertices;
  std::vector<uint8_t> edge_is_flat;
  std::vector<bool> vertex_is_flat;

 private:
  // A triangle without area lies along its longest side. To its short sides it stands in for the triangle across the
  // long side, and the other way round; at the corner between the short sides its angle is pi.
  struct StandIn {
    uint32_t triangle;
    int long_side;
    Vec3 across_long, across_short;
  };

  Vec3 corner(uint32_t t, int k) const { return points_[corners_[size_t{3} * t + k]]; }
  uint32_t edge(uint32_t t, int side) const { return edges_.of_side[size_t{3} * t + side % 3]; }
  uint32_t vertex(uint32_t t, int k) const { return vertices_[size_t{3} * t + k % 3]; }

  // A mesh can be flat only at regular edges.
  void note_irregular() {
    for (size_t e = 0; e < edges_.kinds.size(); ++e) edge_is_flat[e] = edges_.kinds[e] == MeshEdges::Kind::regular;
    for (uint32_t i = 0; i < corners_.size(); ++i) {
      stop_.check();
      if (edges_.kinds[edges_.of_side[i]] != MeshEdges::Kind::irregular) continue;
      vertex_is_flat[vertices_[i]] = false;
      vertex_is_flat[vertices_[i % 3 < 2 ? i + 1 : i - 2]] = false;
    }
  }

  // A face has the weight pi at its edges (here 1) and its angle at its vertices.
  void add_faces() {
    const auto triangle_count = static_cast<uint32_t>(corners_.size() / 3);
    faces.resize(triangle_count);
    for (uint32_t t = 0; t < triangle_count; ++t) {
      stop_.check();
      if (edges_.is_twin[t]) continue;
      const Vec3 p[3] = {corner(t, 0), corner(t, 1), corner(t, 2)};
      faces[t] = triangle_normal(p[0], p[1], p[2]);
      if (faces[t] == no_normal) {
        if (!is_collapsed(vertices_, t)) without_area_.push_back(t);
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        const double angle = angle_between(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
        of_edges[edge(t, k)] += faces[t];
        of_vertices[vertex(t, k)] += angle * faces[t];
        weights_[vertex(t, k)] += angle;
      }
    }
  }

  void add_stand_ins() {
    std::vector<StandIn> all;  // each as the sums are before any of them is added
    for (const uint32_t t : without_area_) all.push_back(stand_in(t));
    for (const StandIn& each : all) add(each);
  }
  StandIn stand_in(uint32_t t) const {
    int k = 0;
    double longest = -1;
    for (int i = 0; i < 3; ++i) {
      const double length = norm(corner(t, (i + 1) % 3) - corner(t, i));
      if (length > longest) {
        longest = length;
        k = i;
      }
    }
    const auto sum = [&](int side) { return of_edges[edge(t, side)]; };
    return {t, k, normalized(sum(k)), normalized(sum(k + 1) + sum(k + 2))};
  }
  void add(const StandIn& s) {
    const uint32_t t = s.triangle;
    of_edges[edge(t, s.long_side)] += s.across_short;
    for (int i = 1; i < 3; ++i) of_edges[edge(t, s.long_side + i)] += s.across_long;
    // Where it has no neighbour to pass on, the surface ends.
    const auto end_at = [&](int side) {
      edge_is_flat[edge(t, side)] = 0;
      vertex_is_flat[vertex(t, side)] = vertex_is_flat[vertex(t, side + 1)] = false;
    };
    if (s.across_short == no_normal) end_at(s.long_side);
    if (s.across_long == no_normal) end_at(s.long_side + 1), end_at(s.long_side + 2);
    of_vertices[vertex(t, s.long_side + 2)] += std::numbers::pi * s.across_long;
    weights_[vertex(t, s.long_side + 2)] += std::numbers::pi;
  }

  // To unit length; where normals cancel, the first triangle's is taken. A normal is flat when no triangle there deviates from
  // it. ids: which of the normals each side or corner has.
  template <class Weight, class Flags>
  void scale(std::vector<Vec3>& normals, std::span<const uint32_t> ids, Weight&& weight, Flags& is_flat) {
    for (size_t i = 0; i < normals.size(); ++i) {
      normals[i] = norm(normals[i]) > cancelled * weight(i) ? normalized(normals[i]) : no_normal;
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      stop_.check();
      if (normals[ids[i]] == no_normal) normals[ids[i]] = faces[i / 3];
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      stop_.check();
      const Vec3 face = faces[i / 3];
      if (!(face == no_normal) && norm(face - normals[ids[i]]) > flat_angle) is_flat[ids[i]] = false;
    }
    for (size_t i = 0; i < normals.size(); ++i) {
      if (normals[i] == no_normal) {
        normals[i] = last_resort;
        is_flat[i] = false;
      }
    }
  }

  const std::span<const Vec3> points_;
  const std::span<const uint32_t> corners_, vertices_;
  const MeshEdges& edges_;
  StopToken& stop_;
  std::vector<double> weights_;  // of each vertex
  std::vector<uint32_t> without_area_;
};

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
                             StopToken& stop)
    : points_(points), corners_(corners) {
  const auto point_count = static_cast<double>(points.size()), corner_count = static_cast<double>(corners.size());
  stop.begin_part(0.65, corner_count + 1.4 * point_count * std::log2(point_count));
  Vertices welded = weld(points, corners, stop);
  const std::span<const uint32_t> vertices = welded.corners.empty() ? corners : std::span<const uint32_t>(welded.corners);
  const size_t vertex_count = welded.corners.empty() ? points.size() : welded.count;

  stop.begin_part(0.68, 4.2 * corner_count);
  if (!known || !welded.corners.empty()) known = std::make_unique<MeshEdges>(vertices, vertex_count, stop);
  stop.begin_part(0.97, 8.6 * corner_count);
  NormalSums sums(points, corners, vertices, vertex_count, *known, stop);
  vertex_normals_ = std::move(sums.of_vertices);
  vertex_is_flat_ = std::move(sums.vertex_is_flat);
  keep_edges(std::move(known->of_side), sums.faces, sums.of_edges, sums.edge_is_flat, stop);
  keep_vertices(std::move(welded.vertices), vertices, stop);
}

void Pseudonormals::keep_edges(std::vector<uint32_t> of_side, std::span<const Vec3> faces, std::span<const Vec3> normals,
                               std::span<const uint8_t> is_flat, StopToken& stop) {
  constexpr uint32_t none = UINT32_MAX;
  std::vector<uint32_t> first(normals.size(), none), second(normals.size(), none), place(normals.size(), none);
  for (uint32_t t = 0; t < triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      uint32_t& one = first[of_side[size_t{3} * t + k]];
      (one == none ? one : second[of_side[size_t{3} * t + k]]) = t;
    }
  }
  std::vector<uint32_t> across = std::move(of_side);  // is replaced side by side
  for (uint32_t i = 0; i < corners_.size(); ++i) {
    stop.check();
    const uint32_t edge = across[i], t = i / 3, low = first[edge], high = second[edge] == none ? low : second[edge];
    const Normal normal{normals[edge], is_flat[edge] != 0};
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
  across_ = PackedNumbers(across, triangle_count() + static_cast<uint32_t>(kept_.size()), stop);
}

void Pseudonormals::keep_vertices(std::vector<uint32_t> of_points, std::span<const uint32_t> of_corners, StopToken& stop) {
  constexpr uint32_t unused = UINT32_MAX, shared = UINT32_MAX - 1;
  std::vector<uint32_t> users(vertex_normals_.size(), unused);  // the only corner at each vertex, or one of these
  for (uint32_t i = 0; i < of_corners.size(); ++i) {
    stop.check();
    uint32_t& user = users[of_corners[i]];
    user = user == unused ? i : shared;
  }
  size_t told = 0;
  for (size_t vertex = 0; vertex < users.size(); ++vertex) {
    stop.check();
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
    stop.check();
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
    stop.check();
    vertex = users[vertex];
  }
  vertices_ = PackedNumbers(of_points, kept, stop);
}

}  // namespace fs
