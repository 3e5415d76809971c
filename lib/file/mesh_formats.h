// The formats of mesh files, on bytes in memory; `file` is the name for error sentences. They throw PARSE and
// UNSUPPORTED. Files are not trusted: each count is checked against the bytes present before memory is allocated, and
// each index against the number of points. No triangle is dropped, even without area.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "math/vec3.h"

namespace fs {

struct MeshData {
  std::vector<Vec3> points;
  std::vector<uint32_t> triangles;  // three for each triangle; polygons are cut (polygon.h)
};

MeshData parse_obj(std::string_view bytes, const std::string& file);
MeshData parse_off(std::string_view bytes, const std::string& file);
MeshData parse_ply(std::string_view bytes, const std::string& file);
MeshData parse_stl(std::string_view bytes, const std::string& file);

// Binary little-endian PLY with double coordinates.
std::string format_ply(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles);

// Triangles refer to points by 32-bit indices.
constexpr uint64_t max_points = std::numeric_limits<uint32_t>::max();

}  // namespace fs
