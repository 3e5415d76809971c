// The closest point of a segment and of a triangle to the origin. The caller passes coordinates relative to the query
// point, so rounding depends only on the size of the triangle and its distance.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "math/vec3.h"

namespace fs {

// Where on a segment or triangle a point lies. The edges of a triangle are ab, bc, ca.
enum class Part : uint8_t { face, edge_ab, edge_bc, edge_ca, corner_a, corner_b, corner_c };

struct Nearest {
  Vec3 offset{};  // the closest point
  double squared = std::numeric_limits<double>::infinity();
  Part part = Part::face;
};

// Clamps p to the range of the other arguments, so that rounding cannot carry it out of their box.
// Never NaN.
inline double clamped(double p, double a, double b) noexcept { return std::max(std::min(a, b), std::min(std::max(a, b), p)); }
inline double clamped(double p, double a, double b, double c) noexcept {
  return std::max(std::min(std::min(a, b), c), std::min(std::max(std::max(a, b), c), p));
}

// Replaces `nearest` by the closest point of the segment ab if that is nearer. ab and ba give the same bits; a segment
// of length 0 counts as a point.
inline void nearest_on_segment(Vec3 a, Vec3 b, Part on_ab, Part at_a, Part at_b, Nearest& nearest) noexcept {
  const Vec3 ab = b - a;
  const double from_a = -dot(a, ab), from_b = dot(b, ab);  // their sum is |ab|^2
  Nearest candidate;
  if (!(from_a > 0)) {
    candidate = {a, dot(a, a), at_a};
  } else if (!(from_b > 0)) {
    candidate = {b, dot(b, b), at_b};
  } else {
    // Start from the nearer end, where rounding is least.
    const double length = dot(ab, ab);
    const Vec3 p = from_a <= from_b ? a + (from_a / length) * ab : b + (from_b / -length) * ab;
    candidate.offset = {clamped(p.x, a.x, b.x), clamped(p.y, a.y, b.y), clamped(p.z, a.z, b.z)};
    candidate.squared = dot(candidate.offset, candidate.offset);
    candidate.part = on_ab;
  }
  if (candidate.squared < nearest.squared) nearest = candidate;
}

// The closest point of triangle abc; for a triangle without area, the closest point of its edges.
inline Nearest nearest_on_triangle(Vec3 a, Vec3 b, Vec3 c) noexcept {
  // The origin's projection is a + s ab + t ac. Modified Gram-Schmidt subtracts from c and from the origin their
  // projections on ab; for a needle-shaped triangle a Gram matrix would lose twice as many digits.
  const Vec3 ab = b - a, ac = c - a;
  const double length = dot(ab, ab);
  const double c_along = dot(ac, ab) / length, along = -dot(a, ab) / length;
  const Vec3 height = ac - c_along * ab;
  const double t = -dot(a + along * ab, height) / dot(height, height);
  const double s = along - t * c_along;
  if (s > 0 && t > 0 && s + t < 1) {
    const Vec3 p = a + s * ab + t * ac;
    const Vec3 q{clamped(p.x, a.x, b.x, c.x), clamped(p.y, a.y, b.y, c.y), clamped(p.z, a.z, b.z, c.z)};
    return {q, dot(q, q), Part::face};
  }
  Nearest nearest;
  nearest_on_segment(a, b, Part::edge_ab, Part::corner_a, Part::corner_b, nearest);
  nearest_on_segment(b, c, Part::edge_bc, Part::corner_b, Part::corner_c, nearest);
  nearest_on_segment(c, a, Part::edge_ca, Part::corner_c, Part::corner_a, nearest);
  return nearest;
}

// The unit normal (counter-clockwise), {0, 0, 0} for a triangle whose area is only rounding error. It is computed at
// the corner with the largest angle, where a needle-shaped triangle loses the fewest digits.
inline Vec3 triangle_normal(Vec3 a, Vec3 b, Vec3 c) noexcept {
  const Vec3 ab = b - a, bc = c - b, ca = a - c;
  const double l_ab = dot(ab, ab), l_bc = dot(bc, bc), l_ca = dot(ca, ca);
  const double longest = std::max(std::max(l_ab, l_bc), l_ca);
  const Vec3 u = longest == l_ab ? bc : longest == l_bc ? ca : ab;
  const Vec3 v = longest == l_ab ? ca : longest == l_bc ? ab : bc;
  const Vec3 n = cross(u, v);
  const double noise = 16 * std::numeric_limits<double>::epsilon() * std::sqrt(dot(u, u)) * std::sqrt(dot(v, v));
  if (!(norm(n) > noise)) return {0, 0, 0};
  return normalized(n);
}

// The rounding error (2 ulps) of coordinates as large as `largest`: distances up to it count as 0.
inline double coordinate_rounding(double largest) noexcept { return 2 * std::numeric_limits<double>::epsilon() * largest; }

}  // namespace fs
