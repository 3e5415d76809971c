// PLY: ASCII and binary of either byte order. The element "vertex" has x y z, the element "face" the list
// vertex_indices (or vertex_index) of any integer types; all other properties and elements are skipped.
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/text.h"
#include "base/whole_file.h"
#include "file/binary.h"
#include "file/mesh_formats.h"
#include "file/mesh_text.h"
#include "file/polygon.h"

namespace fs {
namespace {

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
constexpr size_t type_sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};  // bytes
constexpr const char* type_names[][2] = {{"char", "int8"}, {"uchar", "uint8"}, {"short", "int16"},   {"ushort", "uint16"},
                                         {"int", "int32"}, {"uint", "uint32"}, {"float", "float32"}, {"double", "float64"}};

enum class Role { none, x, y, z, corners };
constexpr const char* role_names[] = {"nothing", "x", "y", "z", "vertex_indices"};

size_t size_of(Type type) { return type_sizes[static_cast<size_t>(type)]; }
bool is_integer(Type type) { return type < Type::float32; }

struct Property {
  Type type;                       // of the value, or of the list's values
  std::optional<Type> count_type;  // of a list
  Role role;
};

struct Element {
  std::string name;
  uint64_t count;
  std::vector<Property> properties;

  bool has(Role role) const {
    for (const Property& property : properties) {
      if (property.role == role) return true;
    }
    return false;
  }
};

enum class PlyFormat { ascii, little, big };

struct Header {
  PlyFormat format = PlyFormat::ascii;
  std::vector<Element> elements;
  size_t size = 0, lines = 0;  // of the header: bytes, lines
};

// ---- header

Type parse_type(const Text& text, std::string_view word) {
  for (size_t i = 0; i < std::size(type_names); ++i) {
    if (word == type_names[i][0] || word == type_names[i][1]) return static_cast<Type>(i);
  }
  fail_at(FS_ERROR_PARSE, text.where(), "the type %s is none of PLY's (char .. double)", in_quotes(word).c_str());
}

PlyFormat parse_format(const Text& text, std::string_view word, std::string_view version) {
  if (version != "1.0") {
    fail_at(FS_ERROR_UNSUPPORTED, text.where(), "the version is %s, must be 1.0", in_quotes(version).c_str());
  }
  if (word == "ascii") return PlyFormat::ascii;
  if (word == "binary_little_endian") return PlyFormat::little;
  if (word == "binary_big_endian") return PlyFormat::big;
  fail_at(FS_ERROR_UNSUPPORTED, text.where(), "the format is %s, must be ascii, binary_little_endian or binary_big_endian",
          in_quotes(word).c_str());
}

Role role_of(const std::string& element, std::string_view property, bool is_list) {
  if (element == "vertex" && !is_list) {
    if (property == "x") return Role::x;
    if (property == "y") return Role::y;
    if (property == "z") return Role::z;
  }
  if (element == "face" && is_list && (property == "vertex_indices" || property == "vertex_index")) {
    return Role::corners;
  }
  return Role::none;
}

Property parse_property(Text& text, const Element& element) {
  Property property{};
  std::string_view type = text.word();
  if (type == "list") {
    property.count_type = parse_type(text, text.word());
    type = text.word();
  }
  property.type = parse_type(text, type);
  const std::string_view name = text.word();
  if (name.empty()) fail_at(FS_ERROR_PARSE, text.where(), "a property has no name");
  if (property.count_type && !is_integer(*property.count_type)) {
    fail_at(FS_ERROR_PARSE, text.where(), "the count of the list %s must be of an integer type", in_quotes(name).c_str());
  }
  property.role = role_of(element.name, name, property.count_type.has_value());
  if (property.role == Role::corners && !is_integer(property.type)) {
    fail_at(FS_ERROR_PARSE, text.where(), "%s must be of an integer type", in_quotes(name).c_str());
  }
  if (property.role != Role::none && element.has(property.role)) {
    fail_at(FS_ERROR_PARSE, text.where(), "%s is given twice", role_names[static_cast<size_t>(property.role)]);
  }
  return property;
}

Element parse_element(Text& text, const std::vector<Element>& before) {
  Element element{std::string(text.word()), 0, {}};
  const int64_t count = text.integer(text.word(), "the number of elements");
  if (count < 0) {
    fail_at(FS_ERROR_PARSE, text.where(), "the number of elements is %lld, must be 0 or more", static_cast<long long>(count));
  }
  element.count = static_cast<uint64_t>(count);
  if (element.name == "vertex" || element.name == "face") {  // others may repeat: comparing very many would be slow
    for (const Element& other : before) {
      if (other.name != element.name) continue;
      fail_at(FS_ERROR_PARSE, text.where(), "the element \"%s\" is given twice", element.name.c_str());
    }
  }
  if (element.name == "tristrips") {
    fail_at(FS_ERROR_UNSUPPORTED, text.where(), "triangle strips are not read; faces are");
  }
  return element;
}

// The header ends with the line "end_header". All its lines end like the first one: any other byte belongs to the data.
Header parse_header(std::string_view bytes, const std::string& file) {
  if (!bytes.starts_with("ply\n") && !bytes.starts_with("ply\r")) {
    fail_at(FS_ERROR_PARSE, file + ", line 1", "is %s, must be \"ply\"",
            in_quotes(bytes.substr(0, bytes.find_first_of("\r\n"))).c_str());
  }
  const char line_end = bytes[3] == '\r' && !bytes.starts_with("ply\r\n") ? '\r' : '\n';
  Header header;
  bool has_format = false;
  for (;;) {
    const size_t end = bytes.find(line_end, header.size);
    if (end == bytes.npos) {
      fail_at(FS_ERROR_PARSE, file + ", line " + std::to_string(header.lines + 1), "the file ends before \"end_header\"");
    }
    Text text(bytes.substr(header.size, end - header.size), file, {}, ++header.lines);
    header.size = end + 1;
    const std::string_view key = text.word();
    if (key.empty() || key == "comment" || key == "obj_info" || header.lines == 1) continue;
    if (key == "format") {
      const std::string_view format = text.word();
      header.format = parse_format(text, format, text.word());
      has_format = true;
    } else if (key == "element") {
      header.elements.push_back(parse_element(text, header.elements));
    } else if (key == "property") {
      if (header.elements.empty()) fail_at(FS_ERROR_PARSE, text.where(), "a property comes before the first element");
      header.elements.back().properties.push_back(parse_property(text, header.elements.back()));
    } else if (key != "end_header") {
      fail_at(FS_ERROR_PARSE, text.where(), "%s is not a keyword of a PLY header", in_quotes(key).c_str());
    }
    const std::string_view more = text.word_anywhere();
    if (!more.empty()) fail_at(FS_ERROR_PARSE, text.where(), "%s is one word too many", in_quotes(more).c_str());
    if (key == "end_header") break;
  }
  if (!has_format) fail_at(FS_ERROR_PARSE, file, "the header (lines 1..%zu) has no \"format\"", header.lines);
  return header;
}

// ---- data: two sources with the same functions

class AsciiSource {
 public:
  AsciiSource(std::string_view data, const std::string& file, const Header& header) : text_(data, file, {}, header.lines + 1) {}

  double number(Type, const char* what) { return text_.number(word(), what); }
  int64_t integer(Type, const char* what) { return text_.integer(word(), what); }
  void skip(Type, uint64_t count) {
    for (; count > 0; --count) word();
  }
  bool has(Type, uint64_t count) const { return count <= (text_.remaining() + 1) / 2; }  // "0 0 0"
  size_t remaining() const { return text_.remaining(); }
  std::string where() const { return text_.where(); }
  void expect_end() {
    const std::string_view more = text_.word_anywhere();
    if (!more.empty()) fail_at(FS_ERROR_PARSE, where(), "%s follows the last element", in_quotes(more).c_str());
  }
  static size_t least_size(const Element& element) { return 2 * element.properties.size(); }

 private:
  std::string_view word() {
    const std::string_view found = text_.word_anywhere();
    if (found.empty()) fail_at(FS_ERROR_PARSE, where(), "the file ends before its last element");
    return found;
  }

  Text text_;
};

template <std::endian order>
class BinarySource {
 public:
  BinarySource(std::string_view data, const std::string& file, const Header& header)
      : data_(data), file_(file), start_(header.size) {}

  double number(Type type, const char* what) {
    const double value = take(type);
    if (!std::isfinite(value)) fail_at(FS_ERROR_PARSE, where(), "%s is %.9g, must be finite", what, value);
    return value;
  }
  int64_t integer(Type type, const char*) { return static_cast<int64_t>(take(type)); }  // 32 bits at most: exact
  void skip(Type type, uint64_t count) { take_bytes(type, count); }
  bool has(Type type, uint64_t count) const { return count <= remaining() / size_of(type); }
  size_t remaining() const { return data_.size() - position_; }
  std::string where() const { return file_ + ", byte " + std::to_string(start_ + last_); }
  void expect_end() {
    last_ = position_;
    if (remaining() > 0) fail_at(FS_ERROR_PARSE, where(), "%zu bytes follow the last element", remaining());
  }
  static size_t least_size(const Element& element) {
    size_t size = 0;
    for (const Property& property : element.properties) size += size_of(property.count_type.value_or(property.type));
    return size;
  }

 private:
  const char* take_bytes(Type type, uint64_t count) {
    last_ = position_;
    if (!has(type, count)) fail_at(FS_ERROR_PARSE, where(), "the file ends before its last element");
    position_ += count * size_of(type);
    return data_.data() + last_;
  }
  double take(Type type) {
    const char* at = take_bytes(type, 1);
    switch (type) {
      case Type::int8: return load<int8_t, order>(at);
      case Type::uint8: return load<uint8_t, order>(at);
      case Type::int16: return load<int16_t, order>(at);
      case Type::uint16: return load<uint16_t, order>(at);
      case Type::int32: return load<int32_t, order>(at);
      case Type::uint32: return load<uint32_t, order>(at);
      case Type::float32: return load<float, order>(at);
      case Type::float64: break;
    }
    return load<double, order>(at);
  }

  std::string_view data_;
  const std::string& file_;
  size_t start_;                    // of data_ in the file
  size_t position_ = 0, last_ = 0;  // in data_: the next value, and the one taken last
};

template <class Source>
void read_corners(Source& source, const Property& property, uint64_t count, uint64_t points, Faces& faces) {
  if (count < 3) {
    fail_at(FS_ERROR_PARSE, source.where(), "a face has %llu corners, must have 3 or more",
            static_cast<unsigned long long>(count));
  }
  for (uint64_t i = 0; i < count; ++i) {
    const int64_t index = source.integer(property.type, "the vertex of a corner");
    if (index < 0 || static_cast<uint64_t>(index) >= points) {
      fail_at(FS_ERROR_PARSE, source.where(), "the vertex of a corner is %lld, must be 0..%lld", static_cast<long long>(index),
              static_cast<long long>(points) - 1);
    }
    faces.add(static_cast<uint32_t>(index));
  }
  faces.end_face();
}

template <class Source>
void read_element(Source& source, const Element& element, uint64_t points, MeshData& mesh, Faces& faces) {
  if (element.properties.empty()) return;
  Vec3 point{};
  for (uint64_t i = 0; i < element.count; ++i) {
    for (const Property& property : element.properties) {
      if (property.count_type) {
        const int64_t count = source.integer(*property.count_type, "the count of a list");
        if (count < 0 || !source.has(property.type, static_cast<uint64_t>(count))) {
          fail_at(FS_ERROR_PARSE, source.where(), "the count of a list is %lld, the %zu bytes that follow do not hold it",
                  static_cast<long long>(count), source.remaining());
        }
        if (property.role == Role::corners) {
          read_corners(source, property, static_cast<uint64_t>(count), points, faces);
        } else {
          source.skip(property.type, static_cast<uint64_t>(count));
        }
        continue;
      }
      switch (property.role) {
        case Role::x: point.x = source.number(property.type, "x"); break;
        case Role::y: point.y = source.number(property.type, "y"); break;
        case Role::z: point.z = source.number(property.type, "z"); break;
        default: source.skip(property.type, 1);
      }
    }
    if (element.name == "vertex") mesh.points.push_back(point);
  }
}

template <class Source>
MeshData read_elements(Source source, const Header& header, const std::string& file) {
  uint64_t points = 0, faces = 0, left = source.remaining() + 1;  // + 1: the last text line may lack its end
  for (const Element& element : header.elements) {
    const size_t least = Source::least_size(element);
    if (least > 0 && element.count > left / least) {
      fail_at(FS_ERROR_PARSE, file, "the header declares %llu of %s, the %zu bytes after it do not hold them",
              static_cast<unsigned long long>(element.count), in_quotes(element.name).c_str(), source.remaining());
    }
    left -= element.count * least;
    if (element.name == "vertex") points = element.count;
    if (element.name == "face") faces = element.count;
    if (element.name == "vertex" && !(element.has(Role::x) && element.has(Role::y) && element.has(Role::z))) {
      fail_at(FS_ERROR_PARSE, file, "the header declares a vertex with no x, y or z");
    }
    if (element.name == "face" && !element.has(Role::corners)) {
      fail_at(FS_ERROR_PARSE, file, "the header declares a face with no list vertex_indices");
    }
  }
  if (points == 0) fail_at(FS_ERROR_PARSE, file, "the header declares no vertex, must declare 1 or more");
  if (points > max_points) fail_at(FS_ERROR_UNSUPPORTED, file, "the header declares 2^32 vertices or more");
  if (faces == 0) fail_at(FS_ERROR_PARSE, file, "the header declares no face, must declare 1 or more");

  MeshData mesh;
  mesh.points.reserve(points);
  mesh.triangles.reserve(3 * std::min<uint64_t>(faces, source.remaining() / 4));  // a face has at least 4 bytes
  Faces cutter(mesh.triangles);
  for (const Element& element : header.elements) read_element(source, element, points, mesh, cutter);
  source.expect_end();
  cutter.cut(mesh.points, file);
  return mesh;
}

}  // namespace

MeshData parse_ply(std::string_view bytes, const std::string& file) {
  const Header header = parse_header(bytes, file);
  const std::string_view data = bytes.substr(header.size);
  switch (header.format) {
    case PlyFormat::ascii: return read_elements(AsciiSource(data, file, header), header, file);
    case PlyFormat::little: return read_elements(BinarySource<std::endian::little>(data, file, header), header, file);
    case PlyFormat::big: break;
  }
  return read_elements(BinarySource<std::endian::big>(data, file, header), header, file);
}

std::string format_ply(const std::vector<Vec3>& points, const std::vector<uint32_t>& triangles) {
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                    "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                    std::to_string(triangles.size() / 3) + "\nproperty list uchar uint vertex_indices\nend_header\n";
  out.reserve(out.size() + 24 * points.size() + 13 * (triangles.size() / 3));
  for (const Vec3& point : points) {
    store(out, point.x);
    store(out, point.y);
    store(out, point.z);
  }
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    store(out, uint8_t{3});
    for (size_t k = 0; k < 3; ++k) store(out, triangles[i + k]);
  }
  return out;
}

}  // namespace fs
