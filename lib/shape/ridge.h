// The blend of a repulsive force where several places of a shape are equally near (its medial axis).
//
// There the direction away from the closest point jumps, and with it the force: a hand that is pushed into a corner is
// thrown to and fro between its walls. Instead of the force at x this takes the direction at the place y that solves
//
//   y = x + l m,   m in the convex hull of the unit directions from the closest points of y to y,
//
// where l is the force divided by the steepest slope that is allowed. (y minimises |y - x|^2 / (2 l) - distance(y): it is
// the proximal point of Moreau, "Proximite et dualite dans un espace hilbertien", Bull. Soc. Math. France 93, 1965.) If y
// has one closest point it is that of x, and m is its direction: nothing changes. Otherwise y lies on the ridge, m tends to
// the mean of the directions there, and while x crosses the ridge y stays, so the force changes by (force / l) times the way:
// by the allowed slope. m is never longer than 1, depends on the surface and not on its triangles, and moves continuously,
// also where a wall begins or ceases to take part. (Weights that fall with the distance, exp(-d/l) for each place that is
// nearer than its neighbours, do not: where such a place ends, as at an edge between two walls, its weight is gone at once.)
// Where edges or vertices are about as near as l, their curvature adds up to half of the slope.
//
// An attractive force is not blended. It jumps at a ridge too, but away from it: the hand leaves the ridge at once, on the
// side on which it is, and does not come back. A blend would only make a place where it balances.
#pragma once

#include "shape/primitive.h"

namespace fs {

struct Ridge {
  Vec3 direction;  // m above, object frame: the force is this times the force of the profile
  Mat3 across;     // projects on the directions across the ridge, in which the slope of the force is -force / l
};

// [rt] Whether x feels a ridge of the shape: y above is another place than without it. closest: what closest_point() gives for
// x; l: m, above. A point, a plane and a straight polyline have none. The ridges of both sides count.
// hint: what helped to find `closest`, may be null: what it remembers of a place nearby saves searches and changes m by a
// thousandth at most. As a rule it takes one search from y, without a hint some more at a ridge. It returns
// false where the effort runs out. After 12 searches it takes what it knows: about the middle of a finely cut sphere, for example.
bool find_ridge(fs_primitive primitive, const Shape* shape, Vec3 x, const Closest& closest, double l, Ridge& out,
                Hint* hint = nullptr, Effort* effort = nullptr) noexcept;

// [rt] In place of closest_point() where find_ridge() follows with the same hint. Where there was no ridge the last time, it
// searches from y instead of x: if x lies between y and what it finds, that is the closest point of both.
bool closest_point_ahead(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out, Hint* hint,
                         Effort* effort) noexcept;

}  // namespace fs
