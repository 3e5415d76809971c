#include "decimated.h"

#ifdef HAS_OPENMESH
#include <cstddef>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include "closest_methods.h"

namespace bench {
namespace {

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using Faces = OpenMesh::TriMesh_ArrayKernelT<Traits>;

Mesh mesh_of(const Faces& faces) {
  Mesh out;
  for (const auto v : faces.vertices()) {
    const auto& p = faces.point(v);
    out.points.push_back({p[0], p[1], p[2]});
  }
  for (const auto f : faces.faces()) {
    for (const auto v : faces.fv_range(f)) out.corners.push_back(static_cast<uint32_t>(v.idx()));
  }
  return out;
}

}  // namespace

std::vector<Level> decimated(const Mesh& mesh, const std::vector<size_t>& triangles) {
  const double start = seconds_now();
  Faces faces;
  std::vector<Faces::VertexHandle> handles;
  for (const fs::Vec3& p : mesh.points) handles.push_back(faces.add_vertex({p.x, p.y, p.z}));
  for (size_t i = 0; i < mesh.corners.size(); i += 3) {
    faces.add_face(handles[mesh.corners[i]], handles[mesh.corners[i + 1]], handles[mesh.corners[i + 2]]);
  }
  std::vector<Level> out;
  for (const size_t count : triangles) {
    OpenMesh::Decimater::DecimaterT<Faces> decimater(faces);
    OpenMesh::Decimater::ModQuadricT<Faces>::Handle quadric;
    decimater.add(quadric);
    decimater.module(quadric).unset_max_err();
    decimater.initialize();
    decimater.decimate_to_faces(0, count);
    faces.garbage_collection();
    out.push_back({mesh_of(faces), seconds_now() - start});
  }
  return out;
}

}  // namespace bench
#else
std::vector<bench::Level> bench::decimated(const Mesh&, const std::vector<size_t>&) { return {}; }
#endif
