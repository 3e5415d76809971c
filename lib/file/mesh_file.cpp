#include "file/mesh_file.h"

#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "base/whole_file.h"

namespace fs {
namespace {

struct Format {
  const char* ending;
  MeshData (*parse)(std::string_view bytes, const std::string& file);
};
constexpr Format formats[] = {{"obj", parse_obj}, {"off", parse_off}, {"ply", parse_ply}, {"stl", parse_stl}};

// The file's extension in lower case, without the '.'; "" when there is none.
std::string ending_of(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  if (dot == path.npos || path[dot] == '/') return "";
  std::string ending = path.substr(dot + 1);
  for (char& c : ending) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return ending;
}

}  // namespace

MeshData read_mesh_file(const std::string& path, double scale) {
  if (!(scale > 0 && std::isfinite(scale))) fail(FS_ERROR_INVALID, "scale is %.9g, must be finite and > 0", scale);
  const std::string ending = ending_of(path);
  for (const Format& format : formats) {
    if (ending != format.ending) continue;
    MeshData mesh = format.parse(read_whole_file(path), path);
    for (size_t i = 0; i < mesh.points.size(); ++i) {
      mesh.points[i] = scale * mesh.points[i];
      if (!is_finite(mesh.points[i])) {
        fail_at(FS_ERROR_PARSE, path, "vertex %zu (from 0) times the scale %g is not finite", i, scale);
      }
    }
    return mesh;
  }
  fail_at(FS_ERROR_UNSUPPORTED, path, "ends in %s, must end in .obj, .ply, .stl or .off", in_quotes(ending).c_str());
}

void write_ply(const std::string& path, const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles) {
  write_file_atomically(path, format_ply(points, triangles));
}

}  // namespace fs
