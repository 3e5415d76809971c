// Meshes from generators, in metres, each about 0.2 m large; and ways of a hand about them. The same arguments give the same
// bits.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "shape/mesh/mesh_tree.h"

namespace bench {

struct Mesh {
  std::vector<fs::Vec3> points;
  std::vector<uint32_t> corners;  // three for each triangle

  size_t count() const { return corners.size() / 3; }
};

// About as many triangles as asked for.
Mesh scan(size_t triangles);     // a closed lump, as a scanner would see it: bumps of five sizes, and noise of 10 um
Mesh terrain(size_t triangles);  // an open sheet of hills with ridges
Mesh part(size_t triangles);     // a closed toothed ring with sharp edges and flat sides
Mesh sphere(size_t triangles);
// By these names. Ends the program if there is no such mesh.
Mesh mesh_of(const std::string& name, size_t triangles);

enum class Way {
  sliding,  // 0 to 5 mm outside, 0.18 m/s at 1 kHz
  free,     // 1 to 10 cm outside, as fast
  jumps,    // anywhere in the mesh's box, made larger by a tenth
};
const char* name_of(Way way);
std::vector<fs::Vec3> walk(const Mesh& mesh, const fs::MeshTree& tree, Way way, size_t ticks);

}  // namespace bench
