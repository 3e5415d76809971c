// Normals for the edges and vertices of a mesh that tell the side of any point by the sign of one product: Baerentzen &
// Aanaes, "Signed distance computation using the angle weighted pseudonormal" (IEEE TVCG 11, 2005).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/wanted.h"
#include "math/vec3.h"

namespace fs {

// Vertices at the same coordinates count as one, whatever their indices, so a soup of triangles has its sides too.
//
// Where the paper's assumptions (closed, consistently oriented, no degenerate triangle) fail:
// - an open edge has the normal of its triangle;
// - a triangle that is there twice counts once;
// - a triangle without area counts on each of its sides as what lies across it, so that it changes nothing;
// - normals that cancel (a sheet with two faces) leave that of the triangle with the lowest index;
// - what has no normal at all (only triangles without area) gets {0, 0, 1}.
class Pseudonormals {
 public:
  struct Normal {
    Vec3 vector;   // unit
    bool is_flat;  // inside a part of the mesh that is flat to 1e-7 rad: no edge or vertex can be felt there
  };

  // Throws Abandoned.
  Pseudonormals(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted);

  // [rt] Of side k (from corner k to the next) and corner k of a triangle.
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
  std::vector<uint32_t> edges_, vertices_;  // three a triangle, with flat_bit
};

}  // namespace fs
