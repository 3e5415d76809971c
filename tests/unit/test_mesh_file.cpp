// The readers of mesh files: what they read, and what they refuse and say about it.
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <new>
#include <numeric>

#include <clocale>
#include <csignal>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/error.h"
#include "base/whole_file.h"
#include "file/binary.h"
#include "file/mesh_file.h"
#include "file/mesh_formats.h"
#include "scenes/folder.h"
#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;
using scenes::Random;

namespace {
size_t largest_request = 0;  // bytes, of one allocation
}

[[gnu::noinline]] void* operator new(size_t size) {
  largest_request = std::max(largest_request, size);
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept { std::free(memory); }

namespace {

using Parse = MeshData (*)(std::string_view, const std::string&);

struct Outcome {
  fs_status status = FS_OK;
  std::string text;
  MeshData mesh;
};

Outcome attempt(const std::function<MeshData()>& read) {
  Outcome out;
  try {
    out.mesh = read();
  } catch (const Error& error) {
    out.status = error.status;
    out.text = error.text;
  }
  return out;
}
Outcome attempt(Parse parse, std::string_view bytes) {
  // A copy of exactly this size, so that the address sanitizer sees a read behind it.
  const std::vector<char> exact(bytes.begin(), bytes.end());
  return attempt([&] { return parse({exact.data(), exact.size()}, "a.mesh"); });
}

uint64_t bits(double value) { return std::bit_cast<uint64_t>(value); }

void write_text(const std::string& path, std::string_view text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string text_of(double value) {
  char buffer[32];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

// A mesh with vertices of every awkward kind, a degenerate triangle, a repeated triangle, and an edge of three
// triangles.
MeshData awkward_mesh() {
  return {{{4100000.98765, -0.0, 5e-324}, {0.1, 1.0 / 3, 1e15}, {1, 0, -2.5e-7}, {-1e-300, 123456789.123456789, 7}},
          {0, 1, 2, 0, 1, 2, 0, 1, 3, 1, 0, 3, 2, 2, 2, 3, 3, 0}};
}

void check_equal(const MeshData& a, const MeshData& b) {
  ck_assert_uint_eq(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) {
    ck_assert_uint_eq(bits(a.points[i].x), bits(b.points[i].x));
    ck_assert_uint_eq(bits(a.points[i].y), bits(b.points[i].y));
    ck_assert_uint_eq(bits(a.points[i].z), bits(b.points[i].z));
  }
  ck_assert_uint_eq(a.triangles.size(), b.triangles.size());
  ck_assert(a.triangles == b.triangles);
}

std::string vertex_lines(const MeshData& mesh, const char* start) {
  std::string out;
  for (const Vec3& p : mesh.points) {
    out += start + text_of(p.x) + " " + text_of(p.y) + " " + text_of(p.z) + "\n";
  }
  return out;
}
std::string face_lines(const MeshData& mesh, const char* start, uint32_t first) {
  std::string out;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (i % 3 == 0) out += start;
    out += std::to_string(mesh.triangles[i] + first) + (i % 3 == 2 ? "\n" : " ");
  }
  return out;
}
std::string to_obj(const MeshData& mesh) { return vertex_lines(mesh, "v ") + face_lines(mesh, "f ", 1); }
std::string to_off(const MeshData& mesh) {
  return "OFF\n" + std::to_string(mesh.points.size()) + " " + std::to_string(mesh.triangles.size() / 3) + " 0\n" +
         vertex_lines(mesh, "") + face_lines(mesh, "3 ", 0);
}
std::string to_ascii_ply(const MeshData& mesh) {
  return "ply\nformat ascii 1.0\ncomment by hand\nelement vertex " + std::to_string(mesh.points.size()) +
         "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
         std::to_string(mesh.triangles.size() / 3) + "\nproperty list uchar int vertex_index\nend_header\n" +
         vertex_lines(mesh, "") + face_lines(mesh, "3 ", 0);
}
std::string to_ascii_stl(const MeshData& mesh) {
  std::string out = "solid by hand\n";
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (i % 3 == 0) out += " facet normal nan nan nan\n  outer loop\n";
    const Vec3 p = mesh.points[mesh.triangles[i]];
    out += "   vertex " + text_of(p.x) + " " + text_of(p.y) + " " + text_of(p.z) + "\n";
    if (i % 3 == 2) out += "  endloop\n endfacet\n";
  }
  return out + "endsolid by hand\n";
}
std::string to_binary_stl(const MeshData& mesh, const char* title = "solid in name only") {
  std::string out = title;
  out.resize(80);
  store(out, static_cast<uint32_t>(mesh.triangles.size() / 3));
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (i % 3 == 0) {
      for (int k = 0; k < 3; ++k) store(out, 0.0f);
    }
    const Vec3 p = mesh.points[mesh.triangles[i]];
    for (const double c : {p.x, p.y, p.z}) store(out, static_cast<float>(c));
    if (i % 3 == 2) store(out, uint16_t{0xffff});
  }
  return out;
}

// x y z of types float, double and short; a list and a scalar to be read over; faces of every kind of list.
template <std::endian order>
std::string mixed_ply(bool large_indices) {
  std::string out = "ply\r\nformat binary_";
  out += order == std::endian::little ? "little" : "big";
  out += "_endian 1.0\r\nelement strange 2\r\nproperty list ushort double junk\r\nelement vertex 4\r\n"
         "property uchar red\r\nproperty float x\r\nproperty double y\r\nproperty list char short extra\r\n"
         "property short z\r\nelement face 2\r\nproperty float quality\r\n";
  out += large_indices ? "property list uint uint vertex_indices\r\n" : "property list char uchar vertex_indices\r\n";
  out += "element nothing 4000000000\r\nelement edge 1\r\nproperty int vertex1\r\nend_header\r\n";
  const auto put = [&out](auto value) {
    std::string bytes;
    store(bytes, value);
    if (order == std::endian::big) std::reverse(bytes.begin(), bytes.end());
    out += bytes;
  };
  put(uint16_t{0});
  put(uint16_t{2}), put(std::nan("")), put(1.0);
  for (int i = 0; i < 4; ++i) {
    put(uint8_t{255}), put(i + 0.5f), put(i + 0.1);
    put(int8_t{2}), put(int16_t{9}), put(int16_t{9});
    put(static_cast<int16_t>(-i));
  }
  for (const auto& corners : {std::vector<int>{0, 1, 2, 3}, std::vector<int>{3, 3, 3}}) {
    put(std::nanf(""));
    const auto put_index = [&](int index) {
      if (large_indices) put(static_cast<uint32_t>(index));
      else put(static_cast<uint8_t>(index));
    };
    put_index(static_cast<int>(corners.size()));
    for (const int corner : corners) put_index(corner);
  }
  put(int32_t{-1});
  return out;
}

}  // namespace

START_TEST(doubles_and_all_triangles_are_kept)
{
  const MeshData mesh = awkward_mesh();
  check_equal(attempt(parse_obj, to_obj(mesh)).mesh, mesh);
  check_equal(attempt(parse_off, to_off(mesh)).mesh, mesh);
  check_equal(attempt(parse_ply, to_ascii_ply(mesh)).mesh, mesh);
  check_equal(attempt(parse_ply, format_ply(mesh.points, mesh.triangles)).mesh, mesh);
  check_equal(attempt(parse_stl, to_ascii_stl(mesh)).mesh, mesh);  // its corners come in the order of the points
}
END_TEST

START_TEST(binary_stl_is_known_by_its_size)
{
  const MeshData mesh{{{4100001, -0.0, 1e-45f}, {0.1f, 1.0f / 3, 1e15f}, {1, 0, -2.5e-7f}, {-1e-30f, 3e38f, 7}},
                      awkward_mesh().triangles};
  check_equal(attempt(parse_stl, to_binary_stl(mesh)).mesh, mesh);
  check_equal(attempt(parse_stl, to_binary_stl(mesh, "other")).mesh, mesh);
}
END_TEST

START_TEST(stl_corners_are_welded_only_where_equal)
{
  MeshData mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0, 0, 0}, {std::nextafter(1.0, 2.0), 0, 0}}, {0, 1, 2, 3, 4, 2}};
  const Outcome out = attempt(parse_stl, to_ascii_stl(mesh));
  ck_assert_uint_eq(out.mesh.points.size(), 4);
  const std::vector<uint32_t> expected{0, 1, 2, 0, 3, 2};
  ck_assert(out.mesh.triangles == expected);
}
END_TEST

START_TEST(ply_of_any_types_and_byte_order)
{
  for (const bool large : {false, true}) {
    for (const std::string& bytes : {mixed_ply<std::endian::little>(large), mixed_ply<std::endian::big>(large)}) {
      const Outcome out = attempt(parse_ply, bytes);
      ck_assert_msg(out.status == FS_OK, "%s", out.text.c_str());
      MeshData expected{{}, {0, 1, 2, 0, 2, 3, 3, 3, 3}};
      for (int i = 0; i < 4; ++i) expected.points.push_back({i + 0.5, i + 0.1, i == 0 ? 0.0 : -i});
      check_equal(out.mesh, expected);
    }
  }
}
END_TEST

START_TEST(obj_has_many_forms)
{
  const Outcome out = attempt(parse_obj,
                              "\xef\xbb\xbf# C:\\models\\\n"      // a comment is not continued
                              "mtllib x.mtl\r\no thing\r"          // three kinds of line ends
                              "f 1/1/1 2//7 \\\n  3/5/ +4\n"       // before its vertices; continued; a polygon
                              "v +1 2. .5 1\nv\t1e0 0 0 0.5 0.5 0.5\n\n"
                              "vn nan nan nan\nvt hello\n"
                              "v 0 1 0 # the third\nv 0 0 1\n"
                              "fo -1 -2 -3\nl 1 2\ng end");
  ck_assert_msg(out.status == FS_OK, "%s", out.text.c_str());
  check_equal(out.mesh, {{{1, 2, 0.5}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 1, 2, 0, 2, 3, 3, 2, 1}});
}
END_TEST

START_TEST(off_has_many_headers)
{
  const MeshData expected{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}};
  for (const char* text : {"OFF 3 1 3\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2", "3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                           "# c\n\nOFF # c\n# c\n3 1 0\n\n0 0 0 # c\n1 0 0\n0 1 0\n\n3 0 1 2 # c\n\n# c\n",
                           "NCOFF\n3 1 0\n0 0 0 0 0 1 9 9 9 9\n1 0 0 0 0 1 9 9 9 9\n0 1 0 0 0 1 9 9 9 9\n3 0 1 2 9 0\n",
                           "STOFF\r\n3 1 0\r\n0 0 0 0 0\r\n1 0 0 0 0\r\n0 1 0 0 0\r\n3 0 1 2\r\n"}) {
    const Outcome out = attempt(parse_off, text);
    ck_assert_msg(out.status == FS_OK, "%s", out.text.c_str());
    check_equal(out.mesh, expected);
  }
}
END_TEST

START_TEST(numbers_do_not_depend_on_the_locale)
{
  if (!std::setlocale(LC_ALL, "de_DE.UTF-8")) return;  // not installed: nothing to see
  check_equal(attempt(parse_obj, to_obj(awkward_mesh())).mesh, awkward_mesh());
  std::setlocale(LC_ALL, "C");
}
END_TEST

namespace {

struct Hostile {
  Parse parse;
  std::string bytes;
  std::vector<const char*> words;  // of the sentence
  fs_status status = FS_ERROR_PARSE;
};

std::string ply(const char* counts, const char* body) {
  return std::string("ply\nformat ascii 1.0\n") + counts + "end_header\n" + body;
}
constexpr char xyz[] = "property float x\nproperty float y\nproperty float z\n";
std::string ply_head(const char* format, const char* vertices, const char* faces) {
  return std::string("ply\nformat ") + format + " 1.0\nelement vertex " + vertices + "\n" + xyz + "element face " +
         faces + "\nproperty list uchar int vertex_indices\nend_header\n";
}

std::vector<Hostile> hostile_files() {
  const MeshData good = awkward_mesh();
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\n", off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n";
  std::string stl = to_binary_stl(good, "binary");
  std::string claims_much = stl, nan_inside = stl, no_triangle = stl.substr(0, 84);
  std::memcpy(claims_much.data() + 80, "\x00\x28\x6b\xee", 4);  // 4e9
  claims_much.resize(200);
  std::memcpy(nan_inside.data() + 84 + 50 + 12 + 4, "\x00\x00\xc0\x7f", 4);
  std::memcpy(no_triangle.data() + 80, "\0\0\0\0", 4);
  std::string binary = format_ply(good.points, good.triangles), infinite = binary, outside = binary;
  const size_t data = binary.find("end_header\n") + 11;
  const std::string at_data = "byte " + std::to_string(data + 24 + 8);
  std::memcpy(infinite.data() + data + 24 + 8, "\0\0\0\0\0\0\xf0\x7f", 8);
  outside[data + 4 * 24 + 1] = 4;
  const std::string at_index = "byte " + std::to_string(data + 4 * 24 + 1);
  static std::vector<std::string> kept;  // words live on
  kept = {at_data, at_index, "byte " + std::to_string(binary.size()),
          "byte " + std::to_string(binary.size() - 13)};
  return {
      {parse_obj, "", {"a.mesh", "has no face"}},
      {parse_obj, "hello\n", {"has no face"}},
      {parse_obj, obj, {"has no face"}},
      {parse_obj, obj + "f 1 2 4\n", {"line 4", "is 4", "1..3"}},
      {parse_obj, obj + "f 1 2 0\n", {"line 4", "is 0"}},
      {parse_obj, obj + "f 1 2 -4\n", {"line 4", "is -4", "-3..-1"}},
      {parse_obj, "f 1 2 3\nf 1 2 9\n" + obj, {"line 2", "is 9", "1..3"}},
      {parse_obj, obj + "f 1 2 4294967297\n", {"line 4", "4294967297"}},
      {parse_obj, obj + "f 1 2 99999999999999999999\n", {"line 4", "\"99999999999999999999\"", "an integer"}},
      {parse_obj, obj + "f 1 2 3x\n", {"line 4", "\"3x\""}},
      {parse_obj, obj + "f 1 2 3/x\n", {"line 4", "texture", "\"x\""}},
      {parse_obj, obj + "f 1 2 3//1/1\n", {"line 4", "normal", "\"1/1\""}},
      {parse_obj, obj + "f 1 2\n", {"line 4", "2 corners", "3 or more"}},
      {parse_obj, obj + "f\n", {"line 4", "0 corners"}},
      {parse_obj, obj + "f 1 2 2.5\n", {"line 4", "\"2.5\""}},
      {parse_obj, "v 0 0\nf 1 1 1\n", {"line 1", "z is missing"}},
      {parse_obj, "v 0 0 nan\nf 1 1 1\n", {"line 1", "z is \"nan\"", "finite"}},
      {parse_obj, "v 0 -inf 0\nf 1 1 1\n", {"line 1", "y is \"-inf\"", "finite"}},
      {parse_obj, "v 1e999 0 0\nf 1 1 1\n", {"line 1", "x is \"1e999\"", "range"}},
      {parse_obj, "v 0x10 0 0\nf 1 1 1\n", {"line 1", "x is \"0x10\"", "a number"}},
      {parse_obj, "v 1,5 0 0\nf 1 1 1\n", {"line 1", "\"1,5\""}},
      {parse_obj, "v 0 0 0 x\nf 1 1 1\n", {"line 1", "\"x\""}},
      {parse_obj, "v 0 0 0\r\n\rv 0 0 x\r\n", {"line 3", "z is \"x\""}},
      {parse_obj, "v 0 0 0 1 2 3 4 5\nf 1 1 1\n", {"line 1", "more than 7"}},
      {parse_obj, obj + std::string("\0", 1) + "f 1 2 3\n", {"byte 24", "NUL"}},
      {parse_obj, "v " + std::string(1 << 20, '9') + "x 0 0\n", {"line 1", "\"99999", "...\"", "a number"}},
      {parse_obj, "v " + std::string(1 << 20, '9') + " 0 0\n", {"line 1", "range"}},
      {parse_off, "", {"line 1", "empty"}},
      {parse_off, "OFX\n3 1 0\n", {"line 1", "\"OFX\""}},
      {parse_off, "OFF", {"line 1", "number of vertices is missing"}},
      {parse_off, "OFF\n3\n", {"line 2", "number of faces is missing"}},
      {parse_off, "OFF\n3 1 x\n", {"line 2", "edges", "\"x\""}},
      {parse_off, "OFF\n-3 1 0\n", {"line 2", "is -3", "1..4294967295"}},
      {parse_off, "OFF\n3 0 0\n0 0 0\n0 0 0\n0 0 0\n", {"line 2", "faces is 0", "1.."}},
      {parse_off, "OFF\n4000000000 4000000000 0\n0 0 0\n", {"line 2", "4000000000", "do not fit"}},
      {parse_off, "OFF\n9223372036854775807 1 0\n0 0 0\n", {"line 2", "9223372036854775807"}},
      {parse_off, off, {"do not fit"}},
      {parse_off, off + "3 0 1 3\n", {"line 6", "is 3", "0..2"}},
      {parse_off, off + "3 0 1 -1\n", {"line 6", "is -1", "0..2"}},
      {parse_off, off + "3 0 1     \n", {"line 6", "missing"}},
      {parse_off, off + "2 0 1     \n", {"line 6", "2 corners"}},
      {parse_off, off + "999999999999 0 1 2\n", {"line 6", "missing"}},
      {parse_off, off + "3 0 1 2\n3 0 1 2\n", {"line 7", "\"3\"", "last of 1 faces"}},
      {parse_off, "OFF\n3 1 0\n0 0 0\n1 0 inf\n0 1 0\n3 0 1 2\n", {"line 4", "z is \"inf\""}},
      {parse_off, "OFF\n3 1 0\n0 0 0\n1 0 0\n               ", {"after 2 of 3 vertices"}},
      {parse_off, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n         ", {"after 0 of 1 faces"}},
      {parse_off, "OFF BINARY\n", {"line 1", "binary"}, FS_ERROR_UNSUPPORTED},
      {parse_off, "4OFF\n", {"line 1", "4OFF"}, FS_ERROR_UNSUPPORTED},
      {parse_off, "nOFF\n", {"line 1", "nOFF"}, FS_ERROR_UNSUPPORTED},
      {parse_off, std::string("OFF\n\0", 5), {"byte 4", "NUL"}},
      {parse_ply, "", {"line 1", "\"ply\""}},
      {parse_ply, "plyx\n", {"line 1", "\"plyx\"", "\"ply\""}},
      {parse_ply, "ply\n", {"line 2", "end_header"}},
      {parse_ply, "ply\nend_header\n", {"no \"format\""}},
      {parse_ply, "ply\nformat ascii 2.0\nend_header\n", {"line 2", "2.0"}, FS_ERROR_UNSUPPORTED},
      {parse_ply, "ply\nformat zip 1.0\nend_header\n", {"line 2", "zip"}, FS_ERROR_UNSUPPORTED},
      {parse_ply, ply("", ""), {"no vertex"}},
      {parse_ply, ply("hello\n", ""), {"line 3", "hello"}},
      {parse_ply, ply("property float x\n", ""), {"line 3", "before the first element"}},
      {parse_ply, ply("element vertex x\n", ""), {"line 3", "\"x\"", "an integer"}},
      {parse_ply, ply("element vertex -1\n", ""), {"line 3", "-1"}},
      {parse_ply, ply("element vertex 1 2\n", ""), {"line 3", "\"2\""}},
      {parse_ply, ply("element vertex 1\nproperty quaternion x\n", ""), {"line 4", "quaternion"}},
      {parse_ply, ply("element vertex 1\nproperty float\n", ""), {"line 4", "no name"}},
      {parse_ply, ply("element vertex 1\nproperty float x\nproperty float x\n", ""), {"line 5", "x is given twice"}},
      {parse_ply, ply("element vertex 1\nelement vertex 1\n", ""), {"line 4", "\"vertex\" is given twice"}},
      {parse_ply, ply("element vertex 1\nproperty float x\nproperty float y\n", "0 0\n"), {"no x, y or z"}},
      {parse_ply, ply("element face 1\nproperty list float int vertex_indices\n", ""), {"line 4", "integer type"}},
      {parse_ply, ply("element face 1\nproperty list uchar float vertex_indices\n", ""), {"line 4", "integer type"}},
      {parse_ply, ply("element face 1\nproperty int vertex_indices\n", "3\n"), {"no list vertex_indices"}},
      {parse_ply, ply("element tristrips 1\n", ""), {"line 3", "strips"}, FS_ERROR_UNSUPPORTED},
      {parse_ply, ply_head("ascii", "1", "0") + "0 0 0\n", {"no face"}},
      {parse_ply, ply_head("ascii", "4000000000", "4000000000") + "0 0 0\n", {"4000000000", "\"vertex\"", "6 bytes"}},
      {parse_ply, ply_head("ascii", "9223372036854775807", "1") + "0 0 0\n", {"9223372036854775807", "6 bytes"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n3 0 0 1\n", {"line 11", "is 1", "0..0"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n3 0 0 -1\n", {"line 11", "is -1", "0..0"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n3 0 0\n", {"ends before"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n2 0 0\n", {"line 11", "2 corners"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n-3 0 0 0\n", {"line 11", "-3"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n4000000000 0 0\n", {"line 11", "4000000000", "do not hold"}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 nan 0\n3 0 0 0\n", {"line 10", "y is \"nan\""}},
      {parse_ply, ply_head("ascii", "1", "1") + "0 0 0\n3 0 0 0\n7\n", {"line 12", "\"7\"", "follows the last"}},
      {parse_ply, ply_head("binary_little_endian", "4000000000", "4000000000") + "1234", {"4000000000", "4 bytes"}},
      {parse_ply, binary.substr(0, binary.size() - 1), {"count of a list is 3", "11 bytes", "byte"}},
      {parse_ply, binary.substr(0, binary.size() - 13), {kept[3].c_str(), "ends before"}},
      {parse_ply, binary.substr(0, binary.size() - 50), {"do not hold"}},
      {parse_ply, binary + "x", {kept[2].c_str(), "1 bytes follow"}},
      {parse_ply, infinite, {kept[0].c_str(), "y is inf"}},
      {parse_ply, outside, {kept[1].c_str(), "is 4", "0..3"}},
      {parse_stl, "", {"the file is empty"}},
      {parse_stl, stl.substr(0, 83), {"byte 83"}},
      {parse_stl, stl.substr(0, stl.size() - 1), {"6 triangles take 384 bytes", "has 383"}},
      {parse_stl, stl + "x", {"6 triangles take 384 bytes", "has 385"}},
      {parse_stl, claims_much, {"4000000000 triangles take 200000000084 bytes", "has 200"}},
      {parse_stl, nan_inside, {"byte 150", "y of corner 0 of triangle 1 is nan"}},
      {parse_stl, no_triangle, {"byte 80", "is 0"}},
      {parse_stl, "solid\n", {"line 2", "endsolid"}},
      {parse_stl, "solid\nendsolid\n", {"without a facet"}},
      {parse_stl, "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 0 0\nendloop\n", {"line 6", "vertex"}},
      {parse_stl, "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0 0\n", {"line 4", "\"0\"", "\"vertex\""}},
      {parse_stl, "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 inf 0\n", {"line 4", "y is \"inf\""}},
      {parse_stl, "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0", {"line 4", "z is missing"}},
      {parse_stl, "solid\nhello\n", {"line 2", "\"hello\""}},
      {parse_stl, to_ascii_stl(good) + "hello\n", {"\"hello\"", "follows"}},
      {parse_stl, to_ascii_stl(good).substr(0, to_ascii_stl(good).size() - 17), {"endsolid"}},
  };
}

}  // namespace

START_TEST(hostile_files_are_refused_with_their_reason)
{
  for (const Hostile& hostile : hostile_files()) {
    const std::vector<char> exact(hostile.bytes.begin(), hostile.bytes.end());
    largest_request = 0;
    const Outcome out = attempt([&] { return hostile.parse({exact.data(), exact.size()}, "a.mesh"); });
    const size_t most = 4096 + 24 * hostile.bytes.size();
    const std::string start = hostile.bytes.substr(0, 200);
    ck_assert_msg(out.status == hostile.status, "%d (%s) for: %s", out.status, out.text.c_str(), start.c_str());
    for (const char* word : hostile.words) {
      ck_assert_msg(out.text.find(word) != out.text.npos, "'%s' is not in: %s", word, out.text.c_str());
    }
    ck_assert_msg(out.text.starts_with("a.mesh"), "%s", out.text.c_str());
    ck_assert_uint_le(out.text.size(), 300);
    ck_assert_msg(largest_request <= most, "%zu bytes taken for: %s", largest_request, start.c_str());
  }
}
END_TEST

// Files that differ by one change from good ones are refused or read: never a crash, an index out of range or a number
// that is not finite.
START_TEST(damaged_files_never_crash)
{
  const MeshData mesh = awkward_mesh();
  const std::pair<Parse, std::string> good[] = {
      {parse_obj, to_obj(mesh)},
      {parse_obj, "v 0 0 0\nv 1/1 0 0\nf 1/1/1 -1//2 \\\n1\n"},
      {parse_off, to_off(mesh)},
      {parse_ply, to_ascii_ply(mesh)},
      {parse_ply, format_ply(mesh.points, mesh.triangles)},
      {parse_ply, mixed_ply<std::endian::little>(false)},
      {parse_ply, mixed_ply<std::endian::big>(true)},
      {parse_stl, to_ascii_stl(mesh)},
      {parse_stl, to_binary_stl(mesh)},
  };
  Random random(7);
  int read = 0, refused = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto& [parse, bytes] = good[i % std::size(good)];
    std::string damaged = bytes;
    for (uint64_t changes = 1 + random.below(3); changes > 0; --changes) {
      const size_t at = random.below(damaged.size() + 1);
      switch (random.below(5)) {
        case 0: damaged.resize(at); break;
        case 1: damaged.insert(at, 1, static_cast<char>(random.bits())); break;
        case 2: damaged.insert(at, damaged.substr(random.below(damaged.size() + 1), random.below(20))); break;
        case 3: damaged.erase(at, random.below(8)); break;
        default:
          if (at < damaged.size()) damaged[at] = static_cast<char>(damaged[at] ^ 1 << random.below(8));
      }
    }
    const Outcome out = attempt(parse, damaged);
    (out.status == FS_OK ? read : refused) += 1;
    if (out.status != FS_OK) ck_assert(out.status == FS_ERROR_PARSE || out.status == FS_ERROR_UNSUPPORTED);
    if (out.status == FS_OK) ck_assert(!out.mesh.triangles.empty() && out.mesh.triangles.size() % 3 == 0);
    for (const uint32_t index : out.mesh.triangles) ck_assert_uint_lt(index, out.mesh.points.size());
    for (const Vec3& point : out.mesh.points) ck_assert(is_finite(point));
  }
  ck_assert_int_gt(read, 500);
  ck_assert_int_gt(refused, 5000);
}
END_TEST

// Large numbers of each thing that a file can repeat: with quadratic time the test would not end within its 60 s.
START_TEST(large_headers_are_read_in_reasonable_time)
{
  std::string elements, properties, line;
  for (int i = 0; i < 1000000; ++i) elements += "element a 0\n";
  for (int i = 0; i < 300000; ++i) {
    properties += "property list uchar float q\n";
    line += "0 ";
  }
  const std::string head = std::string("element vertex 1\n") + xyz;
  const std::string face = "element face 1\nproperty list uchar int vertex_index\n";
  for (const std::string& text : {ply((elements + head + face).c_str(), "0 0 0\n3 0 0 0\n"),
                                  ply((head + elements + face).c_str(), "0 0 0\n3 0 0 0\n"),
                                  ply((head + properties + face).c_str(), ("0 0 0 " + line + "\n3 0 0 0\n").c_str())}) {
    const Outcome out = attempt(parse_ply, text);
    ck_assert_msg(out.status == FS_OK && out.mesh.triangles.size() == 3, "%s", out.text.c_str());
  }
}
END_TEST

START_TEST(a_file_is_read_by_its_ending_and_scaled)
{
  const scenes::Folder directory;
  const MeshData mesh{{{1, 2, 3}, {4, 5, 6}, {7, 8, 10}}, {0, 1, 2}};
  for (const auto& [name, bytes] : std::initializer_list<std::pair<const char*, std::string>>{
           {"a.obj", to_obj(mesh)},
           {"a.b.OFF", to_off(mesh)},
           {"a.Ply", to_ascii_ply(mesh)},
           {"a.StL", to_ascii_stl(mesh)}}) {
    write_text(directory / name, bytes);
    MeshData expected = mesh;
    for (Vec3& p : expected.points) p = 0.001 * p;
    check_equal(read_mesh_file(directory / name, 0.001), expected);
  }
  for (const double scale : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    ck_assert_int_eq(attempt([&] { return read_mesh_file(directory / "a.obj", scale); }).status, FS_ERROR_INVALID);
  }
  const Outcome out = attempt([&] { return read_mesh_file(directory / "a.obj", 1e308); });
  ck_assert_int_eq(out.status, FS_ERROR_PARSE);
  ck_assert_msg(out.text.find("vertex 0") != out.text.npos, "%s", out.text.c_str());
}
END_TEST

START_TEST(files_that_are_none)
{
  const scenes::Folder directory;
  const auto check = [](const std::string& path, fs_status status, const char* word) {
    const Outcome out = attempt([&] { return read_mesh_file(path, 1); });
    ck_assert_msg(out.status == status && out.text.find(word) != out.text.npos && out.text.find(path) == 0, "%s: %d %s",
                  path.c_str(), out.status, out.text.c_str());
  };
  check(directory / "missing.ply", FS_ERROR_NOT_FOUND, "No such file");
  check(directory / "a.xyz", FS_ERROR_UNSUPPORTED, "\"xyz\"");
  check(directory / "noending", FS_ERROR_UNSUPPORTED, "\"\"");
  std::filesystem::create_directory(directory / "d.ply");
  check(directory / "d.ply", FS_ERROR_IO, "a directory");
  check(directory / "d.ply/x", FS_ERROR_UNSUPPORTED, "\"\"");
  write_text(directory / "a.ply", "");
  check(directory / "a.ply", FS_ERROR_PARSE, "line 1");
  check(directory / "a.ply/b.ply", FS_ERROR_NOT_FOUND, "Not a directory");
  ck_assert_int_eq(mkfifo((directory / "pipe.ply").c_str(), 0600), 0);
  check(directory / "pipe.ply", FS_ERROR_IO, "is a pipe, must be a file");
  std::filesystem::create_symlink("/dev/zero", directory / "zero.ply");
  check(directory / "zero.ply", FS_ERROR_IO, "is a device, must be a file");
  const int end = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, (directory / "socket.ply").c_str());
  ck_assert_int_eq(bind(end, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  check(directory / "socket.ply", FS_ERROR_IO, "is a socket, must be a file");
  close(end);
  write_text(directory / "large.ply", "");
  // a sparse file, which takes no room on the disk
  std::filesystem::resize_file(directory / "large.ply", (uint64_t{1} << 36) + 1);
  check(directory / "large.ply", FS_ERROR_IO, "has 68719476737 bytes, must have at most 68719476736");
  check(directory.path + "/" + std::string(300, 'a') + ".ply", FS_ERROR_IO, "too long");
  if (geteuid() != 0) {  // root may read everything
    chmod((directory / "a.ply").c_str(), 0);
    check(directory / "a.ply", FS_ERROR_IO, "Permission denied");
  }
}
END_TEST

START_TEST(a_file_is_replaced_as_a_whole_or_not_at_all)
{
  const scenes::Folder directory;
  const std::string path = directory / "a.ply";
  write_text(path, "old");
  chmod(path.c_str(), 0640);

  // A disk that is full: writing past the limit gives EFBIG once the signal is ignored.
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit unlimited;
  getrlimit(RLIMIT_FSIZE, &unlimited);
  rlimit small = unlimited;
  small.rlim_cur = 1000;
  setrlimit(RLIMIT_FSIZE, &small);
  const Outcome full = attempt([&] { return write_file_atomically(path, std::string(5000, 'x')), MeshData(); });
  setrlimit(RLIMIT_FSIZE, &unlimited);
  ck_assert_int_eq(full.status, FS_ERROR_IO);
  ck_assert_msg(full.text.find("File too large") != full.text.npos && full.text.find(path) == 0, "%s",
                full.text.c_str());
  ck_assert(read_whole_file(path) == "old");
  ck_assert_uint_eq(directory.files(), 1);

  const MeshData mesh = awkward_mesh();
  write_ply(path, mesh.points, mesh.triangles);
  check_equal(read_mesh_file(path, 1), mesh);
  ck_assert_uint_eq(directory.files(), 1);
  struct stat status;
  ck_assert_int_eq(stat(path.c_str(), &status), 0);
  ck_assert_uint_eq(status.st_mode & 0777, 0640);

  const auto refuse = [](const std::string& target, const char* word) {
    const Outcome out = attempt([&] { return write_file_atomically(target, "new"), MeshData(); });
    ck_assert_msg(out.status == FS_ERROR_IO && out.text.find(word) != out.text.npos, "%d %s", out.status,
                  out.text.c_str());
  };
  refuse(directory / "none/a.ply", "No such file");
  refuse(directory.path, "a directory");
  refuse(directory.path + "/", "a directory");
  refuse("", "No such file");
  std::filesystem::create_symlink("/dev/null", directory / "null");
  refuse(directory / "null", "a device");
  ck_assert(std::filesystem::is_character_file("/dev/null"));
  ck_assert_uint_eq(directory.files(), 2);
  if (geteuid() != 0) {
    chmod(directory.path.c_str(), 0500);
    refuse(path, "Permission denied");
    chmod(directory.path.c_str(), 0700);
    check_equal(read_mesh_file(path, 1), mesh);
  }
}
END_TEST

int main()
{
  Suite* suite = suite_create("mesh_file");
  TCase* tests = tcase_create("mesh_file");
  tcase_set_timeout(tests, 500);
  tcase_add_test(tests, doubles_and_all_triangles_are_kept);
  tcase_add_test(tests, binary_stl_is_known_by_its_size);
  tcase_add_test(tests, stl_corners_are_welded_only_where_equal);
  tcase_add_test(tests, ply_of_any_types_and_byte_order);
  tcase_add_test(tests, obj_has_many_forms);
  tcase_add_test(tests, off_has_many_headers);
  tcase_add_test(tests, numbers_do_not_depend_on_the_locale);
  tcase_add_test(tests, hostile_files_are_refused_with_their_reason);
  tcase_add_test(tests, damaged_files_never_crash);
  tcase_add_test(tests, large_headers_are_read_in_reasonable_time);
  tcase_add_test(tests, a_file_is_read_by_its_ending_and_scaled);
  tcase_add_test(tests, files_that_are_none);
  tcase_add_test(tests, a_file_is_replaced_as_a_whole_or_not_at_all);
  suite_add_tcase(suite, tests);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed == 0 ? 0 : 1;
}
