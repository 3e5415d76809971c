// Finds the closest point of a triangle mesh. Built once, then immutable.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "force/box_tree.h"
#include "force/primitive.h"
#include "force/pseudonormals.h"

namespace fs {

class MeshTree {
 public:
  // corners: three indices of points for each triangle.
  // Throws Abandoned.
  MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted);

  // [rt] As closest_point() in primitive.h. Of the triangles at the least distance it takes the one with the lowest
  // index, as a test of all triangles in order would.
  bool closest(Vec3 x, double max_distance, Closest& out) const noexcept;

 private:
  struct Triangle {
    Vec3 a, b, c;
  };

  BoxTree boxes_;
  std::vector<Triangle> triangles_;  // in the order of the tree
  std::vector<Vec3> faces_;          // their normals; {0, 0, 0} where there is no area
  Pseudonormals normals_;
};

}  // namespace fs
