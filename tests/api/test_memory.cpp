// Out of memory: in every call each allocation fails once. Nothing crashes, a call that returns FS_ERROR_MEMORY has
// changed nothing, the same call works afterwards, and the scene goes on. For files all allocations from some
// allocation on fail as well, as when memory has run out for good.
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <new>
#include <sstream>
#include <vector>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "api/support.h"
#include "scenes/folder.h"
#include "scenes/sanitizer.h"

using namespace scenes;

// Every operator new of the program and of the library calls this.
static thread_local long countdown = -1;  // the allocation that fails; -1: none
static thread_local bool has_failed;
static thread_local bool fails_on;  // all later allocations fail, too

static void* allocate(size_t size, size_t alignment) {
  if (countdown >= 0 && countdown-- == 0) {
    has_failed = true;
    if (fails_on) countdown = 0;
    throw std::bad_alloc();
  }
  const size_t whole = (size + alignment - 1) / alignment * alignment;
  void* p = alignment > alignof(std::max_align_t) ? std::aligned_alloc(alignment, whole) : std::malloc(whole);
  if (!p) throw std::bad_alloc();
  return p;
}
void* operator new(size_t size) { return allocate(size, 1); }
void* operator new(size_t size, std::align_val_t alignment) { return allocate(size, static_cast<size_t>(alignment)); }
void* operator new(size_t size, const std::nothrow_t&) noexcept {  // of std::stable_sort, which does without
  try {
    return allocate(size, 1);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void operator delete(void* p, const std::nothrow_t&) noexcept { std::free(p); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { std::free(p); }

#ifdef __SANITIZE_ADDRESS__
// When Embree cannot note in a list that memory ran out in a thread, it loses the 4 bytes of the note.
extern "C" const char* __lsan_default_suppressions() { return "leak:libembree\n"; }
#endif

static fs_object pull(const char* name, double x = 0.01) {  // 2 N
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.pose = at(x, 0, 0);
  o.front = constant(FS_SENSE_ATTRACTIVE, 2);
  return o;
}

static fs_object mortal(fs_object o, double lifetime) {
  o.lifetime = lifetime;
  return o;
}

static fs_servo_options options() {
  fs_servo_options options = virtual_options();
  options.fade = 0.05;
  options.ramp = -1;
  return options;
}

// A scene with some objects, none of them fading, one about to be removed and one that has expired; with a tool and
// perhaps a servo.
struct World : Rig {
  Tool tool = make_tool(scene.get());
  fs_scene* s = scene.get();
  Shape shape;                 // for a call that needs a shape
  int expired = 0, ready = 0;  // number of such events

  explicit World(bool with_servo) : Rig("memory") {
    OK(fs_scene_set_time(s, 1));
    for (const char* name : {"a", "b", "c", "gone"}) set(pull(name));
    set(mortal(pull("life"), 100));
    set(mortal(pull("old"), 0.01));
    OK(fs_scene_set_time(s, 2));
    device = fake.open();
    if (with_servo) {
      servo = start_servo(s, device.get(), options());
      step(10);
    }
    OK(fs_object_remove(s, "gone"));
    if (with_servo) step(300);
  }
  void set(const fs_object& o) { OK(fs_object_set(s, &o)); }
  fs_status next_event(fs_event& event) {
    const fs_status status = fs_scene_next_event(s, 0, &event);
    if (status == FS_OK && event.kind == FS_EVENT_EXPIRED) ++expired;
    if (status == FS_OK && event.kind == FS_EVENT_DEVICE) ++ready;
    return status;
  }

  // Everything that getters and evaluation return, as text.
  std::string all(bool with_revisions, bool with_motion_revisions = false) {
    std::string out;
    auto add = [&](auto... values) {
      for (const double value : {static_cast<double>(values)...}) {
        char text[40];
        std::snprintf(text, sizeof text, " %.17g", value);
        out += text;
      }
    };
    std::vector<fs_report> reports(object_count(s));
    size_t count = 0;
    OK(fs_scene_get_reports(s, reports.data(), reports.size(), &count));
    for (const fs_report& r : reports) {
      out += std::string("\n") + r.name;
      add(r.primitive, r.state, r.weight, r.stiffness_wanted, r.distance, r.wrench.force.x);
      if (with_revisions) add(r.revision);
      fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
      OK(fs_object_get(s, r.name, &o));
      add(o.pose.position.x, o.twist.linear.x, o.front.gain, o.lifetime, o.enabled, o.tool_points);
      fs_object_release(&o);
      const fs_vec3 x{0.003, 0, 0};
      fs_vec3 force{};
      if (fs_evaluate_field(s, r.name, FS_NOW, &x, 1, &force) == FS_OK) add(force.x);
    }
    std::vector<fs_motion> motions(reports.size());
    OK(fs_scene_get_motions(s, nullptr, motions.data(), motions.size(), &count));
    out += "\nmotions";
    add(count);
    for (const fs_motion& m : motions) {
      add(m.pose.position.x, m.twist.linear.x, m.horizon);
      if (with_motion_revisions) add(m.motion_revision);
    }
    fs_frame frame;
    OK(fs_scene_get_frame(s, nullptr, &frame));
    fs_vec3 points[32];
    OK(fs_scene_get_tool(s, points, 32, &count));
    out += "\nframe, tool";
    add(frame.pose.position.x, count, points[0].x, points[count - 1].x);
    if (tool) {
      const fs_response response = evaluate(tool.get(), hand_at({0.003, 0, 0}));
      add(response.wrench.force.x, response.felt_count);
    }
    if (servo) {
      fs_state hand;
      fs_response response;
      OK(fs_scene_get_hand(s, &hand, &response, nullptr));
      add(sent().x, hand.flags, response.felt_count, response.flags);
    }
    return out;
  }
};

struct Call {
  const char* name;
  std::function<fs_status(World&)> call;
  std::function<void(World&)> before = [](World&) {};
  bool may_be_partial = false;  // it may have done a part when memory ran out, but does not crash
};

static std::vector<Call> calls() {
  const auto set = [](const fs_object& o) { return [o](World& w) { return fs_object_set(w.s, &o); }; };
  fs_object plane = pull("a");
  plane.primitive = FS_PRIMITIVE_PLANE;
  fs_object mesh = pull("a");
  mesh.primitive = FS_PRIMITIVE_MESH;
  fs_object off = pull("a");
  off.enabled = false;
  const auto pose = at(0.05, 0, 0);
  const auto in_group = [](World& w) {
    fs_scene_begin(w.s);  // fails in the runs that do everything in a group
    w.set(pull("new"));
    w.set(mortal(pull("b", 0.2), 50));
    OK(fs_object_remove(w.s, "a"));
    OK(fs_scene_set_clutch(w.s, true));
  };
  return {
      {"set, new", set(pull("new", 0.1))},
      {"set, new, with a lifetime", set(mortal(pull("new", 0.1), 50))},
      {"set, there", set(pull("a", 0.2))},
      {"set, there, with a lifetime", set(mortal(pull("a"), 50))},
      {"set, another primitive", set(plane)},
      {"set, disabled", set(off)},
      {"set, a mesh", [mesh](World& w) {  // its tree is built in the call
         fs_object o = mesh;
         o.shape = w.shape.get();
         return fs_object_set(w.s, &o);
       }, [](World& w) { w.shape = make_mesh(sphere_mesh(0.1, 100)); }},
      {"change", [](World& w) {
         fs_object o = pull("a", 0.2);
         o.front.gain = 3;
         return fs_object_change(w.s, &o, FS_PART_POSE | FS_PART_PROFILES);
       }},
      {"move", [pose](World& w) { return fs_object_move(w.s, "a", &pose, nullptr, FS_NOW); }},
      {"move, with a lifetime", [pose](World& w) { return fs_object_move(w.s, "life", &pose, nullptr, FS_NOW); }},
      {"remove", [](World& w) { return fs_object_remove(w.s, "a"); }},
      {"clear", [](World& w) { return fs_scene_clear(w.s); }, [](World&) {}, true},
      {"frame", [](World& w) {
         fs_frame frame = fs_frame_init();
         frame.pose.position.x = 0.3;
         return fs_scene_set_frame(w.s, &frame);
       }},
      {"clutch", [](World& w) { return fs_scene_set_clutch(w.s, true); }},
      {"clutch let go", [](World& w) { return fs_scene_set_clutch(w.s, false); },
       [](World& w) { OK(fs_scene_set_clutch(w.s, true)); if (w.servo) w.step(100); }},
      {"tool", [](World& w) {
         const fs_vec3 points[]{{0, 0, 0}, {0.1, 0, 0}};
         return fs_scene_set_tool(w.s, points, 2);
       }},
      {"begin", [](World& w) {
         const fs_status status = fs_scene_begin(w.s);
         return status == FS_ERROR_STATE ? FS_OK : status;
       }},
      {"commit", [](World& w) { return fs_scene_commit(w.s); }, in_group, true},
      {"cancel", [](World& w) { return fs_scene_cancel(w.s); }, in_group, true},
      {"tool_create", [](World& w) {
         fs_tool* tool = nullptr;
         const fs_status status = fs_tool_create(w.s, nullptr, 0, &tool);
         fs_tool_destroy(tool);
         return status;
       }},
      {"tool_destroy", [](World& w) { w.tool.reset(); return FS_OK; }},
      {"servo_start", [](World& w) {
         if (w.servo) return FS_OK;
         fs_servo* servo = nullptr;
         const fs_servo_options chosen = options();
         const fs_status status = fs_servo_start(w.s, w.device.get(), &chosen, &servo);
         w.servo.reset(servo);
         return status;
       }},
      {"servo_stop", [](World& w) { w.servo.reset(); return FS_OK; }},
      {"next_event", [](World& w) {
         fs_event event;
         return w.next_event(event);
       }},
      {"get_reports", [](World& w) {
         fs_report reports[9];
         size_t count = 0;
         return fs_scene_get_reports(w.s, reports, 9, &count);
       }},
      {"get_motions", [](World& w) {
         fs_motion motions[9];
         size_t count = 0;
         return fs_scene_get_motions(w.s, nullptr, motions, 9, &count);
       }},
      {"get_view", [](World& w) {
         fs_view view;
         return fs_scene_get_view(w.s, nullptr, &view);
       }},
      {"get", [](World& w) {
         fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
         const fs_status status = fs_object_get(w.s, "a", &o);
         fs_object_release(&o);
         return status;
       }},
      {"scene_destroy", [](World& w) { w.tool.reset(); w.servo.reset(); w.scene.reset(); return FS_OK; }},
  };
}

// What a call does when no allocation fails.
static std::string wanted(const Call& call, bool with_servo, bool is_grouped) {
  World world(with_servo);
  if (is_grouped) OK(fs_scene_begin(world.s));
  call.before(world);
  OK(call.call(world));
  return world.scene ? world.all(false) : "";
}

// The number of allocations of a call.
static int sweep(const Call& call, bool with_servo, bool is_grouped) {
  const std::string after_success = wanted(call, with_servo, is_grouped);
  for (int k = 0;; ++k) {
    World world(with_servo);
    if (is_grouped) OK(fs_scene_begin(world.s));
    call.before(world);
    const bool may_shift = std::strcmp(call.name, "servo_start") == 0;  // it shifts all times and back
    const std::string before = world.all(true, !may_shift);
    has_failed = false;
    countdown = k;
    const fs_status status = call.call(world);
    countdown = -1;
    const bool is_last = !has_failed;
    if (!world.scene) {
      if (is_last) return k;
      continue;
    }
    const std::string what = std::string(call.name) + (with_servo ? ", servo" : "") + (is_grouped ? ", group" : "") +
                             ", allocation " + std::to_string(k);
    if (status != FS_OK) {
      ck_assert_msg(has_failed && status == FS_ERROR_MEMORY, "%s: %s", what.c_str(), fs_status_name(status));
      if (!call.may_be_partial) {
        const std::string after = world.all(true, !may_shift);
        ck_assert_msg(after == before, "%s:%s\nhas become%s", what.c_str(), before.c_str(), after.c_str());
        if (with_servo) {
          const fs_vec3 force = world.sent();
          world.step(1);
          ck_assert_msg(norm(world.sent() - force) < 1e-12, "%s: a step of force", what.c_str());
        }
        OK(call.call(world));
      }
    }
    if (call.may_be_partial) world.all(false);  // whatever its state, the getters work
    if (!with_servo && !call.may_be_partial) {
      const std::string after = world.all(false);
      ck_assert_msg(after == after_success, "%s: in the end%s\nnot%s", what.c_str(), after.c_str(),
                    after_success.c_str());
    }

    // The scene goes on.
    fs_scene_commit(world.s);
    world.set(pull("after", 0.1));
    OK(fs_object_remove(world.s, "after"));
    fs_object_remove(world.s, "b");  // it may have been removed
    if (world.servo) world.step(300);
    world.set(pull("after", 0.1));
    fs_event event;
    do OK(world.next_event(event));
    while (event.kind != FS_EVENT_NONE);
    ck_assert_msg(world.expired == 1, "%s: %d objects have expired", what.c_str(), world.expired);
    const bool may_be_lost = std::strcmp(call.name, "servo_stop") == 0;  // it returns no status
    if (world.servo || (with_servo && !may_be_lost)) {
      ck_assert_msg(world.ready == 1, "%s: the device was ready %d times", what.c_str(), world.ready);
    }
    world.servo.reset();
    world.tool = make_tool(world.s);
    ck_assert_uint_ge(evaluate(world.tool.get(), {}).felt_count, 1);
    world.servo = start_servo(world.s, world.device.get(), options());
    world.step(5);
    OK(fs_scene_clear(world.s));
    world.step(100);
    ck_assert_double_eq(norm(world.sent()), 0);
    ck_assert_uint_eq(object_count(world.s), 0);
    if (is_last) return k;
  }
}

START_TEST(each_allocation_fails_once) {
  const Call call = calls()[static_cast<size_t>(_i)];
  for (bool with_servo : {false, true}) {
    for (bool is_grouped : {false, true}) sweep(call, with_servo, is_grouped);
  }
}
END_TEST

// ---- files

// Calls f for k = 0, 1... until no allocation fails; f gets a function that runs a call in which allocation k fails: only that
// one, or all from it on, which is tried of every third k, with tests/run --all of each. Returns how many allocations there were.
using Failing = std::function<fs_status(const std::function<fs_status()>& call)>;
static int each_allocation(bool for_good, const std::function<void(const Failing&)>& f) {
  bool is_last = false;
  int k = 0;
  for (; !is_last; k += for_good ? times(3, 1) : 1) {
    f([&](const std::function<fs_status()>& call) {
      has_failed = false;
      fails_on = for_good;
      countdown = k;
      const fs_status status = call();
      countdown = -1;
      fails_on = false;
      is_last = !has_failed;
      if (is_last) ck_assert_msg(status == FS_OK, "%s: %s", fs_status_name(status), fs_last_error());
      if (status != FS_OK) ck_assert_msg(status == FS_ERROR_MEMORY, "allocation %d: %s: %s", k, fs_status_name(status),
                                         fs_last_error());
      return status;
    });
  }
  return k;
}

static std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

static size_t count_files(const Folder& folder) {
  size_t count = 0;
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(folder.path)) ++count;
  return count;
}

// One of everything that a file can hold.
static Content contents_of_a_file() {
  Content content = ball(20);
  const std::vector<fs_vec3> line{{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.2, 0}};
  content.add_shape("line", make_polyline(line.data(), 3, true)).front = attract(50, 1);
  const double table[]{1, 2, 0.5};
  fs_object& custom = content.add("a name that is longer", FS_PRIMITIVE_PLANE);
  custom.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 9);
  custom.front.curve = content.keep(make_table(table, 3, 0.01), {});
  custom.start = 3;
  if (has_expressions()) {
    fs_object& other = content.add("expression", FS_PRIMITIVE_POINT);
    other.front = custom.front;
    other.front.curve = content.keep(make_expression("3*(1+sin(12*t))*exp(-d/0.01)"), {});
  }
  return content;
}

START_TEST(a_scene_is_saved) {
  const Scene scene = make_scene();
  fill(scene.get(), contents_of_a_file());
  OK(fs_scene_set_time(scene.get(), 10));
  for (const bool for_good : {false, true}) {
    const int count = each_allocation(for_good, [&](const auto& failing) {
      const Folder folder;
      const std::string path = folder / "scene.json";
      std::ofstream(path) << "old";
      if (failing([&] { return fs_scene_save(scene.get(), path.c_str()); }) != FS_OK) {
        ck_assert(text_of(path) == "old");
        ck_assert_uint_eq(count_files(folder), 1);  // and no litter
        OK(fs_scene_save(scene.get(), path.c_str()));
      }
      const Scene loaded = make_scene();
      OK(fs_scene_load(loaded.get(), path.c_str()));
      ck_assert_uint_eq(object_count(loaded.get()), object_count(scene.get()));
    });
    ck_assert_int_gt(count, 100);
  }
}
END_TEST

START_TEST(a_scene_is_loaded) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  {
    const Scene scene = make_scene();
    fill(scene.get(), contents_of_a_file());
    OK(fs_scene_save(scene.get(), path.c_str()));
  }
  for (const bool for_good : {false, true}) {
    const int count = each_allocation(for_good, [&](const auto& failing) {
      const Scene scene = make_scene();
      const Tool tool = make_tool(scene.get());
      const fs_object own = pull("own", 0.1);
      OK(fs_object_set(scene.get(), &own));
      failing([&] { return fs_scene_load(scene.get(), path.c_str()); });
      evaluate(tool.get(), hand_at({0.003, 0, 0}));
      const fs_vec3 x{0.003, 0, 0};
      for (const char* name : {"ball", "line", "own"}) {  // loaded or not
        fs_vec3 force;
        const fs_status status = fs_evaluate_field(scene.get(), name, FS_NOW, &x, 1, &force);
        ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND);
      }
      OK(fs_scene_load(scene.get(), path.c_str()));
    });
    ck_assert_int_gt(count, 100);
  }
}
END_TEST

START_TEST(expressions_are_read) {
  if (!has_expressions()) return;
  fs_surface_settings settings = fs_surface_settings_init();
  settings.columns = settings.rows = 4;
  settings.column_width = settings.row_width = 0.01;
  for (const bool for_good : {false, true}) {
    const int of_curve = each_allocation(for_good, [&](const auto& failing) {
      fs_curve* curve = nullptr;
      failing([&] { return fs_curve_create_expression("1.5e1+.5*sin(2*d*t)", &curve); });
      fs_curve_destroy(curve);
    });
    const int of_surface = each_allocation(for_good, [&](const auto& failing) {
      fs_surface* surface = nullptr;
      failing([&] { return fs_surface_create_expression(&settings, "-0.001*(1+sin(100*x))", &surface); });
      fs_surface_destroy(surface);
    });
    ck_assert_int_gt(of_curve, 100);
    ck_assert_int_gt(of_surface, 100);
  }
}
END_TEST

START_TEST(bad_files_and_meshes_are_read) {
  const Folder folder;
  const std::string vertices = "v 0 2 0\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\n";
  std::ofstream(folder / "l.obj") << vertices << "f 1 2 3 4 5 6\n";
  std::ofstream(folder / "l.off") << "OFF\n6 1 0\n0 2 0\n0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n6 0 1 2 3 4 5\n";
  std::ofstream(folder / "l.stl") << "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                     "vertex 0 1 0\nendloop\nendfacet\nendsolid\n";
  std::ofstream(folder / "bad.json") << R"({"forceserver": "scene", "version": 1, "objects": [[{"a": 1, "a": 2}]]})";
  for (const bool for_good : {false, true}) {
    for (const char* name : {"l.obj", "l.off", "l.stl"}) {
      each_allocation(for_good, [&](const auto& failing) {
        const std::string path = folder / name;
        fs_shape* shape = nullptr;
        failing([&] { return fs_shape_load(path.c_str(), 1, &shape); });
        fs_shape_destroy(shape);
      });
    }
    const Scene scene = make_scene();
    const std::string path = folder / "bad.json";
    for (int k = 0; k < 200; ++k) {  // refused for some reason
      fails_on = for_good;
      countdown = k;
      const fs_status status = fs_scene_load(scene.get(), path.c_str());
      countdown = -1;
      fails_on = false;
      ck_assert(status == FS_ERROR_MEMORY || status == FS_ERROR_PARSE);
    }
  }
}
END_TEST

START_TEST(the_first_object) {  // of an empty scene: a failed call leaves no trace of its name
  for (bool is_grouped : {false, true}) {
    bool is_last = false;
    for (int k = 0; !is_last; ++k) {
      const Scene scene = make_scene();
      if (is_grouped) OK(fs_scene_begin(scene.get()));
      const fs_object o = pull("first", 0.1);
      has_failed = false;
      countdown = k;
      const fs_status status = fs_object_set(scene.get(), &o);
      countdown = -1;
      is_last = !has_failed;
      ck_assert_int_eq(status, is_last ? FS_OK : FS_ERROR_MEMORY);
      OK(fs_object_set(scene.get(), &o));
      if (is_grouped) OK(fs_scene_commit(scene.get()));
      fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
      OK(fs_object_get(scene.get(), "first", &got));
      fs_object_release(&got);
      ck_assert_uint_eq(object_count(scene.get()), 1);
    }
  }
}
END_TEST

// A commit that fails may have made a part felt. The rest stays in the group, which may grow, also by what is felt already,
// and be committed or cancelled.
START_TEST(a_group_after_a_failed_commit) {
  for (const int count : {10, 70}) {  // 70: more than are committed in the order in which they came
    for (const bool is_cancelled : {false, true}) {
      each_allocation(false, [&](const Failing& failing) {
        const Scene scene = make_scene();
        fs_scene* const s = scene.get();
        const auto set = [&](int i, double gain) {
          fs_object o = pull(("a name that is longer " + std::to_string(i)).c_str());
          o.front.gain = o.front.limit = gain;
          OK(fs_object_set(s, &o));
        };
        OK(fs_scene_begin(s));
        for (int i = 0; i < count; ++i) set(i, 1);
        if (failing([&] { return fs_scene_commit(s); }) == FS_OK) return;
        for (int i = count / 2; i < count + 90; ++i) set(i, 2);
        if (is_cancelled) {
          OK(fs_scene_cancel(s));
          const size_t felt = object_count(s);
          ck_assert_uint_le(felt, static_cast<size_t>(count));
          for (int i = 0; i < count + 90; ++i) set(i, 2);  // there is room for all of them
        } else {
          OK(fs_scene_commit(s));
        }
        ck_assert_uint_eq(object_count(s), static_cast<size_t>(count + 90));
        const fs_vec3 x{};
        fs_vec3 force{};
        OK(fs_evaluate_field(s, nullptr, FS_NOW, &x, 1, &force));
        const int first = is_cancelled ? 0 : count / 2;  // of those that were set again
        EXPECT_NEAR(force.x, first + 2 * (count + 90 - first), 1e-9);
      });
    }
  }
}
END_TEST

START_TEST(a_mesh_in_little_memory) {  // is built, or is not, and the call returns
  if (is_sanitized) return;
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGALRM, SIG_DFL);  // Check has a handler
    alarm(60);
    std::ifstream pages("/proc/self/statm");
    rlim_t used = 0;
    pages >> used;
    const rlim_t most = used * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (64 << 20);
    const rlimit limit{most, most};
    if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
    for (int i = 0; i < 3; ++i) {
      const Shape shape = make_mesh(sphere_mesh(0.02, 5000));
      if (const fs_status status = fs_shape_build(shape.get()); status != FS_OK && status != FS_ERROR_MEMORY) _exit(3);
    }
    _exit(0);
  }
  int status = 0;
  ck_assert_int_eq(waitpid(child, &status, 0), child);
  ck_assert_msg(status == 0, "it ends with status %#x", static_cast<unsigned>(status));
}
END_TEST

START_TEST(a_server_is_started) {  // a failed start leaves nothing behind at the servo
  each_allocation(false, [](const Failing& failing) {
    const Scene scene = make_scene();
    const Device device = open_device("sim:");
    Servo servo = start_servo(scene.get(), device.get(), options());
    const std::string endpoint = "shm:test-memory-" + std::to_string(getpid());
    fs_server* server = nullptr;
    const fs_status status = failing([&] { return fs_server_start(servo.get(), endpoint.c_str(), nullptr, &server); });
    const Server owner(server);
    ck_assert((status == FS_OK) == (server != nullptr));
    servo.reset();
  });
}
END_TEST

START_TEST(allocations_are_seen) {  // an allocation inside the library
  for (const Call& call : calls()) {
    if (std::strcmp(call.name, "set, new") == 0) ck_assert_int_gt(sweep(call, true, false), 5);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("memory");
  add_case(suite, "the test", {allocations_are_seen, the_first_object, a_group_after_a_failed_commit, a_mesh_in_little_memory});
  add_case(suite, "files", {a_scene_is_saved, a_scene_is_loaded, expressions_are_read, bad_files_and_meshes_are_read});
  add_case(suite, "server", {a_server_is_started});
  for (int k = 0; k < static_cast<int>(calls().size()); ++k) {
    TCase* test_case = tcase_create(calls()[static_cast<size_t>(k)].name);
    tcase_set_timeout(test_case, 500);
    tcase_add_loop_test(test_case, each_allocation_fails_once, k, k + 1);
    suite_add_tcase(suite, test_case);
  }
  return run_suite(suite);
}
