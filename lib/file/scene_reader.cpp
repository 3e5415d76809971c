// JSON to a scene. Strict: an unknown or repeated key is an error, so that a misspelt key never leaves a default force.
#include "file/scene_reader.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "base/whole_file.h"
#include "field/object.h"
#include "file/json.h"
#include "file/mesh_file.h"
#include "file/scene_words.h"
#include "math/pose.h"

namespace fs {
namespace {

// ---- values. `where` names the file and the part of it: "a.json, object 'wall', front"

[[noreturn]] void fail_value(const Json& value, const std::string& where, const std::string& key, const char* must) {
  fail_at(FS_ERROR_PARSE, where, "%s is %s, must be %s", in_quotes(key).c_str(), printable(to_line(value)).c_str(), must);
}

double parse_number(const Json& value, const std::string& where, const std::string& key) {
  if (const Json::Number* const number = value.number()) return number->value;
  const std::string word = value.text() ? *value.text() : "";
  if (word == "inf") return std::numeric_limits<double>::infinity();
  if (word == "-inf") return -std::numeric_limits<double>::infinity();
  if (word == "nan") return std::numeric_limits<double>::quiet_NaN();
  fail_value(value, where, key, "a number (or the string inf, -inf or nan)");
}

std::string entry_of(const std::string& key, size_t i) { return key + "[" + std::to_string(i) + "]"; }

// Entry i of the list at `key`, which is named where it is no number.
double parse_entry(const Json::List& list, size_t i, const std::string& where, const std::string& key) {
  if (const Json::Number* const number = list[i].number()) return number->value;
  return parse_number(list[i], where, entry_of(key, i));
}

Vec3 parse_vec3(const Json& value, const std::string& where, const std::string& key) {
  const Json::List* const v = value.list();
  if (!v || v->size() != 3) fail_value(value, where, key, "a list of three numbers, [x, y, z]");
  return {parse_entry(*v, 0, where, key), parse_entry(*v, 1, where, key), parse_entry(*v, 2, where, key)};
}

Quat parse_quat(const Json& value, const std::string& where, const std::string& key) {
  const Json::List* const q = value.list();
  if (!q || q->size() != 4) fail_value(value, where, key, "a list of four numbers, [w, x, y, z]");
  return {parse_entry(*q, 0, where, key), parse_entry(*q, 1, where, key), parse_entry(*q, 2, where, key),
          parse_entry(*q, 3, where, key)};
}

std::vector<Vec3> parse_points(const Json& value, const std::string& where, const std::string& key) {
  if (!value.list()) fail_value(value, where, key, "a list of points, [[x, y, z], ...]");
  std::vector<Vec3> points;
  points.reserve(value.list()->size());
  for (size_t i = 0; i < value.list()->size(); ++i) points.push_back(parse_vec3((*value.list())[i], where, entry_of(key, i)));
  return points;
}

// A JSON object whose keys are read one by one; finish() refuses the keys that were never asked for.
class Fields {
 public:
  Fields(const Json& value, std::string where, const char* name) : value_(value), where_(std::move(where)) {
    if (!value.object()) fail_value(value, where_, name, "an object, {...}");
  }

  const std::string& where() const { return where_; }
  void rename(std::string where) { where_ = std::move(where); }

  const Json* find(const char* key) {
    known_.insert(key);
    for (const auto& [name, value] : *value_.object()) {
      if (name == key) return &value;
    }
    return nullptr;
  }
  const Json& need(const char* key) {
    const Json* found = find(key);
    if (!found) fail_at(FS_ERROR_PARSE, where_, "\"%s\" is missing", key);
    return *found;
  }
  void finish() const {
    for (const auto& [key, value] : *value_.object()) {
      if (!known_.count(key)) fail_at(FS_ERROR_PARSE, where_, "the key %s is unknown", in_quotes(key).c_str());
    }
  }

  // Sets out if the key is present; otherwise out keeps its default.
  void read(const char* key, double& out) {
    if (const Json* value = find(key)) out = parse_number(*value, where_, key);
  }
  void read(const char* key, Vec3& out) {
    if (const Json* value = find(key)) out = parse_vec3(*value, where_, key);
  }
  void read(const char* key, Quat& out) {
    if (const Json* value = find(key)) out = parse_quat(*value, where_, key);
  }
  void read(const char* key, bool& out) {
    const Json* value = find(key);
    if (value && !value->boolean()) fail_value(*value, where_, key, "true or false");
    if (value) out = *value->boolean();
  }
  void read(const char* key, uint32_t& out) {
    const Json* value = find(key);
    if (!value) return;
    const Json::Number* const number = value->number();
    if (!number || !number->is_integer || !(number->value >= 0 && number->value <= 0xffffffff)) {
      fail_value(*value, where_, key, "an integer 0..4294967295");
    }
    out = static_cast<uint32_t>(number->value);
  }
  template <class Enum, size_t count>
  void read(const char* key, const std::array<Word, count>& words, Enum& out) {
    const Json* value = find(key);
    if (!value) return;
    const auto found =
        std::ranges::find_if(words, [&](const Word& word) { return value->text() && *value->text() == word.text; });
    if (found == words.end()) {
      std::string must = "one of";
      for (const Word& word : words) must += std::string(" \"") + word.text + "\"";
      fail_value(*value, where_, key, must.c_str());
    }
    out = static_cast<Enum>(found - words.begin());
  }
  std::string text(const char* key) {
    const Json& value = need(key);
    if (!value.text()) fail_value(value, where_, key, "a string");
    if (value.text()->find('\0') != std::string::npos) fail_value(value, where_, key, "without a NUL character");
    return *value.text();
  }

 private:
  const Json& value_;
  std::string where_;
  std::set<std::string> known_;
};

// ---- the scene

class SceneReader {
 public:
  SceneReader(const std::string& path, double time) : path_(path), time_(time) {}

  SceneDescription read(const Json& value) {
    Fields fields(value, path_, "the file");
    check_version(fields);
    if (fields.find("$schema")) fields.text("$schema");  // for editors
    scene_.frame = fs_frame_init();
    if (const Json* frame = fields.find("frame")) scene_.frame = read_frame(*frame);
    scene_.tool = {{0, 0, 0}};
    if (const Json* tool = fields.find("tool")) {
      scene_.tool = parse_points(*tool, path_, "tool");
      if (scene_.tool.empty() || scene_.tool.size() > FS_TOOL_POINTS_MAX) {
        fail_at(FS_ERROR_PARSE, path_, "\"tool\" has %zu points, must have 1..%d", scene_.tool.size(), FS_TOOL_POINTS_MAX);
      }
    }
    fields.read("tool_radius", scene_.tool_radius);
    if (const Json* shapes = fields.find("shapes")) {
      read_all(*shapes, "shapes", "shape", shapes_, [this](Fields& f) { return read_shape(f); });
    }
    if (const Json* curves = fields.find("curves")) {
      read_all(*curves, "curves", "curve", curves_, [this](Fields& f) { return read_curve(f); });
    }
    if (const Json* surfaces = fields.find("surfaces")) {
      read_all(*surfaces, "surfaces", "surface", surfaces_, [](Fields& f) { return read_surface(f); });
    }
    if (const Json* objects = fields.find("objects")) read_objects(*objects);
    fields.finish();
    for (auto& [key, shape] : shapes_) scene_.shapes.push_back(shape);
    for (auto& [key, curve] : curves_) scene_.curves.push_back(curve);
    for (auto& [key, surface] : surfaces_) scene_.surfaces.push_back(surface);
    return std::move(scene_);
  }

 private:
  void check_version(Fields& fields) const {
    if (fields.text("forceserver") != "scene") {
      fail_value(fields.need("forceserver"), path_, "forceserver", "\"scene\": this is not a scene file");
    }
    uint32_t version = 0;
    fields.need("version");
    fields.read("version", version);
    if (version > scene_version) {
      fail_at(FS_ERROR_VERSION, path_, "\"version\" is %u, this library (%d.%d.%d) knows 1..%d", version, FS_VERSION_MAJOR,
              FS_VERSION_MINOR, FS_VERSION_PATCH, scene_version);
    }
    if (version < 1) fail_at(FS_ERROR_PARSE, path_, "\"version\" is %u, must be 1..%d", version, scene_version);
  }

  fs_frame read_frame(const Json& value) const {
    Fields fields(value, path_ + ", frame", "frame");
    fs_frame frame = fs_frame_init();
    read_pose(fields, frame.pose);
    fields.read("scale", frame.scale);
    fields.read("force_scale", frame.force_scale);
    fields.finish();
    return frame;
  }

  static void read_pose(Fields& parent, Pose& out) {
    const Json* value = parent.find("pose");
    if (!value) return;
    Fields fields(*value, parent.where() + ", pose", "pose");
    fields.read("position", out.position);
    fields.read("orientation", out.orientation);
    fields.finish();
  }

  template <class Handle, class Read>
  void read_all(const Json& value, const char* key, const char* noun, std::map<std::string, Handle>& out, Read read) const {
    if (!value.object()) fail_value(value, path_, key, "an object, {\"name\": {...}, ...}");
    for (const auto& [name, item] : *value.object()) {
      Fields fields(item, path_ + ", " + noun + " " + in_quotes(name), noun);
      try {
        out[name] = read(fields);
      } catch (Error& error) {
        // The functions that make shapes, curves and surfaces report INVALID, without the file; for a file it is PARSE.
        if (error.text.rfind(fields.where(), 0) != 0) error.text = fields.where() + ": " + error.text;
        if (error.status == FS_ERROR_INVALID) error.status = FS_ERROR_PARSE;
        throw;
      }
    }
  }

  Ref<const Shape> read_shape(Fields& fields) const {
    if (fields.find("file")) {
      const std::string name = fields.text("file");
      if (name.size() >= PATH_MAX) {  // sentences quote the whole path, so it must have a bound: that of the system
        fail_at(FS_ERROR_PARSE, fields.where(), "\"file\" is %zu bytes long, must be at most %d", name.size(), PATH_MAX - 1);
      }
      if (!is_beside(name)) {
        fail_value(fields.need("file"), fields.where(), "file", "a relative path without \".\" and \"..\"");
      }
      double scale = 1;
      fields.read("scale", scale);
      fields.finish();
      MeshData mesh = read_mesh_file(path_.substr(0, path_.rfind('/') + 1) + name, scale);
      StopToken stop;
      return make_mesh(std::move(mesh.points), std::move(mesh.triangles), stop);
    }
    bool closed = false;
    fields.read("closed", closed);
    const std::vector<Vec3> points = parse_points(fields.need("points"), fields.where(), "points");
    fields.finish();
    return make_polyline(points.data(), points.size(), closed);
  }

  // A scene file from elsewhere may name only files beside it or in folders there.
  static bool is_beside(const std::string& name) {
    for (size_t begin = 0; begin <= name.size();) {
      const size_t end = std::min(name.find('/', begin), name.size());
      const std::string_view part(name.data() + begin, end - begin);
      if (part.empty() || part == "." || part == "..") return false;  // the first part of an absolute path is empty
      begin = end + 1;
    }
    return true;
  }

  Ref<const Curve> read_curve(Fields& fields) const {
    if (fields.find("expression")) {
      const std::string text = fields.text("expression");
      fields.finish();
      return make_expression_curve(text.c_str());
    }
    double step = 0;
    fields.need("step");
    fields.read("step", step);
    const Json& table = fields.need("table");
    if (!table.list()) fail_value(table, fields.where(), "table", "a list of numbers");
    std::vector<double> forces;
    forces.reserve(table.list()->size());
    for (size_t i = 0; i < table.list()->size(); ++i) forces.push_back(parse_entry(*table.list(), i, fields.where(), "table"));
    fields.finish();
    return make_table_curve(forces.data(), forces.size(), step);
  }

  static Ref<const Surface> read_surface(Fields& fields) {
    fs_surface_settings settings = fs_surface_settings_init();
    fields.read("static_friction", settings.static_friction);
    fields.read("dynamic_friction", settings.dynamic_friction);
    fields.read("slip_distance", settings.slip_distance);
    if (const Json* impact = fields.find("impact")) read_impact(*impact, fields.where(), settings);
    std::vector<double> heights;
    if (const Json* texture = fields.find("texture")) read_texture(*texture, fields.where(), settings, heights);
    fields.finish();
    return make_surface(settings, heights);
  }

  static void read_impact(const Json& value, const std::string& where, fs_surface_settings& out) {
    Fields fields(value, where + ", impact", "impact");
    fields.read("gain", out.impact_gain);
    fields.read("frequency", out.impact_frequency);
    fields.read("decay", out.impact_decay);
    fields.finish();
  }

  static void read_texture(const Json& value, const std::string& where, fs_surface_settings& out, std::vector<double>& heights) {
    Fields fields(value, where + ", texture", "texture");
    fields.read("axis", axis_words, out.axis);
    fields.read("repeats", out.repeats);
    fields.read("column_width", out.column_width);
    fields.read("row_width", out.row_width);
    fields.read("first_column", out.first_column);
    fields.read("first_row", out.first_row);
    if (fields.find("expression")) {
      const std::string expression = fields.text("expression");
      fields.read("columns", out.columns);
      fields.read("rows", out.rows);
      fields.finish();  // so a texture has no heights, too
      heights = heights_of(out, expression.c_str());
      return;
    }
    const Json& rows = fields.need("heights");
    const char* const wanted = "a list of rows of equal length, [[...], ...]";
    const auto list_of = [&](const Json& of) -> const Json::List& {
      if (!of.list() || of.list()->empty()) fail_value(of, fields.where(), "heights", wanted);
      return *of.list();
    };
    const size_t columns = list_of(list_of(rows).front()).size();
    for (const Json& row : *rows.list()) {
      if (list_of(row).size() != columns) fail_value(row, fields.where(), "heights", wanted);
      for (size_t i = 0; i < columns; ++i) heights.push_back(parse_entry(*row.list(), i, fields.where(), "heights"));
    }
    out.columns = static_cast<uint32_t>(std::min<size_t>(columns, UINT32_MAX));
    out.rows = static_cast<uint32_t>(std::min<size_t>(rows.list()->size(), UINT32_MAX));
    fields.finish();
  }

  void read_objects(const Json& value) {
    if (!value.list()) fail_value(value, path_, "objects", "a list, [{...}, ...]");
    std::set<std::string> names;
    for (size_t i = 0; i < value.list()->size(); ++i) {
      Fields fields((*value.list())[i], path_ + ", objects[" + std::to_string(i) + "]", "an object");
      const std::string name = fields.text("name");
      if (name.empty() || name.size() > longest_name) {
        fail_at(FS_ERROR_PARSE, fields.where(), "\"name\" is %zu bytes long, must be 1..%zu", name.size(), longest_name);
      }
      fields.rename(path_ + ", object '" + name + "'");
      if (!names.insert(name).second) fail_at(FS_ERROR_PARSE, fields.where(), "another object has this name too");
      scene_.objects.push_back(read_object(fields, name));
    }
  }

  // The handle that the key's value names. It is borrowed; the scene keeps it alive.
  template <class Type>
  static Type* find_handle(Fields& fields, const char* key, const char* list,
                           const std::map<std::string, Ref<const Type>>& handles) {
    if (!fields.find(key)) return nullptr;
    const auto found = handles.find(fields.text(key));
    if (found == handles.end()) {
      fail_value(fields.need(key), fields.where(), key, (std::string("a key of \"") + list + "\"").c_str());
    }
    return const_cast<Type*>(found->second.get());
  }

  fs_object read_object(Fields& fields, const std::string& name) const {
    fs_object object = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
    fields.need("primitive");
    fields.read("primitive", primitive_words, object.primitive);
    object.shape = find_handle(fields, "shape", "shapes", shapes_);
    fields.read("enabled", object.enabled);
    object.pose = identity_pose();
    read_pose(fields, object.pose);
    if (const Json* twist = fields.find("twist")) {
      Fields part(*twist, fields.where() + ", twist", "twist");
      part.read("linear", object.twist.linear);
      part.read("angular", object.twist.angular);
      part.finish();
    }
    read_age(fields, "pose_age", object.time);
    read_profile(fields, "front", object.front);
    read_profile(fields, "back", object.back);
    fields.read("damping", object.damping);
    if (const Json* contact = fields.find("contact")) {
      Fields part(*contact, fields.where() + ", contact", "contact");
      part.read("keep", keep_words, object.contact.keep);
      part.read("stiffness", object.contact.stiffness);
      part.read("limit", object.contact.limit);
      part.read("damping", object.contact.damping);
      part.read("friction", object.contact.friction);
      part.finish();
    }
    object.surface = find_handle(fields, "surface", "surfaces", surfaces_);
    fields.read("start", object.start);
    if (fields.find("age") && fields.find("start")) {
      fail_at(FS_ERROR_PARSE, fields.where(), "has both \"start\" and \"age\", must have one");
    }
    read_age(fields, "age", object.start);
    fields.read("lifetime", object.lifetime);
    fields.read("tool_points", object.tool_points);
    fields.finish();
    return object;
  }

  // out: the time that was so long ago.
  void read_age(Fields& fields, const char* key, double& out) const {
    const Json* const age = fields.find(key);
    if (!age) return;
    if (!age->number()) fail_value(*age, fields.where(), key, "a number");
    out = time_ - age->number()->value;
    if (out == 0) out = std::numeric_limits<double>::denorm_min();  // 0 would mean: not given
  }

  void read_profile(Fields& parent, const char* key, fs_profile& out) const {
    const Json* value = parent.find(key);
    if (!value) return;
    Fields fields(*value, parent.where() + ", " + key, key);
    fields.read("kind", kind_words, out.kind);
    fields.read("sense", sense_words, out.sense);
    fields.read("gain", out.gain);
    fields.read("offset", out.offset);
    fields.read("width", out.width);
    fields.read("limit", out.limit);
    fields.read("reach", out.reach);
    out.curve = find_handle(fields, "curve", "curves", curves_);
    fields.finish();
  }

  const std::string& path_;
  const double time_;
  SceneDescription scene_;
  std::map<std::string, Ref<const Shape>> shapes_;
  std::map<std::string, Ref<const Curve>> curves_;
  std::map<std::string, Ref<const Surface>> surfaces_;
};

}  // namespace

SceneDescription parse_scene(std::string_view text, const std::string& path, double time) {
  return SceneReader(path, time).read(parse_json(text, path));
}

SceneDescription read_scene_file(const std::string& path, double time) { return parse_scene(read_whole_file(path), path, time); }

}  // namespace fs
