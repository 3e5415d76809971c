// The edges of a triangle mesh: which sides of triangles lie on one edge, and what is irregular there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/stop_token.h"

namespace fs {

// True for a triangle with a repeated vertex.
inline bool is_collapsed(std::span<const uint32_t> corners, uint32_t triangle) {
  const uint32_t* v = corners.data() + size_t{3} * triangle;
  return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

// An edge joins two vertices. Side k of triangle t has the number 3 t + k and runs from corner k to the next.
struct MeshEdges {
  enum class Kind : uint8_t {
    none,       // only triangles with a repeated vertex are here
    regular,    // two triangles run along it, in opposite directions; a triangle that repeats another one does not count
    irregular,
  };
  std::vector<uint32_t> of_side;  // the edge that a side lies on
  std::vector<Kind> kinds;        // of each edge
  std::vector<bool> is_twin;      // of each triangle: it repeats one before it
  // Of triangles without a repeated vertex; all of them count.
  uint64_t open = 0;              // edges of one triangle
  uint64_t odd = 0;               // edges of more than two triangles, or of two in the same direction

  bool has_any() const { return open > 0 || odd > 0 || std::find(kinds.begin(), kinds.end(), Kind::regular) != kinds.end(); }

  // corners: three vertices for each triangle, all below vertex_count. Throws Stopped.
  MeshEdges(std::span<const uint32_t> corners, size_t vertex_count, StopToken& stop);
};

}  // namespace fs
