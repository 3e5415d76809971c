// Normals for the edges and vertices of a mesh that tell the side of any point by the sign of one product: Baerentzen &
// Aanaes, "Signed distance computation using the angle weighted pseudonormal" (IEEE TVCG 11, 2005).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/wanted.h"
#include "math/vec3.h"

namespace fs {

// Vertices at equal coordinates count as one, whatever their indices, so unconnected triangles (a soup) have sides too.
//
// Where the paper's assumptions (closed, consistently oriented, no degenerate triangle) fail:
// - an open edge has the normal of its triangle;
// - a repeated triangle counts once;
// - a triangle without area passes on to each neighbour the normal of the neighbour across it, so it changes nothing;
// - where normals cancel (a sheet with two faces), the triangle with the lowest index gives the normal;
// - where no triangle has an area, the normal is {0, 0, 1}.
class Pseudonormals {
 public:
  struct Normal {
    Vec3 vector;   // unit
    bool is_flat;  // inside a part of the mesh that is flat to 1e-7 rad: no edge or vertex can be felt there
  };

  // Throws Abandoned.
  Pseudonormals(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted);

  // [rt] The normals of side k (from corner k to the next) and of corner k of a triangle.
  Normal side(uint32_t triangle, int k) const noexcept { return get(edge_normals_, edges_[size_t{3} * triangle + k]); }
  Normal corner(uint32_t triangle, int k) const noexcept {
    return get(vertex_normals_, vertices_[size_t{3} * triangle + k]);
  }

 private:
  static constexpr uint32_t flat_bit = 0x80000000u;
  static Normal get(const std::vector<Vec3>& normals, uint32_t id) noexcept {
    return {normals[id & ~flat_bit], (id & flat_bit) != 0};
  }

  std::vector<Vec3> edge_normals_, vertex_normals_;
  std::vector<uint32_t> edges_, vertices_;  // three for each triangle, with flat_bit
};

}  // namespace fs
