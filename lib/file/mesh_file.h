// Mesh files: reads OBJ, PLY, STL and OFF, writes PLY. Coordinates are doubles; no triangle is dropped or merged.
#pragma once

#include <string>
#include <vector>

#include "file/mesh_formats.h"

namespace fs {

// The file's extension, in any case, tells the format. Coordinates are multiplied by scale (m per file unit). Throws
// NOT_FOUND, IO, PARSE (with line or byte), UNSUPPORTED (another extension, or a variant that is not read).
MeshData read_mesh_file(const std::string& path, double scale);

// Writes binary PLY with double coordinates; an old file is replaced completely or not at all. Throws IO.
void write_ply(const std::string& path, const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles);

}  // namespace fs
