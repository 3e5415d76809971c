// Up to eight triangles, in single precision on a grid of their own: to tell which of them may be nearest.
#pragma once

#include "force/triangle.h"
#include "force/wide_tree.h"

namespace fs {

// 192 bytes, three lines of the cache.
struct alignas(64) Packet {
  static constexpr uint32_t width = WideTree::width;
  static constexpr uint32_t none = UINT32_MAX;

  float lower[3];                // local frame: the corner of the grid
  float per_unit;                // grid steps a local unit; 0: the triangles are too small for a grid
  uint32_t triangle[width];      // none: an empty lane
  uint16_t corner[3][3][width];  // in steps: corner, axis, lane

  struct Corners {
    Vec3 at[3];  // local frame
  };
  Packet() = default;
  Packet(const uint32_t* triangles, const Corners* corners, uint32_t count);
};

namespace wide {

// What a packet says about its triangles as seen from a point. A triangle may be at a distance d of the point (local units)
// only if its squared distance is at most (d * per_unit + slack)^2.
struct Estimate {
  Floats squared;   // in steps; infinite: an empty lane
  Floats slack;     // in steps
  float per_unit;   // 0: nothing is known
  uint32_t filled;  // bit i: there is a triangle in lane i

  // Bit i: triangle i may be within a squared distance (local units).
  FS_INLINE uint32_t within(double bound) const {
    const double steps = std::sqrt(bound) * per_unit;
    if (!(steps < 1e15)) return filled;
    const Floats most = all(static_cast<float>(steps * (1 + 1e-6))) + slack;
    return bits(squared <= most * most) & filled;
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

FS_INLINE Floats root(Floats v) {
  for (int i = 0; i < 8; ++i) v[i] = __builtin_sqrtf(v[i]);
  return v;
}

FS_INLINE Estimate estimate(const Packet& packet, Vec3 from) {
  Ints id;
  std::memcpy(&id, packet.triangle, sizeof id);
  Estimate out{{}, {}, packet.per_unit, bits(id != -1)};
  const double per_unit = packet.per_unit;
  const double u = (from.x - packet.lower[0]) * per_unit, v = (from.y - packet.lower[1]) * per_unit,
               w = (from.z - packet.lower[2]) * per_unit;
  const double largest = std::max(std::max(std::fabs(u), std::fabs(v)), std::fabs(w));
  if (!(largest < 1e9)) {  // far away all of them are one point
    out.per_unit = 0;
    return out;
  }
  const Floats x = all(static_cast<float>(u)), y = all(static_cast<float>(v)), z = all(static_cast<float>(w));
  const Floats a_x = load(packet.corner[0][0]), a_y = load(packet.corner[0][1]), a_z = load(packet.corner[0][2]);
  const Floats b_x = load(packet.corner[1][0]), b_y = load(packet.corner[1][1]), b_z = load(packet.corner[1][2]);
  const Floats c_x = load(packet.corner[2][0]), c_y = load(packet.corner[2][1]), c_z = load(packet.corner[2][2]);
  const Floats ab_x = b_x - a_x, ab_y = b_y - a_y, ab_z = b_z - a_z;
  const Floats bc_x = c_x - b_x, bc_y = c_y - b_y, bc_z = c_z - b_z;
  const Floats ca_x = a_x - c_x, ca_y = a_y - c_y, ca_z = a_z - c_z;
  const Floats ax = x - a_x, ay = y - a_y, az = z - a_z;
  const Floats bx = x - b_x, by = y - b_y, bz = z - b_z;
  const Floats cx = x - c_x, cy = y - c_y, cz = z - c_z;
  const Floats ab = ab_x * ab_x + ab_y * ab_y + ab_z * ab_z;
  const Floats bc = bc_x * bc_x + bc_y * bc_y + bc_z * bc_z;
  const Floats ca = ca_x * ca_x + ca_y * ca_y + ca_z * ca_z;
  const Floats longest = most(most(ab, bc), ca);

  const Floats edges = least(least(squared_to_segment(ab_x, ab_y, ab_z, ab, ax, ay, az),
                                   squared_to_segment(bc_x, bc_y, bc_z, bc, bx, by, bz)),
                             squared_to_segment(ca_x, ca_y, ca_z, ca, cx, cy, cz));
  // The normal, twice the area long; the planes through the edges tell whether the point is over the triangle.
  const Floats n_x = ab_z * ca_y - ab_y * ca_z, n_y = ab_x * ca_z - ab_z * ca_x, n_z = ab_y * ca_x - ab_x * ca_y;
  const Floats n = n_x * n_x + n_y * n_y + n_z * n_z;
  const auto inside = [&](Floats ex, Floats ey, Floats ez, Floats px, Floats py, Floats pz) __attribute__((always_inline)) {
    return (ey * pz - ez * py) * n_x + (ez * px - ex * pz) * n_y + (ex * py - ey * px) * n_z >= all(0);
  };
  const Ints is_over = inside(ab_x, ab_y, ab_z, ax, ay, az) & inside(bc_x, bc_y, bc_z, bx, by, bz) &
                       inside(ca_x, ca_y, ca_z, cx, cy, cz);
  const Floats height = ax * n_x + ay * n_y + az * n_z;
  const Floats plane = height / most(n, all(1e-30f)) * height;
  // A triangle that is less than a hundredth as wide as long has no normal to rely on: its edges are as near as its face is
  // but for its width.
  const Ints is_thin = n < all(1e-4f) * longest * longest;
  out.squared = is_over & ~is_thin ? plane : edges;
  // The corners stand up to 0.87 steps beside their places, twice that together with the point's own rounding; and
  // rounding turns the normal by up to 3e-5.
  const Floats slack = all(static_cast<float>(2 + 1e-4 * (largest + 65536)));
  out.slack = slack + (Floats)(is_thin & (Ints)(all(0.011f) * root(longest)));
  return out;
}

}  // namespace wide

}  // namespace fs
