// The surface of what the parts of a closed mesh are together. A part is what edges join; a mesh of many parts, stuck into one
// another, has surface that lies inside: it is no boundary of anything, and no profile may count from there.
//
// Inside is where the mesh goes round a place, all parts together: where its winding number is not 0. A hollow, whose surface
// is turned inwards, is outside. What counts is each piece of surface that has an inside on one side only. A triangle that
// others pass through is cut along their planes, and each piece is decided by itself. A part that passes through itself is
// not looked for.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "shape/mesh/mesh_edges.h"
#include "shape/mesh/packet.h"
#include "shape/mesh/wide_tree.h"

namespace fs {

class MeshTree;

// The parts of a closed mesh.
struct MeshParts {
  std::vector<uint32_t> of;  // of each triangle; empty: there is one, or they are not asked for
  uint32_t count = 1;

  MeshParts() = default;
  MeshParts(std::span<const uint32_t> corners, const MeshEdges& edges, StopToken& stop);  // Throws Stopped.
};

// Its items are those triangles of the mesh that count, by their numbers, and then the pieces of triangles.
struct MeshUnion {
  struct Piece {
    Vec3 corners[3];    // m; they run as those of the triangle do
    uint32_t triangle;  // that it was cut from
  };
  std::vector<Piece> pieces;        // number i has the item (triangles of the mesh + i)
  std::vector<bool> counts;         // of each triangle: it is an item as a whole
  // Of each triangle: another part touches it, so its neighbours in its own part do not tell the side at its edges.
  std::vector<bool> is_met;
  std::vector<bool> is_inward;  // of each item that is met: the inside is in front of it
  WideTree tree;  // of the items
  std::vector<Packet> packets;

  // Null: the surface of the mesh is all that counts. mesh: without a union yet. Throws Stopped.
  static std::unique_ptr<MeshUnion> of(const MeshTree& mesh, std::span<const Vec3> points, std::span<const uint32_t> corners,
                                       const MeshParts& parts, StopToken& stop);
};

}  // namespace fs
