#include "shape/crossing.h"

#include <tuple>
#include <utility>

#include "math/quad.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/triangle.h"

namespace fs {
namespace {

// Six times the signed volume of the tetrahedron: > 0 if d lies behind the triangle abc, where its front is the side from
// which a, b, c run counter-clockwise.
double volume_of(Vec3 a, Vec3 b, Vec3 c, Vec3 d) noexcept {
  const Vec3 u = a - d, v = b - d, w = c - d;
  const double vw = v.y * w.z, wv = v.z * w.y, wu = w.y * u.z, uw = w.z * u.y, uv = u.y * v.z, vu = u.z * v.y;
  const double volume = u.x * (vw - wv) + v.x * (wu - uw) + w.x * (uv - vu);
  const double size = (std::fabs(vw) + std::fabs(wv)) * std::fabs(u.x) + (std::fabs(wu) + std::fabs(uw)) * std::fabs(v.x) +
                      (std::fabs(uv) + std::fabs(vu)) * std::fabs(w.x);
  // Shewchuk, "Adaptive precision floating-point arithmetic" (1997): beyond this bound the sign is right.
  if (std::fabs(volume) > 7.8e-16 * size) return volume;
  const Quad ux = Quad(a.x) - d.x, uy = Quad(a.y) - d.y, uz = Quad(a.z) - d.z;
  const Quad vx = Quad(b.x) - d.x, vy = Quad(b.y) - d.y, vz = Quad(b.z) - d.z;
  const Quad wx = Quad(c.x) - d.x, wy = Quad(c.y) - d.y, wz = Quad(c.z) - d.z;
  const Quad exact = ux * (vy * wz - vz * wy) + vx * (wy * uz - wz * uy) + wx * (uy * vz - uz * vy);
  const double out = static_cast<double>(exact);
  return out != 0 || exact == 0 ? out : exact > 0 ? 1e-300 : -1e-300;
}

// On which side of the edge uv the line from a to b passes. uv and vu give opposite numbers, so two triangles agree about the
// edge that they share.
double side_of_edge(Vec3 a, Vec3 b, Vec3 u, Vec3 v) noexcept {
  const bool is_turned = std::tie(v.x, v.y, v.z) < std::tie(u.x, u.y, u.z);
  if (is_turned) std::swap(u, v);
  const double volume = volume_of(a, b, u, v);
  return is_turned ? -volume : volume;
}

bool crosses_plane(Side side, Vec3 from, Vec3 to, double radius, Crossing& out) noexcept {
  const double sign = side == Side::front ? 1 : -1, start = sign * from.z - radius, end = sign * to.z - radius;
  if (!(start >= 0 && end < 0)) return false;
  out.part = start / (start - end);
  out.point = from + out.part * (to - from);
  out.point.z = sign * radius;
  out.normal = {0, 0, sign};
  out.triangle = 0;
  return true;
}

}  // namespace

bool crosses_triangle(Vec3 a, Vec3 b, Vec3 c, Side side, Vec3 from, Vec3 to, double& part) noexcept {
  const double sign = side == Side::front ? -1 : 1;
  const double start = sign * volume_of(a, b, c, from);
  if (!(start >= 0)) return false;
  const double end = sign * volume_of(a, b, c, to);
  if (!(end < 0)) return false;
  const double ab = side_of_edge(from, to, a, b), bc = side_of_edge(from, to, b, c), ca = side_of_edge(from, to, c, a);
  if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) return false;
  part = start / (start - end);
  return true;
}

int crossing_of(Vec3 a, Vec3 b, Vec3 c, Vec3 from, Vec3 to, bool& is_unclear) noexcept {
  const double start = volume_of(a, b, c, from), end = volume_of(a, b, c, to);
  if ((start > 0 && end > 0) || (start < 0 && end < 0)) return 0;
  const double ab = side_of_edge(from, to, a, b), bc = side_of_edge(from, to, b, c), ca = side_of_edge(from, to, c, a);
  const bool is_through = (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
  if (!is_through) return 0;
  if (start == 0 || end == 0 || ab == 0 || bc == 0 || ca == 0) {
    is_unclear |= !(triangle_normal(a, b, c) == Vec3{});  // without area it tells nothing
    return 0;
  }
  return start > 0 ? 1 : -1;
}

bool first_crossing(fs_primitive primitive, const Shape* shape, Side side, Vec3 from, Vec3 to, double radius, Crossing& out,
                    uint32_t* visits) noexcept {
  if (!is_finite(from) || !is_finite(to)) return false;
  if (primitive == FS_PRIMITIVE_PLANE) return crosses_plane(side, from, to, radius, out);
  if (primitive != FS_PRIMITIVE_MESH) return false;
  return shape->tree()->first_crossing(side, from, to, out, visits);
}

}  // namespace fs
