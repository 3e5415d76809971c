// Finds the closest point of a triangle mesh. Built once, then immutable.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "shape/closest.h"
#include "shape/local_frame.h"
#include "shape/mesh/mesh_union.h"
#include "shape/mesh/packet.h"
#include "shape/mesh/pseudonormals.h"
#include "shape/mesh/wide_tree.h"
#include "shape/triangle.h"

namespace fs {

class MeshTree {
 public:
  // corners: three indices of points for each triangle. Both live as long as the tree. edges: of the corners; null: not
  // known. parts: of a closed mesh. Throws Stopped.
  MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> edges,
           const MeshParts& parts, StopToken& stop);

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
  // What was found: a triangle; of a mesh whose parts cross, an item of its union. Of the triangles at the least distance it
  // is the one with the lowest index, as a test of all triangles in order would find it.
  struct Found {
    Nearest nearest;                    // its offset is relative to x
    uint32_t triangle = no_triangle;    // none: nothing is within range
    double least = 0;                   // m: nothing is nearer; where nothing was found, all is farther
    uint32_t visits = 0;                // that it took
    bool is_cut = false;                // the visits ran out: something nearer may be there, but not nearer than `least`
  };
  // [rt]
  Found find(const Query& query) const noexcept;

  // [rt] The same as closest_point() in primitive.h tells it. effort: null: without end.
  Closest tell(Vec3 x, const Found& found, Effort* effort) const noexcept;

  // [rt] See crossing.h.
  bool first_crossing(Side side, Vec3 from, Vec3 to, Crossing& out, uint32_t* visits) const noexcept;

  // [rt] The closest point of a triangle, or of an item of the union, relative to x; and its corner k, m.
  Nearest nearest_on(uint32_t item, Vec3 x) const noexcept {
    return nearest_on_triangle(corner(item, 0) - x, corner(item, 1) - x, corner(item, 2) - x);
  }
  Vec3 corner(uint32_t item, int k) const noexcept {
    if (item >= triangle_count()) return union_->pieces[item - triangle_count()].corners[k];
    return points_[corners_[size_t{3} * item + k]];
  }

  // [rt] How often the mesh, which is closed, goes round x. is_known: false where all ways out of it meet an edge, or the visits
  // do not suffice. visits: that are left; null: without end.
  int winding(Vec3 x, bool& is_known, uint32_t* visits = nullptr) const noexcept;
  // Appends the triangles that may meet the box.
  void collect(const Box& box, std::vector<uint32_t>& out) const;

  // Parts cross or lie in one another: the closest point is that of the union.
  bool is_union() const noexcept { return union_ != nullptr; }
  size_t size() const noexcept;  // bytes

 private:
  template <class From>
  Found find_from(const Query& query) const noexcept;
  // Their code is compiled for each processor.
  static Found find_in(const MeshTree& tree, const Query& query) noexcept;
  static uint32_t cross(const MeshTree& tree, Side side, Vec3 from, Vec3 to, double& part, uint32_t& visits) noexcept;

  uint32_t triangle_count() const noexcept { return static_cast<uint32_t>(corners_.size() / 3); }
  bool is_item(uint32_t item) const noexcept {
    if (!union_) return item < triangle_count();
    return item < triangle_count() ? union_->counts[item] : item - triangle_count() < union_->pieces.size();
  }
  Closest tell_met(Vec3 x, const Found& found, Effort* effort) const noexcept;
  void build_union(std::unique_ptr<MeshUnion> whole, StopToken& stop);

  std::span<const Vec3> points_;
  std::span<const uint32_t> corners_;
  LocalFrame frame_;
  WideTree tree_;
  std::vector<Packet> packets_;  // the leaves of the tree
  Pseudonormals normals_;
  std::unique_ptr<const MeshUnion> union_;  // null: all of the surface counts
};

}  // namespace fs
