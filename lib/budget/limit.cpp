#include "budget/limit.h"

#include <algorithm>
#include <cmath>

#include "field/frame.h"

namespace fs {

SceneLimit scene_limit(const Views& views, const DeviceLimit& limit, double max_stiffness, double blend, double ahead) {
  SceneLimit out{never, never, never, limit.stiffness < limit.whole, blend, ahead, 0, 0, 1, 0, {}};
  bool is_anywhere = !(limit.radius > 0 && limit.height > 0);
  double lever_part = 1;
  for (const View& view : views.rows) {
    if (view.version == 0) continue;
    const fs_frame& frame = view.frame;
    out.to_device = std::max(out.to_device, frame.scale * frame.force_scale);
    out.points = std::max(out.points, static_cast<unsigned>(view.tool->points.size()));
    double arm = 0;
    for (const Vec3& point : view.tool->points) arm = std::max(arm, norm(point));
    const double reach = arm + view.tool->point_radius;
    out.arm = std::max(out.arm, reach);
    if (arm / frame.scale > limit.lever) lever_part = std::min(lever_part, std::pow(limit.lever * frame.scale / arm, 2));
    if (view.was_held || !view.has_own_frame) is_anywhere = true;
    const double margin = 1.2;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 device{margin * (corner & 1 ? 1 : -1) * limit.radius, margin * (corner & 2 ? 1 : -1) * limit.radius,
                        margin * (corner & 4 ? 0.5 : -0.5) * limit.height};
      const Vec3 place = frame.scale * to_local(frame.pose, device);
      out.within.add(place - Vec3{reach, reach, reach});
      out.within.add(place + Vec3{reach, reach, reach});
    }
  }
  if (is_anywhere) out.within = {};
  if (!(out.to_device > 0)) return out;
  const double most = max_stiffness > 0 ? max_stiffness : never;
  const auto in_scene = [&](double stiffness) { return std::min(lever_part * stiffness, most) / out.to_device; };
  out.stiffness = in_scene(limit.stiffness);
  out.whole = in_scene(limit.whole);
  out.to_loop = out.to_device / lever_part;
  out.damping = limit.damping / out.to_device;
  return out;
}

Bounds bounds_alone(const SceneLimit& limit) noexcept {
  return {limit.stiffness, limit.stiffness / limit.points, limit.damping, limit.damping / limit.points};
}

}  // namespace fs
