#include "force/packet.h"

namespace fs {

Packet::Packet(const uint32_t* triangles, const Corners* corners, uint32_t count) : per_unit(0) {
  Box box;
  for (uint32_t i = 0; i < count; ++i) {
    for (const Vec3& at : corners[i].at) box.add(at);
  }
  const double least[3] = {box.lower.x, box.lower.y, box.lower.z}, most[3] = {box.upper.x, box.upper.y, box.upper.z};
  double size = 0;
  for (int k = 0; k < 3; ++k) {
    lower[k] = static_cast<float>(least[k]);
    if (lower[k] > least[k]) lower[k] = std::nextafter(lower[k], -2.0f);
    size = std::max(size, most[k] - lower[k]);
  }
  if (size > 1e-30) per_unit = static_cast<float>(65535 / size);
  for (uint32_t i = 0; i < width; ++i) {
    triangle[i] = i < count ? triangles[i] : none;
    const Corners& mine = corners[i < count ? i : 0];
    for (int c = 0; c < 3; ++c) {
      const double at[3] = {mine.at[c].x, mine.at[c].y, mine.at[c].z};
      for (int k = 0; k < 3; ++k) {
        const double steps = (at[k] - lower[k]) * per_unit;
        corner[c][k][i] = static_cast<uint16_t>(std::clamp(std::round(steps), 0.0, 65535.0));
      }
    }
  }
}

}  // namespace fs
