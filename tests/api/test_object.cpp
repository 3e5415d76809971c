// A scene without a servo: what is refused, and that a refusal changes nothing; handles; reports and the stiffness they tell;
// the clock. What the same calls do where a servo runs is in test_scenario.
#include <cstdint>
#include <ctime>
#include <limits>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "api/support.h"
#include "scenes/longer.h"

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

START_TEST(bad_moves) {
  const Scene scene = make_scene();
  const fs_object o = spring("a");
  OK(fs_object_set(scene.get(), &o));
  const fs_pose pose = at(0.01, 0, 0);
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
  const char* good[]{"a", "123456789012345678901234567890123456789012345678901234567890123", "with space", "r\xc3\xa9sum\xc3\xa9", "\xe2\x82\xac",
                     "\xf0\x9f\x96\x90", "dot.", "-", "\"quoted\\\"", "%s"};
  for (const char* name : good) {
    const fs_object o = spring(name);
    OK(fs_object_set(scene.get(), &o));
    const fs_report report = report_of(scene.get(), name);
    ck_assert_str_eq(report.name, name);
  }
  ck_assert_uint_eq(object_count(scene.get()), std::size(good));
  const Seen before(scene.get());
  const char* bad[]{"", "1234567890123456789012345678901234567890123456789012345678901234", "a/b", "/", "a\nb", "\t", "\x7f", "\x1f", "\xff",
                    "\xc0\xaf", "\xe2\x82", "a\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80"};
  for (const char* name : bad) {
    const fs_object o = spring(name);
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &o), "name");
  }
  fs_object other = spring("alice/spring");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &other),
                  "name has a '/' at byte 5, must be without: another client's object is not set, but changed "
                  "(fs_object_change)");
  const fs_object wall = fs_wall_init("w", {0, 0, 0}, {0, 0, 0}, 500, 10);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &wall),
                  "object 'w': the normal given to fs_wall_init is (0, 0, 0), must be finite and longer than 0");
  const std::string long_name(1000, 'n');  // to ask for, it is only not there
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  const fs_pose pose = at(0, 0, 0);
  for (const char* name : {"", "absent", "a/b", "\xff", "\x1b[31m", "\x7f", long_name.c_str()}) {
    EXPECT(FS_ERROR_NOT_FOUND, fs_object_get(scene.get(), name, &got));
    for (const char* c = fs_last_error(); *c; ++c) ck_assert(static_cast<unsigned char>(*c) >= 0x20 && *c != 0x7f);
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
    {"contact.reserved_32", [](fs_object& o) { o.contact.reserved_32 = 1; }},
    {"contact.reserved[7] is 1", [](fs_object& o) { o.contact.reserved[7] = 1; }},
    {"front.reserved[3] is nan", [](fs_object& o) { o.front.reserved[3] = nan_; }},
    {"back.reserved[0] is -1", [](fs_object& o) { o.back.reserved[0] = -1; }},
    {"stiffness", [](fs_object& o) { o.contact = {FS_KEEP_FRONT, 0, -1, 5, 0, 0, {}}; }},
    {"stiffness", [](fs_object& o) { o.contact = {FS_KEEP_FRONT, 0, nan_, 5, 0, 0, {}}; }},
    {"limit", [](fs_object& o) { o.contact = {FS_KEEP_BACK, 0, 100, 0, 0, 0, {}}; }},
    {"limit", [](fs_object& o) { o.contact = {FS_KEEP_BACK, 0, 100, infinite, 0, 0, {}}; }},
    {"damping", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, -1, 0, {}}; }},
    {"damping", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, nan_, 0, {}}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, -0.1, {}}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, 2.1, {}}; }},
    {"friction", [](fs_object& o) { o.contact = {FS_KEEP_EITHER, 0, 100, 5, 0, nan_, {}}; }},
    {"keep", [](fs_object& o) {
       o.primitive = FS_PRIMITIVE_POINT;
       o.back = {};
       o.contact = {FS_KEEP_FRONT, 0, 0, 5, 0, 0, {}};
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
  } sizes[]{{4104, FS_ERROR_VERSION}, {0xffffffffu, FS_ERROR_VERSION}, {568, FS_ERROR_INVALID},
            {sizeof o + 4, FS_ERROR_INVALID}, {0, FS_ERROR_INVALID}};
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
  // A program that is newer than the library: what the library does not know must be 0, and becomes 0.
  o = spring("a");
  Longer longer(o);
  OK(fs_object_set(scene.get(), &longer.known));
  OK(fs_object_change(scene.get(), &longer.known, 31));
  longer.added = uint64_t{1} << 56;
  const std::string place = "at byte " + std::to_string(sizeof o);
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_object_set(scene.get(), &longer.known), place.c_str());
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_object_change(scene.get(), &longer.known, FS_PART_POSE), "fs_object");
  OK(fs_object_get(scene.get(), "a", &longer.known));
  ck_assert_uint_eq(longer.added, 0);
  ck_assert_uint_eq(longer.known.struct_size, sizeof longer);
  fs_object_release(&longer.known);
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

START_TEST(contacts_are_kept) {
  const Scene scene = make_scene();
  fs_object o = wall("w");
  OK(fs_object_set(scene.get(), &o));
  for (fs_keep keep : {FS_KEEP_FRONT, FS_KEEP_BACK, FS_KEEP_EITHER, FS_KEEP_NONE}) {
    o.contact = {keep, 0, 100, 5, 1, 0.5, {}};
    OK(fs_object_change(scene.get(), &o, FS_PART_CONTACT));
    fs_object got = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
    OK(fs_object_get(scene.get(), "w", &got));
    ck_assert(std::memcmp(&got.contact, &o.contact, sizeof o.contact) == 0);
    fs_object_release(&got);
  }
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
  ck_assert_str_eq(fs_version(), "0.9.0");
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
            {"orientation", [](fs_frame& f) { f.pose.orientation.x = 1; }},
            {"frame.reserved[2] is 1", [](fs_frame& f) { f.reserved[2] = 1; }}};
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
  OK(fs_scene_set_max_stiffness(scene.get(), 100));
  OK(fs_scene_set_max_stiffness(scene.get(), 0));
}
END_TEST

// Reports and events.

static fs_object point(const char* name, const fs_profile& profile) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = profile;
  return o;
}

START_TEST(without_a_servo) {
  const Scene scene = make_scene();
  for (const char* name : {"b", "a", "c"}) {
    const fs_object o = point(name, attract(200, 3));
    OK(fs_object_set(scene.get(), &o));
  }
  OK(fs_scene_sync(scene.get(), 0));  // at once
  std::map<std::string, fs_report> all;
  std::vector<fs_report> reports(3);
  size_t count = 0;
  OK(fs_scene_get_reports(scene.get(), reports.data(), 3, &count));
  for (const fs_report& r : reports) all[r.name] = r;
  ck_assert_uint_eq(all.size(), 3);
  for (const auto& [name, r] : all) {
    ck_assert_int_eq(r.primitive, FS_PRIMITIVE_POINT);
    ck_assert_int_eq(r.state, FS_OBJECT_FELT);
    ck_assert_double_eq(r.weight, 1);
    EXPECT_NEAR(r.stiffness_wanted, 200, 1e-9);
    EXPECT_NEAR(r.stiffness_applied, r.stiffness_wanted, 0);
    ck_assert_double_eq(r.distance, infinite);  // nothing is near
    EXPECT_VECTOR(r.wrench.force, (fs_vec3{}), 0);
    ck_assert_double_eq(r.texture_lost, 0);
    ck_assert_double_eq(r.impact_lost, 0);
    for (double x : r.reserved) ck_assert_double_eq(x, 0);
    const fs_report single = report_of(scene.get(), name.c_str());
    ck_assert_int_eq(std::memcmp(&single, &r, sizeof r), 0);
  }
  fs_report two[2], untouched{};
  OK(fs_scene_get_reports(scene.get(), two, 2, &count));
  ck_assert_uint_eq(count, 3);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_report(scene.get(), "d", &untouched), "d");
  ck_assert_str_eq(untouched.name, "");
  EXPECT(FS_ERROR_INVALID, fs_scene_get_reports(scene.get(), nullptr, 1, &count));
}
END_TEST

// The steepest slope of the force, at the device. On a plane whose sides push the same way nothing jumps at d = 0.
START_TEST(stiffness_wanted) {
  const Scene scene = make_scene();
  auto wanted = [&](fs_profile profile) {
    fs_object wall = fs_object_init("a", FS_PRIMITIVE_PLANE);
    wall.front = wall.back = profile;
    wall.back.sense = FS_SENSE_ATTRACTIVE;
    OK(fs_object_set(scene.get(), &wall));
    const fs_report r = report_of(scene.get(), "a");
    ck_assert_double_eq(r.stiffness_applied, r.stiffness_wanted);  // no caps yet
    return r.stiffness_wanted;
  };
  const fs_sense sense = FS_SENSE_REPULSIVE;
  EXPECT_NEAR(wanted(attract(200, 3)), 200, 1e-9);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_LINEAR_DECREASING, sense, -150, 1, 3)), 150, 1e-9);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_GAUSSIAN, sense, 5, 0.005, 5)), 5 / 0.005 * std::exp(-0.5), 1e-6);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_QUADRATIC, sense, 1000, 0, 2.5)), 2 * 1000 * 0.05, 1e-6);
  EXPECT_NEAR(wanted(fs_profile_init(FS_PROFILE_INVERSE, sense, 0.02, 0, 10)), 5000, 1e-6);
  EXPECT_NEAR(wanted(constant(sense, 2)), 0, 0);
  fs_profile cut = attract(100, 9);
  cut.reach = 0.02;  // 2 N, then none: a jump
  ck_assert_double_eq(wanted(cut), infinite);
  fs_object two_sides = fs_object_init("a", FS_PRIMITIVE_PLANE);
  two_sides.front = attract(100, 3);
  two_sides.back = attract(700, 3);
  OK(fs_object_set(scene.get(), &two_sides));
  EXPECT_NEAR(report_of(scene.get(), "a").stiffness_wanted, 700, 1e-9);
  fs_frame frame = fs_frame_init();
  frame.scale = 10;
  frame.force_scale = 0.5;
  OK(fs_scene_set_frame(scene.get(), &frame));
  EXPECT_NEAR(report_of(scene.get(), "a").stiffness_wanted, 3500, 1e-9);  // scale*force_scale*k
  const fs_object pull = point("a", constant(FS_SENSE_ATTRACTIVE, 1));    // turns over at the point: a jump
  OK(fs_object_set(scene.get(), &pull));
  ck_assert_double_eq(report_of(scene.get(), "a").stiffness_wanted, infinite);
}
END_TEST

// What jumps asks for an infinite stiffness: at d = 0, at the reach, and where two parts of a polyline are equally near.
START_TEST(what_jumps) {
  const Scene scene = make_scene();
  const auto wanted = [&](const fs_object& o) {
    OK(fs_object_set(scene.get(), &o));
    return report_of(scene.get(), o.name).stiffness_wanted;
  };
  const auto line = [&](std::initializer_list<fs_vec3> points, const fs_profile& profile, bool closed = false) {
    const Shape shape = make_polyline(std::data(points), points.size(), closed);
    fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
    o.shape = shape.get();
    o.front = profile;
    return wanted(o);
  };
  const fs_profile spring = attract(150, 2), bell = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 1, 0.01, 1);
  fs_profile late = attract(100, 2), quadratic = fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 1e3, 0, 2);
  late.offset = -1;  // none within 10 mm

  // Points.
  EXPECT_NEAR(wanted(point("p", spring)), 150, 0);
  EXPECT_NEAR(wanted(point("p", late)), 100, 0);
  ck_assert_double_eq(wanted(point("p", bell)), infinite);
  ck_assert_double_eq(wanted(point("p", constant(FS_SENSE_REPULSIVE, 1))), infinite);
  ck_assert_double_eq(wanted(point("p", fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 1, -1, 1))), infinite);
  ck_assert_double_eq(wanted(point("p", fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -9, 1, 1))),
                      infinite);
  late.reach = 0.01;  // f is 0 there: nothing jumps, and nothing is felt at all
  EXPECT_NEAR(wanted(point("p", late)), 0, 0);
  late.reach = 0;

  // A straight polyline is as a point; whichever way it runs, and wherever it lies.
  const fs_vec3 a{1, 2, 3}, b{1.1, 2.2, 2.9};
  EXPECT_NEAR(line({a, b}, spring), 150, 0);
  EXPECT_NEAR(line({a, 0.3 * (b - a) + a, 0.7 * (b - a) + a, b}, spring), 150, 0);
  EXPECT_NEAR(line({a, b, 0.5 * (b - a) + a}, spring, true), 150, 0);
  EXPECT_NEAR(line({a, a, a}, spring), 150, 0);
  ck_assert_double_eq(line({a, b}, bell), infinite);

  // One that is bent jumps wherever it is felt, also if f(0) = 0.
  for (const double bend : {1e-4, 0.01, 0.1}) {
    for (const bool closed : {false, true}) {
      const std::initializer_list<fs_vec3> points{{-0.05, 0, 0}, {0, bend, 0}, {0.05, 0, 0}};
      ck_assert_double_eq(line(points, spring, closed), infinite);
      ck_assert_double_eq(line(points, quadratic, closed), infinite);
      ck_assert_double_eq(line(points, late, closed), infinite);
      EXPECT_NEAR(line(points, attract(0, 2), closed), 0, 0);
      late.reach = 0.005;  // it is never felt
      EXPECT_NEAR(line(points, late, closed), 0, 0);
      late.reach = 0;
    }
  }

  // A plane: where front and back do not agree. A mesh: also where they do, unless both are 0, as its edges turn the force.
  const Content content = ball(100);
  for (const fs_primitive primitive : {FS_PRIMITIVE_PLANE, FS_PRIMITIVE_MESH}) {
    fs_object o = fs_object_init("surface", primitive);
    if (primitive == FS_PRIMITIVE_MESH) o.shape = content.shapes[0].get();
    o.back = attract(400, 3);
    EXPECT_NEAR(wanted(o), 400, 0);
    o.front = constant(FS_SENSE_REPULSIVE, 1);
    ck_assert_double_eq(wanted(o), infinite);
    o.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400, 1, 3);  // 1 N too, the same way
    if (primitive == FS_PRIMITIVE_PLANE) EXPECT_NEAR(wanted(o), 400, 0);
    else ck_assert_double_eq(wanted(o), infinite);
    o.back.sense = FS_SENSE_REPULSIVE;  // the other way
    ck_assert_double_eq(wanted(o), infinite);
  }

  // A curve is looked at at several times.
  if (!has_expressions()) return;
  fs_object pulse = point("p", fs_profile{});
  pulse.front.kind = FS_PROFILE_CUSTOM;
  pulse.front.gain = pulse.front.limit = 1;
  const Curve later = make_expression("t*exp(-d/0.01)"), never = make_expression("30*d*(1+sin(12*t))*exp(-d/0.01)");
  pulse.front.curve = later.get();
  ck_assert_double_eq(wanted(pulse), infinite);
  pulse.front.curve = never.get();
  ck_assert_double_gt(wanted(pulse), 50);
  ck_assert_double_lt(wanted(pulse), 60.1);
}
END_TEST

static fs_event next(fs_scene* scene, double timeout) {
  fs_event event;
  OK(fs_scene_next_event(scene, timeout, &event));
  return event;
}

START_TEST(overflow) {  // older events are dropped, and counted
  const size_t many = 20000;
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  OK(fs_scene_begin(scene.get()));
  fs_object o = point("", attract(10, 3));
  o.lifetime = 1;
  for (size_t i = 0; i < many; ++i) {
    std::snprintf(o.name, sizeof o.name, "o%zu", i);
    OK(fs_object_set(scene.get(), &o));
  }
  OK(fs_scene_commit(scene.get()));
  OK(fs_scene_set_time(scene.get(), 12));
  size_t fetched = 0, dropped = 0;
  std::map<std::string, int> seen;
  for (fs_event e = next(scene.get(), 0); e.kind != FS_EVENT_NONE; e = next(scene.get(), 0)) {
    if (e.kind == FS_EVENT_EXPIRED) {
      ++fetched;
      ck_assert_int_eq(++seen[e.name], 1);
    }
    if (e.kind == FS_EVENT_OVERFLOW) dropped += static_cast<size_t>(e.value);
  }
  ck_assert_uint_eq(fetched + dropped, many);
  std::printf("  events: %zu kept, %zu dropped and counted\n", fetched, dropped);
}
END_TEST

// Time: the clock, streams of moves, lifetimes.

// A scene on a clock told by the test, with one object whose place can be felt.
struct Watched {
  Scene scene = make_scene();
  Tool tool = make_tool(scene.get());

  explicit Watched(double time) {
    tell(time);
    set(0);
  }
  void tell(double time) { OK(fs_scene_set_time(scene.get(), time)); }
  void set(double x) {
    fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
    o.front = attract(1, 1e9);
    o.pose = at(x, 0, 0);
    OK(fs_object_set(scene.get(), &o));
  }
  void move(double x, double time) {
    const fs_pose pose = at(x, 0, 0);
    OK(fs_object_move(scene.get(), "a", &pose, nullptr, time));
  }
  // Where the object is along x at `time`: the hand at (0, 0, 1) is drawn by 1 N for each metre.
  double where(double time) { return force_at(tool.get(), {0, 0, 1}, time).x; }
};

START_TEST(a_stream_of_moves) {  // 25 Hz, as applications are
  Watched w(10);
  for (int k = 1; k <= 50; ++k) {
    w.move(0.3 * 0.04 * k, 10 + 0.04 * k);
    EXPECT_NEAR(w.where(10 + 0.04 * k + 0.039), 0.3 * (0.04 * k + 0.039), 1e-9);
  }
}
END_TEST

START_TEST(a_fast_stream_of_moves) {  // 2 kHz: every one within 1 ms of the one before
  Watched w(10);
  for (int k = 1; k <= 1000; ++k) w.move(0.3 * 0.0005 * k, 10 + 0.0005 * k);
  const double end = 10.5;
  // Still 0.3 m/s, for twice the time between two of them at least.
  EXPECT_NEAR(w.where(end + 0.001), 0.3 * 0.501, 1e-5);
}
END_TEST

// From one end of the world to the other within a moment: no motion, and no number that is too large.
START_TEST(jumps_make_no_twist) {
  const Scene scene = make_scene();
  OK(fs_scene_set_time(scene.get(), 10));
  fs_object o = fs_object_init("o", FS_PRIMITIVE_POINT);
  o.pose = at(-1e15, 0, 0);
  OK(fs_object_set(scene.get(), &o));
  const fs_pose far = at(1e15, 0, 0);
  OK(fs_object_move(scene.get(), "o", &far, nullptr, 10.01));
  fs_object got = fs_object_init("o", FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene.get(), "o", &got));
  EXPECT_VECTOR(got.pose.position, far.position, 0);
  EXPECT_VECTOR(got.twist.linear, (fs_vec3{}), 0);
  fs_object_release(&got);
}
END_TEST

START_TEST(moves_of_one_instant) {  // within 1 ms the later replaces the earlier
  for (double gap : {0.0, 1e-6, 0.0005, 0.0009}) {
    Watched w(10);
    w.move(77, 10.04);
    w.move(0.04 + gap, 10.04 + gap);  // from the set at 10: 1 m/s
    EXPECT_NEAR(w.where(10.06), 0.06, 1e-9);
    EXPECT_NEAR(w.where(11), 0.04 + gap + 2 * (0.04 + gap), 1e-9);
  }
  Watched w(10);
  w.move(1, 10.0005);  // replaces the set: there is nothing before
  EXPECT_NEAR(w.where(10.05), 1, 1e-12);
  w.move(1.05, 10.0505);
  EXPECT_NEAR(w.where(10.06), 1.0595, 1e-9);
}
END_TEST

START_TEST(the_clock) {
  const Scene scene = make_scene();
  timespec before{}, after{};
  clock_gettime(CLOCK_MONOTONIC, &before);
  const double t = now(scene.get());
  clock_gettime(CLOCK_MONOTONIC, &after);
  ck_assert_double_ge(t, before.tv_sec + 1e-9 * before.tv_nsec);
  ck_assert_double_le(t, after.tv_sec + 1e-9 * after.tv_nsec + 1e-6);
  ck_assert_double_ge(now(scene.get()), t);
  for (double bad : {0.0, -1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_set_time(scene.get(), bad), "time");
  }
  OK(fs_scene_set_time(scene.get(), 123.5));
  ck_assert_double_eq(now(scene.get()), 123.5);  // what the caller says, until it says more
  OK(fs_scene_set_time(scene.get(), 124));
  ck_assert_double_eq(now(scene.get()), 124);
}
END_TEST

START_TEST(lifetimes) {  // without a servo it is there or not
  Watched w(10);
  fs_object o = fs_object_init("a", FS_PRIMITIVE_POINT);
  o.front = attract(1, 1e9);
  o.pose = at(1, 0, 0);
  o.lifetime = 0.5;
  OK(fs_object_set(w.scene.get(), &o));
  w.tell(10.4);
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
  w.move(2, FS_NOW);  // from here it counts anew
  w.tell(10.8);
  EXPECT_NEAR(w.where(FS_NOW), 2, 0.9);
  w.tell(11);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  ck_assert_double_eq(report_of(w.scene.get(), "a").weight, 0);  // it stays, at weight 0
  w.tell(12);
  w.move(3, FS_NOW);
  EXPECT_NEAR(w.where(FS_NOW), 3, 1e-12);
  ck_assert_double_eq(report_of(w.scene.get(), "a").weight, 1);
  w.tell(12.6);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  OK(fs_object_change(w.scene.get(), &o, FS_PART_PROFILES));
  EXPECT_NEAR(w.where(FS_NOW), 3, 1e-12);
  w.tell(13.2);
  EXPECT_NEAR(w.where(FS_NOW), 0, 0);
  OK(fs_object_set(w.scene.get(), &o));
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
  o.lifetime = 0;
  OK(fs_object_change(w.scene.get(), &o, FS_PART_OTHER));
  w.tell(1e6);
  EXPECT_NEAR(w.where(FS_NOW), 1, 1e-12);
}
END_TEST

int main() {
  Suite* suite = suite_create("object");
  add_case(suite, "objects", {got_handles_live_until_released, bad_moves, order_of_destruction_is_free});
  add_case(suite, "refusals", {names, bad_fields_are_refused_by_name, edges_of_what_is_good, zeros_are_the_identity,
                               struct_sizes, contacts_are_kept});
  add_case(suite, "base", {base, pose_from_z, tool_and_frame});
  add_case(suite, "reports", {without_a_servo, stiffness_wanted, what_jumps, overflow});
  add_case(suite, "time", {a_stream_of_moves, a_fast_stream_of_moves, jumps_make_no_twist, moves_of_one_instant, the_clock,
                           lifetimes});
  return run_suite(suite);
}
