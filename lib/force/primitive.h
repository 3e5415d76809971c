// The closest point of a primitive, in the object's frame (Table 1 of the paper).
#pragma once

#include "force/shape.h"
#include "math/vec3.h"

namespace fs {

enum class Side : uint8_t { front, back };
// How the closest point moves when x does: it stays (vertex), slides along `tangent` (edge) or follows x along the
// surface (face). The direction's derivative is (I - u u^T)/d, (I - u u^T - t t^T)/d and 0. An edge or vertex inside a
// flat part of a mesh counts as face, a joint inside a straight part of a polyline as edge.
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

// [rt] The closest point to x (object frame, m). False when it lies farther than max_distance (m, may be infinite), or
// when x is not finite or beyond 1e150 m; then out is left alone. shape: for polyline and mesh; built.
// Exact in double precision: worked out in coordinates relative to x, so only the size of a triangle or segment and its
// distance count, not how far both are from the origin. A distance of at most 2 ulps of the coordinates is 0.
bool closest_point(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out) noexcept;

}  // namespace fs
