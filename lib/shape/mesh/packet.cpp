#include "shape/mesh/packet.h"

namespace fs {

Packet::Packet(const uint32_t* triangles, const Vec3* places, uint32_t count) : per_unit(0), corners{} {
  Box box;
  for (uint32_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) box.add(places[3 * i + c]);
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
    for (int c = 0; c < 3; ++c) {
      const Vec3 p = places[3 * (i < count ? i : 0) + c];
      const double at[3] = {p.x, p.y, p.z};
      for (int k = 0; k < 3; ++k) {
        const double steps = (at[k] - lower[k]) * per_unit;
        corners[c][i] |= static_cast<uint32_t>(std::clamp(std::round(steps), 0.0, double{most_steps})) << 10 * k;
      }
    }
  }
}

}  // namespace fs
