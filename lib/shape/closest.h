// What a search of a primitive finds: its closest point, or where a way passes through it.
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace fs {

enum class Side : uint8_t { front, back };
// How the closest point moves when x moves: it stays (vertex), slides along `tangent` (edge) or follows x along the
// surface (face). The derivative of the direction is (I - u u^T)/d, (I - u u^T - t t^T)/d and 0 respectively. An edge
// or vertex inside a flat part of a mesh counts as a face, a joint inside a straight part of a polyline as an edge.
enum class Feature : uint8_t { vertex, edge, face };

struct Closest {
  Vec3 point{};      // p
  double distance = 0;
  Vec3 direction{};  // unit, from p to x. At d = 0: the normal of a plane or mesh; {0, 0, 0} for the other primitives
  Vec3 tangent{};    // unit; set for an edge only
  Side side = Side::front;
  Feature feature = Feature::vertex;
  uint32_t triangle = 0;  // index of the triangle or segment; the lowest of those at equal distance
};

struct Crossing {
  double part = 0;    // of the way, 0..1
  Vec3 point{};       // object frame
  Vec3 normal{};      // unit, object frame: towards the side from which it came
  uint32_t triangle = 0;
};

// The work that searches may do, in visits of nodes and leaves of trees and of triangles, and whether it sufficed.
struct Effort {
  uint32_t visits = UINT32_MAX;  // that are left
  uint32_t ways = UINT32_MAX;    // that are left for tests of ways (crossing.h) and for solids that come near
  uint32_t most = UINT32_MAX;    // of one search
  bool is_cut = false;           // the last search ran out of visits, so what it found may not be the closest;
  double least = 0;              // m: nothing is nearer than this, where it is cut
  bool is_ridge_cut = false;     // the last find_ridge() found none because there were none left
};

}  // namespace fs
