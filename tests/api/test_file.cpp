// Scenes as files: a saved scene comes back bit for bit; a bad file loads nothing, and the error sentence says what is
// wrong and where.
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;
namespace files = std::filesystem;

static std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}
static void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

static void expect_same_profile(const fs_profile& a, const fs_profile& b) {
  ck_assert_int_eq(a.kind, b.kind);
  ck_assert_int_eq(a.sense, b.sense);
  ck_assert(a.gain == b.gain && a.offset == b.offset && a.width == b.width && a.limit == b.limit && a.reach == b.reach);
  ck_assert_int_eq(a.curve != nullptr, b.curve != nullptr);
  if (!a.curve) return;
  const char *first = fs_curve_get_expression(a.curve), *second = fs_curve_get_expression(b.curve);
  if (first || second) {
    ck_assert_str_eq(first, second);
    return;
  }
  size_t n = 0, m = 0;
  double step = 0, other_step = 0;
  const double *x = fs_curve_get_table(a.curve, &n, &step), *y = fs_curve_get_table(b.curve, &m, &other_step);
  ck_assert_uint_eq(n, m);
  ck_assert(step == other_step);
  ck_assert_int_eq(std::memcmp(x, y, n * sizeof *x), 0);
}

// Everything that a file holds; time and twist, which belong to a moment, are not saved.
static void expect_same_objects(fs_scene* a, fs_scene* b) {
  std::vector<fs_report> reports(object_count(a));
  size_t count = 0;
  OK(fs_scene_get_reports(a, reports.data(), reports.size(), &count));
  ck_assert_uint_eq(object_count(b), count);
  for (const fs_report& report : reports) {
    fs_object x = fs_object_init("", FS_PRIMITIVE_POINT), y = x;
    OK(fs_object_get(a, report.name, &x));
    OK(fs_object_get(b, report.name, &y));
    ck_assert_int_eq(x.primitive, y.primitive);
    ck_assert_int_eq(std::memcmp(&x.pose.position, &y.pose.position, sizeof x.pose.position), 0);
    EXPECT_NEAR(x.pose.orientation.w, y.pose.orientation.w, 0);
    EXPECT_NEAR(x.pose.orientation.x, y.pose.orientation.x, 0);
    expect_same_profile(x.front, y.front);
    expect_same_profile(x.back, y.back);
    ck_assert(x.damping == y.damping && x.lifetime == y.lifetime && x.tool_points == y.tool_points);
    ck_assert_int_eq(x.enabled, y.enabled);
    if (x.shape) {
      size_t n = 0, m = 0;
      const fs_vec3 *p = fs_shape_get_points(x.shape, &n), *q = fs_shape_get_points(y.shape, &m);
      ck_assert_uint_eq(n, m);
      ck_assert_int_eq(std::memcmp(p, q, n * sizeof *p), 0);
      const uint32_t *t = fs_shape_get_triangles(x.shape, &n), *u = fs_shape_get_triangles(y.shape, &m);
      ck_assert_uint_eq(n, m);
      if (t) ck_assert_int_eq(std::memcmp(t, u, 3 * n * sizeof *t), 0);
      fs_shape_info first = fs_shape_info_init(), second = first;
      OK(fs_shape_get_info(x.shape, &first));
      OK(fs_shape_get_info(y.shape, &second));
      ck_assert_int_eq(first.closed, second.closed);
    }
    fs_object_release(&x);
    fs_object_release(&y);
  }
}

static void expect_same_field(fs_scene* a, fs_scene* b, double half) {
  Random random(1);
  std::vector<fs_vec3> places(200), first(200), second(200);
  for (fs_vec3& x : places) x = random.in_box(half);
  OK(fs_evaluate_field(a, nullptr, FS_NOW, places.data(), places.size(), first.data()));
  OK(fs_evaluate_field(b, nullptr, FS_NOW, places.data(), places.size(), second.data()));
  ck_assert_int_eq(std::memcmp(first.data(), second.data(), first.size() * sizeof first[0]), 0);
}

START_TEST(all_scenes_come_back) {
  const Folder folder;
  for (const Named& named : all_scenes()) {
    const Content content = named.build();
    const Scene scene = make_scene(), loaded = make_scene();
    fill(scene.get(), content);
    const std::string path = folder / (std::string(named.name) + ".json").c_str();
    OK(fs_scene_save(scene.get(), path.c_str()));
    OK(fs_scene_load(loaded.get(), path.c_str()));
    expect_same_objects(scene.get(), loaded.get());
    if (std::string(named.name) != "moving") expect_same_field(scene.get(), loaded.get(), 0.1);
  }
}
END_TEST

START_TEST(every_field_comes_back) {
  const Folder folder;
  const Scene scene = make_scene(), loaded = make_scene();
  Content content;
  const std::vector<fs_vec3> line{{1.0 / 3, -2e-300, 1e15}, {0, 5e-324, -0.1}, {0.1, 0.2, 0.3}};
  fs_object& o = content.add_shape("a \"name\" with \\ and \xc3\xa9", make_polyline(line.data(), 3, true));
  o.pose = {{1.0 / 3, 1e-17, -1e15}, turn({1, 2, 3}, 2.5)};
  const double table[]{0.1, 1.0 / 3, 0, 1e-300};
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1.0 / 7, 0, 1e-3);
  o.front.curve = content.keep(make_table(table, 4, 1.0 / 3), {});
  o.front.reach = 0.1 + 0.2;
  o.damping = 0.7;
  o.lifetime = 1e9;
  o.tool_points = 0x80000001u;
  o.enabled = false;
  if (has_expressions()) {
    fs_object& e = content.add("e", FS_PRIMITIVE_PLANE);
    e.back = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 2, 0, 3);
    e.back.curve = content.keep(make_expression("3*(1+sin(12*t))*exp(-d/0.01)"), {});
  }
  fill(scene.get(), content);
  fs_frame frame = fs_frame_init(), got;
  frame.pose = {{0.1, 1.0 / 3, -7}, turn({3, 1, 2}, 1)};
  frame.scale = 1.0 / 3;
  frame.force_scale = 0.7;
  OK(fs_scene_set_frame(scene.get(), &frame));
  const fs_vec3 tool[]{{1.0 / 3, 0, 0}, {0, 1e-9, 0}};
  OK(fs_scene_set_tool(scene.get(), tool, 2));
  const std::string path = folder / "scene.json";
  OK(fs_scene_save(scene.get(), path.c_str()));
  OK(fs_scene_load(loaded.get(), path.c_str()));
  expect_same_objects(scene.get(), loaded.get());
  OK(fs_scene_get_frame(scene.get(), nullptr, &frame));
  OK(fs_scene_get_frame(loaded.get(), nullptr, &got));
  ck_assert_int_eq(std::memcmp(&frame, &got, sizeof got), 0);
  fs_vec3 points[2]{};
  size_t count = 0;
  OK(fs_scene_get_tool(loaded.get(), points, 2, &count));
  ck_assert_uint_eq(count, 2);
  ck_assert_int_eq(std::memcmp(points, tool, sizeof tool), 0);
  // Saving again gives the same text.
  const std::string again = folder / "again.json";
  OK(fs_scene_save(loaded.get(), again.c_str()));
  ck_assert(text_of(again) == text_of(path));
}
END_TEST

START_TEST(a_start_goes_on) {  // whatever time the clock of the loading machine shows
  const Folder folder;
  const std::string path = folder / "s.json", edited = folder / "t.json";
  const Scene scene = make_scene(), loaded = make_scene();
  OK(fs_scene_set_time(scene.get(), 1000.25));
  fs_object o = fs_object_init("given", FS_PRIMITIVE_POINT);
  o.start = 990;
  OK(fs_object_set(scene.get(), &o));
  o = fs_object_init("later", FS_PRIMITIVE_POINT);
  o.start = 1007.5;
  OK(fs_object_set(scene.get(), &o));
  o = fs_object_init("none", FS_PRIMITIVE_POINT);
  OK(fs_object_set(scene.get(), &o));
  OK(fs_scene_save(scene.get(), path.c_str()));
  ck_assert_ptr_nonnull(std::strstr(text_of(path).c_str(), "\"age\": 10.25"));
  ck_assert_ptr_null(std::strstr(text_of(path).c_str(), "\"start\""));
  const auto start_of = [&](const char* name) {
    fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
    OK(fs_object_get(loaded.get(), name, &got));
    fs_object_release(&got);
    return got.start;
  };
  for (const double now : {5.0, 10.25, 1e6}) {  // after a new start of the machine; where start comes to 0; days later
    OK(fs_scene_clear(loaded.get()));
    OK(fs_scene_set_time(loaded.get(), now));
    OK(fs_scene_load(loaded.get(), path.c_str()));
    EXPECT_NEAR(start_of("given"), now - 10.25, 1e-300);  // 0 would mean: not given
    EXPECT_NEAR(start_of("later"), now + 7.25, 0);
    EXPECT_NEAR(start_of("none"), now, 0);
    OK(fs_scene_save(loaded.get(), edited.c_str()));
    ck_assert(text_of(edited) == text_of(path));
  }
  // A file of an earlier version has the start itself.
  write_text(edited, R"({"forceserver": "scene", "version": 1,
                         "objects": [{"name": "given", "primitive": "point", "start": 4.5}]})");
  OK(fs_scene_load(loaded.get(), edited.c_str()));
  EXPECT_NEAR(start_of("given"), 4.5, 0);
  write_text(edited, R"({"forceserver": "scene", "version": 1,
                         "objects": [{"name": "given", "primitive": "point", "start": 4.5, "age": 1}]})");
  EXPECT_SENTENCE(FS_ERROR_PARSE, fs_scene_load(loaded.get(), edited.c_str()), "both \"start\" and \"age\"");
  EXPECT_NEAR(start_of("given"), 4.5, 0);
}
END_TEST

START_TEST(a_moving_object_keeps_its_place) {  // from before it is saved until after it is loaded, and moves on as it would
  const Folder folder;
  const std::string path = folder / "s.json";
  const auto place = [](const Scene& scene) {  // of an object that draws with 100 N/m to where it is
    const fs_vec3 x{};
    fs_vec3 force{};
    OK(fs_evaluate_field(scene.get(), "h", FS_NOW, &x, 1, &force));
    return 0.01 * force;
  };
  for (const bool is_worked_out : {false, true}) {
    for (const double since : {0.0, 0.02, 0.05, 0.3, -0.05}) {  // s, from the time of the pose to the saving
      const Scene scene = make_scene(), loaded = make_scene();
      fs_object o = fs_object_init("h", FS_PRIMITIVE_POINT);
      o.front = attract(100, 100);
      o.twist = {{0.5, 0, 0}, {0, 0, 1}};
      o.time = 1000;
      OK(fs_scene_set_time(scene.get(), 1000));
      OK(fs_object_set(scene.get(), &o));
      if (is_worked_out) {  // from a stream of 50 Hz: for 40 ms after the last move
        const fs_pose from = at(0.1, 0, 0), to = at(0.12, 0, 0);
        OK(fs_object_move(scene.get(), "h", &from, nullptr, 999.98));
        OK(fs_object_move(scene.get(), "h", &to, nullptr, 1000));
      }
      OK(fs_scene_set_time(scene.get(), 1000 + since));
      OK(fs_scene_save(scene.get(), path.c_str()));
      OK(fs_scene_set_time(loaded.get(), 7));  // another machine
      OK(fs_scene_load(loaded.get(), path.c_str()));
      EXPECT_VECTOR(place(loaded), place(scene), 1e-9);
      if (is_worked_out && since < 0.04) continue;  // it may go on for longer
      for (const double later : {0.03, 0.2}) {
        OK(fs_scene_set_time(scene.get(), 1000 + since + later));
        OK(fs_scene_set_time(loaded.get(), 7 + later));
        EXPECT_VECTOR(place(loaded), place(scene), 1e-9);
      }
    }
  }
}
END_TEST

START_TEST(odd_tables) {  // what counts as 0 in a table may be saved too
  const Folder folder;
  const Scene scene = make_scene(), loaded = make_scene();
  const double table[]{1, NAN, INFINITY, -1, 2};
  Content content;
  fs_object& o = content.add("odd", FS_PRIMITIVE_POINT);
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 9);
  o.front.curve = content.keep(make_table(table, 5, 0.01), {});
  fill(scene.get(), content);
  OK(fs_scene_save(scene.get(), (folder / "odd.json").c_str()));
  OK(fs_scene_load(loaded.get(), (folder / "odd.json").c_str()));
  expect_same_field(scene.get(), loaded.get(), 0.05);
}
END_TEST

START_TEST(load_adds_and_replaces) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  Content content = hello();
  content.add("second", FS_PRIMITIVE_PLANE).front = attract(50, 1);
  const Scene scene = make_scene(), other = make_scene();
  fill(scene.get(), content);
  OK(fs_scene_save(scene.get(), path.c_str()));
  fs_object o = fs_object_init("own", FS_PRIMITIVE_POINT);
  OK(fs_object_set(other.get(), &o));
  o = fs_object_init("spring", FS_PRIMITIVE_PLANE);
  OK(fs_object_set(other.get(), &o));
  OK(fs_scene_load(other.get(), path.c_str()));
  ck_assert_uint_eq(object_count(other.get()), 3);
  ck_assert_int_eq(report_of(other.get(), "spring").primitive, FS_PRIMITIVE_POINT);
  // Loading as part of a group.
  const Scene grouped = make_scene();
  const Tool tool = make_tool(grouped.get());
  OK(fs_scene_begin(grouped.get()));
  OK(fs_scene_load(grouped.get(), path.c_str()));
  ck_assert_uint_eq(object_count(grouped.get()), 2);
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{}), 0);
  OK(fs_scene_cancel(grouped.get()));
  ck_assert_uint_eq(object_count(grouped.get()), 0);
  OK(fs_scene_begin(grouped.get()));
  OK(fs_scene_load(grouped.get(), path.c_str()));
  OK(fs_scene_commit(grouped.get()));
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), (fs_vec3{-2, 0, 0}), 1e-12);
}
END_TEST

START_TEST(shared_shapes_are_one_file) {
  const Folder folder;
  const Scene scene = make_scene(), loaded = make_scene();
  Content content = ball(200);
  fs_object twin = content.objects[0];
  std::strcpy(twin.name, "twin");
  content.objects.push_back(twin);
  fill(scene.get(), content);
  OK(fs_scene_save(scene.get(), (folder / "s.json").c_str()));
  size_t ply_files = 0;
  for (const auto& entry : files::directory_iterator(folder.path)) ply_files += entry.path().extension() == ".ply";
  ck_assert_uint_eq(ply_files, 1);
  // The folder may be moved: names in the file are relative to it.
  const Folder elsewhere;
  files::copy(folder.path, elsewhere.path, files::copy_options::recursive);
  files::remove_all(folder.path);
  OK(fs_scene_load(loaded.get(), (elsewhere / "s.json").c_str()));
  fs_object a = fs_object_init("", FS_PRIMITIVE_POINT), b = a;
  OK(fs_object_get(loaded.get(), "ball", &a));
  OK(fs_object_get(loaded.get(), "twin", &b));
  ck_assert_ptr_eq(a.shape, b.shape);
  fs_object_release(&a);
  fs_object_release(&b);
}
END_TEST

START_TEST(meshes_on_the_map) {  // UTM coordinates keep their last bit
  const Folder folder;
  const Scene scene = make_scene(), loaded = make_scene();
  const fs_vec3 place{448262.12345678901, 4600000.9876543210, 1200.1234567890123};
  Content content;
  content.add_shape("ground", make_mesh(moved(terrain_mesh(50, 5, 500), at(place)))).back = attract(100, 5);
  fill(scene.get(), content);
  OK(fs_scene_save(scene.get(), (folder / "map.json").c_str()));
  OK(fs_scene_load(loaded.get(), (folder / "map.json").c_str()));
  expect_same_objects(scene.get(), loaded.get());
}
END_TEST

static std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  ck_assert_msg(at != std::string::npos, "the file has no %s", from.c_str());
  return text.replace(at, from.size(), to);
}

START_TEST(bad_files_load_nothing) {
  const Folder folder;
  const std::string good = folder / "good.json", bad = folder / "bad.json";
  const Scene writer = make_scene();
  Content content = hello();
  content.add("second", FS_PRIMITIVE_POINT).front = attract(50, 1);
  content.add_shape("third", make_mesh(box_mesh({1, 1, 1}))).front = attract(20, 1);
  fill(writer.get(), content);
  OK(fs_scene_save(writer.get(), good.c_str()));
  const std::string text = text_of(good);
  const std::string ply = [&] {
    for (const auto& entry : files::directory_iterator(folder.path)) {
      if (entry.path().extension() == ".ply") return entry.path().filename().string();
    }
    return std::string();
  }();
  struct Bad {
    std::string text;
    const char* names;  // what the sentence must contain
  };
  const Bad cases[]{
      {"", "1"},
      {"{", "1"},
      {"[]", ""},
      {"not json", "1"},
      {text.substr(0, text.size() / 2), "line"},
      {text + "x", "line"},
      {replaced(text, "50.0", "-50.0"), "second"},            // refused as fs_object_set does
      {replaced(text, "50.0", "\"fifty\""), "second"},
      {replaced(text, "50.0", "1e999"), ""},
      {replaced(text, "50.0", "null"), "second"},
      {replaced(text, "linear_increasing", "linear_whatever"), "spring"},
      {replaced(text, "\"attractive\"", "\"both\""), "spring"},
      {replaced(text, "\"gain\"", "\"gian\""), "gian"},        // an unknown key
      {replaced(text, "\"second\"", "\"sec/ond\""), "name"},
      {replaced(text, "\"second\"", "\"spring\""), "spring"},  // the name twice
      {replaced(text, "\"second\"", '"' + std::string(64, 'n') + '"'), "name"},
      {replaced(text, "\"primitive\": \"mesh\"", "\"primitive\": \"plane\""), "third"},
      {replaced(text, ply, "no-such.ply"), "third"},
      {replaced(text, "\"version\": 1", "\"version\": 2"), "version"},
      {replaced(text, "\"scale\": 1.0", "\"scale\": -1.0"), "scale"},
  };
  const Scene scene = make_scene();
  fs_object own = fs_object_init("own", FS_PRIMITIVE_POINT), spring = fs_object_init("spring", FS_PRIMITIVE_PLANE);
  OK(fs_object_set(scene.get(), &own));
  OK(fs_object_set(scene.get(), &spring));
  const uint64_t revision = report_of(scene.get(), "spring").revision;
  for (size_t i = 0; i < std::size(cases); ++i) {
    write_text(bad, cases[i].text);
    const fs_status status = fs_scene_load(scene.get(), bad.c_str());
    ck_assert_msg(status == FS_ERROR_PARSE || status == FS_ERROR_INVALID || status == FS_ERROR_VERSION ||
                      (status == FS_ERROR_NOT_FOUND && std::strstr(cases[i].text.c_str(), "no-such.ply")),
                  "case %zu: %s", i, fs_status_name(status));
    ck_assert_msg(std::strstr(fs_last_error(), cases[i].names), "case %zu: \"%s\" does not name %s", i, fs_last_error(),
                  cases[i].names);
    ck_assert_msg(object_count(scene.get()) == 2, "case %zu (\"%s\") leaves %zu objects", i, fs_last_error(),
                  object_count(scene.get()));
    ck_assert_int_eq(report_of(scene.get(), "spring").primitive, FS_PRIMITIVE_PLANE);
    ck_assert_uint_eq(report_of(scene.get(), "spring").revision, revision);
    fs_frame frame;
    OK(fs_scene_get_frame(scene.get(), nullptr, &frame));
    ck_assert_double_eq(frame.scale, 1);
  }
  OK(fs_scene_load(scene.get(), good.c_str()));
  ck_assert_uint_eq(object_count(scene.get()), 4);
}
END_TEST

START_TEST(contacts_in_files) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  const Scene scene = make_scene();
  write_text(path, R"({"forceserver": "scene", "version": 1, "objects": [
    {"name": "good", "primitive": "point"},
    {"name": "solid", "primitive": "plane",
     "contact": {"keep": "front", "stiffness": 700, "limit": 5.0, "damping": 2, "friction": 0.25}}]})");
  OK(fs_scene_load(scene.get(), path.c_str()));
  OK(fs_scene_save(scene.get(), path.c_str()));
  const Scene again = make_scene();
  OK(fs_scene_load(again.get(), path.c_str()));
  fs_object got = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
  OK(fs_object_get(again.get(), "solid", &got));
  const fs_contact wanted{FS_KEEP_FRONT, 0, 700, 5, 2, 0.25, {}};
  ck_assert(std::memcmp(&got.contact, &wanted, sizeof wanted) == 0);
  fs_object_release(&got);
}
END_TEST

START_TEST(places_that_are_not_there) {
  const Folder folder;
  const Scene scene = make_scene();
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_load(scene.get(), (folder / "none.json").c_str()), "none.json");
  fill(scene.get(), hello());
  EXPECT(FS_ERROR_IO, fs_scene_save(scene.get(), (folder / "no/such/folder/s.json").c_str()));
  EXPECT(FS_ERROR_IO, fs_scene_save(scene.get(), folder.path.c_str()));  // a folder
  const fs_status status = fs_scene_load(scene.get(), folder.path.c_str());
  ck_assert(status == FS_ERROR_IO || status == FS_ERROR_PARSE);
  ck_assert_uint_eq(object_count(scene.get()), 1);
  ck_assert_int_lt(fs_scene_save(scene.get(), ""), 0);
  // Anything that is not a regular file is refused at once.
  const std::string pipe = folder / "pipe.json";
  ck_assert_int_eq(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_SENTENCE(FS_ERROR_IO, fs_scene_load(scene.get(), pipe.c_str()), "is a pipe");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_scene_save(scene.get(), pipe.c_str()), "is a pipe");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_scene_load(scene.get(), "/dev/zero"), "is a device");
}
END_TEST

START_TEST(a_full_disk_leaves_the_old_file) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  const Scene scene = make_scene();
  fill(scene.get(), hello());
  OK(fs_scene_save(scene.get(), path.c_str()));
  const std::string before = text_of(path);
  size_t files_before = 0, files_after = 0;
  for (const auto& entry : files::directory_iterator(folder.path)) files_before += entry.is_regular_file();

  rlimit old_limit{};
  getrlimit(RLIMIT_FSIZE, &old_limit);
  rlimit small = old_limit;
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t bytes : {rlim_t{1}, rlim_t{4096}, rlim_t{20000}}) {
    // The scene's text, its mesh or both are too long for the disk.
    for (const Content& content : {crowd(500), ball(2000)}) {
      OK(fs_scene_clear(scene.get()));
      fill(scene.get(), content);
      small.rlim_cur = bytes;
      setrlimit(RLIMIT_FSIZE, &small);
      const fs_status status = fs_scene_save(scene.get(), path.c_str());
      setrlimit(RLIMIT_FSIZE, &old_limit);
      ck_assert_msg(status == FS_ERROR_IO, "%s with %lu bytes", fs_status_name(status), (unsigned long)bytes);
      ck_assert_msg(std::strstr(fs_last_error(), "large") || std::strstr(fs_last_error(), "space"),
                    "\"%s\" does not have the system's reason", fs_last_error());
      ck_assert(text_of(path) == before);
    }
  }
  std::signal(SIGXFSZ, old_handler);
  for (const auto& entry : files::directory_iterator(folder.path)) files_after += entry.is_regular_file();
  ck_assert_uint_eq(files_after, files_before);  // no temporary file is left
  const Scene loaded = make_scene();
  OK(fs_scene_load(loaded.get(), path.c_str()));
  ck_assert_uint_eq(object_count(loaded.get()), 1);
}
END_TEST

int main() {
  Suite* suite = suite_create("file");
  add_case(suite, "round trips", {all_scenes_come_back, every_field_comes_back, a_start_goes_on, a_moving_object_keeps_its_place, odd_tables,
                                  load_adds_and_replaces, shared_shapes_are_one_file, meshes_on_the_map});
  add_case(suite, "refusals", {bad_files_load_nothing, contacts_in_files, places_that_are_not_there,
                               a_full_disk_leaves_the_old_file});
  return run_suite(suite);
}
