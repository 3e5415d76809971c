// STL, binary and ASCII. Corners at equal coordinates become one point; every triangle is kept.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/text.h"
#include "base/whole_file.h"
#include "file/binary.h"
#include "file/mesh_formats.h"
#include "file/mesh_text.h"

namespace fs {
namespace {

constexpr size_t header_size = 84, triangle_size = 50;  // bytes: 80 of text and the count; 12 floats and 2 bytes more

// Merges points at equal coordinates and numbers them in the order in which they first appear. It sorts, because a
// hostile file could make a hash table slow.
MeshData weld(const std::vector<Vec3>& corners) {
  struct Corner {
    Vec3 point;
    uint32_t index;
  };
  std::vector<Corner> sorted(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) sorted[i] = {corners[i], static_cast<uint32_t>(i)};
  std::sort(sorted.begin(), sorted.end(), [](const Corner& a, const Corner& b) {
    if (a.point.x != b.point.x) return a.point.x < b.point.x;
    if (a.point.y != b.point.y) return a.point.y < b.point.y;
    if (a.point.z != b.point.z) return a.point.z < b.point.z;
    return a.index < b.index;
  });
  std::vector<uint32_t> first(corners.size());  // the first corner at the same place
  for (size_t i = 0; i < sorted.size(); ++i) {
    const bool is_new = i == 0 || !(sorted[i].point == sorted[i - 1].point);
    first[sorted[i].index] = is_new ? sorted[i].index : first[sorted[i - 1].index];
  }

  MeshData mesh;
  mesh.triangles.resize(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    if (first[i] == i) {
      mesh.triangles[i] = static_cast<uint32_t>(mesh.points.size());
      mesh.points.push_back(corners[i]);
    } else {
      mesh.triangles[i] = mesh.triangles[first[i]];
    }
  }
  return mesh;
}

MeshData parse_binary(std::string_view bytes, const std::string& file) {
  const auto triangles = load<uint32_t, std::endian::little>(bytes.data() + 80);
  if (triangles == 0) fail_at(FS_ERROR_PARSE, file, "byte 80: the number of triangles is 0, must be 1 or more");
  if (uint64_t{triangles} * 3 > max_points) {
    fail_at(FS_ERROR_UNSUPPORTED, file, "byte 80: the number of triangles is %u, must be at most %llu", triangles,
            static_cast<unsigned long long>(max_points / 3));
  }
  std::vector<Vec3> corners;
  corners.reserve(3 * size_t{triangles});
  for (size_t i = 0; i < triangles; ++i) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const size_t at = header_size + triangle_size * i + 12 * (corner + 1);  // after the normal
      double xyz[3];
      for (size_t k = 0; k < 3; ++k) {
        xyz[k] = load<float, std::endian::little>(bytes.data() + at + 4 * k);
        if (!std::isfinite(xyz[k])) {
          fail_at(FS_ERROR_PARSE, file, "byte %zu: %c of corner %zu of triangle %zu is %.9g, must be finite", at + 4 * k,
                  "xyz"[k], corner, i, xyz[k]);
        }
      }
      corners.push_back({xyz[0], xyz[1], xyz[2]});
    }
  }
  return weld(corners);
}

bool is_keyword(std::string_view word, std::string_view keyword) {  // ignores case
  return std::equal(word.begin(), word.end(), keyword.begin(), keyword.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

void expect(Text& text, const char* keyword) {
  const std::string_view word = text.word_anywhere();
  if (is_keyword(word, keyword)) return;
  if (word.empty()) fail_at(FS_ERROR_PARSE, text.where(), "the file ends, must go on with \"%s\"", keyword);
  fail_at(FS_ERROR_PARSE, text.where(), "the word is %s, must be \"%s\"", in_quotes(word).c_str(), keyword);
}

MeshData parse_ascii(std::string_view bytes, const std::string& file) {
  Text text(bytes, file, {});
  std::vector<Vec3> corners;
  expect(text, "solid");
  for (bool is_open = true; is_open;) {
    text.next_line();  // the solid's name
    for (;;) {
      const std::string_view word = text.word_anywhere();
      if (is_keyword(word, "endsolid")) break;
      if (!is_keyword(word, "facet")) {
        if (word.empty()) {
          fail_at(FS_ERROR_PARSE, text.where(), "the file ends, must go on with \"facet\" or \"endsolid\"");
        }
        fail_at(FS_ERROR_PARSE, text.where(), "the word is %s, must be \"facet\" or \"endsolid\"", in_quotes(word).c_str());
      }
      expect(text, "normal");
      for (int i = 0; i < 3; ++i) text.word_anywhere();  // often nan, and the order of the corners gives it too
      expect(text, "outer");
      expect(text, "loop");
      for (int corner = 0; corner < 3; ++corner) {
        expect(text, "vertex");
        corners.push_back(text.point(text.word()));
      }
      expect(text, "endloop");
      expect(text, "endfacet");
      if (corners.size() > max_points) fail_at(FS_ERROR_UNSUPPORTED, text.where(), "there are too many triangles");
    }
    text.next_line();  // the name again
    const std::string_view word = text.word_anywhere();
    is_open = is_keyword(word, "solid");
    if (!is_open && !word.empty()) {
      fail_at(FS_ERROR_PARSE, text.where(), "%s follows \"endsolid\"", in_quotes(word).c_str());
    }
  }
  if (corners.empty()) fail_at(FS_ERROR_PARSE, text.where(), "the file ends without a facet");
  return weld(corners);
}

}  // namespace

MeshData parse_stl(std::string_view bytes, const std::string& file) {
  if (bytes.empty()) {
    fail_at(FS_ERROR_PARSE, file, "the file is empty; an STL file begins with \"solid\" or has at least %zu bytes", header_size);
  }
  uint32_t triangles = 0;
  if (bytes.size() >= header_size) triangles = load<uint32_t, std::endian::little>(bytes.data() + 80);
  const uint64_t expected = header_size + triangle_size * uint64_t{triangles};
  // The size is tested first, because many binary files begin with "solid" too.
  if (bytes.size() >= header_size && bytes.size() == expected) return parse_binary(bytes, file);
  std::string_view start = bytes.substr(0, header_size);
  if (start.find('\0') == start.npos) {
    if (start.starts_with("\xef\xbb\xbf")) start.remove_prefix(3);
    start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n\v\f"), start.size()));
    if (is_keyword(start.substr(0, 5), "solid")) return parse_ascii(bytes, file);
  }
  if (bytes.size() < header_size) {
    fail_at(FS_ERROR_PARSE, file, "byte %zu: the file ends here, must begin with \"solid\" or have %zu bytes or more",
            bytes.size(), header_size);
  }
  fail_at(FS_ERROR_PARSE, file, "byte 80: %u triangles take %llu bytes, the file has %zu", triangles,
          static_cast<unsigned long long>(expected), bytes.size());
}

}  // namespace fs
