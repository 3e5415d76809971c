// Normals for the edges and vertices of a mesh that tell the side of any point by the sign of one product: Baerentzen &
// Aanaes, "Signed distance computation using the angle weighted pseudonormal" (IEEE TVCG 11, 2005).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "shape/mesh/mesh_edges.h"
#include "shape/mesh/packed_numbers.h"

namespace fs {

// Vertices at equal coordinates count as one, whatever their indices, so unconnected triangles (a soup) have sides too.
//
// Where the paper's assumptions (closed, consistently oriented, no degenerate triangle) fail:
// - an open edge has the normal of its triangle;
// - a repeated triangle counts once;
// - a triangle without area passes on to each neighbour the normal of the neighbour across it, so it changes nothing;
// - where normals cancel (a sheet with two faces), the triangle with the lowest index gives the normal;
// - where no triangle has an area, the normal is {0, 0, 1}.
//
// For most edges only the triangle on the other side is kept, and the normal is worked out when it is asked for. The normals
// of the vertices and of irregular edges are kept; but a triangle that is alone at a vertex tells the normal there.
class Pseudonormals {
 public:
  struct Normal {
    Vec3 vector;   // unit
    bool is_flat;  // inside a part of the mesh that is flat to 1e-7 rad: no edge or vertex can be felt there
  };

  // points, corners: three indices of points for each triangle; they live as long as the normals. edges: those of the
  // corners, which serve where no two points coincide; null: not known. Throws Stopped.
  Pseudonormals(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> edges,
                StopToken& stop);

  // [rt] The normals of side k (from corner k to the next) and of corner k of a triangle.
  Normal side(uint32_t triangle, int k) const noexcept;
  Normal corner(uint32_t triangle, int k) const noexcept;
  // [rt] The unit normal of a triangle; {0, 0, 0} without area.
  Vec3 face(uint32_t triangle) const noexcept;

  size_t size() const noexcept;  // bytes

 private:
  Normal alone_at(uint32_t triangle, int k) const noexcept;  // at corner k, where no other triangle is
  // Keeps the normals of those edges only whose two triangles do not tell them. of_side: the edge of each side; normals, is_flat:
  // of each edge.
  void keep_edges(std::vector<uint32_t> of_side, std::span<const Vec3> faces, std::span<const Vec3> normals,
                  std::span<const uint8_t> is_flat, StopToken& stop);
  // Keeps the normals of those vertices only that no triangle tells. of_points, of_corners: their vertices; of_points empty:
  // each point is a vertex of its own.
  void keep_vertices(std::vector<uint32_t> of_points, std::span<const uint32_t> of_corners, StopToken& stop);
  uint32_t triangle_count() const noexcept { return static_cast<uint32_t>(corners_.size() / 3); }

  std::span<const Vec3> points_;
  std::span<const uint32_t> corners_;
  // Of each side of each triangle the other triangle; itself where there is none; or, from triangle_count() on, the place of the
  // edge's normal in kept_.
  PackedNumbers across_;
  std::vector<Normal> kept_;
  // Of each point the index of its normal; vertex_normals_.size(): only one triangle is there, which tells the normal. Empty: each
  // point is a vertex of its own.
  PackedNumbers vertices_;
  std::vector<Vec3> vertex_normals_;
  std::vector<bool> vertex_is_flat_;
};

}  // namespace fs
