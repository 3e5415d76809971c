// The reader of one format of mesh files, FUZZ_PARSE, and what is made of a mesh: its search tree.
#include "base/error.h"
#include "base/stop_token.h"
#include "file/mesh_formats.h"
#include "fuzz/fuzz.h"
#include "shape/shape.h"

using fuzz::require;

static void check(const fs::MeshData& mesh) {  // what a reader promises
  require(!mesh.triangles.empty() && mesh.triangles.size() % 3 == 0, "no triangles");
  for (const uint32_t index : mesh.triangles) require(index < mesh.points.size(), "a triangle of a point that is not there");
  for (const fs::Vec3& point : mesh.points) require(fs::is_finite(point), "a point that is not finite");
}

static bool is_same(const fs::Vec3& a, const fs::Vec3& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t most_built = 64;  // triangles: a tree of more tells nothing new
  try {
    fs::MeshData mesh = fs::FUZZ_PARSE({reinterpret_cast<const char*>(data), size}, "fuzz");
    check(mesh);
    // What was read is written and read again as it is.
    const fs::MeshData again = fs::parse_ply(fs::format_ply(mesh.points, mesh.triangles), "again");
    check(again);
    require(again.triangles == mesh.triangles, "another mesh");
    require(std::equal(again.points.begin(), again.points.end(), mesh.points.begin(), mesh.points.end(), is_same), "other points");
    if (mesh.triangles.size() <= 3 * most_built) {
      fs::StopToken stop;
      fs::make_mesh(std::move(mesh.points), std::move(mesh.triangles), stop)->build();
    }
  } catch (const fs::Error& error) {
    const bool is_of_reader = error.status == FS_ERROR_PARSE || error.status == FS_ERROR_UNSUPPORTED;
    require(is_of_reader ? error.text.starts_with("fuzz") : error.status == FS_ERROR_INVALID, "a sentence:", error.text.c_str());
    require(error.text.size() < 400, "a long sentence:", error.text.c_str());
  }
  return 0;
}
