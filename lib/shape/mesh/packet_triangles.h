// What a packet tells of its triangles, eight at a time: about how far from a point they are, and which of them may meet a
// box. To be included where its inlined code is compiled for each processor.
#pragma once

#include "shape/mesh/packet.h"
#include "shape/mesh/wide_children.h"

namespace fs::wide {

// What a packet says about its triangles as seen from a point. A triangle may be at a distance d of the point (local units)
// only if its squared distance is at most (d * per_unit + slack)^2.
struct Estimate {
  Floats8 squared;   // in steps
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

FS_INLINE Floats8 squared_to_segment(Floats8 ex, Floats8 ey, Floats8 ez, Floats8 length, Floats8 x, Floats8 y, Floats8 z) {
  Floats8 t = (x * ex + y * ey + z * ez) / most(length, all(1.0f));
  t = least(most(t, all(0.0f)), all(1.0f));
  x -= t * ex;
  y -= t * ey;
  z -= t * ez;
  return x * x + y * y + z * z;
}

FS_INLINE Estimate estimate_of(const Packet& packet, Vec3 from) {
  const Ints8 id = load(packet.triangle);
  Estimate out{{}, 0, packet.per_unit, bits(id != -1)};
  const double per_unit = packet.per_unit;
  const double u = (from.x - packet.lower[0]) * per_unit, v = (from.y - packet.lower[1]) * per_unit,
               w = (from.z - packet.lower[2]) * per_unit;
  const double largest = std::max(std::max(std::fabs(u), std::fabs(v)), std::fabs(w));
  if (!(largest < 1e9)) {  // far away all of them are one point
    out.per_unit = 0;
    return out;
  }
  const Floats8 x = all(static_cast<float>(u)), y = all(static_cast<float>(v)), z = all(static_cast<float>(w));
  const Ints8 a = load(packet.corners[0]), b = load(packet.corners[1]), c = load(packet.corners[2]);
  const Floats8 a_x = field(a, 0, 10), a_y = field(a, 10, 10), a_z = field(a, 20, 10);
  const Floats8 b_x = field(b, 0, 10), b_y = field(b, 10, 10), b_z = field(b, 20, 10);
  const Floats8 c_x = field(c, 0, 10), c_y = field(c, 10, 10), c_z = field(c, 20, 10);
  const Floats8 ab_x = b_x - a_x, ab_y = b_y - a_y, ab_z = b_z - a_z;
  const Floats8 bc_x = c_x - b_x, bc_y = c_y - b_y, bc_z = c_z - b_z;
  const Floats8 ca_x = a_x - c_x, ca_y = a_y - c_y, ca_z = a_z - c_z;
  const Floats8 ax = x - a_x, ay = y - a_y, az = z - a_z;
  const Floats8 bx = x - b_x, by = y - b_y, bz = z - b_z;
  const Floats8 cx = x - c_x, cy = y - c_y, cz = z - c_z;
  const Floats8 ab = ab_x * ab_x + ab_y * ab_y + ab_z * ab_z;
  const Floats8 bc = bc_x * bc_x + bc_y * bc_y + bc_z * bc_z;
  const Floats8 ca = ca_x * ca_x + ca_y * ca_y + ca_z * ca_z;

  const Floats8 edges =
      least(least(squared_to_segment(ab_x, ab_y, ab_z, ab, ax, ay, az), squared_to_segment(bc_x, bc_y, bc_z, bc, bx, by, bz)),
            squared_to_segment(ca_x, ca_y, ca_z, ca, cx, cy, cz));
  // The normal, twice the area long and exact, as the corners are small integers; the planes through the edges along it tell
  // whether the point is over the triangle.
  const Floats8 n_x = ab_z * ca_y - ab_y * ca_z, n_y = ab_x * ca_z - ab_z * ca_x, n_z = ab_y * ca_x - ab_x * ca_y;
  const Floats8 n = n_x * n_x + n_y * n_y + n_z * n_z;
  const auto inside = [&](Floats8 ex, Floats8 ey, Floats8 ez, Floats8 px, Floats8 py, Floats8 pz) __attribute__((always_inline)) {
    return (ey * pz - ez * py) * n_x + (ez * px - ex * pz) * n_y + (ex * py - ey * px) * n_z >= all(0.0f);
  };
  const Ints8 is_over =
      inside(ab_x, ab_y, ab_z, ax, ay, az) & inside(bc_x, bc_y, bc_z, bx, by, bz) & inside(ca_x, ca_y, ca_z, cx, cy, cz);
  const Floats8 height = ax * n_x + ay * n_y + az * n_z;
  out.squared = (is_over & (n > all(0.0f))) ? height / most(n, all(1.0f)) * height : edges;
  // A corner stands up to 0.87 steps beside its place, and the distance is rounded.
  out.slack = static_cast<float>(0.9 + 4e-6 * (largest + Packet::most_steps));
  return out;
}

// Bit i: the box of triangle i may meet the span.
FS_INLINE uint32_t triangles_in(const Packet& packet, const Span& span) {
  const Ints8 id = load(packet.triangle);
  Ints8 meets = id != -1;
  if (packet.per_unit > 0) {
    const Ints8 a = load(packet.corners[0]), b = load(packet.corners[1]), c = load(packet.corners[2]);
    for (int k = 0; k < 3; ++k) {
      const Floats8 x = field(a, 10 * k, 10), y = field(b, 10 * k, 10), z = field(c, 10 * k, 10);
      const double lower = (span.lower[k] - packet.lower[k]) * packet.per_unit,
                   upper = (span.upper[k] - packet.lower[k]) * packet.per_unit;
      meets &= (least(least(x, y), z) <= all(static_cast<float>(std::min(upper, 2000.0) + 1))) &
               (most(most(x, y), z) >= all(static_cast<float>(std::max(lower, -2000.0) - 1)));
    }
  }
  return bits(meets);
}

}  // namespace fs::wide
