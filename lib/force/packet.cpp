#include "force/packet.h"

namespace fs {

Packet::Packet(const uint32_t* triangles, const Triangle* places, uint32_t count) : per_unit(0), corners{} {
  Box box;
  for (uint32_t i = 0; i < count; ++i) {
    for (const Vec3& corner : places[i].corners) box.add(corner);
  }
  const double least[3] = {box.lower.x, box.lower.y, box.lower.z}, most[3] = {box.upper.x, box.upper.y, box.upper.z};
  double size = 0;
  for (int k = 0; k < 3; ++k) {
    lower[k] = static_cast<float>(least[k]);
    if (lower[k] > least[k]) lower[k] = std::nextafter(lower[k], -2.0f);
    size = std::max(size, most[k] - lower[k]);
  }
  if (size > 1e-30) per_unit = static_cast<float>(most_steps / size);
  for (uint32_t i = 0; i < width; ++i) {
    triangle[i] = i < count ? triangles[i] : none;
    const Triangle& mine = places[i < count ? i : 0];
    for (int c = 0; c < 3; ++c) {
      const Vec3 p = mine.corners[c];
      const double at[3] = {p.x, p.y, p.z};
      for (int k = 0; k < 3; ++k) {
        const double steps = (at[k] - lower[k]) * per_unit;
        corners[c][i] |= static_cast<uint32_t>(std::clamp(std::round(steps), 0.0, double{most_steps})) << 10 * k;
      }
    }
  }

  Vec3 sum{};
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3(&p)[3] = places[i].corners;
    sum += triangle_normal(p[0], p[1], p[2]);
  }
  const Vec3 direction = normalized(sum), middle = 0.5 * box.lower + 0.5 * box.upper;
  const double c[3] = {middle.x, middle.y, middle.z}, n[3] = {direction.x, direction.y, direction.z};
  for (int k = 0; k < 3; ++k) {
    centre[k] = static_cast<float>(c[k]);
    normal[k] = static_cast<float>((1 - 1e-6) * n[k]);
  }
  double most_up = 0, most_beside = 0;
  for (uint32_t i = 0; i < count; ++i) {
    for (const Vec3& p : places[i].corners) {
      const Vec3 from{p.x - centre[0], p.y - centre[1], p.z - centre[2]};
      const double along = dot({normal[0], normal[1], normal[2]}, from);
      most_up = std::max(most_up, std::fabs(along));
      most_beside = std::max(most_beside, std::sqrt(std::max(dot(from, from) - along * along, 0.0)));
    }
  }
  const double margin = 1e-6 * (most_up + most_beside) + 1e-12;  // more than rounding makes
  height = static_cast<float>(most_up + margin);
  radius = static_cast<float>(most_beside + margin);
}

}  // namespace fs
