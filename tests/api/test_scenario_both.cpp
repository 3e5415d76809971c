// The same script on a scene in this process and on one that is connected to a server gives the same statuses, error
// sentences, getter results and forces. Random scripts, bad input, files, an application's own tools.
#include <algorithm>
#include <limits>
#include <sstream>

#include "api/world.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();

// ---------------------------------------------------------------------------------------------------------- scripts

// What a script saw, as text that can be compared.
struct Trace {
  struct Number {
    std::string what;
    double value;
  };
  std::vector<std::string> lines;
  std::vector<Number> numbers;  // numbers that may differ in the last bits

  void say(const std::string& line) { lines.push_back(line); }
  void say(const std::string& call, fs_status status) {
    say(call + ": " + fs_status_name(status) + (status < 0 ? std::string(", ") + fs_last_error() : ""));
  }
  void bits(const std::string& what, std::initializer_list<double> values) {
    std::ostringstream line;
    line << what << std::hexfloat;
    for (const double value : values) line << ' ' << value;
    say(line.str());
  }
  void near(const std::string& what, double value) { numbers.push_back({what, value}); }
  void near(const std::string& what, fs_vec3 v) {
    near(what + ".x", v.x);
    near(what + ".y", v.y);
    near(what + ".z", v.z);
  }
};
static void expect_same(const Trace& a, const Trace& b) {
  for (size_t i = 0; i < std::min(a.lines.size(), b.lines.size()); ++i) {
    ck_assert_msg(a.lines[i] == b.lines[i], "here:   %s\nserver: %s", a.lines[i].c_str(), b.lines[i].c_str());
  }
  ck_assert_uint_eq(a.lines.size(), b.lines.size());
  ck_assert_uint_eq(a.numbers.size(), b.numbers.size());
  double scale = 1;
  for (const auto& [what, x] : a.numbers) scale = std::fmax(scale, std::isfinite(x) ? std::fabs(x) : 0);
  for (size_t i = 0; i < a.numbers.size(); ++i) {
    const double x = a.numbers[i].value, y = b.numbers[i].value;
    ck_assert_msg(x == y || std::fabs(x - y) <= 1e-12 * scale, "%s is %.17g here and %.17g at the server",
                  a.numbers[i].what.c_str(), x, y);
  }
}

static void tell_profile(Trace& trace, const fs_profile& p) {
  size_t count = 0;
  double step = 0;
  const double* table = p.curve ? fs_curve_get_table(p.curve, &count, &step) : nullptr;
  trace.bits("  profile", {double(p.kind), double(p.sense), p.gain, p.offset, p.width, p.limit, p.reach, step});
  for (size_t i = 0; i < count; ++i) trace.bits("    entry", {table[i]});
}
// Everything that getters return about the scene's own objects, by name. times: including the times and twists that the
// scene worked out.
static void tell(Trace& trace, fs_scene* scene, bool with_times) {
  std::vector<fs_report> reports = own_reports_of(scene);
  std::sort(reports.begin(), reports.end(),
            [](const fs_report& a, const fs_report& b) { return std::strcmp(a.name, b.name) < 0; });
  for (const fs_report& r : reports) {
    trace.say(std::string("object ") + r.name + " " + std::to_string(r.primitive) + " " + std::to_string(r.state));
    trace.bits("  report", {r.weight, r.stiffness_wanted, r.stiffness_applied});
    const std::string name = r.name;
    trace.near(name + ", distance", r.distance);
    trace.near(name + ", point", r.point);
    trace.near(name + ", force", r.wrench.force);
    trace.near(name + ", torque", r.wrench.torque);
    const Got o(scene, r.name);
    const fs_quat q = o->pose.orientation;
    trace.bits("  pose", {o->pose.position.x, o->pose.position.y, o->pose.position.z, q.w, q.x, q.y, q.z});
    trace.bits("  twist", {o->twist.linear.x, o->twist.linear.y, o->twist.linear.z, o->twist.angular.x,
                           o->twist.angular.y, o->twist.angular.z});
    if (with_times) trace.bits("  times", {o->time, o->start});
    trace.bits("  other", {o->lifetime, o->damping, double(o->tool_points), double(o->enabled), o->contact.stiffness,
                           o->contact.limit, o->contact.damping, o->contact.friction});
    tell_profile(trace, o->front);
    tell_profile(trace, o->back);
    if (!o->shape) continue;
    size_t points = 0, triangles = 0;
    fs_shape_get_points(o->shape, &points);
    fs_shape_get_triangles(o->shape, &triangles);
    trace.bits("  shape", {double(points), double(triangles)});
  }
  const fs_frame f = frame_of(scene);
  const fs_quat q = f.pose.orientation;
  trace.bits("frame", {f.pose.position.x, f.pose.position.y, f.pose.position.z, q.w, q.x, q.y, q.z, f.scale,
                       f.force_scale});
  for (const fs_vec3 point : tool_of(scene)) trace.bits("tool", {point.x, point.y, point.z});
}

// Any call, valid or not, in any order. Times are given and lie in the past, so that nothing depends on when it runs.
static Trace random_script(int variant, uint64_t seed) {
  Random random(seed);
  RandomOptions options;
  options.count = 40;
  options.mesh_triangles = 40;
  options.time = -500;
  options.moves = options.masks = options.disables = options.damps = true;
  const Content content = random_content(random, options);
  Trace trace;
  World w(variant);
  double time = -400;
  bool is_group = false;
  int views = 0;  // new frames and tools: at a server, which ticks between them, they may fade one after the other
  for (int round = 0; round < 12; ++round) {
    const uint64_t count = 1 + random.below(15);
    for (uint64_t k = 0; k < count; ++k) {
      time += random.coin(0.5) ? 0.02 : 0.5;
      fs_object o = content.objects[random.below(content.objects.size())];
      std::snprintf(o.name, sizeof o.name, "o%d", static_cast<int>(random.below(10)));
      o.time = time;
      switch (random.below(13)) {
        case 0:
        case 1:
        case 2:
        case 3: trace.say(std::string("set ") + o.name, PATIENTLY(fs_object_set(w.scene, &o))); break;
        case 4: {
          const auto parts = static_cast<uint32_t>(random.below(32));
          trace.say("change " + std::to_string(parts) + " of " + o.name, PATIENTLY(fs_object_change(w.scene, &o, parts)));
          break;
        }
        case 5:
        case 6: {
          const fs_pose pose = random.pose(0.1);
          const fs_twist twist{random.in_box(0.1), random.in_box(1)};
          const bool is_given = random.coin();
          trace.say(std::string(is_given ? "move " : "follow ") + o.name,
                    PATIENTLY(fs_object_move(w.scene, o.name, &pose, is_given ? &twist : nullptr, time)));
          break;
        }
        case 7: trace.say(std::string("remove ") + o.name, PATIENTLY(fs_object_remove(w.scene, o.name))); break;
        case 8: {
          ++views;
          const fs_frame frame{random.pose(0.03), random.between(0.5, 2), random.between(0, 2), {}};
          trace.say("frame", PATIENTLY(fs_scene_set_frame(w.scene, &frame)));
          break;
        }
        case 9: {
          ++views;
          const fs_vec3 points[]{random.in_box(0.02), random.in_box(0.02), random.in_box(0.02)};
          const uint64_t used = 1 + random.below(3);
          trace.say("tool", PATIENTLY(fs_scene_set_tool(w.scene, points, used)));
          break;
        }
        case 10:
          trace.say("begin", PATIENTLY(fs_scene_begin(w.scene)));
          is_group = true;
          break;
        case 11:
          trace.say("commit", random.coin(0.8) ? PATIENTLY(fs_scene_commit(w.scene)) : PATIENTLY(fs_scene_cancel(w.scene)));
          is_group = false;
          break;
        default:
          if (random.coin(0.1)) trace.say("clear", PATIENTLY(fs_scene_clear(w.scene)));
      }
    }
    if (is_group && round % 3) trace.say("commit", PATIENTLY(fs_scene_commit(w.scene)));
    if (round % 3) is_group = false;
    w.fake.state.twist = {};
    w.fake.state.pose = random.pose(0.1);
    w.settle();
    for (int i = 0; i < views; ++i) w.settle();
    w.step(200);
    if (!is_group) views = 0;
    tell(trace, w.scene, true);
    for (int i = 0; i < 10; ++i) {
      w.fake.state.twist = {random.in_box(0.5), random.in_box(4)};
      const fs_wrench wrench = w.wrench_at(random.pose(0.1));
      trace.near("round " + std::to_string(round) + ", force", wrench.force);
      trace.near("round " + std::to_string(round) + ", torque", wrench.torque);
    }
  }
  return trace;
}
START_TEST(random_scripts) { expect_same(random_script(in_process, _i), random_script(connected, _i)); }
END_TEST

// --------------------------------------------------------------------------------------------------------- bad input

struct Bad {
  std::string what;
  std::function<fs_status(fs_scene*)> call;
};

static std::vector<Bad> bad_calls(const Content& content, const std::string& folder) {
  std::vector<Bad> out;
  const auto add = [&](const std::string& what, std::function<fs_status(fs_scene*)> call) {
    out.push_back({what, std::move(call)});
  };
  fs_shape* const line = content.shapes[0].get();
  fs_shape* const mesh = content.shapes[1].get();
  fs_curve* const curve = content.curves[0].get();

  // Bad objects: each as a new object, as a set of an existing one, and as a change of its parts.
  const std::vector<std::pair<const char*, std::function<void(fs_object&)>>> spoils{
      {"primitive", [](fs_object& o) { std::memset(&o.primitive, 9, 1); }},
      {"reserved", [](fs_object& o) { o.reserved[1] = 1; }},
      {"position", [](fs_object& o) { o.pose.position.y = NAN; }},
      {"far position", [](fs_object& o) { o.pose.position.z = 2e15; }},
      {"orientation", [](fs_object& o) { o.pose.orientation = {1, 1, 0, 0}; }},
      {"twist", [](fs_object& o) { o.twist.angular.x = infinite; }},
      {"time", [](fs_object& o) { o.time = NAN; }},
      {"start", [](fs_object& o) { o.start = infinite; }},
      {"lifetime", [](fs_object& o) { o.lifetime = -1; }},
      {"long lifetime", [](fs_object& o) { o.lifetime = 2e12; }},
      {"kind", [](fs_object& o) { std::memset(&o.front.kind, 99, 1); }},
      {"sense", [](fs_object& o) { std::memset(&o.front.sense, 7, 1); }},
      {"gain", [](fs_object& o) { o.front.gain = -1; }},
      {"gain that is none", [](fs_object& o) { o.front.gain = NAN; }},
      {"limit", [](fs_object& o) { o.front.limit = 0; }},
      {"large limit", [](fs_object& o) { o.front.limit = 1e10; }},
      {"reach", [](fs_object& o) { o.front.reach = -1; }},
      {"a second profile", [](fs_object& o) { o.back = constant(FS_SENSE_REPULSIVE, 1); }},
      {"no curve", [](fs_object& o) { o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 1); }},
      {"a curve", [curve](fs_object& o) { o.front.curve = curve; }},
      {"damping", [](fs_object& o) { o.damping = -0.1; }},
      {"no shape", [](fs_object& o) { o.primitive = FS_PRIMITIVE_MESH; }},
      {"a shape", [mesh](fs_object& o) { o.shape = mesh; }},
      {"another shape", [line](fs_object& o) { o.primitive = FS_PRIMITIVE_MESH; o.shape = line; }},
      {"keep", [](fs_object& o) { std::memset(&o.contact.keep, 9, 1); }},
      {"keep of a point", [](fs_object& o) { o.contact.keep = FS_KEEP_FRONT; o.contact.limit = 1; }},
      {"solid without a limit", [](fs_object& o) {
         o.primitive = FS_PRIMITIVE_PLANE;
         o.contact.keep = FS_KEEP_FRONT;
         o.contact.limit = 0;
       }},
      {"contact.stiffness", [](fs_object& o) { o.contact.stiffness = -1; }},
      {"contact.friction", [](fs_object& o) { o.contact.friction = 3; }},
      {"contact.reserved", [](fs_object& o) { o.contact.reserved_32 = 1; }},
      {"contact.reserved", [](fs_object& o) { o.contact.reserved[7] = 1; }},
      {"front.reserved", [](fs_object& o) { o.front.reserved[3] = NAN; }},
      {"back.reserved", [](fs_object& o) { o.back.reserved[0] = -1; }},
      {"struct_size", [](fs_object& o) { o.struct_size = 4104; }},
      {"small struct_size", [](fs_object& o) { o.struct_size = 568; }}};
  for (const auto& [what, spoil] : spoils) {
    for (const char* name : {"new", "a"}) {
      fs_object o = spring(name);
      spoil(o);
      add(std::string("set, ") + what, [o](fs_scene* s) { return fs_object_set(s, &o); });
    }
    fs_object o = spring("a");
    spoil(o);
    if (std::string_view(what) == "reserved") continue;  // it is not read
    add(std::string("change, ") + what, [o](fs_scene* s) { return fs_object_change(s, &o, 31); });
  }
  const std::string names[]{"", std::string(64, 'x'), "x/y", "/", "tab\there", "\x7f", "\xc3\x28", "\xed\xa0\x80",
                            std::string(127, 'y')};
  for (const std::string& name : names) {
    const fs_object o = spring(name.c_str());
    add("set, name", [o](fs_scene* s) { return fs_object_set(s, &o); });
    if (name.find('/') == std::string::npos) {
      add("change, name", [o](fs_scene* s) { return fs_object_change(s, &o, FS_PART_POSE); });
      add("change nothing, name", [o](fs_scene* s) { return fs_object_change(s, &o, 0); });
    }
  }
  const fs_object a = spring("a"), none = spring("none");
  add("set null", [](fs_scene* s) { return fs_object_set(s, nullptr); });
  add("change null", [](fs_scene* s) { return fs_object_change(s, nullptr, 1); });
  for (const uint32_t parts : {32u, 0x80000000u, ~0u}) {
    add("change, parts", [a, parts](fs_scene* s) { return fs_object_change(s, &a, parts); });
  }
  for (const uint32_t parts : {0u, 1u, 31u}) {
    add("change none", [none, parts](fs_scene* s) { return fs_object_change(s, &none, parts); });
  }
  // A valid part may make the object invalid as a whole.
  fs_object plane = push("line");
  fs_object other = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  other.shape = mesh;
  add("change, a mesh for a line", [other](fs_scene* s) { return fs_object_change(s, &other, FS_PART_SHAPE); });
  plane.back = plane.front;
  add("change, two sides", [plane](fs_scene* s) { return fs_object_change(s, &plane, FS_PART_PROFILES); });

  // Names that do not exist or are invalid.
  const fs_pose pose = at(0, 0, 0);
  const auto get = [](fs_scene* s, const char* name, uint32_t size) {
    fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
    o.struct_size = size;
    return fs_object_get(s, name, &o);
  };
  const auto move = [](fs_scene* s, const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
    return fs_object_move(s, name, &pose, twist, time);
  };
  for (const std::string& name : {std::string("none"), std::string(""), std::string(40, 'x'), std::string(500, 'y'),
                                  std::string("\xff"), std::string("line ")}) {
    add("get " + name, [=](fs_scene* s) { return get(s, name.c_str(), sizeof(fs_object)); });
    add("move " + name, [=](fs_scene* s) { return move(s, name.c_str(), pose, nullptr, FS_NOW); });
    add("remove " + name, [=](fs_scene* s) { return fs_object_remove(s, name.c_str()); });
    add("report " + name, [=](fs_scene* s) {
      fs_report report;
      return fs_scene_get_report(s, name.c_str(), &report);
    });
    add("field " + name, [=](fs_scene* s) {
      fs_vec3 x{}, f{};
      return fs_evaluate_field(s, name.c_str(), FS_NOW, &x, 1, &f);
    });
  }
  add("get into one that is no struct", [=](fs_scene* s) { return get(s, "a", 4104); });
  add("get into a smaller one", [=](fs_scene* s) { return get(s, "a", 568); });
  add("get null", [=](fs_scene* s) { return fs_object_get(s, "a", nullptr); });
  add("get of null", [=](fs_scene* s) { return get(s, nullptr, sizeof(fs_object)); });
  add("move null", [=](fs_scene* s) { return move(s, nullptr, pose, nullptr, FS_NOW); });
  add("move to null", [=](fs_scene* s) { return fs_object_move(s, "a", nullptr, nullptr, FS_NOW); });
  add("remove null", [=](fs_scene* s) { return fs_object_remove(s, nullptr); });
  fs_pose bad = pose;
  bad.position.x = infinite;
  add("move, position", [=](fs_scene* s) { return move(s, "a", bad, nullptr, FS_NOW); });
  bad = pose;
  bad.orientation = {0.9, 0, 0, 0};
  add("move, orientation", [=](fs_scene* s) { return move(s, "a", bad, nullptr, FS_NOW); });
  add("move none, orientation", [=](fs_scene* s) { return move(s, "none", bad, nullptr, FS_NOW); });
  bad.orientation = {NAN, 0, 0, 0};
  add("move, orientation that is none", [=](fs_scene* s) { return move(s, "a", bad, nullptr, FS_NOW); });
  fs_twist twist{};
  twist.linear.z = NAN;
  add("move, twist", [=](fs_scene* s) { return move(s, "a", pose, &twist, FS_NOW); });
  add("move, time", [=](fs_scene* s) { return move(s, "a", pose, nullptr, infinite); });

  // The scene.
  for (const double timeout : {-1.0, -1e-300, double(NAN), infinite}) {
    add("sync", [=](fs_scene* s) { return fs_scene_sync(s, timeout); });
    add("event", [=](fs_scene* s) {
      fs_event event;
      return fs_scene_next_event(s, timeout, &event);
    });
  }
  add("event null", [](fs_scene* s) { return fs_scene_next_event(s, 0, nullptr); });
  add("save", [=](fs_scene* s) { return fs_scene_save(s, (folder + "/no/such/folder.json").c_str()); });
  add("save null", [](fs_scene* s) { return fs_scene_save(s, nullptr); });
  add("load null", [](fs_scene* s) { return fs_scene_load(s, nullptr); });
  add("load nothing", [=](fs_scene* s) { return fs_scene_load(s, (folder + "/none.json").c_str()); });
  int number = 0;
  const std::string scene = R"({"forceserver": "scene", "version": )", point = R"({"name": "a", "primitive": "point"})";
  for (const std::string& text :
       {std::string(), std::string("{"), scene + "99}",
        scene + "1, \"objects\": [" + point + R"(, {"name": "b", "primitive": "point", "lifetime": -1}]})",
        scene + R"(1, "frame": {"scale": 0}, "objects": [)" + point + "]}",
        scene + R"(1, "tool": [], "objects": [)" + point + "]}"}) {
    const std::string path = folder + "/bad" + std::to_string(number++) + ".json";
    std::ofstream(path) << text;
    add("load bad" + std::to_string(number), [=](fs_scene* s) { return fs_scene_load(s, path.c_str()); });
  }
  const auto bad_frame = [&](const std::function<void(fs_frame&)>& spoil) {
    fs_frame frame = fs_frame_init();
    spoil(frame);
    add("frame", [frame](fs_scene* s) { return fs_scene_set_frame(s, &frame); });
  };
  bad_frame([](fs_frame& f) { f.scale = 0; });
  bad_frame([](fs_frame& f) { f.scale = 1e10; });
  bad_frame([](fs_frame& f) { f.scale = NAN; });
  bad_frame([](fs_frame& f) { f.force_scale = -1; });
  bad_frame([](fs_frame& f) { f.force_scale = 2e9; });
  bad_frame([](fs_frame& f) { f.pose.position.x = NAN; });
  bad_frame([](fs_frame& f) { f.pose.orientation = {2, 0, 0, 0}; });
  add("frame null", [](fs_scene* s) { return fs_scene_set_frame(s, nullptr); });
  add("get frame null", [](fs_scene* s) { return fs_scene_get_frame(s, nullptr, nullptr); });
  const std::vector<fs_vec3> points(33);
  for (const size_t count : {size_t{0}, size_t{33}, size_t{1} << 60}) {
    add("tool", [=](fs_scene* s) { return fs_scene_set_tool(s, points.data(), count); });
  }
  add("tool null", [](fs_scene* s) { return fs_scene_set_tool(s, nullptr, 1); });
  const fs_vec3 bad_points[]{{0, 0, 0}, {0, NAN, 0}};
  add("tool, points", [=](fs_scene* s) { return fs_scene_set_tool(s, bad_points, 2); });
  add("get tool null", [](fs_scene* s) {
    size_t count = 0;
    return fs_scene_get_tool(s, nullptr, 1, &count);
  });
  add("get tool, no count", [](fs_scene* s) { return fs_scene_get_tool(s, nullptr, 0, nullptr); });
  for (const double x : {-1.0, double(NAN), infinite}) {
    add("accuracy", [=](fs_scene* s) { return fs_scene_set_accuracy(s, x); });
    add("stiffness", [=](fs_scene* s) { return fs_scene_set_max_stiffness(s, x); });
  }
  add("time null", [](fs_scene* s) { return fs_scene_get_time(s, nullptr); });
  add("reports, no count", [](fs_scene* s) { return fs_scene_get_reports(s, nullptr, 0, nullptr); });
  add("reports null", [](fs_scene* s) {
    size_t count = 0;
    return fs_scene_get_reports(s, nullptr, 1, &count);
  });
  add("motions, no count", [](fs_scene* s) { return fs_scene_get_motions(s, nullptr, nullptr, 0, nullptr); });
  add("motions null", [](fs_scene* s) {
    size_t count = 0;
    return fs_scene_get_motions(s, nullptr, nullptr, 1, &count);
  });
  add("view null", [](fs_scene* s) { return fs_scene_get_view(s, nullptr, nullptr); });
  add("report null", [](fs_scene* s) { return fs_scene_get_report(s, "a", nullptr); });
  add("report of null", [](fs_scene* s) {
    fs_report report;
    return fs_scene_get_report(s, nullptr, &report);
  });
  for (const uint32_t size : {4104u, 8u}) {
    add("stats", [=](fs_scene* s) {
      fs_servo_stats stats = fs_servo_stats_init();
      stats.struct_size = size;
      return fs_scene_get_servo_stats(s, &stats);
    });
    add("device", [=](fs_scene* s) {
      fs_device_info info = fs_device_info_init();
      info.struct_size = size;
      return fs_scene_get_device_info(s, &info);
    });
  }
  add("stats null", [](fs_scene* s) { return fs_scene_get_servo_stats(s, nullptr); });
  add("device null", [](fs_scene* s) { return fs_scene_get_device_info(s, nullptr); });

  // An application's own loop.
  for (const size_t count : {size_t{33}, size_t{2}}) {
    add("tool of one's own", [=](fs_scene* s) {
      fs_tool* tool = nullptr;
      return fs_tool_create(s, count == 2 ? bad_points : points.data(), count, &tool);
    });
  }
  add("no points", [](fs_scene* s) {
    fs_tool* tool = nullptr;
    return fs_tool_create(s, nullptr, 3, &tool);
  });
  add("no tool", [](fs_scene* s) { return fs_tool_create(s, nullptr, 0, nullptr); });
  add("field, positions", [=](fs_scene* s) {
    fs_vec3 f[2];
    return fs_evaluate_field(s, nullptr, FS_NOW, bad_points, 2, f);
  });
  add("field, time", [=](fs_scene* s) {
    fs_vec3 f[2];
    return fs_evaluate_field(s, nullptr, NAN, points.data(), 2, f);
  });
  add("field null", [](fs_scene* s) { return fs_evaluate_field(s, nullptr, FS_NOW, nullptr, 2, nullptr); });
  add("evaluate", [=](fs_scene* s) {
    const Tool tool = make_tool(s);
    fs_state state = hand_at({});
    state.time = NAN;
    fs_response response;
    return fs_evaluate(tool.get(), &state, &response);
  });
  return out;
}

START_TEST(bad_input) {  // gives the same status and the same sentence, and changes nothing
  const Folder folder;
  const Content content = profiles();
  Content own;
  const std::vector<Bad> calls = [&] {
    // A line, a mesh, a curve.
    own.shapes.emplace_back(fs_shape_retain(content.shapes[0].get()));
    own.shapes.emplace_back(fs_shape_retain(content.shapes[1].get()));
    own.curves.emplace_back(fs_curve_retain(content.curves[0].get()));
    return bad_calls(own, folder.path);
  }();
  World here(in_process), there(connected);
  for (World* w : {&here, &there}) {
    fs_object o = spring("a");
    o.time = o.start = 1e-3;
    w->set(o);
    o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
    o.shape = own.shapes[0].get();
    o.front = attract(10, 10);
    o.time = o.start = 1e-3;
    w->set(o);
    const fs_vec3 points[]{{0, 0, 0}, {0.1, 0, 0}};
    OK(fs_scene_set_tool(w->scene, points, 2));
    w->settle();
  }
  const auto state_of = [](World& w) {
    Trace trace;
    tell(trace, w.scene, true);
    return trace;
  };
  const Trace before = state_of(here), before_there = state_of(there);
  expect_same(before, before_there);
  const uint64_t revisions[]{report_of(here.scene, "a").revision, report_of(there.scene, "a").revision};
  for (const bool is_group : {false, true}) {
    if (is_group) {
      OK(fs_scene_begin(here.scene));
      OK(fs_scene_begin(there.scene));
    }
    for (const Bad& bad : calls) {
      if (bad.what.starts_with("report") && is_group) continue;
      const fs_status status = bad.call(here.scene);
      const std::string sentence = fs_last_error();
      const fs_status other = bad.call(there.scene);
      ck_assert_msg(status < 0, "%s is good", bad.what.c_str());
      ck_assert_msg(status == other, "%s: %s here (%s), %s at the server (%s)", bad.what.c_str(),
                    fs_status_name(status), sentence.c_str(), fs_status_name(other), fs_last_error());
      ck_assert_msg(sentence == fs_last_error(), "%s: \"%s\" here, \"%s\" at the server", bad.what.c_str(),
                    sentence.c_str(), fs_last_error());
      expect_same(before, state_of(here));
      expect_same(before, state_of(there));
    }
    if (is_group) {
      EXPECT(FS_ERROR_STATE, fs_scene_begin(here.scene));
      const std::string sentence = fs_last_error();
      EXPECT(FS_ERROR_STATE, fs_scene_begin(there.scene));
      ck_assert_str_eq(sentence.c_str(), fs_last_error());
      OK(fs_scene_commit(here.scene));
      OK(fs_scene_commit(there.scene));
    }
    for (const auto end : {fs_scene_commit, fs_scene_cancel}) {
      EXPECT(FS_ERROR_STATE, end(here.scene));
      const std::string sentence = fs_last_error();
      EXPECT(FS_ERROR_STATE, end(there.scene));
      ck_assert_str_eq(sentence.c_str(), fs_last_error());
    }
  }
  OK(here.sync(here.scene));
  OK(there.sync(there.scene));  // the server has refused nothing
  ck_assert_uint_eq(report_of(here.scene, "a").revision, revisions[0]);
  ck_assert_uint_eq(report_of(there.scene, "a").revision, revisions[1]);
}
END_TEST

// ------------------------------------------------------------------------------------------------- files, own tools

static std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

// A scene with all that a file can hold.
static Content for_a_file() {
  Content content = profiles();
  Random random(11);
  for (fs_object& o : content.objects) {
    o.pose = random.pose(0.1);
    o.damping = random.below(3) ? 0 : random.between(0, 2);
    o.tool_points = static_cast<uint32_t>(random.below(4));
    o.enabled = random.coin(0.8);
    o.lifetime = random.coin(0.8) ? 0 : 1e9 * random.unit_interval();
    o.start = random.coin() ? 0 : random.between(-5, 5);
    o.contact.stiffness = random.between(0, 100);
  }
  return content;
}

START_TEST(files) {
  const Folder folder;
  const Content content = for_a_file();
  const fs_frame frame{{{0.1, 1.0 / 3, -0.3}, turn({1, 2, 3}, 0.4)}, 1.7, 0.3, {}};
  const fs_vec3 points[]{{0, 0, 0.1}, {1e-17, 2.0 / 3, 0}};
  // It writes the same bytes as a scene without a servo.
  const Scene plain = make_scene();
  World w(_i), other(_i);
  for (fs_scene* scene : {plain.get(), w.scene}) {
    fill(scene, content);
    OK(fs_scene_set_frame(scene, &frame));
    OK(fs_scene_set_tool(scene, points, 2));
  }
  w.settle();
  OK(fs_scene_set_time(plain.get(), now(w.scene)));  // so that its objects have the same age
  OK(fs_scene_save(plain.get(), (folder / "scene.json").c_str()));
  const std::string wanted = text_of(folder / "scene.json");
  OK(fs_scene_save(w.scene, (folder / "scene.json").c_str()));
  ck_assert(text_of(folder / "scene.json") == wanted);
  // It comes back bit for bit. Other objects of the scene stay, and those with the same name are replaced.
  other.set(push("mine", 1));
  other.set(push(content.objects[0].name, 5));
  OK(fs_scene_load(other.scene, (folder / "scene.json").c_str()));
  ck_assert(has(other.scene, "mine"));
  OK(fs_object_remove(other.scene, "mine"));
  OK(fs_scene_save(other.scene, (folder / "again.json").c_str()));
  OK(fs_scene_load(plain.get(), (folder / "again.json").c_str()));
  other.settle();
  // The meshes are named after the file.
  OK(fs_scene_save(other.scene, (folder / "scene.json").c_str()));
  const std::string again = text_of(folder / "scene.json");
  const auto lines = [](const std::string& text) { return std::count(text.begin(), text.end(), '\n'); };
  ck_assert_int_eq(lines(again), lines(wanted));
  Trace a, b;
  tell(a, w.scene, false);
  tell(b, other.scene, false);
  for (Trace* trace : {&a, &b}) trace->numbers.clear();  // they are of other ticks
  expect_same(a, b);
  for (int i = 0; i < 20; ++i) {
    const fs_pose hand = at(0.01 * i - 0.1, 0.02, 0.005 * i);
    const fs_wrench first = w.wrench_at(hand), second = other.wrench_at(hand);
    EXPECT_VECTOR(first.force, second.force, 1e-12 * (1 + norm(first.force)));
    EXPECT_VECTOR(first.torque, second.torque, 1e-12 * (1 + norm(first.torque)));
  }
  // In a group loading is part of the group.
  OK(fs_scene_begin(other.scene));
  OK(fs_scene_clear(other.scene));
  OK(fs_scene_load(other.scene, (folder / "scene.json").c_str()));
  ck_assert_uint_eq(own_reports_of(other.scene).size(), content.objects.size());
  OK(fs_scene_cancel(other.scene));
  OK(fs_scene_begin(other.scene));
  OK(fs_scene_clear(other.scene));
  OK(fs_scene_load(other.scene, (folder / "scene.json").c_str()));
  OK(fs_object_remove(other.scene, content.objects[0].name));
  OK(fs_scene_commit(other.scene));
  other.settle();
  ck_assert_uint_eq(own_reports_of(other.scene).size(), content.objects.size() - 1);
}
END_TEST

START_TEST(tools_of_ones_own) {  // the same bits, wherever the scene is
  Random random(17);
  RandomOptions options;
  options.count = 20;
  options.moves = options.masks = options.disables = options.damps = true;
  const Content content = random_content(random, options);
  const Scene plain = make_scene();
  World w(_i);
  const std::vector<fs_vec3> points{{0, 0, 0}, {0.02, 0, -0.01}, {-0.015, 0.02, 0}};
  fs_tool *first = nullptr, *second = nullptr;
  OK(fs_tool_create(plain.get(), nullptr, 0, &first));
  OK(fs_tool_create(w.scene, nullptr, 0, &second));
  const Tool tool(first), other(second);
  for (fs_scene* scene : {plain.get(), w.scene}) {
    fill(scene, content);
    OK(fs_scene_set_tool(scene, points.data(), points.size()));
  }
  const auto compare = [&] {
    for (int i = 0; i < 100; ++i) {
      fs_state state{};
      state.pose = random.pose(0.1);
      state.twist = {random.in_box(0.5), random.in_box(4)};
      state.time = options.time + random.between(-0.2, 0.2);
      fs_response a, b;
      OK(fs_evaluate(tool.get(), &state, &a));
      OK(fs_evaluate(other.get(), &state, &b));
      ck_assert_int_eq(std::memcmp(&a, &b, sizeof a), 0);
    }
    std::vector<fs_vec3> places(500), a(500), b(500);
    for (fs_vec3& x : places) x = random.in_box(0.1);
    const size_t size = sizeof a[0] * a.size();
    OK(fs_evaluate_field(plain.get(), nullptr, options.time, places.data(), 500, a.data()));
    OK(fs_evaluate_field(w.scene, nullptr, options.time, places.data(), 500, b.data()));
    ck_assert_int_eq(std::memcmp(a.data(), b.data(), size), 0);
    OK(fs_evaluate_field(plain.get(), "o1", options.time, places.data(), 500, a.data()));
    OK(fs_evaluate_field(w.scene, "o1", options.time, places.data(), 500, b.data()));
    ck_assert_int_eq(std::memcmp(a.data(), b.data(), size), 0);
  };
  compare();
  for (int k = 0; k < 20; ++k) {  // at once, without a tick
    const fs_pose pose = random.pose(0.1);
    const fs_object o = content.objects[random.below(20)];
    for (fs_scene* scene : {plain.get(), w.scene}) {
      OK(fs_object_move(scene, "o1", &pose, nullptr, options.time + 0.01 * k));
      OK(fs_object_set(scene, &o));
    }
    if (k % 5 == 0) compare();
  }
  compare();
  OK(fs_tool_reset(other.get()));
  w.settle();
  compare();
}
END_TEST

int main() {
  Suite* suite = suite_create("scenario_both");
  add_on_both(suite, "data", {files, tools_of_ones_own});
  add_once(suite, "both", {bad_input});
  TCase* scripts = new_case(suite, "scripts");
  tcase_add_loop_test(scripts, random_scripts, 0, is_sanitized ? times(3, 10) : 10);
  return run_suite(suite);
}
