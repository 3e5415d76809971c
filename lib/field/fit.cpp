#include "field/fit.h"

#include <cmath>

namespace fs {

Pose fitted(const ToolState& tool, const Vec3* proxies) noexcept {
  Pose pose = tool.pose;
  const double point_weight = 1.0 / tool.count;
  Vec3 middle{}, target{};
  for (uint32_t k = 0; k < tool.count; ++k) {
    middle += point_weight * tool.points[k].arm;
    target += point_weight * proxies[k];
  }
  Quat turn = identity_quat();
  for (int step = 0; tool.count > 1 && step < 4; ++step) {
    Mat3 inertia{};
    Vec3 torque{};
    double size = 0;
    for (uint32_t k = 0; k < tool.count; ++k) {
      const Vec3 arm = rotate(turn, tool.points[k].arm - middle), error = proxies[k] - target - arm;
      inertia += dot(arm, arm) * identity() + -1.0 * outer(arm, arm);
      torque += cross(arm, error);
      size += dot(arm, arm);
    }
    if (!(size > 0)) break;
    inertia += 1e-9 * size * identity();  // points on a line say nothing of a turn about it
    const Mat3& m = inertia;
    const Vec3 x{m.xx, m.yx, m.zx}, y{m.xy, m.yy, m.zy}, z{m.xz, m.yz, m.zz};
    const double det = dot(x, cross(y, z));
    if (!(std::fabs(det) > 0)) break;
    const Vec3 by{dot(torque, cross(y, z)) / det, dot(x, cross(torque, z)) / det, dot(x, cross(y, torque)) / det};
    turn = normalized(exp_rotation(by) * turn);
  }
  pose.orientation = tool.count > 1 ? normalized(turn * pose.orientation) : pose.orientation;
  pose.position = target - rotate(turn, middle);
  return pose;
}

}  // namespace fs
