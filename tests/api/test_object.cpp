// Force-objects: set, get, change, move, remove, clear; what is refused, and that a refusal changes nothing.
#include <cstdint>
#include <limits>
#include <thread>
#include <vector>

#include "api/support.h"

using namespace scenes;

static constexpr double nan_ = std::numeric_limits<double>::quiet_NaN();
static constexpr double infinite = std::numeric_limits<double>::infinity();

static fs_object spring(const char* name) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = attract(200, 3);
  return o;
}

static fs_object wall(const char* name) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
  o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 0.01, 1);
  o.back = attract(500, 4);
  return o;
}

// What can be seen of a scene: its reports and what a tool feels at two places.
struct Seen {
  std::vector<fs_report> reports;
  fs_vec3 here, there;

  explicit Seen(fs_scene* scene) {
    size_t count = object_count(scene);
    reports.resize(count);
    OK(fs_scene_get_reports(scene, reports.data(), count, &count));
    const Tool tool = make_tool(scene);
    here = force_at(tool.get(), {0.003, 0.004, 0.01});
    there = force_at(tool.get(), {0.01, -0.02, -0.01});
  }
  void expect_same(fs_scene* scene) const {
    const Seen after(scene);
    ck_assert_uint_eq(after.reports.size(), reports.size());
    for (size_t i = 0; i < reports.size(); ++i) {
      ck_assert_str_eq(after.reports[i].name, reports[i].name);
      ck_assert_uint_eq(after.reports[i].revision, reports[i].revision);
    }
    ck_assert(after.here == here && after.there == there);
  }
};

START_TEST(set_adds_and_replaces) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  fs_object o = spring("a");
  OK(fs_object_set(scene.get(), &o));
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-12);
  o.front.gain = 100;
  OK(fs_object_set(scene.get(), &o));
  ck_assert_uint_eq(object_count(scene.get()), 1);
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-1, 0, 0}), 1e-12);
  o = spring("b");  // forces add
  OK(fs_object_set(scene.get(), &o));
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-3, 0, 0}), 1e-12);
  OK(fs_object_remove(scene.get(), "a"));
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-12);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_remove(scene.get(), "a"), "a");
  OK(fs_scene_clear(scene.get()));
  ck_assert_uint_eq(object_count(scene.get()), 0);
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{}), 0);
  OK(fs_scene_clear(scene.get()));
}
END_TEST

START_TEST(get_gives_what_was_set) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 50));
  Content content;
  const std::vector<fs_vec3> line = helix(0.01, 0.02, 1, 9);
  fs_object& o = content.add_shape("a line", make_polyline(line.data(), line.size(), true));
  const double table[]{1, 2, 0};
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 0.5, 0, 7);
  o.front.curve = content.keep(make_table(table, 3, 0.01), {});
  o.front.reach = 0.3;
  o.pose = {{1, -2, 3}, {0.5, -0.5, 0.5, 0.5}};
  o.twist = {{0.1, 0.2, 0.3}, {-1, 2, -3}};
  o.time = 49.95;
  o.start = 40;
  o.lifetime = 12;
  o.damping = 0.25;
  o.tool_points = 5;
  o.enabled = false;
  OK(fs_object_set(scene.get(), &o));

  fs_object got = fs_object_init("whatever", FS_PRIMITIVE_MESH);
  OK(fs_object_get(scene.get(), "a line", &got));
  ck_assert_str_eq(got.name, "a line");
  ck_assert_uint_eq(got.struct_size, sizeof got);
  ck_assert_int_eq(got.primitive, FS_PRIMITIVE_POLYLINE);
  EXPECT_VECTOR(got.pose.position, o.pose.position, 0);
  EXPECT_NEAR(got.pose.orientation.x, -0.5, 1e-15);
  EXPECT_NEAR(got.pose.orientation.z, 0.5, 1e-15);
  EXPECT_VECTOR(got.twist.linear, o.twist.linear, 0);
  EXPECT_VECTOR(got.twist.angular, o.twist.angular, 0);
  EXPECT_NEAR(got.time, 49.95, 0);
  EXPECT_NEAR(got.start, 40, 0);
  EXPECT_NEAR(got.lifetime, 12, 0);
  EXPECT_NEAR(got.damping, 0.25, 0);
  ck_assert_int_eq(got.front.kind, FS_PROFILE_CUSTOM);
  ck_assert_int_eq(got.front.sense, FS_SENSE_REPULSIVE);
  EXPECT_NEAR(got.front.gain, 0.5, 0);
  EXPECT_NEAR(got.front.limit, 7, 0);
  EXPECT_NEAR(got.front.reach, 0.3, 0);
  ck_assert_ptr_eq(got.front.curve, o.front.curve);
  ck_assert_int_eq(got.back.kind, FS_PROFILE_NONE);
  ck_assert_ptr_eq(got.shape, o.shape);
  ck_assert_ptr_nonnull(got.owner);
  ck_assert_uint_eq(got.tool_points, 5);
  ck_assert(!got.enabled);
  fs_object_release(&got);
}
END_TEST

START_TEST(get_edit_set) {  // the way of an editor
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  const Tool tool = make_tool(scene.get());
  fs_object o = wall("w");
  OK(fs_object_set(scene.get(), &o));
  const Seen before(scene.get());
  OK(fs_scene_set_time(scene.get(), 20));
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene.get(), "w", &got));
  OK(fs_object_set(scene.get(), &got));
  const fs_vec3 same = force_at(tool.get(), {0.01, -0.02, -0.01});
  EXPECT_VECTOR(same, before.there, 0);
  got.back.gain = 250;
  OK(fs_object_set(scene.get(), &got));
  fs_object_release(&got);
  EXPECT_VECTOR(before.there, (fs_vec3{0, 0, 4}), 1e-12);  // at its limit
  EXPECT_VECTOR(force_at(tool.get(), {0.01, -0.02, -0.01}), (fs_vec3{0, 0, 2.5}), 1e-12);
}
END_TEST

START_TEST(got_handles_live_until_released) {
  Scene scene = make_scene();
  Content content;
  fs_object& o = content.add_shape("ball", make_mesh(sphere_mesh(0.02, 60)));
  o.back = attract(300, 2);
  const double table[]{2, 1};
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 2);
  o.front.curve = content.keep(make_table(table, 2, 0.01), {});
  OK(fs_object_set(scene.get(), &o));
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT), again = got;
  OK(fs_object_get(scene.get(), "ball", &got));
  OK(fs_object_get(scene.get(), "ball", &again));
  content = {};                      // ours go
  OK(fs_scene_clear(scene.get()));   // the scene's go
  scene.reset();
  size_t count = 0;
  double step = 0;
  ck_assert_ptr_nonnull(fs_shape_get_triangles(got.shape, &count));
  ck_assert_uint_gt(count, 40);
  ck_assert_double_eq(fs_curve_get_table(got.front.curve, &count, &step)[1], 1);
  const Shape kept(fs_shape_retain(got.shape));
  const Curve kept_curve(fs_curve_retain(got.front.curve));
  got.shape = nullptr;               // whatever the fields hold by now
  got.front.curve = nullptr;
  got.primitive = FS_PRIMITIVE_POINT;
  fs_object_release(&got);
  fs_object_release(&got);
  fs_object_release(&again);
  ck_assert_double_eq(fs_shape_get_points(kept.get(), &count)[0].x, fs_shape_get_points(kept.get(), &count)[0].x);
  ck_assert_double_eq(fs_curve_get_table(kept_curve.get(), &count, &step)[0], 2);

  fs_object own = spring("own");     // not from get: does nothing
  fs_object_release(&own);
  fs_object_release(nullptr);
}
END_TEST

START_TEST(change_takes_only_its_parts) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  fs_object o = wall("w");
  o.lifetime = 100;
  OK(fs_object_set(scene.get(), &o));
  fs_object other = wall("w");
  other.pose = {{1, 2, 3}, turn({1, 0, 0}, 1)};
  other.twist.linear = {4, 5, 6};
  other.front.gain = 2;
  other.back = fs_profile{};
  other.damping = 3;
  other.lifetime = 50;
  other.tool_points = 2;
  other.enabled = false;
  const Content line_content = path();
  struct {
    uint32_t parts;
  } cases[]{{FS_PART_POSE}, {FS_PART_PROFILES}, {FS_PART_CONTACT}, {FS_PART_OTHER}, {FS_PART_SHAPE},
            {FS_PART_POSE | FS_PART_OTHER}, {31}};
  for (const auto& c : cases) {
    OK(fs_object_set(scene.get(), &o));
    const uint64_t revision = report_of(scene.get(), "w").revision;
    OK(fs_object_change(scene.get(), &other, c.parts));
    fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
    OK(fs_object_get(scene.get(), "w", &got));
    const bool pose = c.parts & FS_PART_POSE, profiles = c.parts & FS_PART_PROFILES, rest = c.parts & FS_PART_OTHER;
    EXPECT_VECTOR(got.pose.position, pose ? other.pose.position : o.pose.position, 0);
    EXPECT_VECTOR(got.twist.linear, pose ? other.twist.linear : o.twist.linear, 0);
    ck_assert_double_eq(got.front.gain, profiles ? 2 : 1);
    ck_assert_int_eq(got.back.kind, profiles ? FS_PROFILE_NONE : FS_PROFILE_LINEAR_INCREASING);
    ck_assert_double_eq(got.damping, profiles ? 3 : 0);
    ck_assert_double_eq(got.lifetime, rest ? 50 : 100);
    ck_assert_uint_eq(got.tool_points, rest ? 2 : 0);
    ck_assert_int_eq(got.enabled, !rest);
    fs_object_release(&got);
    if (profiles || rest) ck_assert_uint_gt(report_of(scene.get(), "w").revision, revision);
  }
  const Seen before(scene.get());
  EXPECT(FS_ERROR_INVALID, fs_object_change(scene.get(), &other, 32));
  EXPECT(FS_ERROR_INVALID, fs_object_change(scene.get(), &other, 0x80000001u));
  other.back = attract(-1, 1);
  EXPECT(FS_ERROR_INVALID, fs_object_change(scene.get(), &other, FS_PART_PROFILES));
  fs_object absent = spring("absent");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_change(scene.get(), &absent, FS_PART_POSE), "absent");
  before.expect_same(scene.get());
}
END_TEST

START_TEST(change_of_shape) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  const fs_vec3 low[]{{-1, 0, 0}, {1, 0, 0}}, high[]{{-1, 0, 0.01}, {1, 0, 0.01}};
  const Shape first = make_polyline(low, 2, false), second = make_polyline(high, 2, false);
  fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  o.front = attract(100, 5);
  o.shape = first.get();
  OK(fs_object_set(scene.get(), &o));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0.02}), (fs_vec3{0, 0, -2}), 1e-12);
  o.shape = second.get();
  OK(fs_object_change(scene.get(), &o, FS_PART_PROFILES));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0.02}), (fs_vec3{0, 0, -2}), 1e-12);
  OK(fs_object_change(scene.get(), &o, FS_PART_SHAPE));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0.02}), (fs_vec3{0, 0, -1}), 1e-12);
}
END_TEST

START_TEST(move_moves) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  const Tool tool = make_tool(scene.get());
  const fs_object o = spring("a");
  OK(fs_object_set(scene.get(), &o));
  const uint64_t revision = report_of(scene.get(), "a").revision;
  fs_pose pose = at(0.01, 0, 0);
  OK(fs_object_move(scene.get(), "a", &pose, nullptr, FS_NOW));
  EXPECT_VECTOR(force_at(tool.get(), {0.02, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-12);
  ck_assert_uint_eq(report_of(scene.get(), "a").revision, revision);  // grows with every change but moves

  const Seen before(scene.get());
  const fs_twist bad_twist{{nan_, 0, 0}, {}};
  fs_pose bad = at(nan_, 0, 0);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(scene.get(), "a", &bad, nullptr, FS_NOW), "position");
  bad = at(0, 0, -1.1e15);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(scene.get(), "a", &bad, nullptr, FS_NOW), "position");
  bad.position = {};
  bad.orientation = {1, 0.1, 0, 0};
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(scene.get(), "a", &bad, nullptr, FS_NOW), "orientation");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(scene.get(), "a", &pose, &bad_twist, FS_NOW), "twist");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(scene.get(), "a", &pose, nullptr, infinite), "time");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_move(scene.get(), "b", &pose, nullptr, FS_NOW), "b");
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(scene.get(), "somebody/a", &pose, nullptr, FS_NOW));
  before.expect_same(scene.get());
}
END_TEST

START_TEST(names) {
  const Scene scene = make_scene();
  const char* good[]{"a", "1234567890123456789012345678901", "with space", "r\xc3\xa9sum\xc3\xa9", "\xe2\x82\xac",
                     "\xf0\x9f\x96\x90", "dot.", "-", "\"quoted\\\"", "%s"};
  for (const char* name : good) {
    const fs_object o = spring(name);
    OK(fs_object_set(scene.get(), &o));
    const fs_report report = report_of(scene.get(), name);
    ck_assert_str_eq(report.name, name);
  }
  ck_assert_uint_eq(object_count(scene.get()), std::size(good));
  const Seen before(scene.get());
  const char* bad[]{"", "12345678901234567890123456789012", "a/b", "/", "a\nb", "\t", "\x7f", "\x1f", "\xff",
                    "\xc0\xaf", "\xe2\x82", "a\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80"};
  for (const char* name : bad) {
    const fs_object o = spring(name);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &o), "name");
  }
  const std::string long_name(1000, 'n');  // to ask for, it is only not there
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  const fs_pose pose = at(0, 0, 0);
  for (const char* name : {"", "absent", "a/b", "\xff", long_name.c_str()}) {
    EXPECT(FS_ERROR_NOT_FOUND, fs_object_get(scene.get(), name, &got));
    EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(scene.get(), name));
    EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(scene.get(), name, &pose, nullptr, FS_NOW));
  }
  fs_object endless = spring("x");
  std::memset(endless.name, 'x', sizeof endless.name);  // no end at all
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &endless), "name");
  before.expect_same(scene.get());
}
END_TEST

static Shape line_shape() {
  const fs_vec3 ends[]{{0, 0, 0}, {1, 0, 0}};
  return make_polyline(ends, 2, false);
}

struct BadField {
  const char* field;
  void (*spoil)(fs_object&);
};

static Curve some_curve;
static Shape some_line, some_mesh;

static fs_profile custom_profile() {
  fs_profile p = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  p.curve = some_curve.get();
  return p;
}

static const BadField bad_fields[]{
    {"primitive", [](fs_object& o) { o.primitive = static_cast<fs_primitive>(4); }},
    {"primitive", [](fs_object& o) { o.primitive = static_cast<fs_primitive>(-1); }},
    {"primitive", [](fs_object& o) { o.primitive = FS_PRIMITIVE_FORCE_32; }},
    {"position", [](fs_object& o) { o.pose.position.x = nan_; }},
    {"position", [](fs_object& o) { o.pose.position.y = infinite; }},
    {"position", [](fs_object& o) { o.pose.position.z = -1.01e15; }},
    {"orientation", [](fs_object& o) { o.pose.orientation = {0.9985, 0, 0, 0}; }},
    {"orientation", [](fs_object& o) { o.pose.orientation = {0, 0, 1.0015, 0}; }},
    {"orientation", [](fs_object& o) { o.pose.orientation = {1, nan_, 0, 0}; }},
    {"orientation", [](fs_object& o) { o.pose.orientation = {1e200, 0, 0, 0}; }},
    {"orientation", [](fs_object& o) { o.pose.orientation = {1e-200, 0, 0, 0}; }},
    {"twist", [](fs_object& o) { o.twist.linear.y = nan_; }},
    {"twist", [](fs_object& o) { o.twist.angular.z = infinite; }},
    {"time", [](fs_object& o) { o.time = nan_; }},
    {"time", [](fs_object& o) { o.time = infinite; }},
    {"start", [](fs_object& o) { o.start = nan_; }},
    {"start", [](fs_object& o) { o.start = -infinite; }},
    {"lifetime", [](fs_object& o) { o.lifetime = -1e-9; }},
    {"lifetime", [](fs_object& o) { o.lifetime = nan_; }},
    {"lifetime", [](fs_object& o) { o.lifetime = infinite; }},
    {"damping", [](fs_object& o) { o.damping = -1; }},
    {"damping", [](fs_object& o) { o.damping = nan_; }},
    {"damping", [](fs_object& o) { o.damping = infinite; }},
    {"reserved", [](fs_object& o) { o.reserved[0] = 1; }},
    {"reserved", [](fs_object& o) { o.reserved[2] = 255; }},
    {"kind", [](fs_object& o) { o.front.kind = static_cast<fs_profile_kind>(8); }},
    {"kind", [](fs_object& o) { o.back.kind = static_cast<fs_profile_kind>(-1); }},
    {"sense", [](fs_object& o) { o.front.sense = static_cast<fs_sense>(2); }},
    {"sense", [](fs_object& o) { o.back.sense = static_cast<fs_sense>(-1); }},
    {"gain", [](fs_object& o) { o.front.gain = nan_; }},
    {"gain", [](fs_object& o) { o.back.gain = infinite; }},
    {"gain", [](fs_object& o) { o.front = constant(FS_SENSE_ATTRACTIVE, -1); o.front.limit = 1; }},
    {"gain", [](fs_object& o) { o.back = attract(-1, 1); }},
    {"gain", [](fs_object& o) { o.back.kind = FS_PROFILE_LINEAR_DECREASING; }},
    {"gain", [](fs_object& o) { o.front.gain = -1; }},
    {"width", [](fs_object& o) { o.front.width = 0; }},
    {"width", [](fs_object& o) { o.front.width = -0.01; }},
    {"width", [](fs_object& o) { o.front.width = nan_; }},
    {"gain", [](fs_object& o) { o.front = fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_ATTRACTIVE, -1, 0, 1); }},
    {"gain", [](fs_object& o) { o.front = fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, nan_, 0, 1); }},
    {"gain", [](fs_object& o) { o.front = custom_profile(); o.front.gain = -2; }},
    {"gain", [](fs_object& o) { o.front = custom_profile(); o.front.gain = -1e-300; }},
    {"curve", [](fs_object& o) { o.front = custom_profile(); o.front.curve = nullptr; }},
    {"curve", [](fs_object& o) { o.back.curve = some_curve.get(); }},
    {"offset", [](fs_object& o) { o.back.offset = nan_; }},
    {"offset", [](fs_object& o) { o.front.offset = 1; }},  // a gaussian has none
    {"offset", [](fs_object& o) { o.front = constant(FS_SENSE_REPULSIVE, 1); o.front.offset = 1; }},
    {"offset", [](fs_object& o) { o.front = custom_profile(); o.front.offset = -1; }},
    {"width", [](fs_object& o) { o.back.width = 1; }},
    {"width", [](fs_object& o) { o.front = custom_profile(); o.front.width = 1; }},
    {"width", [](fs_object& o) { o.front = constant(FS_SENSE_REPULSIVE, 1); o.front.width = 1; }},
    {"limit", [](fs_object& o) { o.front.limit = 0; }},
    {"limit", [](fs_object& o) { o.back.limit = -1; }},
    {"limit", [](fs_object& o) { o.back.limit = nan_; }},
    {"limit", [](fs_object& o) { o.back.limit = infinite; }},
    {"limit", [](fs_object& o) { o.back.limit = 1.1e9; }},
    {"reach", [](fs_object& o) { o.front.reach = -1; }},
    {"reach", [](fs_object& o) { o.front.reach = nan_; }},
    {"reach", [](fs_object& o) { o.front.reach = infinite; }},
    {"gain", [](fs_object& o) { o.front = fs_profile{}; o.front.gain = 1; }},
    {"offset", [](fs_object& o) { o.front = fs_profile{}; o.front.offset = 1; }},
    {"curve", [](fs_object& o) { o.front = fs_profile{}; o.front.curve = some_curve.get(); }},
    {"back", [](fs_object& o) { o.primitive = FS_PRIMITIVE_POINT; }},
    {"back", [](fs_object& o) { o.primitive = FS_PRIMITIVE_POLYLINE; o.shape = some_line.get(); }},
    {"shape", [](fs_object& o) { o.shape = some_mesh.get(); }},
    {"shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_POINT; o.back = fs_profile{}; o.shape = some_line.get(); }},
    {"shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_MESH; }},
    {"shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_MESH; o.shape = some_line.get(); }},
    {"shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_POLYLINE; o.back = fs_profile{}; }},
    {"shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_POLYLINE; o.back = {}; o.shape = some_mesh.get(); }},
    {"keep", [](fs_object& o) { o.contact.keep = static_cast<fs_keep>(4); o.contact.limit = 1; }},
    {"keep", [](fs_object& o) { o.contact.keep = static_cast<fs_keep>(-1); o.contact.limit = 1; }},
    {"reserved", [](fs_object& o) { o.contact.reserved = 1; }},
    {"stiffness", [](fs_object& o) { o.contact = {FS_KEEP_FRONT, 0, -1, 5, 0, 0}; }},
    {"stiffness", [](fs_object& o) { o.contact = {FS_KEEP_FRONT, 0, nan_, 5, 0, 0}; }},
    {"limit", [](fs_object& o) { o.contact = {FS_KEEP_BACK, 0, 100, 0, 0, 0}; }},
    {"limit", [](fs_object& o) { o.contact = {FS_KEEP_BACK, 0, 100, infinite, 0, 0}; }},
    {"damping", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, -1, 0}; }},
    {"damping", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, nan_, 0}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, -0.1}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, 2.1}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, nan_}; }},
    {"keep", [](fs_object& o) {
       o.primitive = FS_PRIMITIVE_POINT;
       o.back = {};
       o.contact = {FS_KEEP_FRONT, 0, 0, 5, 0, 0};
     }},
};

START_TEST(bad_fields_are_refused_by_name) {
  some_line = line_shape();
  some_mesh = make_mesh(box_mesh({1, 1, 1}));
  const double table[]{1, 0};
  some_curve = make_table(table, 2, 1);
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 5));
  const fs_object good = wall("w");
  const fs_object another = spring("a");
  OK(fs_object_set(scene.get(), &good));
  OK(fs_object_set(scene.get(), &another));
  const Seen before(scene.get());
  for (size_t i = 0; i < std::size(bad_fields); ++i) {
    for (const char* name : {"w", "new"}) {  // one that is there, and one that is not
      fs_object bad = wall(name);
      bad_fields[i].spoil(bad);
      const fs_status status = fs_object_set(scene.get(), &bad);
      ck_assert_msg(status == FS_ERROR_INVALID, "case %zu, %s: %s", i, bad_fields[i].field, fs_status_name(status));
      ck_assert_msg(std::strstr(fs_last_error(), bad_fields[i].field), "case %zu: \"%s\" does not name \"%s\"", i,
                    fs_last_error(), bad_fields[i].field);
      ck_assert_msg(std::strstr(fs_last_error(), name), "case %zu: \"%s\" does not name %s", i, fs_last_error(), name);
    }
  }
  before.expect_same(scene.get());
  some_line.reset();
  some_mesh.reset();
  some_curve.reset();
}
END_TEST

START_TEST(edges_of_what_is_good) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  struct Good {
    void (*alter)(fs_object&);
  };
  const Good good[]{
      {[](fs_object& o) { o.pose.orientation = {0.9992, 0, 0, 0}; }},
      {[](fs_object& o) { o.pose.orientation = {0, 1.0008, 0, 0}; }},
      {[](fs_object& o) { o.pose.position = {1e15, -1e15, 0}; }},
      {[](fs_object& o) { o.front.limit = 1e9; }},
      {[](fs_object& o) { o.front.limit = 1e-300; }},
      {[](fs_object& o) { o.front = fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_REPULSIVE, -5, 2, 1); }},
      {[](fs_object& o) { o.front = fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_REPULSIVE, 0, 0, 1); }},
      {[](fs_object& o) { o.front = o.back = fs_profile{}; }},
      {[](fs_object& o) { o.tool_points = 0xffffffffu; }},
      {[](fs_object& o) { o.contact.keep = FS_KEEP_NONE; }},
      {[](fs_object& o) { o.lifetime = 1e9; }},
  };
  for (const Good& g : good) {
    fs_object o = wall("w");
    g.alter(o);
    OK(fs_object_set(scene.get(), &o));
    const fs_response r = evaluate(tool.get(), hand_at({0.001, 0.002, 0.003}));
    ck_assert(std::isfinite(r.wrench.force.x) && std::isfinite(r.stiffness.zz));
  }
}
END_TEST

START_TEST(zeros_are_the_identity) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  fs_object o = wall("w");
  ck_assert_double_eq(o.pose.orientation.w, 0);  // as fs_object_init leaves it
  OK(fs_object_set(scene.get(), &o));
  const fs_vec3 f = force_at(tool.get(), {0.3, 0.2, -0.004});
  EXPECT_VECTOR(f, (fs_vec3{0, 0, 2}), 1e-12);
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene.get(), "w", &got));
  ck_assert_double_eq(got.pose.orientation.w, 1);
  fs_object_release(&got);
  o.pose.orientation = {0, 1.0005, 0, 0};  // half a turn about x, not quite of length 1: normalised
  OK(fs_object_set(scene.get(), &o));
  EXPECT_VECTOR(force_at(tool.get(), {0.3, 0.2, 0.004}), (fs_vec3{0, 0, -2}), 1e-12);
  fs_state state = hand_at({0.3, 0.2, 0.004});  // of the hand too
  state.pose.orientation = {};
  EXPECT_VECTOR(evaluate(tool.get(), state).wrench.force, (fs_vec3{0, 0, -2}), 1e-12);
}
END_TEST

START_TEST(struct_sizes) {
  const Scene scene = make_scene();
  fs_object o = spring("a");
  OK(fs_object_set(scene.get(), &o));
  struct {
    uint32_t size;
    fs_status status;
  } sizes[]{{sizeof o + 8, FS_ERROR_VERSION}, {0xffffffffu, FS_ERROR_VERSION}, {sizeof o - 8, FS_ERROR_INVALID},
            {0, FS_ERROR_INVALID}};
  for (const auto& s : sizes) {
    o.struct_size = s.size;
    EXPECT_SENTENCE(s.status, fs_object_set(scene.get(), &o), "struct_size");
    EXPECT(s.status, fs_object_change(scene.get(), &o, FS_PART_POSE));
    struct {
      fs_object object;
      uint8_t behind[64];
    } out{fs_object_init("untouched", FS_PRIMITIVE_POINT), {}};
    out.object.struct_size = s.size;
    EXPECT(s.status, fs_object_get(scene.get(), "a", &out.object));
    ck_assert_str_eq(out.object.name, "untouched");
  }
  // A caller's struct that stands directly before other memory: no byte behind it is written.
  struct {
    fs_object object;
    uint8_t guard[64];
  } framed;
  framed.object = fs_object_init("", FS_PRIMITIVE_POINT);
  std::memset(framed.guard, 0xa5, sizeof framed.guard);
  OK(fs_object_get(scene.get(), "a", &framed.object));
  for (uint8_t byte : framed.guard) ck_assert_uint_eq(byte, 0xa5);
  fs_object_release(&framed.object);
}
END_TEST

START_TEST(contacts_wait_for_the_proxy) {  // checked in full, then UNSUPPORTED, in this version
  const Scene scene = make_scene();
  fs_object o = wall("w");
  OK(fs_object_set(scene.get(), &o));
  const Seen before(scene.get());
  for (fs_keep keep : {FS_KEEP_FRONT, FS_KEEP_BACK, FS_KEEP_EITHER}) {
    o.contact = {keep, 0, 0, 5, 1, 0.5};
    EXPECT(FS_ERROR_UNSUPPORTED, fs_object_set(scene.get(), &o));
    ck_assert_uint_gt(std::strlen(fs_last_error()), 10);
    EXPECT(FS_ERROR_UNSUPPORTED, fs_object_change(scene.get(), &o, FS_PART_CONTACT));
  }
  before.expect_same(scene.get());
  OK(fs_object_change(scene.get(), &o, FS_PART_POSE));  // other parts are not touched by it
}
END_TEST

START_TEST(input_is_copied) {
  const Scene scene = make_scene();
  const Tool tool = make_tool(scene.get());
  Content content = path();
  OK(fs_object_set(scene.get(), &content.objects[0]));
  const fs_vec3 before = force_at(tool.get(), {0.05, 0.01, 0});
  ck_assert_double_gt(norm(before), 0.1);
  std::memset(&content.objects[0], 0xff, sizeof(fs_object));
  content.shapes.clear();
  EXPECT_VECTOR(force_at(tool.get(), {0.05, 0.01, 0}), before, 0);
}
END_TEST

START_TEST(order_of_destruction_is_free) {
  Scene scene = make_scene();
  Tool tool = make_tool(scene.get());
  const Content content = hello();
  fill(scene.get(), content);
  scene.reset();
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-12);
  fs_scene_destroy(nullptr);
  fs_shape_destroy(nullptr);
  fs_curve_destroy(nullptr);
  fs_tool_destroy(nullptr);
  fs_device_close(nullptr);
  fs_servo_stop(nullptr);
  fs_server_stop(nullptr);
}
END_TEST

START_TEST(base) {
  ck_assert_str_eq(fs_version(), "0.1.0");
  struct {
    fs_status status;
    const char* name;
  } names[]{{FS_OK, "FS_OK"}, {FS_ERROR_INVALID, "FS_ERROR_INVALID"}, {FS_ERROR_NOT_FOUND, "FS_ERROR_NOT_FOUND"},
            {FS_ERROR_EXISTS, "FS_ERROR_EXISTS"}, {FS_ERROR_STATE, "FS_ERROR_STATE"},
            {FS_ERROR_VERSION, "FS_ERROR_VERSION"}, {FS_ERROR_UNSUPPORTED, "FS_ERROR_UNSUPPORTED"},
            {FS_ERROR_MEMORY, "FS_ERROR_MEMORY"}, {FS_ERROR_IO, "FS_ERROR_IO"}, {FS_ERROR_PARSE, "FS_ERROR_PARSE"},
            {FS_ERROR_TIMEOUT, "FS_ERROR_TIMEOUT"}, {FS_ERROR_DISCONNECTED, "FS_ERROR_DISCONNECTED"},
            {FS_ERROR_DENIED, "FS_ERROR_DENIED"}, {FS_ERROR_FULL, "FS_ERROR_FULL"},
            {FS_ERROR_INTERNAL, "FS_ERROR_INTERNAL"}};
  for (const auto& n : names) ck_assert_str_eq(fs_status_name(n.status), n.name);
  ck_assert_ptr_nonnull(fs_status_name(static_cast<fs_status>(-99)));
  ck_assert_ptr_nonnull(fs_status_name(static_cast<fs_status>(5)));

  ck_assert_ptr_nonnull(fs_last_error());
  EXPECT(FS_ERROR_INVALID, fs_scene_create(nullptr));
  const std::string sentence = fs_last_error();
  ck_assert_uint_gt(sentence.size(), 5);
  std::thread([] {
    ck_assert_str_eq(fs_last_error(), "");  // of this thread: none yet
    fs_scene_clear(nullptr);
  }).join();
  ck_assert_str_eq(fs_last_error(), sentence.c_str());
  const Scene scene = make_scene();  // a success leaves it
  ck_assert_str_eq(fs_last_error(), sentence.c_str());
}
END_TEST

START_TEST(pose_from_z) {
  const fs_vec3 directions[]{{0, 0, 1}, {0, 0, -1}, {0, 0, 1e-300}, {1, 0, 0}, {-1e200, 1e200, 0}, {1, 2, -3},
                             {1e-9, 0, -1}};
  for (const fs_vec3& d : directions) {
    fs_pose pose{};
    OK(fs_pose_from_z({1, 2, 3}, d, &pose));
    EXPECT_VECTOR(pose.position, (fs_vec3{1, 2, 3}), 0);
    const double largest = std::fmax(std::fabs(d.x), std::fmax(std::fabs(d.y), std::fabs(d.z)));
    const fs_vec3 along = unit(fs_vec3{d.x / largest, d.y / largest, d.z / largest});
    EXPECT_VECTOR(rotate(pose.orientation, {0, 0, 1}), along, 1e-15);
  }
  fs_pose untouched = at(7, 7, 7);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_pose_from_z({}, {0, 0, 0}, &untouched), "direction");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_pose_from_z({}, {nan_, 0, 0}, &untouched), "direction");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_pose_from_z({infinite, 0, 0}, {1, 0, 0}, &untouched), "position");
  EXPECT_VECTOR(untouched.position, (fs_vec3{7, 7, 7}), 0);
}
END_TEST

START_TEST(tool_and_frame) {
  const Scene scene = make_scene();
  size_t count = 0;
  fs_vec3 points[40]{};
  OK(fs_scene_get_tool(scene.get(), points, 40, &count));
  ck_assert_uint_eq(count, 1);
  EXPECT_VECTOR(points[0], (fs_vec3{}), 0);
  for (int i = 0; i < 40; ++i) points[i] = {0.001 * i, 0, 0};
  OK(fs_scene_set_tool(scene.get(), points, 32));
  fs_vec3 got[3]{};
  OK(fs_scene_get_tool(scene.get(), got, 2, &count));  // a small buffer is not an error
  ck_assert_uint_eq(count, 32);
  EXPECT_VECTOR(got[1], points[1], 0);
  EXPECT_VECTOR(got[2], (fs_vec3{}), 0);
  OK(fs_scene_get_tool(scene.get(), nullptr, 0, &count));
  EXPECT(FS_ERROR_INVALID, fs_scene_set_tool(scene.get(), points, 33));
  EXPECT(FS_ERROR_INVALID, fs_scene_set_tool(scene.get(), points, 0));
  points[1].y = nan_;
  EXPECT(FS_ERROR_INVALID, fs_scene_set_tool(scene.get(), points, 3));
  OK(fs_scene_get_tool(scene.get(), nullptr, 0, &count));
  ck_assert_uint_eq(count, 32);

  fs_frame frame{};
  OK(fs_scene_get_frame(scene.get(), nullptr, &frame));
  ck_assert_double_eq(frame.scale, 1);
  ck_assert_double_eq(frame.force_scale, 1);
  frame.pose = {{1, 2, 3}, turn({0, 0, 1}, 1)};
  frame.scale = 10;
  frame.force_scale = 0;
  OK(fs_scene_set_frame(scene.get(), &frame));
  fs_frame bad = frame;
  struct {
    const char* field;
    void (*spoil)(fs_frame&);
  } cases[]{{"scale", [](fs_frame& f) { f.scale = 0; }},       {"scale", [](fs_frame& f) { f.scale = -1; }},
            {"scale", [](fs_frame& f) { f.scale = nan_; }},    {"force_scale", [](fs_frame& f) { f.force_scale = -1; }},
            {"force_scale", [](fs_frame& f) { f.force_scale = infinite; }},
            {"position", [](fs_frame& f) { f.pose.position.x = nan_; }},
            {"orientation", [](fs_frame& f) { f.pose.orientation.x = 1; }}};
  for (const auto& c : cases) {
    bad = frame;
    c.spoil(bad);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_set_frame(scene.get(), &bad), c.field);
  }
  fs_frame got_frame{};
  OK(fs_scene_get_frame(scene.get(), nullptr, &got_frame));
  ck_assert_double_eq(got_frame.scale, 10);
  EXPECT_VECTOR(got_frame.pose.position, frame.pose.position, 0);
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_frame(scene.get(), "nobody", &got_frame));

  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_set_accuracy(scene.get(), -1), "newtons");
  EXPECT(FS_ERROR_INVALID, fs_scene_set_accuracy(scene.get(), nan_));
  OK(fs_scene_set_accuracy(scene.get(), 0.1));
  EXPECT(FS_ERROR_INVALID, fs_scene_set_max_stiffness(scene.get(), -1));
  EXPECT(FS_ERROR_INVALID, fs_scene_set_max_stiffness(scene.get(), nan_));
  EXPECT(FS_ERROR_UNSUPPORTED, fs_scene_set_max_stiffness(scene.get(), 100));
  OK(fs_scene_set_max_stiffness(scene.get(), 0));
}
END_TEST

int main() {
  Suite* suite = suite_create("object");
  add_case(suite, "objects", {set_adds_and_replaces, get_gives_what_was_set, get_edit_set,
                              got_handles_live_until_released, change_takes_only_its_parts, change_of_shape,
                              move_moves, input_is_copied, order_of_destruction_is_free});
  add_case(suite, "refusals", {names, bad_fields_are_refused_by_name, edges_of_what_is_good, zeros_are_the_identity,
                               struct_sizes, contacts_wait_for_the_proxy});
  add_case(suite, "base", {base, pose_from_z, tool_and_frame});
  return run_suite(suite);
}
