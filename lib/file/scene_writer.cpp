// A scene to JSON. Keys are in a fixed order; a value with the same bits as its default is left out.
#include <bit>
#include <cmath>
#include <cstring>
#include <map>

#include <unistd.h>

#include "base/error.h"
#include "base/hash.h"
#include "base/whole_file.h"
#include "file/json.h"
#include "file/mesh_file.h"
#include "file/mesh_formats.h"
#include "file/scene_file.h"
#include "file/scene_words.h"
#include "math/pose.h"

namespace fs {
namespace {

// ---- values

bool has_same_bits(double a, double b) { return std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b); }
bool has_same_bits(Vec3 a, Vec3 b) { return std::memcmp(&a, &b, sizeof a) == 0; }
bool has_same_bits(Quat a, Quat b) { return std::memcmp(&a, &b, sizeof a) == 0; }

Json to_json(double value) {
  if (std::isnan(value)) return Json("nan");
  if (std::isinf(value)) return Json(value > 0 ? "inf" : "-inf");
  return Json(value);
}
Json to_json(Vec3 v) { return Json::List{to_json(v.x), to_json(v.y), to_json(v.z)}; }
Json to_json(Quat q) { return Json::List{to_json(q.w), to_json(q.x), to_json(q.y), to_json(q.z)}; }

void add(Json::Object& out, std::string key, Json value) { out.push_back({std::move(key), std::move(value)}); }

// Adds the value unless it is the default.
template <class Value>
void put(Json::Object& out, const char* key, const Value& value, const Value& unless) {
  if (!has_same_bits(value, unless)) add(out, key, to_json(value));
}
void put(Json::Object& out, const char* key, double value) { put(out, key, value, 0.0); }
void put(Json::Object& out, const char* key, Json::Object value) {
  if (!value.empty()) add(out, key, std::move(value));
}

template <size_t count>
const char* word_of(const std::array<Word, count>& words, int value, const char* field) {
  if (value < 0 || static_cast<size_t>(value) >= count) {
    fail(FS_ERROR_INVALID, "%s is %d, must be 0..%zu", field, value, count - 1);
  }
  return words[static_cast<size_t>(value)].text;
}

Json::Object to_json(const Pose& pose) {
  Json::Object out;
  put(out, "position", pose.position, Vec3{0, 0, 0});
  put(out, "orientation", pose.orientation, identity_quat());
  return out;
}

Json::Object to_json(const Twist& twist) {
  Json::Object out;
  put(out, "linear", twist.linear, Vec3{0, 0, 0});
  put(out, "angular", twist.angular, Vec3{0, 0, 0});
  return out;
}

Json::Object to_json(const fs_contact& contact) {
  Json::Object out;
  if (contact.keep != FS_KEEP_NONE) add(out, "keep", Json(word_of(keep_words, contact.keep, "contact.keep")));
  put(out, "stiffness", contact.stiffness);
  put(out, "limit", contact.limit);
  put(out, "damping", contact.damping);
  put(out, "friction", contact.friction);
  return out;
}

Json::Object to_json(const fs_frame& frame) {
  Json::Object out;
  put(out, "pose", to_json(frame.pose));
  add(out, "scale", to_json(frame.scale));
  add(out, "force_scale", to_json(frame.force_scale));
  return out;
}

Json::Object to_json(const Curve& curve) {
  Json::Object out;
  if (const std::string* text = curve.expression()) {
    add(out, "expression", Json(*text));
    return out;
  }
  add(out, "step", to_json(curve.step()));
  Json::List table;
  for (const double force : *curve.table()) table.push_back(to_json(force));
  add(out, "table", std::move(table));
  return out;
}

Json::Object to_json(const Texture& texture, const fs_surface_settings& of) {
  Json::Object out;
  if (of.axis != FS_AXIS_Z) add(out, "axis", Json(word_of(axis_words, of.axis, "axis")));
  if (of.repeats) add(out, "repeats", Json(true));
  put(out, "column_width", of.column_width);
  put(out, "row_width", of.row_width);
  put(out, "first_column", of.first_column);
  put(out, "first_row", of.first_row);
  Json::List rows;
  for (auto row = texture.heights().begin(); row != texture.heights().end(); row += of.columns) {
    Json::List line;
    for (auto height = row; height != row + of.columns; ++height) line.push_back(to_json(*height));
    rows.push_back(std::move(line));
  }
  add(out, "heights", std::move(rows));
  return out;
}

Json::Object to_json(const Surface& surface) {
  Json::Object out;
  put(out, "static_friction", surface.settings.static_friction);
  put(out, "dynamic_friction", surface.settings.dynamic_friction);
  put(out, "slip_distance", surface.settings.slip_distance);
  if (surface.settings.impact_gain > 0) {
    Json::Object impact;
    put(impact, "gain", surface.settings.impact_gain);
    put(impact, "frequency", surface.settings.impact_frequency);
    put(impact, "decay", surface.settings.impact_decay);
    add(out, "impact", std::move(impact));
  }
  if (surface.texture) add(out, "texture", to_json(*surface.texture, surface.settings));
  return out;
}

Json::Object polyline_to_json(const Shape& shape) {  // a mesh is in its own file
  Json::Object out;
  if (shape.closed) add(out, "closed", Json(true));
  Json::List points;
  for (const Vec3& point : shape.points) points.push_back(to_json(point));
  add(out, "points", std::move(points));
  return out;
}

// ---- files of meshes

// Writes the meshes beside a scene file. Each is named after its content, so no mesh of the old scene file is ever
// replaced: the old scene file stays complete until the new one is there. Meshes that the new one no longer uses stay,
// because another scene file (a copy) may use them.
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
  ~MeshWriter() {  // without keep(), removes the files that it wrote
    for (const std::string& path : written_) ::unlink(path.c_str());
  }
  void keep() { written_.clear(); }

  std::string write(const Shape& shape) {  // returns the file's name, relative to the scene file
    const std::string content = format_ply(shape.points, shape.triangles);
    char hash[17];
    std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(hash_of(content)));
    for (unsigned i = 0;; ++i) {  // skips a damaged file, or other content with the same hash
      const std::string name = stem_ + "-" + hash + (i == 0 ? "" : "-" + std::to_string(i)) + ".ply";
      const std::string path = directory_ + name;
      if (::access(path.c_str(), F_OK) != 0) {
        written_.push_back(path);  // noted first, so that a failure leaves no unnoted file
        write_file_atomically(path, content);
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
  SceneWriter(MeshWriter& meshes, double time) : meshes_(meshes), time_(time) {}

  Json write(const SceneDescription& scene) {
    Json::Object out;
    add(out, "forceserver", Json("scene"));
    add(out, "version", Json(Json::Number{scene_version, true}));
    add(out, "frame", to_json(scene.frame));
    Json::List tool, objects;
    for (const Vec3& point : scene.tool) tool.push_back(to_json(point));
    for (const fs_object& object : scene.objects) objects.push_back(write(object));
    add(out, "tool", std::move(tool));
    put(out, "tool_radius", scene.tool_radius);
    put(out, "shapes", std::move(shapes_));
    put(out, "curves", std::move(curves_));
    put(out, "surfaces", std::move(surfaces_));
    add(out, "objects", std::move(objects));
    return out;
  }

 private:
  Json write(const fs_object& object) {
    const std::string name(object.name, strnlen(object.name, sizeof object.name));
    Json::Object out;
    add(out, "name", Json(name));
    add(out, "primitive", Json(word_of(primitive_words, object.primitive, "primitive")));
    if (object.shape) add(out, "shape", Json(shape_key(*object.shape, name)));
    if (!object.enabled) add(out, "enabled", Json(false));
    put(out, "pose", to_json(object.pose));
    put(out, "twist", to_json(object.twist));
    if (object.time != 0) add(out, "pose_age", to_json(time_ - object.time));
    put(out, "front", write(object.front, name + ".front"));
    put(out, "back", write(object.back, name + ".back"));
    put(out, "damping", object.damping);
    put(out, "contact", to_json(object.contact));
    if (object.surface) add(out, "surface", Json(surface_key(*object.surface, name)));
    if (object.start != 0) add(out, "age", to_json(time_ - object.start));
    put(out, "lifetime", object.lifetime);
    if (object.tool_points != 0) {
      add(out, "tool_points", Json(Json::Number{static_cast<double>(object.tool_points), true}));
    }
    return out;
  }

  Json::Object write(const fs_profile& profile, const std::string& place) {
    Json::Object out;
    if (profile.kind != FS_PROFILE_NONE) add(out, "kind", Json(word_of(kind_words, profile.kind, "kind")));
    if (profile.kind != FS_PROFILE_NONE || profile.sense != FS_SENSE_ATTRACTIVE) {
      add(out, "sense", Json(word_of(sense_words, profile.sense, "sense")));
    }
    put(out, "gain", profile.gain);
    put(out, "offset", profile.offset);
    put(out, "width", profile.width);
    put(out, "limit", profile.limit);
    put(out, "reach", profile.reach);
    if (profile.curve) add(out, "curve", Json(curve_key(*profile.curve, place)));
    return out;
  }

  // Shapes, curves and surfaces are named after the first object that uses them.
  std::string shape_key(const Shape& shape, const std::string& name) {
    const auto [entry, is_new] = shape_keys_.try_emplace(&shape, name);
    if (is_new && shape.primitive == FS_PRIMITIVE_MESH) {
      Json::Object mesh;
      add(mesh, "file", Json(meshes_.write(shape)));
      add(shapes_, name, std::move(mesh));
    } else if (is_new) {
      add(shapes_, name, polyline_to_json(shape));
    }
    return entry->second;
  }
  std::string curve_key(const Curve& curve, const std::string& place) {
    const auto [entry, is_new] = curve_keys_.try_emplace(&curve, place);
    if (is_new) add(curves_, place, to_json(curve));
    return entry->second;
  }
  std::string surface_key(const Surface& surface, const std::string& name) {
    const auto [entry, is_new] = surface_keys_.try_emplace(&surface, name);
    if (is_new) add(surfaces_, name, to_json(surface));
    return entry->second;
  }

  MeshWriter& meshes_;
  const double time_;
  Json::Object shapes_, curves_, surfaces_;
  std::map<const Shape*, std::string> shape_keys_;
  std::map<const Curve*, std::string> curve_keys_;
  std::map<const Surface*, std::string> surface_keys_;
};

}  // namespace

void write_scene_file(const std::string& path, const SceneDescription& scene, double time) {
  MeshWriter meshes(path);
  const std::string text = to_lines(SceneWriter(meshes, time).write(scene)) + "\n";
  if (!is_utf8(text)) fail_at(FS_ERROR_INVALID, path, "a name in it, or its own, is not UTF-8: JSON cannot hold it");
  write_file_atomically(path, text);
  meshes.keep();
}

}  // namespace fs
