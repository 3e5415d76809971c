// libFuzzer on the readers of mesh files: the first byte chooses the format. Built and run by tests/fuzz/run.
#include <cstdlib>

#include "base/error.h"
#include "file/mesh_formats.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void check(const fs::MeshData& mesh) {  // what a reader promises
  require(!mesh.triangles.empty() && mesh.triangles.size() % 3 == 0);
  for (const uint32_t index : mesh.triangles) require(index < mesh.points.size());
  for (const fs::Vec3& point : mesh.points) require(fs::is_finite(point));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr decltype(&fs::parse_obj) formats[] = {fs::parse_obj, fs::parse_off, fs::parse_ply, fs::parse_stl};
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const fs::MeshData mesh = formats[data[0] % 4](bytes, "fuzz");
    check(mesh);
    // What was read is written and read again as it is.
    const fs::MeshData again = fs::parse_ply(fs::format_ply(mesh.points, mesh.triangles), "again");
    check(again);
    require(again.triangles == mesh.triangles && again.points.size() == mesh.points.size());
    for (size_t i = 0; i < mesh.points.size(); ++i) require(fs::operator==(again.points[i], mesh.points[i]));
  } catch (const fs::Error& error) {
    require(error.status == FS_ERROR_PARSE || error.status == FS_ERROR_UNSUPPORTED);
    require(error.text.starts_with("fuzz") && error.text.size() < 400);
  }
  return 0;
}
