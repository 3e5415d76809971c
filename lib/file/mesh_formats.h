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

}  // namespace fs
