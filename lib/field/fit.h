// The pose of a tool whose points are held somewhere.
#pragma once

#include "field/object_force.h"

namespace fs {

// [rt] The rigid pose that best fits the proxies of the points, one of each (m, scene frame): least squares, by a few steps of
// Gauss and Newton from the pose of the tool, because proxies are near it.
Pose fitted(const ToolState& tool, const Vec3* proxies) noexcept;

}  // namespace fs
