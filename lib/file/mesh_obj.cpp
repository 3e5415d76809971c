// OBJ: reads the lines "v" and "f". The rest (normals, texture, groups, materials, lines, curves) is ignored.
#include "base/whole_file.h"
#include "file/mesh_formats.h"
#include "file/mesh_text.h"
#include "file/polygon.h"

namespace fs {
namespace {

Vec3 read_vertex(Text& text) {
  const Vec3 point = text.point(text.word());
  for (int i = 0; i < 4; ++i) {  // an optional weight or colour
    const std::string_view more = text.word();
    if (more.empty()) return point;
    text.number(more, "the value after x y z");
  }
  if (!text.word().empty()) fail_at(FS_ERROR_PARSE, text.where(), "a vertex has more than 7 numbers");
  return point;
}

// The vertex number in "7", "7/5", "7//3" or "7/5/3", as written: from 1, or negative to count back from the last.
int64_t read_corner(const Text& text, std::string_view word) {
  const size_t end = word.find('/');
  if (end != word.npos) {
    std::string_view rest = word.substr(end + 1);
    const size_t middle = rest.find('/');
    if (const auto texture = rest.substr(0, middle); !texture.empty()) text.integer(texture, "the texture of a corner");
    if (middle != rest.npos) {
      rest.remove_prefix(middle + 1);
      if (!rest.empty()) text.integer(rest, "the normal of a corner");
    }
  }
  return text.integer(word.substr(0, end), "the vertex of a corner");
}

}  // namespace

MeshData parse_obj(std::string_view bytes, const std::string& file) {
  Text text(bytes, file, {.comments = true, .continuation = true});
  MeshData mesh;
  Faces faces(mesh.triangles);
  int64_t largest = 0;  // the largest index seen; checked at the end, because a face may come before its vertices
  size_t line_of_largest = 0;
  do {
    const std::string_view key = text.word();
    if (key == "v") {
      if (mesh.points.size() == max_points) fail_at(FS_ERROR_UNSUPPORTED, text.where(), "there are too many vertices");
      mesh.points.push_back(read_vertex(text));
    } else if (key == "f" || key == "fo") {
      const auto points = static_cast<int64_t>(mesh.points.size());
      for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
        const int64_t index = read_corner(text, word);
        if (index == 0 || index < -points || index > static_cast<int64_t>(max_points)) {
          fail_at(FS_ERROR_PARSE, text.where(), "the vertex of a corner is %lld, must be 1 or more, or -%lld..-1",
                  static_cast<long long>(index), static_cast<long long>(points));
        }
        if (index > points && index > largest) {
          largest = index;
          line_of_largest = text.line();
        }
        faces.add(static_cast<uint32_t>(index > 0 ? index - 1 : points + index));
      }
      if (faces.corners() < 3) {
        fail_at(FS_ERROR_PARSE, text.where(), "a face has %zu corners, must have 3 or more", faces.corners());
      }
      faces.end_face();
    }
  } while (text.next_line());

  if (largest > static_cast<int64_t>(mesh.points.size())) {
    fail_at(FS_ERROR_PARSE, file + ", line " + std::to_string(line_of_largest),
            "the vertex of a corner is %lld, must be 1..%zu: the file has no more", static_cast<long long>(largest),
            mesh.points.size());
  }
  if (mesh.triangles.empty()) {
    fail_at(FS_ERROR_PARSE, file, "has no face (lines 1..%zu), must have 1 or more", text.line());
  }
  faces.cut(mesh.points, file);
  return mesh;
}

}  // namespace fs
