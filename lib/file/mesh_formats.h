// The formats of mesh files, on bytes in memory; `file` is the name for sentences. They throw PARSE and UNSUPPORTED.
// A file may lie: every count is compared with the bytes that are there before memory is taken, every index with the
// points. No triangle is dropped, also none without area.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "file/mesh_file.h"

namespace fs {

MeshData parse_obj(std::string_view bytes, const std::string& file);
MeshData parse_off(std::string_view bytes, const std::string& file);
MeshData parse_ply(std::string_view bytes, const std::string& file);
MeshData parse_stl(std::string_view bytes, const std::string& file);

// Binary little-endian PLY with double coordinates.
std::string format_ply(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles);

// Triangles count their points in 32 bits.
constexpr uint64_t max_points = std::numeric_limits<uint32_t>::max();

// Cuts one polygon into a fan of triangles: its corners 0 1 2, 0 2 3, 0 3 4 and so on.
class Fan {
 public:
  explicit Fan(std::vector<uint32_t>& triangles) : triangles_(triangles) {}

  void add(uint32_t corner) {
    if (corners_ >= 2) triangles_.insert(triangles_.end(), {first_, previous_, corner});
    if (corners_ == 0) first_ = corner;
    previous_ = corner;
    ++corners_;
  }
  size_t corners() const { return corners_; }

 private:
  std::vector<uint32_t>& triangles_;
  uint32_t first_ = 0, previous_ = 0;
  size_t corners_ = 0;
};

}  // namespace fs
