// The points of a polyline or triangles of a mesh, immutable. It is the fs_shape of the C contract itself.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include <forceserver/object.h>

#include "base/counted.h"
#include "base/serial.h"
#include "base/stop_token.h"
#include "math/vec3.h"
#include "shape/local_frame.h"

namespace fs {
class MeshTree;
struct MeshEdges;
class WideTree;
}  // namespace fs

namespace fs {

// The segments of a polyline: segment i begins at point i.
struct Segments {
  static constexpr size_t few = 12;
  LocalFrame frame;
  std::unique_ptr<const WideTree> tree;   // in that frame; null: they are few, so all of them are looked at
  std::vector<Vec3> tangents;             // unit; {0, 0, 0} without length
  std::vector<uint8_t> goes_straight_on;  // into the next segment

  Segments(const std::vector<Vec3>& points, bool closed, StopToken& stop);
  ~Segments();
  size_t count() const noexcept { return tangents.size(); }
};

}  // namespace fs

struct fs_shape : fs::Counted<fs_shape> {
  // edges: those of a mesh, as joined_edges finds them.
  fs_shape(const fs_shape_info& info, std::vector<fs::Vec3> points, std::vector<uint32_t> triangles,
           std::unique_ptr<fs::MeshEdges> edges, fs::StopToken& stop);
  ~fs_shape();

  const uint64_t serial = fs::next_serial();
  const fs_primitive primitive;            // POLYLINE or MESH
  const std::vector<fs::Vec3> points;      // m, object frame
  const std::vector<uint32_t> triangles;   // three point indices for each triangle; empty for a polyline
  const bool closed;                       // polyline: the last point joins the first; mesh: has_inside of fs_shape_info
  const double radius;                     // m, from the origin to the farthest point, rounded up
  const bool has_inward_parts;             // mesh, closed: some part faces inwards that lies in no part that faces outwards
  const bool is_straight;                  // polyline: all its points lie on one line, within a millionth of its length

  // Builds the search tree of a mesh once. Any thread may call it; the others wait until the tree is built. A polyline
  // is always built. Throws Stopped.
  void build(fs::StopToken& stop) const;
  void build() const {
    fs::StopToken stop;
    build(stop);
  }
  bool is_built() const noexcept;
  bool is_united() const noexcept;  // [rt] see fs_shape_info
  // [rt] 0..1, of the build; 1 only when it is built.
  double progress() const noexcept { return is_built() ? 1 : 0.999 * progress_.load(std::memory_order_relaxed); }
  const fs::MeshTree* tree() const noexcept { return tree_.load(std::memory_order_acquire); }  // [rt] null until built

  const fs::Segments& segments() const noexcept { return *segments_; }  // [rt] of a polyline

  // Open and odd edges join vertices of equal index; a triangle with a repeated index is degenerate and has no edges here.
  void get_info(fs_shape_info& out) const;  // all but struct_size and content
  std::array<uint64_t, 2> content() const noexcept;  // see fs_shape_info

  // Keeps `what` alive as long as the shape. Called before any other thread has the shape.
  void keep(std::shared_ptr<const void> what) const { kept_ = std::move(what); }

 private:
  mutable std::shared_ptr<const void> kept_;
  fs_shape_info info_;
  std::unique_ptr<const fs::Segments> segments_;
  mutable std::mutex build_mutex_;
  mutable std::unique_ptr<fs::MeshEdges> edges_;  // of a mesh until a build takes them, which need not sort them again
  mutable std::atomic<double> progress_{0};
  mutable std::atomic<const fs::MeshTree*> tree_{nullptr};
  mutable std::array<std::atomic<uint64_t>, 2> content_{};
  mutable std::atomic<bool> has_content_{false};
};

namespace fs {

using Shape = fs_shape;

// These check their arguments, and copy them unless they are vectors. INVALID: fewer than 2 points, no triangle, an index out of range, a coordinate
// not finite or beyond 1e15 m, more than 4e9 points or 5e8 triangles; the sentence names the first bad point or
// triangle. Throws Stopped.
Ref<const Shape> make_polyline(const Vec3* points, size_t count, bool closed, StopToken& stop);
Ref<const Shape> make_mesh(const Vec3* points, size_t point_count, const uint32_t* triangles, size_t triangle_count,
                           StopToken& stop);
Ref<const Shape> make_mesh(std::vector<Vec3> points, std::vector<uint32_t> triangles, StopToken& stop);
inline Ref<const Shape> make_polyline(const Vec3* points, size_t count, bool closed) {
  StopToken stop;
  return make_polyline(points, count, closed, stop);
}
inline Ref<const Shape> make_mesh(const Vec3* points, size_t point_count, const uint32_t* triangles, size_t triangle_count) {
  StopToken stop;
  return make_mesh(points, point_count, triangles, triangle_count, stop);
}

}  // namespace fs
