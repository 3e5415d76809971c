// Finds the closest point of a triangle mesh. Built once, then immutable.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "force/crossing.h"
#include "force/packet.h"
#include "force/primitive.h"
#include "force/pseudonormals.h"
#include "force/wide_tree.h"

namespace fs {

class MeshTree {
 public:
  // corners: three indices of points for each triangle. Both live as long as the tree. edges: of the corners; null: not
  // known. Throws Abandoned.
  MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> edges, Wanted& wanted);

  static constexpr uint32_t no_triangle = UINT32_MAX;
  static constexpr uint32_t no_limit = UINT32_MAX;

  // What is asked.
  struct Query {
    Vec3 x;                        // m, within 1e150 m
    double range;                  // m, may be infinite
    uint32_t hint = no_triangle;   // a triangle that may be near, such as that of the last query: any makes no difference
                                   // but in time
    uint32_t visits = no_limit;    // of nodes and leaves of the tree and of triangles; the last leaf is finished
  };
  // What was found. Of the triangles at the least distance it is the one with the lowest index, as a test of all triangles in
  // order would find it.
  struct Found {
    Nearest nearest;                    // its offset is relative to x
    uint32_t triangle = no_triangle;    // none: nothing is within range
    double least = 0;                   // m, nothing is nearer; out of range: nothing is as near
    uint32_t visits = 0;                // that it took
    bool is_cut = false;                // the visits ran out: something nearer may be there, but not nearer than `least`
  };
  // [rt]
  Found find(const Query& query) const noexcept;

  // [rt] The same as closest_point() in primitive.h tells it.
  Closest tell(Vec3 x, const Found& found) const noexcept;

  // [rt] See crossing.h.
  bool first_crossing(Side side, Vec3 from, Vec3 to, Crossing& out) const noexcept;

  size_t size() const noexcept;  // bytes

 private:
  template <class From>
  Found find_from(const Query& query) const noexcept;
  Found find_plain(const Query& query) const noexcept;
  Found find_avx2(const Query& query) const noexcept;
  uint32_t cross(Side side, Vec3 from, Vec3 to, double& part) const noexcept;
  uint32_t cross_avx2(Side side, Vec3 from, Vec3 to, double& part) const noexcept;

  Nearest nearest_on(uint32_t triangle, Vec3 x) const noexcept {
    const uint32_t* v = corners_.data() + size_t{3} * triangle;
    return nearest_on_triangle(points_[v[0]] - x, points_[v[1]] - x, points_[v[2]] - x);
  }

  std::span<const Vec3> points_;
  std::span<const uint32_t> corners_;
  LocalFrame frame_;
  WideTree tree_;
  std::vector<Packet> packets_;  // the leaves of the tree
  Pseudonormals normals_;
};

}  // namespace fs
