// Cuts the faces of a mesh file into triangles. All formats with polygons use this.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "file/mesh_file.h"

namespace fs {

// Takes faces corner by corner: add() for each, then end_face(). A face of n >= 3 corners becomes n - 2 triangles.
// cut() comes last, when all points are known (a face of an OBJ file may come before its points).
//
// A convex polygon becomes a fan from its first corner: 0 1 2, 0 2 3, 0 3 4... Any other is cut by its ears (Meisters
// 1975) in its own plane, with exact orientation tests: the triangles of a simple polygon cover it and nothing else.
// A polygon that touches or crosses itself, or is bent so much that its projection does, is cut by its ears while it
// has any, then by its convex corners; the rest becomes a fan, as does a polygon without area. So the signed areas of
// the triangles always add up to the signed area of the polygon.
class Faces {
 public:
  explicit Faces(std::vector<uint32_t>& triangles) : triangles_(triangles) {}

  void add(uint32_t corner) {
    if (corners_ >= 2) triangles_.insert(triangles_.end(), {first_, previous_, corner});
    if (corners_ == 0) first_ = corner;
    previous_ = corner;
    ++corners_;
  }
  size_t corners() const { return corners_; }  // of the face being added
  void end_face() {
    if (corners_ > 3) polygons_.push_back({triangles_.size() - 3 * (corners_ - 2), corners_});
    corners_ = 0;
  }

  // Throws UNSUPPORTED for a polygon so entangled that cutting it would take more than about 1 s per MB of the file.
  void cut(const std::vector<Vec3>& points, const std::string& file);

 private:
  struct Polygon {
    size_t begin;  // in triangles_, where it is a fan until it is cut
    size_t corners;
  };

  std::vector<uint32_t>& triangles_;
  std::vector<Polygon> polygons_;
  uint32_t first_ = 0, previous_ = 0;
  size_t corners_ = 0;
};

}  // namespace fs
