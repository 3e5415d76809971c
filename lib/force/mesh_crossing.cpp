// The search of a MeshTree for the first triangle that a way crosses.
#include <bit>
#include <limits>

#include "base/processor.h"
#include "force/mesh_tree.h"
#include "force/packet_triangles.h"

namespace fs {

using namespace wide;

// Returns the triangle, or none.
FS_INLINE uint32_t MeshTree::cross(Side side, Vec3 from, Vec3 to, double& part) const noexcept {
  const Vec3 start = frame_.local(from), way = frame_.local(to) - start;
  uint32_t out = no_triangle;
  part = std::numeric_limits<double>::infinity();
  Span span(start, start + way);
  uint32_t stack[WideTree::most_depth * (WideNode::width - 1) + 1];
  uint32_t size = 0;
  stack[size++] = tree_.nodes() ? WideTree::root : WideNode::leaf_bit;
  while (size > 0) {
    const uint32_t child = stack[--size];
    if (!(child & WideNode::leaf_bit)) {
      const WideNode& node = tree_.nodes()[child];
      for (uint32_t near = children_in(node, span); near; near &= near - 1) {
        stack[size++] = node.child[std::countr_zero(near)];
      }
      continue;
    }
    const Packet& packet = packets_[child & ~WideNode::leaf_bit];
    for (uint32_t near = triangles_in(packet, span); near; near &= near - 1) {
      const uint32_t triangle = packet.triangle[std::countr_zero(near)];
      const uint32_t* v = corners_.data() + size_t{3} * triangle;
      double here;
      if (!crosses_triangle(points_[v[0]], points_[v[1]], points_[v[2]], side, from, to, here)) continue;
      if (here > part || (here == part && triangle > out)) continue;
      part = here;
      out = triangle;
      span = Span(start, start + part * way);
    }
  }
  return out;
}

#ifdef __x86_64__
__attribute__((target("avx2"))) uint32_t MeshTree::cross_avx2(Side side, Vec3 from, Vec3 to, double& part) const noexcept {
  return cross(side, from, to, part);
}
#endif

bool MeshTree::first_crossing(Side side, Vec3 from, Vec3 to, Crossing& out) const noexcept {
  double part;
#ifdef __x86_64__
  const uint32_t triangle = has_avx2 ? cross_avx2(side, from, to, part) : cross(side, from, to, part);
#else
  const uint32_t triangle = cross(side, from, to, part);
#endif
  if (triangle == no_triangle) return false;
  out.part = part;
  out.point = from + part * (to - from);
  out.triangle = triangle;
  out.normal = normals_.face(triangle);
  if (side == Side::back) out.normal = -out.normal;
  if (out.normal == Vec3{}) out.normal = normalized(from - to);  // its area is only rounding error
  return true;
}

}  // namespace fs
