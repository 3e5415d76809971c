#include "ipc/victim.h"

#include <sys/mman.h>
#include <sys/ptrace.h>
#include <ucontext.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "ipc/process.h"
#include "scenes/scenes.h"

namespace life {
namespace {

using namespace scenes;

constexpr int object_count = 10;  // that push
constexpr int crowd_count = 64;   // that are only moved

Scene must_connect(const char* endpoint, const char* name) {
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(endpoint, name, &scene);
  if (status == FS_OK) return Scene(scene);
  tell(std::string("fs_scene_connect: ") + fs_status_name(status) + ": " + fs_last_error());
  std::_Exit(EXIT_FAILURE);
}

class Victim {
 public:
  Victim(std::string endpoint, std::string name, uint64_t seed)
      : endpoint_(std::move(endpoint)), name_(std::move(name)), random_(seed), direction_(random_.direction()) {
    require(fs_pose_from_z(-100.0 * direction_, direction_, &plane_), "fs_pose_from_z");
  }

  [[noreturn]] void run(const std::string& work) {
    connect();
    tell("connected");
    if (work == "connects") {
      for (;;) {
        scene_.reset();
        connect();
        if (random_.coin()) set(0);
      }
    }
    for (int i = 0; i < object_count; ++i) set(i);
    if (work == "moves" || work == "batches") {
      fs_scene_begin(get());
      for (int i = 0; i < crowd_count; ++i) set_in_crowd(i);
      fs_scene_commit(get());
    }
    for (;;) {
      if (work == "moves") move_in_crowd(static_cast<int>(random_.below(crowd_count)));
      if (work == "batches") move_batch();
      if (work == "meshes") set_mesh(static_cast<int>(random_.below(object_count)));
      if (work == "everything") do_anything();
    }
  }

 private:
  fs_scene* get() const { return scene_.get(); }

  // A client that behaves is never turned away, and never dropped.
  void check(fs_status status, const char* call) const {
    if (status != FS_ERROR_DISCONNECTED && status != FS_ERROR_INTERNAL && status != FS_ERROR_MEMORY) return;
    tell(std::string(call) + ": " + fs_status_name(status) + ": " + fs_last_error());
    std::_Exit(EXIT_FAILURE);
  }

  void connect() { scene_ = must_connect(endpoint_.c_str(), name_.c_str()); }

  // The same push by another object: from far away, so that it has the same direction wherever it is moved to.
  fs_object push(int i) {
    const auto primitive = static_cast<fs_primitive>(random_.below(3));
    fs_object o = fs_object_init(("push" + std::to_string(i)).c_str(), primitive);
    o.front = constant(FS_SENSE_REPULSIVE, victim_force / object_count);
    o.pose = primitive == FS_PRIMITIVE_PLANE ? plane_ : at(far_away());
    if (primitive == FS_PRIMITIVE_POLYLINE) {
      if (!line_ || random_.coin(0.2)) {
        const std::vector<fs_vec3> points = helix(0.1, 0.2, 3, 10 + random_.below(1000));
        line_ = make_polyline(points.data(), points.size(), false);
      }
      o.shape = line_.get();
    }
    if (random_.coin(0.2)) {
      o.front.kind = FS_PROFILE_CUSTOM;
      o.front.gain = 1;
      o.front.curve = new_curve();
    }
    o.pose.position = o.pose.position + random_.in_box(1);
    o.enabled = random_.coin(0.9);
    o.lifetime = random_.coin(0.1) ? 0.01 : 0;
    return o;
  }
  fs_vec3 far_away() const { return -1e5 * direction_; }

  fs_curve* new_curve() {
    const double force = victim_force / object_count;
    if (has_expressions() && random_.coin()) {
      curve_ = make_expression(std::to_string(force).c_str());
    } else {
      const std::vector<double> table(2 + random_.below(10'000), force);
      curve_ = make_table(table.data(), table.size(), 1e-3);
    }
    return curve_.get();
  }

  void set(int i) {
    const fs_object o = push(i);
    check(fs_object_set(get(), &o), "fs_object_set");
  }

  void set_mesh(int i) {
    const auto triangles = static_cast<size_t>(random_.log_between(1e4, 1e5));
    const Shape mesh = make_mesh(random_.coin() ? sphere_mesh(0.05, triangles) : torus_mesh(0.05, 0.02, triangles));
    fs_object o = push(i);
    o.primitive = FS_PRIMITIVE_MESH;
    o.pose = at(far_away());
    o.shape = mesh.get();
    check(fs_object_set(get(), &o), "fs_object_set");
    if (random_.coin(0.3)) {
      o = push(i);
      check(fs_object_set(get(), &o), "fs_object_set");
    }
  }

  // Far from the hand, with a reach of at most 1 mm.
  void set_in_crowd(int i) {
    fs_object o = fs_object_init(("crowd" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    o.front = attract(100, 0.1);
    o.front.reach = 1e-3;
    o.pose = at(10, 0, 0);
    check(fs_object_set(get(), &o), "fs_object_set");
  }
  void move_in_crowd(int i) {
    const fs_pose pose = at(fs_vec3{10, 0, 0} + random_.in_box(1));
    check(fs_object_move(get(), ("crowd" + std::to_string(i)).c_str(), &pose, nullptr, FS_NOW), "fs_object_move");
  }
  void move_batch() {
    check(fs_scene_begin(get()), "fs_scene_begin");
    for (int i = 0; i < crowd_count; ++i) move_in_crowd(i);
    check(fs_scene_commit(get()), "fs_scene_commit");
  }

  void do_anything() {
    const std::string name = "push" + std::to_string(random_.below(object_count));
    const char* other = random_.coin() ? "honest/prey" : "server/prey";
    fs_scene* s = get();
    switch (random_.below(24)) {
      case 0:
      case 1:
      case 2: return set(static_cast<int>(random_.below(object_count)));
      case 3: {  // what does not change its force: it is felt at once
        fs_object o = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
        o.front = constant(FS_SENSE_REPULSIVE, victim_force / object_count);
        o.front.limit = random_.between(1, 2);
        return check(fs_object_change(s, &o, FS_PART_PROFILES), "fs_object_change");
      }
      case 4: {
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        if (fs_object_get(s, name.c_str(), &got) != FS_OK) return;
        got.enabled = !got.enabled;
        check(fs_object_change(s, &got, FS_PART_OTHER), "fs_object_change");
        return fs_object_release(&got);
      }
      case 5:
      case 6: {
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        if (fs_object_get(s, name.c_str(), &got) != FS_OK) return;
        got.pose.position = got.pose.position + random_.in_box(0.1);
        check(fs_object_move(s, name.c_str(), &got.pose, nullptr, FS_NOW), "fs_object_move");
        return fs_object_release(&got);
      }
      case 7: return check(fs_object_remove(s, name.c_str()), "fs_object_remove");
      case 8: {
        fs_status status = fs_scene_begin(s);
        for (int i = 0; i < 5; ++i) set(i);
        fs_object_remove(s, name.c_str());
        if (random_.coin(0.2)) fs_scene_clear(s);
        status = random_.coin(0.8) ? fs_scene_commit(s) : fs_scene_cancel(s);
        return check(status, "fs_scene_commit");
      }
      case 9: {
        fs_frame frame = fs_frame_init();
        frame.pose.position = random_.in_box(0.01);
        frame.scale = random_.between(0.5, 2);
        return check(fs_scene_set_frame(s, &frame), "fs_scene_set_frame");
      }
      case 10: return check(fs_scene_set_clutch(s, random_.coin()), "fs_scene_set_clutch");
      case 11: {
        const fs_vec3 points[]{random_.in_box(0.01), random_.in_box(0.01)};
        return check(fs_scene_set_tool(s, points, 1 + random_.below(2)), "fs_scene_set_tool");
      }
      case 12: return check(fs_scene_sync(s, 0.01), "fs_scene_sync");
      case 13: {
        std::vector<fs_report> reports(100);
        size_t count;
        if (random_.coin()) return check(fs_scene_get_motions(s, nullptr, nullptr, 0, &count), "fs_scene_get_motions");
        return check(fs_scene_get_reports(s, reports.data(), reports.size(), &count), "fs_scene_get_reports");
      }
      case 14: {
        fs_report report;
        return check(fs_scene_get_report(s, random_.coin() ? other : name.c_str(), &report), "fs_scene_get_report");
      }
      case 15: {
        fs_event event;
        return check(fs_scene_next_event(s, random_.coin() ? 0 : 1e-3, &event), "fs_scene_next_event");
      }
      case 16: {
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        const fs_status status = fs_object_get(s, other, &got);
        fs_object_release(&got);
        return check(status, "fs_object_get");
      }
      case 17: {
        fs_object o = fs_object_init(other, FS_PRIMITIVE_POINT);
        o.damping = random_.between(0, 10);
        o.pose = random_.pose(1);
        return check(fs_object_change(s, &o, FS_PART_POSE | FS_PART_PROFILES), "fs_object_change");
      }
      case 18: {
        const fs_pose pose = random_.pose(1);
        return check(fs_object_move(s, other, &pose, nullptr, FS_NOW), "fs_object_move");
      }
      case 19: return random_.coin(0.2) ? check(fs_object_remove(s, other), "fs_object_remove") : void();
      case 20: {
        fs_client clients[8];
        fs_client_view views[8];
        size_t count;
        if (random_.coin()) return check(fs_scene_get_views(s, views, 8, &count), "fs_scene_get_views");
        return check(fs_scene_get_clients(s, clients, 8, &count), "fs_scene_get_clients");
      }
      case 21: {
        fs_servo_stats stats = fs_servo_stats_init();
        return check(fs_scene_get_servo_stats(s, &stats), "fs_scene_get_servo_stats");
      }
      case 22: {
        fs_wrench sent;
        return check(fs_scene_get_hand(s, nullptr, nullptr, &sent), "fs_scene_get_hand");
      }
      default: return random_.coin(0.2) ? set_mesh(static_cast<int>(random_.below(object_count))) : void();
    }
  }

  const std::string endpoint_, name_;
  Random random_;
  const fs_vec3 direction_;
  fs_pose plane_;
  Scene scene_;
  Shape line_;
  Curve curve_;
};

// ---------------------------------------------------------------------------------------------------- stops at a write

#if defined(__x86_64__) && defined(__linux__)

// The memory is write-protected. Each write is counted, and then let through for a single instruction.
char *shared_begin, *shared_end;
int writes, stop_before;
constexpr greg_t single_step = 0x100;  // of the processor's flags

bool find_shared_memory() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find("memfd:forceserver-inbox") == std::string::npos) continue;
    void *begin, *end;
    if (std::sscanf(line.c_str(), "%p-%p", &begin, &end) != 2) return false;
    shared_begin = static_cast<char*>(begin);
    shared_end = static_cast<char*>(end);
    return true;
  }
  return false;
}
void allow_writing(bool is_allowed) {
  mprotect(shared_begin, static_cast<size_t>(shared_end - shared_begin), PROT_READ | (is_allowed ? PROT_WRITE : 0));
}
void before_write(int, siginfo_t* info, void* context) {
  const char* address = static_cast<char*>(info->si_addr);
  if (address < shared_begin || address >= shared_end) {
    std::signal(SIGSEGV, SIG_DFL);
    return;
  }
  if (++writes == stop_before) kill(getpid(), SIGSTOP);
  allow_writing(true);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] |= single_step;
}
void after_write(int, siginfo_t*, void* context) {
  allow_writing(false);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] &= ~single_step;
}
bool stop_before_write(int number) {
  if (!find_shared_memory()) return false;
  stop_before = number;
  struct sigaction action {};
  action.sa_flags = SA_SIGINFO;
  action.sa_sigaction = before_write;
  sigaction(SIGSEGV, &action, nullptr);
  action.sa_sigaction = after_write;
  sigaction(SIGTRAP, &action, nullptr);
  allow_writing(false);
  return true;
}
void write_as_ever() { allow_writing(true); }

#else

bool stop_before_write(int) { return false; }
void write_as_ever() {}

#endif

}  // namespace

int be_a_victim(int count, char** arguments) {
  if (count != 6) return EXIT_FAILURE;
  leave_with_parent();
  Victim(arguments[2], arguments[3], std::strtoull(arguments[5], nullptr, 10)).run(arguments[4]);
}

int be_a_writer(int count, char** arguments) {
  if (count != 5) return EXIT_FAILURE;
  leave_with_parent();
  const Scene scene = must_connect(arguments[2], arguments[3]);
  fs_pose up, down;
  require(fs_pose_from_z({0, 0, -100}, {0, 0, 1}, &up), "fs_pose_from_z");
  require(fs_pose_from_z({0, 0, 100}, {0, 0, -1}, &down), "fs_pose_from_z");
  const char* const names[] = {"a", "b", "c"};
  for (const char* name : names) {
    fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
    o.front = constant(FS_SENSE_REPULSIVE, flip_force);
    o.pose = up;
    require(fs_object_set(scene.get(), &o), "fs_object_set");
  }
  require(fs_scene_sync(scene.get(), 30), "fs_scene_sync");
  if (!stop_before_write(std::atoi(arguments[4]))) {
    tell("unsupported");
    return EXIT_FAILURE;
  }
  tell("connected");
  std::string line;
  listen(line);
  const fs_twist still{};
  // Twice, so that the server looks at what the second call changes.
  require(fs_object_move(scene.get(), "a", &up, &still, FS_NOW), "fs_object_move");
  require(fs_object_move(scene.get(), "a", &down, &still, FS_NOW), "fs_object_move");
  fs_response felt{};
  do {
    require(fs_scene_get_hand(scene.get(), nullptr, &felt, nullptr), "fs_scene_get_hand");
  } while (felt.wrench.force.z > 2 * flip_force);
  require(fs_scene_begin(scene.get()), "fs_scene_begin");
  for (const char* name : names) require(fs_object_move(scene.get(), name, &down, &still, FS_NOW), "fs_object_move");
  require(fs_scene_commit(scene.get()), "fs_scene_commit");
  write_as_ever();
  tell("over");
  while (listen(line)) {
  }
  return EXIT_SUCCESS;
}

int be_a_caller(int count, char** arguments) {
  if (count != 4) return EXIT_FAILURE;
  leave_with_parent();
  const Shape mesh = make_mesh(sphere_mesh(0.05, 1000));
  const std::vector<double> table(1000, 0.1);
  const Curve curve = make_table(table.data(), table.size(), 1e-3);
  if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) {
    tell("unsupported");
    return EXIT_FAILURE;
  }
  raise(SIGSTOP);
  Scene scene = must_connect(arguments[2], arguments[3]);
  fs_object o = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  o.shape = mesh.get();
  o.front = constant(FS_SENSE_REPULSIVE, 0.1);
  o.front.kind = FS_PROFILE_CUSTOM;
  o.front.gain = 1;
  o.front.curve = curve.get();
  o.pose = at(0, 0, -100);
  require(fs_object_set(scene.get(), &o), "fs_object_set");
  require(fs_object_move(scene.get(), "mesh", &o.pose, nullptr, FS_NOW), "fs_object_move");
  size_t number = 0;
  require(fs_scene_get_reports(scene.get(), nullptr, 0, &number), "fs_scene_get_reports");
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  require(fs_object_get(scene.get(), "server/prey", &got), "fs_object_get");
  require(fs_object_change(scene.get(), &got, FS_PART_POSE), "fs_object_change");
  fs_object_release(&got);
  require(fs_object_remove(scene.get(), "mesh"), "fs_object_remove");
  scene.reset();
  std::_Exit(EXIT_SUCCESS);  // a sanitizer cannot look for leaks in what is traced
}

}  // namespace life
