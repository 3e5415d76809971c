// Mesh files: OBJ, PLY, STL and OFF in, PLY out. Coordinates stay doubles; no triangle is dropped or merged.
#pragma once

#include <string>
#include <vector>

#include "math/vec3.h"

namespace fs {

struct MeshData {
  std::vector<Vec3> points;
  std::vector<uint32_t> triangles;  // three a triangle; polygons are cut (polygon.h)
};

// By the file's ending, case aside. Coordinates are multiplied by scale (m per file unit). Throws NOT_FOUND, IO, PARSE
// (with line or byte), UNSUPPORTED (another ending, or a variant that is not read).
MeshData read_mesh_file(const std::string& path, double scale);

// Binary PLY with double coordinates, replaced as a whole or not at all. Throws IO.
void write_ply(const std::string& path, const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles);

}  // namespace fs
