// The closest point of a primitive, in the object's frame (Table 1 of the paper).
#pragma once

#include "shape/closest.h"
#include "shape/shape.h"

namespace fs {

// What is remembered from one search of a shape to the next, to make it faster. It makes no difference to what closest_point()
// finds in this shape, and little to find_ridge() (ridge.h); with another one, begin with a new hint.
struct Hint {
  uint32_t triangle = UINT32_MAX;  // that was nearest
  Vec3 from{};                     // m: when the search was made from here,
  double gap = 0;                  // nothing was nearer than this, m

  // Of the last find_ridge() (ridge.h), and of the closest_point_ahead() since then.
  Vec3 ahead{};          // m, from x to the place y on the line from its closest point through x; 0: do not search from there
  double free = 0;       // m, up to this distance along `ahead` nothing is nearer than the closest point of x
  uint32_t items[4];     // triangles or segments that were nearest to y
  uint32_t item_count = 0;  // 0: there was no ridge
};

// [rt] The closest point to x (object frame, m). False when it is farther than max_distance (m, may be infinite), or
// when x is not finite or beyond 1e150 m; then out is unchanged. shape: of a polyline or mesh, already built.
// Exact to double precision: coordinates are taken relative to x, so rounding depends on the size of a triangle or
// segment and its distance, not on how far both are from the origin. A distance within 2 ulps of the coordinates is 0.
// hint: of this shape; null: none. effort: null: without end.
bool closest_point(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out, Hint* hint = nullptr,
                   Effort* effort = nullptr) noexcept;

}  // namespace fs
