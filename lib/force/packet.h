// Up to eight triangles, in single precision on a grid of their own: to tell which of them may be nearest.
#pragma once

#include "force/triangle.h"
#include "force/wide_tree.h"

namespace fs {

// 192 bytes, three lines of the cache.
struct alignas(64) Packet {
  static constexpr uint32_t width = WideTree::width;
  static constexpr uint32_t none = UINT32_MAX;

  // All triangles lie in a disc: within `radius` of the line through the centre along the normal, and within `height` of the
  // plane through the centre. The normal is hardly shorter than 1.
  float centre[3], normal[3], radius, height;  // local frame
  float lower[3];             // the corner of the grid
  float per_unit;             // grid steps a local unit; 0: the triangles are too small for a grid
  uint32_t triangle[width];   // none: an empty lane
  uint32_t corners[3][width]; // of a, b and c: x, y and z in steps, in 10 bits each, from the lowest
  static constexpr int most_steps = 1023;

  struct Triangle {
    Vec3 corners[3];  // local frame
  };
  Packet(const uint32_t* triangles, const Triangle* places, uint32_t count);
};

namespace wide {

// A lower bound of the squared distance to the disc of a packet (local units).
FS_INLINE double squared_to_disc(const Packet& packet, Vec3 from) {
  const double x = from.x - packet.centre[0], y = from.y - packet.centre[1], z = from.z - packet.centre[2];
  const double along = packet.normal[0] * x + packet.normal[1] * y + packet.normal[2] * z;
  const double up = std::max(std::fabs(along) - packet.height, 0.0);
  const double beside = std::max(std::sqrt(std::max(x * x + y * y + z * z - along * along, 0.0)) - packet.radius, 0.0);
  return (up * up + beside * beside) * (1 - 1e-5);
}

// What a packet says about its triangles as seen from a point. A triangle may be at a distance d of the point (local units)
// only if its squared distance is at most (d * per_unit + slack)^2.
struct Estimate {
  Floats squared;   // in steps
  float slack;      // in steps
  float per_unit;   // 0: nothing is known
  uint32_t filled;  // bit i: there is a triangle in lane i

  // Bit i: triangle i may be within a distance (local units).
  FS_INLINE uint32_t within(double distance) const {
    const double steps = distance * per_unit * (1 + 1e-6) + slack;
    if (!(steps < 1e15)) return filled;
    const auto most = static_cast<float>(steps);
    return bits(squared <= all(most * most)) & filled;
  }
};

FS_INLINE Floats squared_to_segment(Floats ex, Floats ey, Floats ez, Floats length, Floats x, Floats y, Floats z) {
  Floats t = (x * ex + y * ey + z * ez) / most(length, all(1));
  t = least(most(t, all(0)), all(1));
  x -= t * ex;
  y -= t * ey;
  z -= t * ez;
  return x * x + y * y + z * z;
}

FS_INLINE Estimate estimate(const Packet& packet, Vec3 from) {
  Ints id;
  std::memcpy(&id, packet.triangle, sizeof id);
  Estimate out{{}, 0, packet.per_unit, bits(id != -1)};
  const double per_unit = packet.per_unit;
  const double u = (from.x - packet.lower[0]) * per_unit, v = (from.y - packet.lower[1]) * per_unit,
               w = (from.z - packet.lower[2]) * per_unit;
  const double largest = std::max(std::max(std::fabs(u), std::fabs(v)), std::fabs(w));
  if (!(largest < 1e9)) {  // far away all of them are one point
    out.per_unit = 0;
    return out;
  }
  const Floats x = all(static_cast<float>(u)), y = all(static_cast<float>(v)), z = all(static_cast<float>(w));
  const Ints a = load(packet.corners[0]), b = load(packet.corners[1]), c = load(packet.corners[2]);
  const Floats a_x = field(a, 0, 10), a_y = field(a, 10, 10), a_z = field(a, 20, 10);
  const Floats b_x = field(b, 0, 10), b_y = field(b, 10, 10), b_z = field(b, 20, 10);
  const Floats c_x = field(c, 0, 10), c_y = field(c, 10, 10), c_z = field(c, 20, 10);
  const Floats ab_x = b_x - a_x, ab_y = b_y - a_y, ab_z = b_z - a_z;
  const Floats bc_x = c_x - b_x, bc_y = c_y - b_y, bc_z = c_z - b_z;
  const Floats ca_x = a_x - c_x, ca_y = a_y - c_y, ca_z = a_z - c_z;
  const Floats ax = x - a_x, ay = y - a_y, az = z - a_z;
  const Floats bx = x - b_x, by = y - b_y, bz = z - b_z;
  const Floats cx = x - c_x, cy = y - c_y, cz = z - c_z;
  const Floats ab = ab_x * ab_x + ab_y * ab_y + ab_z * ab_z;
  const Floats bc = bc_x * bc_x + bc_y * bc_y + bc_z * bc_z;
  const Floats ca = ca_x * ca_x + ca_y * ca_y + ca_z * ca_z;

  const Floats edges = least(least(squared_to_segment(ab_x, ab_y, ab_z, ab, ax, ay, az),
                                   squared_to_segment(bc_x, bc_y, bc_z, bc, bx, by, bz)),
                             squared_to_segment(ca_x, ca_y, ca_z, ca, cx, cy, cz));
  // The normal, twice the area long and exact, as the corners are small integers; the planes through the edges along it tell
  // whether the point is over the triangle.
  const Floats n_x = ab_z * ca_y - ab_y * ca_z, n_y = ab_x * ca_z - ab_z * ca_x, n_z = ab_y * ca_x - ab_x * ca_y;
  const Floats n = n_x * n_x + n_y * n_y + n_z * n_z;
  const auto inside = [&](Floats ex, Floats ey, Floats ez, Floats px, Floats py, Floats pz) __attribute__((always_inline)) {
    return (ey * pz - ez * py) * n_x + (ez * px - ex * pz) * n_y + (ex * py - ey * px) * n_z >= all(0);
  };
  const Ints is_over = inside(ab_x, ab_y, ab_z, ax, ay, az) & inside(bc_x, bc_y, bc_z, bx, by, bz) &
                       inside(ca_x, ca_y, ca_z, cx, cy, cz);
  const Floats height = ax * n_x + ay * n_y + az * n_z;
  out.squared = is_over & (n > all(0)) ? height / most(n, all(1)) * height : edges;
  // A corner stands up to 0.87 steps beside its place, and the distance is rounded.
  out.slack = static_cast<float>(0.9 + 4e-6 * (largest + Packet::most_steps));
  return out;
}

}  // namespace wide

}  // namespace fs
