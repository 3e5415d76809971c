// The search of a MeshTree for the first triangle that a way crosses.
#include <bit>
#include <limits>

#include "shape/crossing.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/mesh/packet_triangles.h"

namespace fs {

using namespace wide;

// Returns the triangle, or none. visits: that are left; 0 afterwards: they did not suffice.
FS_INLINE uint32_t MeshTree::cross(const MeshTree& tree, Side side, Vec3 from, Vec3 to, double& part, uint32_t& visits) noexcept {
  const Vec3 start = tree.frame_.local(from), way = tree.frame_.local(to) - start;
  uint32_t out = no_triangle;
  part = std::numeric_limits<double>::infinity();
  Span span(start, start + way);
  uint32_t stack[WideTree::most_depth * (WideNode::width - 1) + 1];
  uint32_t size = 0;
  stack[size++] = tree.tree_.nodes() ? WideTree::root : WideNode::leaf_bit;
  while (size > 0 && visits > 0) {
    --visits;
    const uint32_t child = stack[--size];
    if (!(child & WideNode::leaf_bit)) {
      const WideNode& node = tree.tree_.nodes()[child];
      for (uint32_t near = children_in(node, span); near; near &= near - 1) {
        stack[size++] = node.child[std::countr_zero(near)];
      }
      continue;
    }
    const Packet& packet = tree.packets_[child & ~WideNode::leaf_bit];
    for (uint32_t near = triangles_in(packet, span); near; near &= near - 1) {
      const uint32_t triangle = packet.triangle[std::countr_zero(near)];
      const uint32_t* v = tree.corners_.data() + size_t{3} * triangle;
      const std::span<const Vec3> points = tree.points_;
      double here;
      if (visits > 0) --visits;
      if (!crosses_triangle(points[v[0]], points[v[1]], points[v[2]], side, from, to, here)) continue;
      if (here > part || (here == part && triangle > out)) continue;
      part = here;
      out = triangle;
      span = Span(start, start + part * way);
    }
  }
  return out;
}

namespace {

// Calls use(triangle) for each that may meet the span, as long as visits are left.
template <class Use>
void for_each_near(const WideTree& tree, const std::vector<Packet>& packets, const Span& span, uint32_t& visits, Use&& use) {
  uint32_t stack[WideTree::most_depth * (WideNode::width - 1) + 1];
  uint32_t size = 0;
  stack[size++] = tree.nodes() ? WideTree::root : WideNode::leaf_bit;
  while (size > 0 && visits > 0) {
    --visits;
    const uint32_t child = stack[--size];
    if (!(child & WideNode::leaf_bit)) {
      const WideNode& node = tree.nodes()[child];
      for (uint32_t near = children_in(node, span); near; near &= near - 1) stack[size++] = node.child[std::countr_zero(near)];
      continue;
    }
    const Packet& packet = packets[child & ~WideNode::leaf_bit];
    for (uint32_t near = triangles_in(packet, span); near; near &= near - 1) {
      if (visits > 0) --visits;
      use(packet.triangle[std::countr_zero(near)]);
    }
  }
}

}  // namespace

int MeshTree::winding(Vec3 x, bool& is_known, uint32_t* visits) const noexcept {
  // Ways that leave the mesh nearly along an axis, so that few triangles are near; each leans another way, so that hardly any
  // meets an edge, and hardly two of them do.
  constexpr int tries = 9;
  const double size = 2 / frame_.scale;  // m; the mesh is no larger
  const Vec3 away = x - frame_.middle;
  uint32_t endless = UINT32_MAX;
  uint32_t& left = visits ? *visits : endless;
  for (int i = 0; i < tries && left > 0; ++i) {
    double way[3];
    const double from[3] = {away.x, away.y, away.z};
    for (int k = 0; k < 3; ++k) {
      const double lean = 1e-4 * (1 + 0.137 * i + 0.618 * k);
      way[k] = k == (2 - i % 3) ? (from[k] < 0 ? -1 : 1) : k % 2 ? lean : -lean;
    }
    const Vec3 to = x + size * Vec3{way[0], way[1], way[2]};
    const Vec3 a = frame_.local(x), b = frame_.local(to);
    int out = 0;
    bool is_unclear = false;
    for_each_near(tree_, packets_, Span(a, b), left, [&](uint32_t triangle) {
      out += crossing_of(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2), x, to, is_unclear);
    });
    if (!is_unclear && left > 0) return out;
  }
  is_known = false;
  return 0;
}

void MeshTree::collect(const Box& box, std::vector<uint32_t>& out) const {
  uint32_t visits = UINT32_MAX;
  for_each_near(tree_, packets_, Span(frame_.local(box.lower), frame_.local(box.upper)), visits,
                [&](uint32_t triangle) { out.push_back(triangle); });
}

bool MeshTree::first_crossing(Side side, Vec3 from, Vec3 to, Crossing& out, uint32_t* visits) const noexcept {
  double part;
  uint32_t endless = UINT32_MAX;
  uint32_t& left = visits ? *visits : endless;
  const uint32_t triangle = lanes::run<cross>(*this, side, from, to, part, left);
  if (left == 0) {
    out = {.part = 0, .point = from, .normal = normalized(from - to), .triangle = no_triangle};
    return true;
  }
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
