// Where a straight way of a point first passes through a surface, without a gap anywhere: at shared edges and vertices too.
#pragma once

#include "shape/closest.h"
#include "shape/shape.h"

namespace fs {

// [rt] The first place at which the way from `from` to `to` (object frame) passes from one side (`side`) of a plane or mesh to
// the other. A point on the surface counts as on the side from which it came. False: it does not; out is as it was.
// radius: m, of a ball that a plane keeps on its side: `from`, `to` and the place are those of its middle. A mesh does not regard it.
// The signs that decide are those of exact numbers, to 113 bits. visits: of nodes, leaves and triangles that are left; null: without
// end. Where they do not suffice, the way counts as barred where it begins.
bool first_crossing(fs_primitive primitive, const Shape* shape, Side side, Vec3 from, Vec3 to, double radius, Crossing& out,
                    uint32_t* visits = nullptr) noexcept;

// The same for one triangle. normal is not set.
bool crosses_triangle(Vec3 a, Vec3 b, Vec3 c, Side side, Vec3 from, Vec3 to, double& part) noexcept;

// 1: the way leaves through this triangle, from behind it to its front; -1: it enters; 0: neither. is_unclear: set where an end of
// the way is in the plane of the triangle or the way passes through an edge, as more than one triangle may tell then.
int crossing_of(Vec3 a, Vec3 b, Vec3 c, Vec3 from, Vec3 to, bool& is_unclear) noexcept;

}  // namespace fs
