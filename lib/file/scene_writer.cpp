// A scene to JSON. Keys stand in a fixed order; what has its default is left out, compared bit by bit.
#include <bit>
#include <cmath>
#include <cstring>
#include <map>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/error.h"
#include "base/whole_file.h"
#include "file/mesh_file.h"
#include "file/mesh_formats.h"
#include "file/scene_file.h"
#include "file/scene_words.h"
#include "math/pose.h"

namespace fs {
namespace {

using Json = nlohmann::ordered_json;

// ---- text: what fits on a line stands on one line

constexpr size_t line_width = 110;  // columns

void print_on_one_line(std::string& out, const Json& value) {
  if (!value.is_structured()) {
    out += value.dump();
    return;
  }
  out += value.is_array() ? '[' : '{';
  const char* separator = "";
  for (const auto& [key, child] : value.items()) {
    out += separator;
    if (value.is_object()) out += Json(key).dump() + ": ";
    print_on_one_line(out, child);
    separator = ", ";
  }
  out += value.is_array() ? ']' : '}';
}

bool is_list_of_scalars(const Json& value) {
  return value.is_array() && !value.empty() && !value.front().is_structured();
}

// Appends value; its first line begins at `column`, its further ones at `indent`.
void print(std::string& out, const Json& value, size_t indent, size_t column) {
  std::string line;
  print_on_one_line(line, value);
  if (!value.is_structured() || column + line.size() <= line_width) {
    out += line;
    return;
  }
  const std::string margin(indent + 2, ' ');
  out += value.is_array() ? "[" : "{";
  size_t used = line_width;  // of the present line
  const char* separator = "";
  for (const auto& [key, child] : value.items()) {
    out += separator;
    if (is_list_of_scalars(value)) {  // as many as fit
      const std::string text = child.dump();
      if (used + text.size() + 3 > line_width) {
        out += "\n" + margin;
        used = margin.size();
      } else {
        out += ' ';
        ++used;
      }
      out += text;
      used += text.size() + 1;
    } else {
      const std::string head = margin + (value.is_object() ? Json(key).dump() + ": " : "");
      out += "\n" + head;
      print(out, child, indent + 2, head.size());
    }
    separator = ",";
  }
  out += "\n" + std::string(indent, ' ') + (value.is_array() ? "]" : "}");
}

// ---- values

bool has_same_bits(double a, double b) { return std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b); }
bool has_same_bits(Vec3 a, Vec3 b) { return std::memcmp(&a, &b, sizeof a) == 0; }
bool has_same_bits(Quat a, Quat b) { return std::memcmp(&a, &b, sizeof a) == 0; }

Json to_json(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return value;
}
Json to_json(Vec3 v) { return Json::array({to_json(v.x), to_json(v.y), to_json(v.z)}); }
Json to_json(Quat q) { return Json::array({to_json(q.w), to_json(q.x), to_json(q.y), to_json(q.z)}); }

template <class Value>
void put(Json& out, const char* key, const Value& value, const Value& unless) {
  if (!has_same_bits(value, unless)) out[key] = to_json(value);
}
void put(Json& out, const char* key, double value) { put(out, key, value, 0.0); }
void put(Json& out, const char* key, Json value) {
  if (!value.empty()) out[key] = std::move(value);
}

template <size_t count>
const char* word_of(const char* const (&words)[count], int value, const char* field) {
  if (value < 0 || static_cast<size_t>(value) >= count) {
    fail(FS_ERROR_INVALID, "%s is %d, must be 0..%zu", field, value, count - 1);
  }
  return words[value];
}

Json to_json(const Pose& pose) {
  Json out = Json::object();
  put(out, "position", pose.position, Vec3{0, 0, 0});
  put(out, "orientation", pose.orientation, identity_quat());
  return out;
}

Json to_json(const Twist& twist) {
  Json out = Json::object();
  put(out, "linear", twist.linear, Vec3{0, 0, 0});
  put(out, "angular", twist.angular, Vec3{0, 0, 0});
  return out;
}

Json to_json(const fs_contact& contact) {
  Json out = Json::object();
  if (contact.keep != FS_KEEP_NONE) out["keep"] = word_of(keep_words, contact.keep, "contact.keep");
  put(out, "stiffness", contact.stiffness);
  put(out, "limit", contact.limit);
  put(out, "damping", contact.damping);
  put(out, "friction", contact.friction);
  return out;
}

Json to_json(const fs_frame& frame) {
  Json out = Json::object();
  put(out, "pose", to_json(frame.pose));
  out["scale"] = to_json(frame.scale);
  out["force_scale"] = to_json(frame.force_scale);
  return out;
}

Json to_json(const Curve& curve) {
  Json out = Json::object();
  if (const std::string* text = curve.expression()) {
    out["expression"] = *text;
    return out;
  }
  out["step"] = to_json(curve.step());
  Json& table = out["table"] = Json::array();
  for (const double force : *curve.table()) table.push_back(to_json(force));
  return out;
}

Json polyline_to_json(const Shape& shape) {  // a mesh has its file
  Json out = Json::object();
  if (shape.closed) out["closed"] = true;
  Json& points = out["points"] = Json::array();
  for (const Vec3& point : shape.points) points.push_back(to_json(point));
  return out;
}

// ---- files of meshes

uint64_t fnv1a(std::string_view bytes) {  // FNV-1a, 64 bits
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

// Writes the meshes beside a scene file. Each is named after its content, so a mesh of the old scene file is never
// replaced: until the new scene file is there, the old one is whole. Meshes that the new one no longer refers to are
// left, as another scene file (a copy) may refer to them.
class MeshWriter {
 public:
  explicit MeshWriter(const std::string& scene_path) {
    const size_t name = scene_path.rfind('/') + 1;  // 0 where there is no '/'
    directory_ = scene_path.substr(0, name);
    stem_ = scene_path.substr(name);
    if (stem_.ends_with(".json")) stem_.resize(stem_.size() - 5);
  }
  MeshWriter(const MeshWriter&) = delete;
  MeshWriter& operator=(const MeshWriter&) = delete;
  ~MeshWriter() {  // not kept: takes back what it wrote
    for (const std::string& path : written_) ::unlink(path.c_str());
  }
  void keep() { written_.clear(); }

  std::string write(const Shape& shape) {  // returns the file's name, relative to the scene file
    const std::string content = format_ply(shape.points, shape.triangles);
    char hash[17];
    std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(fnv1a(content)));
    for (unsigned i = 0;; ++i) {  // past a damaged file of this name, or another content of this hash
      const std::string name = stem_ + "-" + hash + (i == 0 ? "" : "-" + std::to_string(i)) + ".ply";
      const std::string path = directory_ + name;
      if (::access(path.c_str(), F_OK) != 0) {
        write_file_atomically(path, content);
        written_.push_back(path);
        return name;
      }
      if (holds(path, content)) return name;
    }
  }

 private:
  static bool holds(const std::string& path, const std::string& content) {
    try {
      return read_whole_file(path) == content;
    } catch (const Error&) {
      return false;
    }
  }

  std::string directory_, stem_;
  std::vector<std::string> written_;
};

// ---- the scene

class SceneWriter {
 public:
  explicit SceneWriter(MeshWriter& meshes) : meshes_(meshes) {}

  Json write(const SceneDescription& scene) {
    Json out = {{"forceserver", "scene"}, {"version", scene_version}, {"frame", to_json(scene.frame)}};
    Json& tool = out["tool"] = Json::array();
    for (const Vec3& point : scene.tool) tool.push_back(to_json(point));
    Json objects = Json::array();
    for (const fs_object& object : scene.objects) objects.push_back(write(object));
    put(out, "shapes", std::move(shapes_));
    put(out, "curves", std::move(curves_));
    out["objects"] = std::move(objects);
    return out;
  }

 private:
  Json write(const fs_object& object) {
    const std::string name(object.name, strnlen(object.name, sizeof object.name));
    Json out = {{"name", name}, {"primitive", word_of(primitive_words, object.primitive, "primitive")}};
    if (object.shape) out["shape"] = shape_key(*object.shape, name);
    if (!object.enabled) out["enabled"] = false;
    put(out, "pose", to_json(object.pose));
    put(out, "twist", to_json(object.twist));
    put(out, "front", write(object.front, name + ".front"));
    put(out, "back", write(object.back, name + ".back"));
    put(out, "damping", object.damping);
    put(out, "contact", to_json(object.contact));
    put(out, "start", object.start);
    put(out, "lifetime", object.lifetime);
    if (object.tool_points != 0) out["tool_points"] = object.tool_points;
    return out;
  }

  Json write(const fs_profile& profile, const std::string& place) {
    Json out = Json::object();
    if (profile.kind != FS_PROFILE_NONE) {
      out["kind"] = word_of(kind_words, profile.kind, "kind");
      out["sense"] = word_of(sense_words, profile.sense, "sense");
    } else if (profile.sense != FS_SENSE_ATTRACTIVE) {
      out["sense"] = word_of(sense_words, profile.sense, "sense");
    }
    put(out, "gain", profile.gain);
    put(out, "offset", profile.offset);
    put(out, "width", profile.width);
    put(out, "limit", profile.limit);
    put(out, "reach", profile.reach);
    if (profile.curve) out["curve"] = curve_key(*profile.curve, place);
    return out;
  }

  // Shapes and curves are named after the object that is the first to use them.
  std::string shape_key(const Shape& shape, const std::string& name) {
    const auto [entry, is_new] = shape_keys_.try_emplace(&shape, name);
    if (is_new && shape.primitive == FS_PRIMITIVE_MESH) shapes_[name]["file"] = meshes_.write(shape);
    if (is_new && shape.primitive != FS_PRIMITIVE_MESH) shapes_[name] = polyline_to_json(shape);
    return entry->second;
  }
  std::string curve_key(const Curve& curve, const std::string& place) {
    const auto [entry, is_new] = curve_keys_.try_emplace(&curve, place);
    if (is_new) curves_[place] = to_json(curve);
    return entry->second;
  }

  MeshWriter& meshes_;
  Json shapes_ = Json::object(), curves_ = Json::object();
  std::map<const Shape*, std::string> shape_keys_;
  std::map<const Curve*, std::string> curve_keys_;
};

}  // namespace

void write_scene_file(const std::string& path, const SceneDescription& scene) {
  MeshWriter meshes(path);
  std::string text;
  try {
    print(text, SceneWriter(meshes).write(scene), 0, line_width);  // the outermost braces stand alone
  } catch (const Json::type_error&) {  // nlohmann-json refuses to print it
    fail_at(FS_ERROR_INVALID, path, "a name in it, or its own, is not UTF-8: JSON cannot hold it");
  }
  write_file_atomically(path, text + "\n");
  meshes.keep();
}

}  // namespace fs
