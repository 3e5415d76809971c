// OFF: a header, the counts, a line for each vertex and each face. Colours, normals and texture are skipped.
#include "base/text.h"
#include "base/whole_file.h"
#include "file/mesh_formats.h"
#include "file/mesh_text.h"
#include "file/polygon.h"

namespace fs {
namespace {

// The header is "OFF" after prefixes for more data of each vertex, which follows x y z: normal N, colour C, texture ST.
void check_header(std::string_view word, const Text& text) {
  std::string_view kind = word;
  while (kind.size() > 3 && (kind[0] == 'N' || kind[0] == 'C' || kind.starts_with("ST"))) {
    kind.remove_prefix(kind[0] == 'S' ? 2 : 1);
  }
  if (kind == "OFF") return;
  if (kind == "4OFF" || kind == "nOFF" || kind == "4nOFF") {
    fail_at(FS_ERROR_UNSUPPORTED, text.where(), "the header is %s: only three dimensions are read", in_quotes(word).c_str());
  }
  fail_at(FS_ERROR_PARSE, text.where(), "the header is %s, must be \"OFF\"", in_quotes(word).c_str());
}

uint64_t read_count(const Text& text, std::string_view word, const char* what) {
  const int64_t count = text.integer(word, what);
  if (count < 1 || count > static_cast<int64_t>(max_points)) {
    fail_at(FS_ERROR_PARSE, text.where(), "%s is %lld, must be 1..%llu", what, static_cast<long long>(count),
            static_cast<unsigned long long>(max_points));
  }
  return static_cast<uint64_t>(count);
}

// The first word of the next line that is not empty. n of count lines were read before.
std::string_view next_item(Text& text, const char* what, uint64_t n, uint64_t count) {
  text.next_line();
  const std::string_view word = text.word_anywhere();
  if (word.empty()) {
    fail_at(FS_ERROR_PARSE, text.where(), "the file ends after %llu of %llu %s", static_cast<unsigned long long>(n),
            static_cast<unsigned long long>(count), what);
  }
  return word;
}

}  // namespace

MeshData parse_off(std::string_view bytes, const std::string& file) {
  Text text(bytes, file, {.comments = true});
  std::string_view word = text.word_anywhere();
  if (word.empty()) fail_at(FS_ERROR_PARSE, text.where(), "the file is empty");
  if (word[0] < '0' || word[0] > '9' || word.ends_with("OFF")) {  // the header may be missing
    check_header(word, text);
    word = text.word_anywhere();
  }
  if (word == "BINARY") fail_at(FS_ERROR_UNSUPPORTED, text.where(), "binary OFF is not read; ASCII is");
  const uint64_t points = read_count(text, word, "the number of vertices");
  const uint64_t faces = read_count(text, text.word(), "the number of faces");
  if (const auto edges = text.word(); !edges.empty()) text.integer(edges, "the number of edges");
  // The shortest vertex is "0 0 0\n", the shortest face "3 0 0 0\n".
  if (points * 6 + faces * 8 > text.remaining() + 1) {
    fail_at(FS_ERROR_PARSE, text.where(), "%llu vertices and %llu faces do not fit into the %zu bytes that follow",
            static_cast<unsigned long long>(points), static_cast<unsigned long long>(faces), text.remaining());
  }

  MeshData mesh;
  mesh.points.reserve(points);
  mesh.triangles.reserve(3 * faces);
  Faces cutter(mesh.triangles);
  for (uint64_t i = 0; i < points; ++i) {
    mesh.points.push_back(text.point(next_item(text, "vertices", i, points)));
  }
  for (uint64_t i = 0; i < faces; ++i) {
    const int64_t corners = text.integer(next_item(text, "faces", i, faces), "the number of corners");
    if (corners < 3) {
      fail_at(FS_ERROR_PARSE, text.where(), "a face has %lld corners, must have 3 or more", static_cast<long long>(corners));
    }
    for (int64_t k = 0; k < corners; ++k) {
      const int64_t index = text.integer(text.word(), "the vertex of a corner");
      if (index < 0 || index >= static_cast<int64_t>(points)) {
        fail_at(FS_ERROR_PARSE, text.where(), "the vertex of a corner is %lld, must be 0..%llu", static_cast<long long>(index),
                static_cast<unsigned long long>(points - 1));
      }
      cutter.add(static_cast<uint32_t>(index));
    }
    cutter.end_face();
  }
  text.next_line();
  if (const auto more = text.word_anywhere(); !more.empty()) {
    fail_at(FS_ERROR_PARSE, text.where(), "%s follows the last of %llu faces", in_quotes(more).c_str(),
            static_cast<unsigned long long>(faces));
  }
  cutter.cut(mesh.points, file);
  return mesh;
}

}  // namespace fs
