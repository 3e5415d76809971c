// The closest point of a primitive, in the object's frame (Table 1 of the paper).
#pragma once

#include "force/shape.h"
#include "math/vec3.h"

namespace fs {

enum class Side : uint8_t { front, back };
// How the closest point moves when x does: it stays (vertex), slides along `tangent` (edge) or follows x along the
// surface (face). The direction's derivative is (I - u u^T)/d, (I - u u^T - t t^T)/d and 0.
enum class Feature : uint8_t { vertex, edge, face };

struct Closest {
  Vec3 point{};      // p
  double distance = 0;
  Vec3 direction{};  // unit, from p to x. At d = 0: of a plane or mesh its normal there; else {0, 0, 0}
  Vec3 tangent{};    // unit; edge only
  Side side = Side::front;
  Feature feature = Feature::vertex;
  uint32_t triangle = 0;  // or segment: the lowest index among ties
};

// [rt] The closest point to x (object frame, m). False when it lies farther than max_distance (m, may be infinite);
// then out is left alone. shape: for polyline and mesh; built.
bool closest_point(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out) noexcept;

}  // namespace fs
