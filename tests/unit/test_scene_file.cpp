// Scenes to JSON and back. With an argument it only writes scenes into that folder, for validate_schema.py.
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include <csignal>
#include <sys/resource.h>
#include <unistd.h>

#include "base/error.h"
#include "base/whole_file.h"
#include "file/json.h"
#include "file/mesh_file.h"
#include "file/mesh_formats.h"
#include "file/scene_file.h"
#include "file/scene_reader.h"
#include "scenes/folder.h"
#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;
using scenes::Random;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

void write_text(const std::string& path, std::string_view text) {
  std::ofstream(path, std::ios::binary) << text;
}

struct Outcome {
  fs_status status = FS_OK;
  std::string text;
};
Outcome attempt(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return {error.status, error.text};
  }
  return {};
}

SceneDescription empty_scene() {
  SceneDescription scene;
  scene.frame = fs_frame_init();
  scene.tool = {{0, 0, 0}};
  return scene;
}

// An object as the library gives it: with an orientation.
fs_object make_object(const char* name, fs_primitive primitive) {
  fs_object object = fs_object_init(name, primitive);
  object.pose = {{0, 0, 0}, {1, 0, 0, 0}};
  return object;
}

Ref<const Shape> make_square(double z) {
  const Vec3 points[] = {{0, 0, z}, {1, 0, z}, {1, 1, z}, {0, 1, z}};
  const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
  return make_mesh(points, 4, triangles, 2);
}

double any_number(Random& random) {  // of any sign and size: the bits are what counts
  switch (random.below(6)) {
    case 0: return 0;
    case 1: return -0.0;
    case 2: return static_cast<double>(random.below(1000));
    case 3: return random.between(-1e6, 1e6);
    case 4: return 5e-324 * static_cast<double>(random.below(9));
    default: return std::ldexp(random.between(-1, 1), static_cast<int>(random.below(1900)) - 950);
  }
}

fs_profile random_profile(Random& random, SceneDescription& scene) {
  const auto kind = static_cast<fs_profile_kind>(random.below(8));
  const auto sense = static_cast<fs_sense>(random.below(2));
  if (kind == FS_PROFILE_NONE) return fs_profile_init(kind, FS_SENSE_ATTRACTIVE, 0, 0, 0);
  const double gain = random.log_between(1e-3, 1e3);
  fs_profile profile = fs_profile_init(kind, sense, kind == FS_PROFILE_LINEAR_DECREASING ? -gain : gain, 0,
                                       random.log_between(0.1, 20));
  if (kind == FS_PROFILE_GAUSSIAN) profile.width = random.log_between(1e-4, 1);
  else if (kind != FS_PROFILE_CONSTANT && kind != FS_PROFILE_CUSTOM) profile.offset = random.between(-5, 5);
  if (random.coin()) profile.reach = random.unit_interval();
  if (kind == FS_PROFILE_CUSTOM) {
    if (scene.curves.empty() || random.coin()) {
      std::vector<double> values{0, -0.0, infinity, -infinity, std::nan("")};
      for (uint64_t i = random.below(100); i > 0; --i) values.push_back(any_number(random));
#ifdef FORCESERVER_EXPRESSIONS
      if (random.coin()) {
        scene.curves.push_back(make_expression_curve("3*(1+sin(12*t))*exp(-d/0.01)"));
      } else
#endif
        scene.curves.push_back(make_table_curve(values.data(), values.size(), random.log_between(1e-6, 1)));
    }
    profile.curve = const_cast<fs_curve*>(scene.curves[random.below(scene.curves.size())].get());
  }
  return profile;
}

Ref<const Shape> random_shape(Random& random, fs_primitive primitive) {
  std::vector<Vec3> points;
  for (uint64_t i = 3 + random.below(20); i > 0; --i) points.push_back(random.in_box(random.coin() ? 1 : 4e6));
  points.push_back({-0.0, 4100000.98765, 5e-324});
  if (primitive == FS_PRIMITIVE_POLYLINE) return make_polyline(points.data(), points.size(), random.coin());
  std::vector<uint32_t> triangles(3 * (1 + random.below(30)));
  for (uint32_t& index : triangles) index = static_cast<uint32_t>(random.below(points.size()));
  return make_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3);
}

// Anything that fs_object_set accepts and that the schema allows.
SceneDescription random_scene(uint64_t seed) {
  Random random(seed);
  SceneDescription scene = empty_scene();
  if (random.coin()) {
    scene.frame.pose = random.pose(2);
    scene.frame.scale = random.log_between(1e-3, 1e3);
    scene.frame.force_scale = random.unit_interval();
  }
  if (random.coin()) {
    scene.tool.clear();
    for (uint64_t i = 1 + random.below(32); i > 0; --i) scene.tool.push_back(random.in_box(0.1));
  }
  const char* names[] = {"wall", "a \"quoted\" \\ name", "B\xc3\xa4r.front", "\xe6\x9d\xb1\xe4\xba\xac", "B\xc3\xa4r",
                         "1", "wall.front", "a name of sixty-three bytes, which is as long as a name can be."};
  for (const char* name : names) {
    if (random.coin(0.2)) continue;
    fs_object object = make_object(std::string(name).substr(0, 63).c_str(), static_cast<fs_primitive>(random.below(4)));
    const bool has_surface = object.primitive == FS_PRIMITIVE_PLANE || object.primitive == FS_PRIMITIVE_MESH;
    if (random.coin()) object.pose = random.pose(4e6);
    if (random.coin()) object.twist = {random.in_box(1), random.in_box(1)};
    object.time = random.unit_interval();
    if (random.coin()) object.start = random.between(0, 1e6);
    if (random.coin()) object.lifetime = random.between(0, 10);
    object.front = random_profile(random, scene);
    if (has_surface) object.back = random_profile(random, scene);
    if (random.coin()) object.damping = random.between(0, 10);
    if (has_surface && random.coin()) {
      object.contact = {static_cast<fs_keep>(1 + random.below(3)), 0, random.coin() ? 0 : random.between(0, 3000),
                        random.log_between(0.1, 10), random.between(0, 5), random.between(0, 2), {}};
    }
    if (object.primitive == FS_PRIMITIVE_POLYLINE || object.primitive == FS_PRIMITIVE_MESH) {
      for (const auto& shape : scene.shapes) {
        if (shape->primitive == object.primitive && random.coin()) object.shape = const_cast<fs_shape*>(shape.get());
      }
      if (!object.shape) {
        scene.shapes.push_back(random_shape(random, object.primitive));
        object.shape = const_cast<fs_shape*>(scene.shapes.back().get());
      }
    }
    if (random.coin()) object.tool_points = static_cast<uint32_t>(random.bits());
    object.enabled = random.coin(0.8);
    scene.objects.push_back(object);
  }
  return scene;
}

uint64_t bits(double value) { return std::bit_cast<uint64_t>(value); }

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void check_equal(const fs_profile& a, const fs_profile& b, const std::string& name) {
  fs_profile x = a, y = b;
  ck_assert_msg(!x.curve == !y.curve, "%s", name.c_str());
  if (x.curve && x.curve->expression()) {
    ck_assert_msg(y.curve->expression() && *x.curve->expression() == *y.curve->expression(), "%s", name.c_str());
  } else if (x.curve) {
    ck_assert_msg(y.curve->table() && same_bytes(*x.curve->table(), *y.curve->table()) &&
                      bits(x.curve->step()) == bits(y.curve->step()), "%s", name.c_str());
  }
  x.curve = y.curve = nullptr;
  ck_assert_msg(std::memcmp(&x, &y, sizeof x) == 0, "%s", name.c_str());
}

void check_equal(const SceneDescription& a, const SceneDescription& b) {
  ck_assert_int_eq(std::memcmp(&a.frame, &b.frame, sizeof a.frame), 0);
  ck_assert(same_bytes(a.tool, b.tool));
  ck_assert_uint_eq(a.objects.size(), b.objects.size());
  for (size_t i = 0; i < a.objects.size(); ++i) {
    fs_object x = a.objects[i], y = b.objects[i];
    ck_assert_str_eq(x.name, y.name);
    check_equal(x.front, y.front, x.name);
    check_equal(x.back, y.back, x.name);
    ck_assert_msg(!x.shape == !y.shape, "%s", x.name);
    if (x.shape) {
      ck_assert(x.shape->primitive == y.shape->primitive && x.shape->closed == y.shape->closed);
      ck_assert_msg(same_bytes(x.shape->points, y.shape->points), "%s", x.name);
      ck_assert_msg(same_bytes(x.shape->triangles, y.shape->triangles), "%s", x.name);
    }
    for (size_t k = 0; k < i; ++k) {  // shared handles are shared again
      ck_assert((x.shape == a.objects[k].shape) == (y.shape == b.objects[k].shape));
      ck_assert((x.front.curve == a.objects[k].front.curve) == (y.front.curve == b.objects[k].front.curve));
      ck_assert((x.front.curve == a.objects[k].back.curve) == (y.front.curve == b.objects[k].back.curve));
    }
    x.shape = y.shape = nullptr;
    x.front = y.front = x.back = y.back = fs_profile{};
    ck_assert_double_eq_tol(y.time, x.time, 1e-9 * (1 + std::fabs(x.time)));  // its age comes back, bit for bit
    x.time = y.time;
    ck_assert_msg(std::memcmp(&x, &y, sizeof x) == 0, "%s", x.name);
  }
}

}  // namespace

START_TEST(random_scenes_come_back_bit_for_bit)
{
  const scenes::Folder one, two;
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    const SceneDescription scene = random_scene(seed);
    write_scene_file(one / "a.scene.json", scene, 0);
    const SceneDescription back = read_scene_file(one / "a.scene.json", 0);
    check_equal(scene, back);
    write_scene_file(two / "a.scene.json", back, 0);
    ck_assert(read_whole_file(one / "a.scene.json") == read_whole_file(two / "a.scene.json"));
  }
  // The same meshes, bytes and names; and nothing else beside the scene.
  ck_assert_uint_eq(one.files(), two.files());
  for (const auto& file : std::filesystem::directory_iterator(one.path)) {
    const std::string name = file.path().filename();
    ck_assert(read_whole_file(one / name.c_str()) == read_whole_file(two / name.c_str()));
    const bool is_expected = name == "a.scene.json" || (name.starts_with("a.scene-") && name.ends_with(".ply"));
    ck_assert_msg(is_expected, "%s", name.c_str());
  }
}
END_TEST

START_TEST(every_number_field_comes_back_bit_for_bit)
{
  const scenes::Folder directory;
  Random random(3);
  for (int round = 0; round < 60; ++round) {
    SceneDescription scene = empty_scene();
    fs_object object = make_object("x", FS_PRIMITIVE_MESH);
    for (double* numbers : {&object.pose.position.x, &object.twist.linear.x, &object.front.gain, &object.back.gain,
                            &object.damping, &object.contact.stiffness, &scene.frame.pose.position.x}) {
      size_t count = 1;
      if (numbers == &object.pose.position.x || numbers == &scene.frame.pose.position.x) count = 7;
      if (numbers == &object.twist.linear.x) count = 6;
      if (numbers == &object.front.gain || numbers == &object.back.gain) count = 5;
      if (numbers == &object.contact.stiffness) count = 4;
      auto* bytes = reinterpret_cast<unsigned char*>(numbers);
      for (size_t i = 0; i < count; ++i, bytes += sizeof(double)) {
        const double choices[] = {any_number(random), infinity, -infinity, std::nan(""), -0.0, 0.1};
        std::memcpy(bytes, &choices[random.below(6)], sizeof(double));
      }
    }
    scene.objects = {object};
    scene.frame.scale = any_number(random);
    scene.frame.force_scale = infinity;
    scene.tool = {{infinity, -0.0, 1e-310}};
    write_scene_file(directory / "a.json", scene, 0);
    check_equal(scene, read_scene_file(directory / "a.json", 0));
  }
}
END_TEST

START_TEST(defaults_are_left_out)
{
  const scenes::Folder directory;
  SceneDescription scene = empty_scene();
  scene.objects = {make_object("here", FS_PRIMITIVE_POINT)};
  scene.objects[0].front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_REPULSIVE, 200, 0, 3);
  write_scene_file(directory / "a.json", scene, 0);
  const std::string expected =
      "{\n"
      "  \"forceserver\": \"scene\",\n"
      "  \"version\": 1,\n"
      "  \"frame\": {\"scale\": 1.0, \"force_scale\": 1.0},\n"
      "  \"tool\": [[0.0, 0.0, 0.0]],\n"
      "  \"objects\": [\n"
      "    {\n"
      "      \"name\": \"here\",\n"
      "      \"primitive\": \"point\",\n"
      "      \"front\": {\"kind\": \"linear_increasing\", \"sense\": \"repulsive\", \"gain\": 200.0, \"limit\": 3.0}\n"
      "    }\n"
      "  ]\n"
      "}\n";
  const std::string written = read_whole_file(directory / "a.json");
  ck_assert_str_eq(written.c_str(), expected.c_str());
  // A field that the file leaves out has its default.
  const SceneDescription back = parse_scene(R"({"forceserver": "scene", "version": 1,
                                                "objects": [{"name": "x", "primitive": "plane"}]})", "a.json", 0);
  SceneDescription defaults = empty_scene();
  defaults.objects = {make_object("x", FS_PRIMITIVE_PLANE)};
  check_equal(defaults, back);
  ck_assert(parse_scene(R"({"forceserver": "scene", "version": 1})", "a.json", 0).objects.empty());
  // An editor looks for this key; the reader ignores it.
  ck_assert(parse_scene(R"({"$schema": "a", "forceserver": "scene", "version": 1})", "a.json", 0).objects.empty());
}
END_TEST

START_TEST(numbers_by_hand)
{
  const auto start_of = [](const char* number) {
    const std::string text = std::string(R"({"forceserver": "scene", "version": 1, "objects": [{"name": "x",
                                            "primitive": "point", "start": )") + number + "}]}";
    return parse_scene(text, "a.json", 0).objects.at(0).start;
  };
  ck_assert_double_eq(start_of("7"), 7);
  ck_assert_double_eq(start_of("-7"), -7);
  ck_assert_double_eq(start_of("18446744073709551616"), 18446744073709551616.0);
  ck_assert_double_eq(start_of("1E3"), 1000);
  ck_assert_double_eq(start_of("4100000.98765"), 4100000.98765);
  ck_assert_uint_eq(bits(start_of("-0.0")), bits(-0.0));
  ck_assert_uint_eq(bits(start_of("2.2250738585072011e-308")), bits(2.2250738585072011e-308));
  ck_assert_double_eq(start_of("\"inf\""), infinity);
  ck_assert_double_eq(start_of("\"-inf\""), -infinity);
  ck_assert(std::isnan(start_of("\"nan\"")));
}
END_TEST

namespace {

std::string scene_text(const std::string& more) {
  return "{\"forceserver\": \"scene\",\n \"version\": 1,\n " + more + "}";
}

}  // namespace

START_TEST(a_start_is_kept_as_an_age)
{
  const scenes::Folder directory;
  Random random(5);
  for (int round = 0; round < 300; ++round) {
    SceneDescription scene = empty_scene();
    scene.objects = {make_object("x", FS_PRIMITIVE_POINT), make_object("y", FS_PRIMITIVE_POINT)};
    const double saved = random.log_between(1e-3, 1e6), loaded = random.log_between(1e-3, 1e6);
    scene.objects[0].start = saved - random.between(-1000, 1000);
    write_scene_file(directory / "a.json", scene, saved);
    const SceneDescription back = read_scene_file(directory / "a.json", loaded);
    const double rounding = 1e-16 * (saved + loaded + 3000);
    ck_assert_double_eq_tol(loaded - back.objects[0].start, saved - scene.objects[0].start, rounding);
    ck_assert_double_eq(back.objects[1].start, 0);
    // Saved again at that time the text is the same, but for a last digit of the age.
    write_scene_file(directory / "b.json", back, loaded);
    ck_assert_double_eq_tol(read_scene_file(directory / "b.json", loaded).objects[0].start, back.objects[0].start,
                            rounding);
  }
  // The number in the file is the age, bit for bit; a start that comes out as 0 is still one that was given.
  const auto start_of = [](const char* age, double time) {
    return parse_scene(scene_text(std::string("\"objects\": [{\"name\": \"x\", \"primitive\": \"point\", \"age\": ") +
                                  age + "}]"), "a.json", time).objects.at(0).start;
  };
  ck_assert_double_eq(start_of("0.1", 0), -0.1);
  ck_assert_double_eq(start_of("-0.30000000000000004", 0), 0.30000000000000004);
  ck_assert_double_eq(start_of("2.5", 1000), 997.5);
  ck_assert(start_of("1000", 1000) != 0 && std::fabs(start_of("1000", 1000)) < 1e-300);
}
END_TEST

START_TEST(values_by_hand)
{
  const std::pair<double, const char*> numbers[] = {
      {0, "0.0"}, {-0.0, "-0.0"}, {1, "1.0"}, {-250, "-250.0"}, {100000, "100000.0"}, {1.0 / 3, "0.3333333333333333"},
      {1e-5, "0.00001"}, {1e-6, "1e-06"}, {5e-324, "5e-324"}, {1e15, "1e+15"}, {123456789012345, "123456789012345.0"},
      {1.7976931348623157e308, "1.7976931348623157e+308"}};
  for (const auto& [value, text] : numbers) {
    const std::string line = to_line(Json(value));
    ck_assert_str_eq(line.c_str(), text);
    ck_assert_uint_eq(bits(parse_json(text, "a").number()->value), bits(value));
  }
  const char* const text = R"({"a": [1, -2, 4294967295, true, false, null, {}], "b\u0001\"\\": "\u00e9\n"})";
  const std::string line = to_line(parse_json(text, "a"));
  ck_assert_str_eq(line.c_str(),
                   "{\"a\": [1, -2, 4294967295, true, false, null, {}], \"b\\u0001\\\"\\\\\": \"\xc3\xa9\\u000a\"}");
  for (const char* good : {"", "a", "\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xee\x80\x80",
                           "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf", "B\xc3\xa4r"}) {
    ck_assert_msg(is_utf8(good), "%s", good);
  }
  for (const char* bad : {"\x80", "\xbf", "\xc0\x80", "\xc1\xbf", "\xc3", "\xc3(", "\xe0\x9f\xbf", "\xed\xa0\x80",
                          "\xe2\x82", "\xf0\x8f\xbf\xbf", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xff", "a\xfe"}) {
    ck_assert_msg(!is_utf8(bad), "%s", bad);
  }
}
END_TEST

namespace {

struct Hostile {
  std::string text;
  std::vector<const char*> words;
  fs_status status = FS_ERROR_PARSE;
};

std::string object_text(const std::string& more) {
  return scene_text("\"curves\": {\"c\": {\"step\": 1, \"table\": [1, 2]}}, "
                    "\"shapes\": {\"p\": {\"points\": [[0, 0, 0], [1, 0, 0]]}}, "
                    "\"objects\": [{\"name\": \"wall\", \"primitive\": \"plane\"" + more + "}]");
}
std::string shape_text(const std::string& shape) { return scene_text("\"shapes\": {\"p\": " + shape + "}"); }
std::string curve_text(const std::string& curve) { return scene_text("\"curves\": {\"c\": " + curve + "}"); }

std::vector<Hostile> hostile_files() {
  const std::string deep(100000, '['), wide = "{\"a\":";
  std::string nested;
  for (int i = 0; i < 100000; ++i) nested += wide;
  return {
      {"", {"a.json", "line 1, column"}},
      {"{", {"line 1, column"}},
      {"nonsense", {"line 1, column 2", "syntax error"}},
      {"[]", {"must be an object"}},
      {"{\"forceserver\": \"scene\",\n  \"version\" 1}", {"line 2, column 13", "syntax error", "':'"}},
      {scene_text("") + "x", {"line 3", "column"}},
      {scene_text("\"frame\": {}"), {}, FS_OK},
      {scene_text("\"frame\": {}") + "x", {"line 3, column 14"}},
      {scene_text("\"frame\": {},"), {"line 3, column 14"}},
      {"{\"forceserver\": \"scene\xff\"}", {"line 1, column 23", "UTF-8"}},
      {std::string("{\"forceserver\": \"sc\0ene\"}", 25), {"line 1, column 20"}},
      {deep, {"line 1, column 17", "deep"}},
      {nested, {"line 1, column 81", "deep"}},
      {scene_text("\"tool\": [[1e999, 0, 0]]"), {"line 3, column 16", "1e999"}},
      {"{\"version\": 1}", {"\"forceserver\" is missing"}},
      {"{\"forceserver\": 7, \"version\": 1}", {"\"forceserver\" is 7", "a string"}},
      {"{\"forceserver\": \"rover\", \"version\": 1}", {"\"rover\"", "not a scene file"}},
      {"{\"forceserver\": \"scene\"}", {"\"version\" is missing"}},
      {"{\"forceserver\": \"scene\", \"version\": 0}", {"\"version\" is 0"}},
      {"{\"forceserver\": \"scene\", \"version\": -1}", {"\"version\" is -1"}},
      {"{\"forceserver\": \"scene\", \"version\": 1.0}", {"\"version\" is 1.0", "integer"}},
      {"{\"forceserver\": \"scene\", \"version\": 2, \"new\": 1}", {"\"version\" is 2", "1..1"}, FS_ERROR_VERSION},
      {scene_text("\"colour\": 1"), {"the key \"colour\" is unknown"}},
      {scene_text("\"tool\": [],\n\"tool\": []"), {"line 4, column 6", "\"tool\" is given twice"}},
      {object_text(", \"front\": {\"gain\": 1, \"gain\": 2}"), {"line 3", "\"gain\" is given twice"}},
      {scene_text("\"tool\": []"), {"\"tool\" has 0 points", "1..32"}},
      {scene_text("\"tool\": [[0, 0]]"), {"\"tool[0]\" is [0, 0]", "three numbers"}},
      {scene_text("\"tool\": [[0, 0, null]]"), {"\"tool[0][2]\" is null", "a number"}},
      {scene_text("\"tool\": 7"), {"\"tool\" is 7", "list of points"}},
      {scene_text("\"frame\": []"), {"frame", "must be an object"}},
      {scene_text("\"frame\": {\"scale\": \"big\"}"), {"a.json, frame", "\"scale\" is \"big\"", "a number"}},
      {scene_text("\"frame\": {\"size\": 1}"), {"a.json, frame", "\"size\" is unknown"}},
      {scene_text("\"objects\": {}"), {"\"objects\" is {}", "a list"}},
      {scene_text("\"objects\": [7]"), {"objects[0]", "is 7", "an object"}},
      {scene_text("\"objects\": [{}]"), {"objects[0]", "\"name\" is missing"}},
      {scene_text("\"objects\": [{\"name\": 7}]"), {"objects[0]", "\"name\" is 7", "a string"}},
      {scene_text("\"objects\": [{\"name\": \"\"}]"), {"objects[0]", "0 bytes", "1..63"}},
      {scene_text("\"objects\": [{\"name\": \"" + std::string(64, 'x') + "\"}]"), {"objects[0]", "64 bytes"}},
      {scene_text("\"objects\": [{\"name\": \"a\\u0000b\"}]"), {"objects[0]", "NUL"}},
      {scene_text("\"objects\": [{\"name\": \"a\"}]"), {"object 'a'", "\"primitive\" is missing"}},
      {scene_text("\"objects\": [{\"name\": \"a\", \"primitive\": \"point\"}, "
                  "{\"name\": \"a\", \"primitive\": \"point\"}]"),
       {"object 'a'", "another object"}},
      {scene_text("\"objects\": [{\"name\": \"a\", \"primitive\": \"ball\"}]"),
       {"object 'a'", "\"primitive\" is \"ball\"", "\"mesh\""}},
      {object_text(", \"colour\": 1"), {"object 'wall'", "\"colour\" is unknown"}},
      {object_text(", \"time\": 1"), {"object 'wall'", "\"time\" is unknown"}},
      {object_text(", \"front\": {\"kind\": \"strong\"}"), {"object 'wall', front", "\"strong\"", "\"gaussian\""}},
      {object_text(", \"front\": {\"kind\": 1}"), {"object 'wall', front", "\"kind\" is 1", "\"gaussian\""}},
      {object_text(", \"front\": {\"sense\": \"pull\"}"), {"object 'wall', front", "\"pull\"", "\"repulsive\""}},
      {object_text(", \"back\": {\"gain\": true}"), {"object 'wall', back", "\"gain\" is true", "a number"}},
      {object_text(", \"back\": {\"gains\": 1}"), {"object 'wall', back", "\"gains\" is unknown"}},
      {object_text(", \"front\": {\"curve\": \"d\"}"), {"object 'wall', front", "\"d\"", "a key of \"curves\""}},
      {object_text(", \"front\": {\"curve\": {}}"), {"object 'wall', front", "\"curve\" is {}", "a string"}},
      {object_text(", \"shape\": \"q\""), {"object 'wall'", "\"q\"", "a key of \"shapes\""}},
      {object_text(", \"contact\": {\"keep\": \"both\"}"), {"object 'wall', contact", "\"both\"", "\"either\""}},
      {object_text(", \"contact\": {\"reserved\": 0}"), {"object 'wall', contact", "\"reserved\" is unknown"}},
      {object_text(", \"pose\": {\"position\": [0, 0, \"up\"]}"), {"object 'wall', pose", "\"position[2]\" is \"up\""}},
      {object_text(", \"pose\": {\"orientation\": [0, 0, 0]}"), {"object 'wall', pose", "four numbers"}},
      {object_text(", \"pose\": null"), {"object 'wall', pose", "null", "an object"}},
      {object_text(", \"twist\": {\"x\": 0}"), {"object 'wall', twist", "\"x\" is unknown"}},
      {object_text(", \"age\": 1, \"start\": 1"), {"object 'wall'", "both \"start\" and \"age\""}},
      {object_text(", \"age\": \"inf\""), {"object 'wall'", "\"age\" is \"inf\", must be a number"}},
      {object_text(", \"age\": null"), {"object 'wall'", "\"age\" is null"}},
      {object_text(", \"enabled\": 1"), {"object 'wall'", "\"enabled\" is 1", "true or false"}},
      {object_text(", \"tool_points\": -1"), {"object 'wall'", "\"tool_points\" is -1"}},
      {object_text(", \"tool_points\": 4294967296"), {"object 'wall'", "4294967296", "0..4294967295"}},
      {object_text(", \"tool_points\": 1.5"), {"object 'wall'", "1.5", "an integer"}},
      {object_text(", \"tool_points\": \"" + std::string(100000, 'x') + "\""), {"object 'wall'", "\"xxxx", "..."}},
      {scene_text("\"shapes\": []"), {"\"shapes\" is []"}},
      {shape_text("{}"), {"shape \"p\"", "\"points\" is missing"}},
      {shape_text("{\"points\": [[0, 0, 0]]}"), {"shape \"p\"", "2"}},
      {shape_text("{\"points\": [[0, 0, 0], [0, 0, \"nan\"]]}"), {"shape \"p\"", "nan"}},
      {shape_text("{\"points\": [[0, 0, 0], [1, 0, 0]], \"scale\": 2}"), {"shape \"p\"", "\"scale\" is unknown"}},
      {shape_text("{\"points\": [[0, 0, 0], [1, 0, 0]], \"closed\": 1}"), {"shape \"p\"", "\"closed\" is 1"}},
      {shape_text("{\"file\": \"x.ply\", \"points\": []}"), {"shape \"p\"", "\"points\" is unknown"}},
      {shape_text("{\"file\": \"/etc/passwd\"}"), {"shape \"p\"", "/etc/passwd", "relative"}},
      {shape_text("{\"file\": \"../x.ply\"}"), {"shape \"p\"", "relative"}},
      {shape_text("{\"file\": \"a/../../x.ply\"}"), {"shape \"p\"", "relative"}},
      {shape_text("{\"file\": \"a/..\"}"), {"shape \"p\"", "relative"}},
      {shape_text("{\"file\": \"\"}"), {"shape \"p\"", "relative"}},
      {shape_text("{\"file\": \"" + std::string(4096, 'a') + "\"}"),
       {"shape \"p\"", "\"file\" is 4096 bytes long, must be at most 4095"}},
      {shape_text("{\"file\": \"a\\u0000.ply\"}"), {"shape \"p\"", "NUL"}},
      {shape_text("{\"file\": \"x.ply\", \"scale\": 0}"), {"shape \"p\"", "scale is 0"}},
      {shape_text("{\"file\": \"none/x.ply\"}"), {"shape \"p\"", "none/x.ply", "No such file"}, FS_ERROR_NOT_FOUND},
      {shape_text("{\"file\": \"x.exe\"}"), {"shape \"p\"", "x.exe"}, FS_ERROR_UNSUPPORTED},
      {curve_text("{}"), {"curve \"c\"", "\"step\" is missing"}},
      {curve_text("{\"step\": 1}"), {"curve \"c\"", "\"table\" is missing"}},
      {curve_text("{\"step\": 0, \"table\": [1, 2]}"), {"curve \"c\"", "step is 0"}},
      {curve_text("{\"step\": 1, \"table\": [1]}"), {"curve \"c\"", "count is 1"}},
      {curve_text("{\"step\": 1, \"table\": [1, \"2\"]}"), {"curve \"c\"", "\"table[1]\" is \"2\""}},
      {curve_text("{\"step\": 1, \"table\": 7}"), {"curve \"c\"", "\"table\" is 7"}},
      {curve_text("{\"expression\": 7}"), {"curve \"c\"", "\"expression\" is 7"}},
      {curve_text("{\"expression\": \"1\", \"step\": 7}"), {"curve \"c\"", "\"step\" is unknown"}},
#ifdef FORCESERVER_EXPRESSIONS
      {curve_text("{\"expression\": \"3*(d\"}"), {"curve \"c\"", "column"}},
#endif
  };
}

}  // namespace

START_TEST(hostile_files_are_refused_with_their_reason)
{
  for (const Hostile& hostile : hostile_files()) {
    const std::vector<char> exact(hostile.text.begin(), hostile.text.end());
    const Outcome out = attempt([&] { parse_scene({exact.data(), exact.size()}, "a.json", 0); });
    const std::string start = hostile.text.substr(0, 200);
    ck_assert_msg(out.status == hostile.status, "%d (%s) for: %s", out.status, out.text.c_str(), start.c_str());
    for (const char* word : hostile.words) {
      ck_assert_msg(out.text.find(word) != out.text.npos, "'%s' is not in: %s", word, out.text.c_str());
    }
    if (out.status != FS_OK) ck_assert_msg(out.text.starts_with("a.json"), "%s", out.text.c_str());
    ck_assert_uint_le(out.text.size(), 400);
  }
}
END_TEST

// Very many objects or keys: with quadratic time the test would not end within its 60 s.
START_TEST(large_files_are_read_in_reasonable_time)
{
  std::string many = "{}";
  for (int i = 0; i < 300000; ++i) many += ", {}";
  ck_assert_int_eq(attempt([&] { parse_scene(scene_text("\"objects\": [" + many + "]"), "a.json", 0); }).status,
                   FS_ERROR_PARSE);
  std::string keys = "{\"forceserver\": \"scene\", \"version\": 1", objects, shapes;
  for (int i = 0; i < 100000; ++i) keys += ", \"k" + std::to_string(i) + "\": 0";
  ck_assert_int_eq(attempt([&] { parse_scene(keys + "}", "a.json", 0); }).status, FS_ERROR_PARSE);
  for (int i = 0; i < 20000; ++i) {
    const std::string n = std::to_string(i), comma = i == 0 ? "" : ", ";
    shapes += comma + "\"" + n + "\": {\"points\": [[0, 0, 0], [1, 0, 0]]}";
    objects += comma + "{\"name\": \"" + n + "\", \"primitive\": \"polyline\", \"shape\": \"" + n + "\"}";
  }
  const SceneDescription scene =
      parse_scene(scene_text("\"shapes\": {" + shapes + "}, \"objects\": [" + objects + "]"), "a.json", 0);
  ck_assert_uint_eq(scene.objects.size(), 20000);
}
END_TEST

START_TEST(damaged_files_never_crash)
{
  const scenes::Folder directory;
  std::vector<std::string> good;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    write_scene_file(directory / "a.json", random_scene(seed), 0);
    good.push_back(read_whole_file(directory / "a.json"));
  }
  Random random(11);
  int read = 0, refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = good[i % good.size()];
    for (uint64_t changes = 1 + random.below(2); changes > 0; --changes) {
      const size_t at = random.below(damaged.size() + 1);
      switch (random.below(5)) {
        case 0: damaged.insert(at, 1, "0123456789{}[],:\"-.en"[random.below(21)]); break;
        case 1: damaged.insert(at, damaged.substr(random.below(damaged.size() + 1), random.below(30))); break;
        case 2: damaged.erase(at, random.below(8)); break;
        case 3:
          if (i % 8 == 0) damaged.resize(at);
          break;
        default:
          if (at < damaged.size()) damaged[at] = static_cast<char>(damaged[at] ^ 1 << random.below(8));
      }
    }
    const Outcome out = attempt([&] { parse_scene(damaged, directory / "b.json", 0); });
    (out.status == FS_OK ? read : refused) += 1;
  }
  ck_assert_int_gt(read, 100);
  ck_assert_int_gt(refused, 1000);
}
END_TEST

START_TEST(meshes_lie_beside_the_scene_one_file_each)
{
  const scenes::Folder directory;
  SceneDescription scene = empty_scene();
  const Ref<const Shape> square = make_square(0), other = make_square(0.5);
  scene.shapes = {square, other, make_square(0)};
  for (const char* name : {"a", "b", "c", "d"}) scene.objects.push_back(make_object(name, FS_PRIMITIVE_MESH));
  for (size_t i = 0; i < 4; ++i) scene.objects[i].shape = const_cast<fs_shape*>(scene.shapes[i % 3].get());
  write_scene_file(directory / "terrain.json", scene, 0);
  ck_assert_uint_eq(directory.files(), 3);  // equal content is one file

  // A new mesh: the old scene file's meshes stay, so a copy of it is still whole.
  std::filesystem::copy(directory / "terrain.json", directory / "copy.json");
  scene.shapes = {make_square(7)};
  for (fs_object& object : scene.objects) object.shape = const_cast<fs_shape*>(scene.shapes[0].get());
  write_scene_file(directory / "terrain.json", scene, 0);
  ck_assert_uint_eq(directory.files(), 5);
  ck_assert_double_eq(read_scene_file(directory / "copy.json", 0).objects[1].shape->points[0].z, 0.5);
  check_equal(scene, read_scene_file(directory / "terrain.json", 0));

  // A damaged mesh file of the right name is not taken for the mesh.
  for (const auto& file : std::filesystem::directory_iterator(directory.path)) {
    if (file.path().extension() == ".ply") write_text(file.path(), "damaged");
  }
  write_scene_file(directory / "terrain.json", scene, 0);
  check_equal(scene, read_scene_file(directory / "terrain.json", 0));

  // By hand: another format, in a folder beside it, in millimetres.
  std::filesystem::create_directory(directory / "meshes");
  write_text(directory / "meshes/a.obj", "v 0 0 0\nv 1000 0 0\nv 0 1000 0\nf 1 2 3\n");
  write_text(directory / "hand.json", shape_text("{\"file\": \"meshes/a.obj\", \"scale\": 0.001}"));
  const SceneDescription hand = read_scene_file(directory / "hand.json", 0);
  ck_assert_double_eq(hand.shapes.at(0)->points[1].x, 1);
}
END_TEST

START_TEST(a_scene_that_cannot_be_written_leaves_the_old_one)
{
  const scenes::Folder directory;
  SceneDescription scene = empty_scene();
  scene.shapes = {make_square(0)};
  scene.objects = {make_object("old", FS_PRIMITIVE_MESH)};
  scene.objects[0].shape = const_cast<fs_shape*>(scene.shapes[0].get());
  write_scene_file(directory / "a.json", scene, 0);
  const std::string old = read_whole_file(directory / "a.json");

  // The disk is full when the JSON comes, after its mesh: 300 bytes hold the mesh's file but not the scene's.
  SceneDescription large = empty_scene();
  large.shapes = {make_square(1)};
  for (int i = 0; i < 1000; ++i) {
    large.objects.push_back(make_object(std::to_string(i).c_str(), FS_PRIMITIVE_MESH));
    large.objects[i].shape = const_cast<fs_shape*>(large.shapes[0].get());
  }
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit unlimited;
  getrlimit(RLIMIT_FSIZE, &unlimited);
  for (const rlim_t bytes : {100, 1000}) {
    rlimit small = unlimited;
    small.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &small);
    const Outcome full = attempt([&] { write_scene_file(directory / "a.json", large, 0); });
    setrlimit(RLIMIT_FSIZE, &unlimited);
    ck_assert_int_eq(full.status, FS_ERROR_IO);
    ck_assert_msg(full.text.find("File too large") != full.text.npos, "%s", full.text.c_str());
    ck_assert_uint_eq(directory.files(), 2);
    ck_assert(read_whole_file(directory / "a.json") == old);
    check_equal(scene, read_scene_file(directory / "a.json", 0));
  }

  const auto refuse = [&](const std::string& path, fs_status status, const char* word) {
    const Outcome out = attempt([&] { write_scene_file(path, scene, 0); });
    ck_assert_msg(out.status == status && out.text.find(word) != out.text.npos, "%d %s", out.status, out.text.c_str());
  };
  refuse(directory / "none/a.json", FS_ERROR_IO, "No such file");
  std::filesystem::create_directory(directory / "d.json");
  refuse(directory / "d.json", FS_ERROR_IO, "a directory");
  refuse(directory / "\xff.json", FS_ERROR_INVALID, "UTF-8");  // the name of its mesh would be in it
  ck_assert_uint_eq(directory.files(), 3);
  ck_assert_int_eq(attempt([&] { read_scene_file(directory / "none.json", 0); }).status, FS_ERROR_NOT_FOUND);
  ck_assert_int_eq(attempt([&] { read_scene_file(directory / "d.json", 0); }).status, FS_ERROR_IO);
}
END_TEST

namespace {

void write_scenes(const std::string& directory) {
  write_scene_file(directory + "/empty.json", empty_scene(), 0);
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    write_scene_file(directory + "/random-" + std::to_string(seed) + ".json", random_scene(seed), 0);
  }
}

}  // namespace

int main(int count, char** arguments)
{
  if (count == 2) {
    write_scenes(arguments[1]);
    return 0;
  }
  Suite* suite = suite_create("scene_file");
  TCase* tests = tcase_create("scene_file");
  tcase_set_timeout(tests, 500);
  tcase_add_test(tests, random_scenes_come_back_bit_for_bit);
  tcase_add_test(tests, every_number_field_comes_back_bit_for_bit);
  tcase_add_test(tests, defaults_are_left_out);
  tcase_add_test(tests, numbers_by_hand);
  tcase_add_test(tests, a_start_is_kept_as_an_age);
  tcase_add_test(tests, values_by_hand);
  tcase_add_test(tests, hostile_files_are_refused_with_their_reason);
  tcase_add_test(tests, large_files_are_read_in_reasonable_time);
  tcase_add_test(tests, damaged_files_never_crash);
  tcase_add_test(tests, meshes_lie_beside_the_scene_one_file_each);
  tcase_add_test(tests, a_scene_that_cannot_be_written_leaves_the_old_one);
  suite_add_tcase(suite, tests);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed == 0 ? 0 : 1;
}
