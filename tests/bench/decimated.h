// Meshes with fewer triangles, made by OpenMesh.
#pragma once

#include "meshes.h"

namespace bench {

struct Level {
  Mesh mesh;
  double time;  // s, from the full mesh
};
// Of about so many triangles each, in falling order. Empty: built without OpenMesh.
std::vector<Level> decimated(const Mesh& mesh, const std::vector<size_t>& triangles);

}  // namespace bench
