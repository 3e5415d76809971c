// The edges of a triangle mesh, found by sorting its half-edges into the lower of their two vertices.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/wanted.h"

namespace fs {

// Side k of triangle t runs from its corner k to the next; id = 3 t + k.
struct HalfEdge {
  uint32_t other;  // the higher vertex
  uint32_t id;
  uint32_t triangle() const { return id / 3; }
  int side() const { return static_cast<int>(id % 3); }
};

// True when the half-edge runs from the lower vertex to the higher.
inline bool runs_up(std::span<const uint32_t> corners, HalfEdge h) { return corners[h.id] != h.other; }

// True for a triangle with a repeated vertex.
inline bool is_collapsed(std::span<const uint32_t> corners, uint32_t triangle) {
  const uint32_t* v = corners.data() + size_t{3} * triangle;
  return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

// Calls edge(half_edges) for every edge, with the half-edges that lie on it in the order of their triangles. corners:
// three vertices for each triangle, all below vertex_count. The half-edges of collapsed triangles are included.
template <class Edge>
void for_each_edge(std::span<const uint32_t> corners, size_t vertex_count, Wanted& wanted, Edge&& edge) {
  const auto for_each_half_edge = [&](auto&& visit) {
    for (size_t t = 0; t + 2 < corners.size(); t += 3) {
      wanted.step();
      const uint32_t v[3] = {corners[t], corners[t + 1], corners[t + 2]};
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t from = v[k], to = v[(k + 1) % 3];
        visit(std::min(from, to), HalfEdge{std::max(from, to), static_cast<uint32_t>(t + k)});
      }
    }
  };
  // A counting sort: begin[v] .. begin[v + 1] are the half-edges whose lower vertex is v.
  std::vector<uint32_t> begin(vertex_count + 2, 0);
  for_each_half_edge([&](uint32_t low, HalfEdge) { ++begin[low + size_t{2}]; });
  for (size_t v = 2; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<HalfEdge> half_edges(begin.back());
  for_each_half_edge([&](uint32_t low, HalfEdge h) { half_edges[begin[low + size_t{1}]++] = h; });

  for (size_t v = 0; v < vertex_count; ++v) {
    HalfEdge* first = half_edges.data() + begin[v];
    HalfEdge* const last = half_edges.data() + begin[v + 1];
    std::sort(first, last, [&](HalfEdge a, HalfEdge b) {
      wanted.step();
      return a.other != b.other ? a.other < b.other : a.id < b.id;
    });
    wanted.step();
    while (first != last) {
      HalfEdge* end = first + 1;
      while (end != last && end->other == first->other) ++end;
      edge(std::span<const HalfEdge>(first, end));
      first = end;
    }
  }
}

}  // namespace fs
