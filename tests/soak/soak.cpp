// The load of tests/soak/run, through the public C functions alone. soak.py starts it, tells it what to do, line by line on
// standard input, and reads what it answers.
//   soak virtual TICKS SEED              a virtual servo makes so many ticks between random calls, then the golden run
//   soak golden                          the golden run alone, in a fresh process
//   soak server ENDPOINT SEED PRIORITY   a servo with a server and a device that can be unplugged
//   soak client ENDPOINT NAME SEED       a client that makes random calls
//   soak observer ENDPOINT               a client that looks at the server, as it is told
#include <malloc.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <forceserver/driver.h>

#include "scenes/folder.h"
#include "scenes/scenes.h"

using namespace scenes;

namespace {

constexpr double period = 1e-3;        // s, of all servos
constexpr double slew_limit = 1500;    // N/s, of the server's servo
constexpr double max_stiffness = 500;  // N/m: slew_limit is 3 m/s times that

double monotonic() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
void wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

// Commands from standard input, a line each.
class Commands {
 public:
  // The next line, or an empty one when none comes within so long (s). At the end of the input: "leave".
  std::string next(double timeout) {
    for (;;) {
      if (const size_t end = read_.find('\n'); end != std::string::npos) {
        const std::string line = read_.substr(0, end);
        read_.erase(0, end + 1);
        return line;
      }
      pollfd look{STDIN_FILENO, POLLIN, 0};
      if (poll(&look, 1, static_cast<int>(1000 * timeout)) <= 0) return "";
      char buffer[256];
      const ssize_t got = read(STDIN_FILENO, buffer, sizeof buffer);
      if (got <= 0) return "leave";
      read_.append(buffer, static_cast<size_t>(got));
    }
  }

 private:
  std::string read_;
};

void tell(const std::string& line) {
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

// A call that a busy or suspended server has not answered in time is made again, for two minutes.
template <class Call>
fs_status patiently(Call&& call) {
  const double start = monotonic();
  fs_status status;
  do status = call();
  while (status == FS_ERROR_TIMEOUT && monotonic() - start < 120);
  return status;
}

// Makes calls of all kinds at random. One that gives a status which it must not give ends the process.
class Load {
 public:
  Load(fs_scene* scene, std::string folder, uint64_t seed, uint64_t names, bool is_connected)
      : scene_(scene), folder_(std::move(folder)), random_(seed), names_(names), is_connected_(is_connected) {}

  void act() {
    ++calls;
    switch (random_.below(26)) {
      case 0: case 1: case 2: case 3: case 4: return set();
      case 5: case 6: case 7: case 8: return move();
      case 9: check(fs_object_remove(scene_, name().c_str()), "fs_object_remove", {FS_ERROR_NOT_FOUND}); return;
      case 10: case 11: return change();
      case 12: case 13: return group();
      case 14: return set_frame();
      case 15: check(fs_scene_set_clutch(scene_, random_.coin()), "fs_scene_set_clutch"); return;
      case 16: return set_tool();
      case 17: check(fs_scene_set_accuracy(scene_, random_.coin() ? 0 : 0.01), "fs_scene_set_accuracy"); return;
      case 18: check(fs_scene_set_max_stiffness(scene_, random_.coin() ? 0 : 400), "fs_scene_set_max_stiffness"); return;
      case 19: case 20: return evaluate();
      case 21: case 22: return look();
      case 23: if (random_.coin(0.2)) use_file(); return;
      case 24: if (is_connected_) edit_others(); return;
      default: if (random_.coin(0.1)) check(fs_scene_clear(scene_), "fs_scene_clear"); return;
    }
  }

  // Nothing is felt any more, and frame, tool and bounds are as in a new scene.
  void reset() {
    const fs_frame frame = fs_frame_init();
    const fs_vec3 origin{};
    check(fs_scene_clear(scene_), "fs_scene_clear");
    check(fs_scene_set_clutch(scene_, false), "fs_scene_set_clutch");
    check(fs_scene_set_frame(scene_, &frame), "fs_scene_set_frame");
    check(fs_scene_set_tool(scene_, &origin, 1), "fs_scene_set_tool");
    check(fs_scene_set_tool_radius(scene_, 0), "fs_scene_set_tool_radius");
    check(fs_scene_set_accuracy(scene_, 0), "fs_scene_set_accuracy");
    check(fs_scene_set_max_stiffness(scene_, 0), "fs_scene_set_max_stiffness");
  }

  uint64_t calls = 0;

 private:
  fs_status check(fs_status status, const char* what, std::initializer_list<fs_status> others = {}) {
    if (status == FS_OK || std::find(others.begin(), others.end(), status) != others.end()) return status;
    if (is_connected_ && status == FS_ERROR_TIMEOUT) return status;  // the server is suspended, or the machine busy
    std::fprintf(stderr, "%s: %s: %s\n", what, fs_status_name(status), fs_last_error());
    std::_Exit(status == FS_ERROR_DISCONNECTED ? 3 : 1);
  }

  std::string name() { return "o" + std::to_string(random_.below(names_)); }

  // A random object with shapes and curves of its own, which live in `content`.
  fs_object object(Content& content) {
    RandomOptions options;
    options.count = 1;
    options.half = 0.06;
    options.mesh_triangles = 150;
    options.moves = options.damps = options.masks = options.disables = true;
    check(fs_scene_get_time(scene_, &options.time), "fs_scene_get_time");
    content = random_content(random_, options);
    fs_object o = content.objects[0];
    std::strcpy(o.name, name().c_str());
    if (o.primitive == FS_PRIMITIVE_POINT && has_expressions() && random_.coin(0.2)) {
      o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 2);
      o.front.curve = content.keep(make_expression("(1+sin(30*t))*exp(-d/0.02)"), {});
    }
    if (o.primitive >= FS_PRIMITIVE_PLANE && random_.coin(0.3)) {
      const double friction = random_.coin() ? 0.3 : 0;
      o.contact = {static_cast<fs_keep>(1 + random_.below(3)), 0, random_.coin(0.2) ? 0.0 : 500.0, 3, 1, friction, {}};
      if (friction == 0 && random_.coin()) {
        surface_ = make_random_surface();
        o.surface = surface_.get();
      }
    }
    o.lifetime = random_.coin(0.1) ? 0.1 : 0;
    return o;
  }
  Surface make_random_surface() {
    fs_surface_settings settings = sticky(0.6, 0.3, 0.001);
    if (random_.coin()) check(fs_surface_set_impact(&settings, FS_IMPACT_MEDIUM), "fs_surface_set_impact");
    if (random_.coin()) return make_surface(settings);
    settings.columns = settings.rows = 4;
    settings.column_width = settings.row_width = 0.005;
    settings.repeats = true;
    std::vector<double> heights(16);
    for (double& h : heights) h = random_.between(-0.0005, 0);
    return make_texture(settings, heights);
  }

  // UNSUPPORTED: a solid mesh beside a tool whose points have a radius.
  void set() {
    Content content;
    const fs_object o = object(content);
    check(fs_object_set(scene_, &o), "fs_object_set", {FS_ERROR_UNSUPPORTED});
  }
  void move() {
    const fs_pose pose = random_.pose(0.05);
    const fs_twist twist{random_.in_box(0.1), random_.in_box(1)};
    check(fs_object_move(scene_, name().c_str(), &pose, random_.coin() ? &twist : nullptr, FS_NOW), "fs_object_move",
          {FS_ERROR_NOT_FOUND});
  }
  void change() {
    fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
    if (check(fs_object_get(scene_, name().c_str(), &o), "fs_object_get", {FS_ERROR_NOT_FOUND}) == FS_OK) {
      o.front.gain *= random_.between(0.5, 1.5);
      o.enabled = random_.coin(0.8);
      check(fs_object_change(scene_, &o, random_.coin() ? FS_PART_PROFILES : FS_PART_OTHER), "fs_object_change",
            {FS_ERROR_NOT_FOUND});
    }
    fs_object_release(&o);
  }
  void group() {
    if (check(fs_scene_begin(scene_), "fs_scene_begin") != FS_OK) return;
    for (uint64_t k = 1 + random_.below(8); k > 0; --k) {
      const uint64_t which = random_.below(4);
      if (which < 2) set();
      if (which == 2) move();
      if (which == 3) check(fs_object_remove(scene_, name().c_str()), "fs_object_remove", {FS_ERROR_NOT_FOUND});
    }
    const bool is_kept = random_.coin(0.7);
    const fs_status end = check(is_kept ? fs_scene_commit(scene_) : fs_scene_cancel(scene_), "the end of a group",
                                {FS_ERROR_UNSUPPORTED});
    if (end != FS_OK) check(fs_scene_cancel(scene_), "fs_scene_cancel");
  }
  void set_frame() {
    fs_frame frame = fs_frame_init();
    frame.pose.position = random_.in_box(0.01);
    frame.pose.orientation = random_.orientation();
    frame.scale = random_.between(0.5, 2);
    frame.force_scale = random_.between(0.2, 1);
    check(fs_scene_set_frame(scene_, &frame), "fs_scene_set_frame");
  }
  void set_tool() {
    const fs_vec3 points[]{random_.in_box(0.01), random_.in_box(0.02), random_.in_box(0.02)};
    check(fs_scene_set_tool(scene_, points, 1 + random_.below(3)), "fs_scene_set_tool");
    check(fs_scene_set_tool_radius(scene_, random_.coin(0.2) ? 0.005 : 0), "fs_scene_set_tool_radius", {FS_ERROR_UNSUPPORTED});
  }
  void evaluate() {
    fs_tool* made = nullptr;
    if (check(fs_tool_create(scene_, nullptr, 0, &made), "fs_tool_create") != FS_OK) return;
    const Tool tool(made);
    fs_response response;
    for (int k = 0; k < 5; ++k) {
      fs_state state{};
      state.pose = random_.pose(0.05);
      check(fs_evaluate(tool.get(), &state, &response), "fs_evaluate");
    }
    std::vector<fs_vec3> places(random_.coin(0.02) ? 2000 : 3), forces(places.size());
    for (fs_vec3& x : places) x = random_.in_box(0.05);
    check(fs_evaluate_field(scene_, nullptr, FS_NOW, places.data(), places.size(), forces.data()), "fs_evaluate_field");
  }
  void look() {
    std::vector<fs_report> reports(64);
    std::vector<fs_motion> motions(64);
    size_t count = 0;
    fs_view view;
    fs_event event;
    fs_servo_stats stats = fs_servo_stats_init();
    fs_state hand;
    check(fs_scene_get_reports(scene_, reports.data(), reports.size(), &count), "fs_scene_get_reports");
    check(fs_scene_get_motions(scene_, nullptr, motions.data(), motions.size(), &count), "fs_scene_get_motions");
    check(fs_scene_get_view(scene_, nullptr, &view), "fs_scene_get_view");
    check(fs_scene_get_servo_stats(scene_, &stats), "fs_scene_get_servo_stats");
    check(fs_scene_get_hand(scene_, &hand, nullptr, nullptr), "fs_scene_get_hand");
    do check(fs_scene_next_event(scene_, 0, &event), "fs_scene_next_event");
    while (event.kind != FS_EVENT_NONE);
  }
  void use_file() {
    const std::string path = folder_ + "/" + std::to_string(getpid()) + ".json";
    if (random_.coin()) check(fs_scene_save(scene_, path.c_str()), "fs_scene_save");
    else check(fs_scene_load(scene_, path.c_str()), "fs_scene_load", {FS_ERROR_NOT_FOUND, FS_ERROR_UNSUPPORTED});
    std::error_code gone;
    if (++files_ % 8) return;
    // The meshes beside the file are named after it.
    for (const auto& file : std::filesystem::directory_iterator(folder_, gone)) {
      if (file.path().filename().string().starts_with(std::to_string(getpid()))) std::filesystem::remove(file.path(), gone);
    }
  }
  // Changes an object of another guest, whose objects nobody has to find again.
  void edit_others() {
    std::vector<fs_motion> motions(600);
    size_t count = 0;
    if (check(fs_scene_get_motions(scene_, nullptr, motions.data(), motions.size(), &count), "fs_scene_get_motions") != FS_OK) return;
    count = std::min(count, motions.size());
    if (count == 0) return;
    const char* const other = motions[random_.below(count)].name;
    if (std::strncmp(other, "guest", 5) != 0) return;
    const fs_pose pose = random_.pose(0.05);
    check(fs_object_move(scene_, other, &pose, nullptr, FS_NOW), "fs_object_move", {FS_ERROR_NOT_FOUND});
    if (random_.coin(0.2)) check(fs_object_remove(scene_, other), "fs_object_remove", {FS_ERROR_NOT_FOUND});
  }

  fs_scene* const scene_;
  const std::string folder_;
  Random random_;
  const uint64_t names_;
  const bool is_connected_;
  Surface surface_;
  uint64_t files_ = 0;
};

// ---- In virtual time.

// A hash of state, response and force of all ticks while the hand flies through the testbed for 20 s. Everything is new but
// the scene, which must be empty.
uint64_t golden(fs_scene* scene) {
  const Device device = open_device("sim:?path=figure8&seed=5");
  const Content content = testbed();
  fill(scene, content);
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  const Servo servo = start_servo(scene, device.get(), options);
  uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a
  const auto add = [&](const void* data, size_t size) {
    for (size_t i = 0; i < size; ++i) hash = (hash ^ static_cast<const unsigned char*>(data)[i]) * 0x100000001b3u;
  };
  std::vector<fs_tick> ticks(1000);
  for (int second = 0; second < 20; ++second) {
    size_t count = 0;
    require(fs_servo_step(servo.get(), ticks.size()), "fs_servo_step");
    require(fs_servo_get_record(servo.get(), ticks.data(), ticks.size(), &count), "fs_servo_get_record");
    for (const fs_tick& tick : ticks) {
      add(&tick.state, sizeof tick.state);
      add(&tick.response, sizeof tick.response);
      add(&tick.sent, sizeof tick.sent);
    }
  }
  return hash;
}

size_t entries(const char* folder) {
  const std::filesystem::directory_iterator all(folder);
  return static_cast<size_t>(std::distance(begin(all), end(all)));
}
// Bytes resident and in use by the heap, descriptors, threads.
void tell_holdings(const std::string& when) {
  size_t all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  const struct mallinfo2 heap = mallinfo2();
  tell("holdings " + when + " " + std::to_string(resident * static_cast<size_t>(sysconf(_SC_PAGESIZE))) + " " +
       std::to_string(heap.uordblks + heap.hblkhd) + " " + std::to_string(entries("/proc/self/fd")) + " " +
       std::to_string(entries("/proc/self/task")));
}

int run_virtual(uint64_t ticks, uint64_t seed) {
  const Folder folder;
  const Scene scene = make_scene();
  Random random(seed);
  Load load(scene.get(), folder.path, seed + 1, 12, false);
  uint64_t done = 0, servos = 0, faults = 0;
  const double start = monotonic();
  bool is_first = true;  // the look after a tenth of the ticks is still to come
  while (is_first || done < ticks) {
    const Device device = open_device(("sim:?path=figure8&seed=" + std::to_string(seed + servos)).c_str());
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.fade = random.log_between(0.02, 1);
    options.blend = random.coin(0.2) ? -1 : 0;
    const Servo servo = start_servo(scene.get(), device.get(), options);
    ++servos;
    const auto step = [&](uint64_t n) {
      require(fs_servo_step(servo.get(), n), "fs_servo_step");
      done += n;
    };
    const uint64_t next_look = is_first ? ticks / 10 : ticks;
    const uint64_t end = std::min<uint64_t>(done + random.below(500'000), next_look);
    while (done < end) {
      load.act();
      if (random.coin(0.01)) {
        require(fs_scene_stop_force(scene.get()), "fs_scene_stop_force");
        step(1 + random.below(50));
        require(fs_scene_resume_force(scene.get()), "fs_scene_resume_force");
      }
      step(1 + random.below(200));
      fs_servo_stats stats = fs_servo_stats_init();
      require(fs_scene_get_servo_stats(scene.get(), &stats), "fs_scene_get_servo_stats");
      if (stats.faults == 0) continue;
      ++faults;  // a hand that was pushed too fast
      require(fs_servo_set_enabled(servo.get(), true), "fs_servo_set_enabled");
    }
    if (done < next_look) continue;
    load.reset();
    step(3000);  // all has faded out
    tell_holdings(is_first ? "tenth" : "end");
    is_first = false;
  }
  std::printf("virtual %llu in %.0f s, %llu calls, %llu servos, %llu faults\n", static_cast<unsigned long long>(done),
              monotonic() - start, static_cast<unsigned long long>(load.calls), static_cast<unsigned long long>(servos),
              static_cast<unsigned long long>(faults));
  std::printf("golden %016llx\n", static_cast<unsigned long long>(golden(scene.get())));
  return EXIT_SUCCESS;
}

// ---- The server.

// The device "soak:SEED": the simulator on the real clock, which can be unplugged.
std::atomic<double> unplugged_until{0};  // s, monotonic
bool is_unplugged() { return monotonic() < unplugged_until; }

fs_driver soak_driver() {
  fs_driver driver{};
  driver.struct_size = sizeof driver;
  driver.scheme = "soak";
  driver.open = [](const char* address, void** self) {
    fs_device* simulator = nullptr;
    const fs_status status = fs_device_open((std::string("sim:?path=figure8&seed=") + address).c_str(), &simulator);
    *self = simulator;
    return status;
  };
  driver.close = [](void* self) { fs_device_close(static_cast<fs_device*>(self)); };
  driver.get_info = [](void* self, fs_device_info* out) { return fs_device_get_info(static_cast<fs_device*>(self), out); };
  driver.read = [](void* self, fs_state* out) {
    return is_unplugged() ? FS_ERROR_DISCONNECTED : fs_device_read(static_cast<fs_device*>(self), out);
  };
  driver.write = [](void* self, const fs_wrench* wrench) {
    return is_unplugged() ? FS_ERROR_DISCONNECTED : fs_device_write(static_cast<fs_device*>(self), wrench);
  };
  return driver;
}

int run_server(const char* endpoint, const std::string& seed, int priority) {
  const fs_driver driver = soak_driver();
  require(fs_driver_register(&driver), "fs_driver_register");
  const Scene scene = make_scene();
  const Device device = open_device(("soak:" + seed).c_str());
  fs_servo_options options = fs_servo_options_init();
  options.rate = 1 / period;
  options.force_limit = 10;
  options.max_stiffness = max_stiffness;
  options.slew_limit = slew_limit;
  options.priority = priority;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  fs_server_options server_options = fs_server_options_init();
  server_options.max_clients = 64;
  server_options.force_limit = 4;
  fs_server* made = nullptr;
  require(fs_server_start(servo.get(), endpoint, &server_options, &made), "fs_server_start");
  const Server server(made);
  const Folder folder;
  Load load(scene.get(), folder.path, std::stoull(seed), 8, false);
  tell("ready");

  unsigned long latched = 0;
  Commands commands;
  for (;;) {
    const std::string command = commands.next(0.05);
    if (command == "leave") break;
    if (command.starts_with("unplug ")) unplugged_until = monotonic() + std::stod(command.substr(7));
    if (command.starts_with("save ")) {
      const Content content = testbed();  // with meshes, whose files are beside that of the scene
      fill(scene.get(), content);
      tell(fs_status_name(fs_scene_save(scene.get(), command.c_str() + 5)));
    }
    if (command == "holdings") tell_holdings("now");
    if (command == "latched") tell(std::to_string(latched));
    if (command == "clock") tell(std::to_string(std::time(nullptr)));
    load.act();
    fs_servo_stats stats = fs_servo_stats_init();
    require(fs_scene_get_servo_stats(scene.get(), &stats), "fs_scene_get_servo_stats");
    if (!(stats.faults & ~static_cast<uint32_t>(FS_FAULT_DEVICE))) continue;
    ++latched;
    require(fs_servo_set_enabled(servo.get(), true), "fs_servo_set_enabled");
  }
  return EXIT_SUCCESS;
}

// ---- Clients.

Scene join(const std::string& endpoint, const char* name) {
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect((endpoint + "?timeout=60").c_str(), name, &scene);
  if (status == FS_OK) return Scene(scene);
  std::fprintf(stderr, "fs_scene_connect: %s: %s\n", fs_status_name(status), fs_last_error());
  std::_Exit(1);
}

// What an object is, in a line that is the same wherever it is looked at.
std::string describe(const std::string& name, const fs_object& o) {
  const fs_vec3& x = o.pose.position;
  const fs_quat& q = o.pose.orientation;
  char text[1000];
  fs_shape_info shape = fs_shape_info_init();
  if (o.shape) require(fs_shape_get_info(o.shape, &shape), "fs_shape_get_info");
  std::snprintf(text, sizeof text, "object %s %s %a %a %a %a %a %a %a %s %a %a %s %a %a %u %d %a %d %016llx%016llx", name.c_str(),
                fs_primitive_name(o.primitive), x.x, x.y, x.z, q.w, q.x, q.y, q.z, fs_profile_kind_name(o.front.kind), o.front.gain,
                o.front.limit, fs_profile_kind_name(o.back.kind), o.damping, o.contact.stiffness, o.tool_points, o.enabled, o.lifetime,
                o.surface != nullptr, static_cast<unsigned long long>(shape.content[0]),
                static_cast<unsigned long long>(shape.content[1]));
  return text;
}

// Tells all objects of a scene. prefix: what others call those of this scene, such as "client/"; an observer tells what others have.
void tell_objects(fs_scene* scene, const std::string& prefix) {
  std::vector<fs_motion> motions(2000);
  size_t count = 0;
  require(patiently([&] { return fs_scene_get_motions(scene, nullptr, motions.data(), motions.size(), &count); }),
          "fs_scene_get_motions");
  for (size_t i = 0; i < std::min(count, motions.size()); ++i) {
    const std::string name = motions[i].name;
    const bool is_foreign = name.find('/') != std::string::npos;
    if (is_foreign != prefix.empty()) continue;
    fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
    const fs_status status = patiently([&] { return fs_object_get(scene, name.c_str(), &o); });
    if (status != FS_ERROR_NOT_FOUND) {  // gone meanwhile
      require(status, "fs_object_get");
      tell(describe(prefix + name, o));
    }
    fs_object_release(&o);
  }
  tell(".");
}

int run_client(const char* endpoint, const char* name, uint64_t seed) {
  Scene scene = join(endpoint, name);
  const Folder folder;
  Load load(scene.get(), folder.path, seed, 6, true);
  tell("connected");
  Random random(seed + 1);
  Commands commands;
  for (;;) {
    const std::string command = commands.next(random.between(0, 0.1));
    if (command == "leave") break;
    if (command == "freeze") {
      require(patiently([&] { return fs_scene_sync(scene.get(), 10); }), "fs_scene_sync");
      tell_objects(scene.get(), std::string(name) + "/");
      while (commands.next(1) != "leave") {
      }
      break;
    }
    load.act();
  }
  scene.reset();
  return EXIT_SUCCESS;
}

// Looks at the ticks that the servo has made.
class Ticks {
 public:
  void look(fs_scene* scene) {
    size_t count = 0;
    const fs_status status = fs_scene_get_record(scene, last_.number, ticks_.data(), ticks_.size(), &count);
    if (status == FS_ERROR_TIMEOUT) return;
    require(status, "fs_scene_get_record");
    for (size_t i = 0; i < std::min(count, ticks_.size()); ++i) add(ticks_[i]);
  }

  uint64_t seen = 0, unseen = 0, cuts = 0, above = 0;
  double largest_step = 0, largest_cut = 0;  // N/ms
  double largest_force = 0;                  // N

 private:
  void add(const fs_recorded_tick& now) {
    const fs_vec3 force = now.tick.sent.force, change = force - last_.tick.sent.force;
    largest_force = std::fmax(largest_force, norm(force));
    const bool is_next = now.number == last_.number + 1;
    if (last_.number) unseen += now.number - last_.number - 1;
    ++seen;
    // A fault, a stop and the loss of the device make the force zero at once, as they must.
    const bool is_cut = force == fs_vec3{} && (now.tick.faults || (now.tick.response.flags & FS_RESPONSE_GUARDED));
    const double since = period + now.tick.late, step = norm(change) / (1000 * since);
    if (is_next && is_cut) {
      cuts += step > 0;
      largest_cut = std::fmax(largest_cut, step);
    } else if (is_next) {
      largest_step = std::fmax(largest_step, step);
      above += !(norm(change) <= slew_limit * since * (1 + 1e-9));
    }
    last_ = now;
  }

  std::vector<fs_recorded_tick> ticks_ = std::vector<fs_recorded_tick>(4096);
  fs_recorded_tick last_{};
};

int run_observer(const char* endpoint) {
  const Scene scene = join(endpoint, "observer");
  tell("connected");
  fs_object o = fs_object_init("ball", FS_PRIMITIVE_MESH);
  const Shape ball = make_mesh(sphere_mesh(0.02, 1000));
  o.shape = ball.get();
  require(fs_object_set(scene.get(), &o), "fs_object_set");
  Ticks ticks;
  Commands commands;
  for (;;) {
    const std::string command = commands.next(0.2);
    ticks.look(scene.get());
    if (command == "leave") return EXIT_SUCCESS;
    if (command == "stop") tell(fs_status_name(patiently([&] { return fs_scene_stop_force(scene.get()); })));
    if (command == "resume") tell(fs_status_name(patiently([&] { return fs_scene_resume_force(scene.get()); })));
    if (command.starts_with("save ")) tell(fs_status_name(fs_scene_save(scene.get(), command.c_str() + 5)));
    if (command == "list") {
      std::vector<fs_client> clients(100);
      size_t count = 0;
      require(patiently([&] { return fs_scene_get_clients(scene.get(), clients.data(), clients.size(), &count); }),
              "fs_scene_get_clients");
      for (size_t i = 0; i < std::min(count, clients.size()); ++i) tell(std::string("client ") + clients[i].name);
      tell_objects(scene.get(), "");
    }
    if (command == "look") {
      fs_servo_stats stats = fs_servo_stats_init();
      require(patiently([&] { return fs_scene_get_servo_stats(scene.get(), &stats); }), "fs_scene_get_servo_stats");
      double age = 1e9;  // s, from the newest tick's time, by the server's clock, to now, by this process's: the least of some
      for (int k = 0; k < 5; ++k) {
        fs_state hand;
        require(fs_scene_get_hand(scene.get(), &hand, nullptr, nullptr), "fs_scene_get_hand");
        if (hand.time > 0) age = std::fmin(age, monotonic() - hand.time);
        wait(3e-4);
      }
      fs_event event;
      do require(fs_scene_next_event(scene.get(), 0, &event), "fs_scene_next_event");
      while (event.kind != FS_EVENT_NONE);
      char text[1000];
      std::snprintf(text, sizeof text,
                    "{\"time\": %.9f, \"age\": %.9f, \"ticks\": %llu, \"misses\": %llu, \"device_errors\": %llu, \"late_p99\": %.9f, "
                    "\"compute_p99\": %.9f, \"realtime\": \"%s\", \"seen\": %llu, \"unseen\": %llu, \"cuts\": %llu, "
                    "\"above\": %llu, \"largest_step\": %.9g, \"largest_cut\": %.9g, \"largest_force\": %.9g}",
                    monotonic(), age, static_cast<unsigned long long>(stats.ticks), static_cast<unsigned long long>(stats.misses),
                    static_cast<unsigned long long>(stats.device_errors), stats.late_p99, stats.compute_p99,
                    fs_realtime_name(stats.realtime), static_cast<unsigned long long>(ticks.seen),
                    static_cast<unsigned long long>(ticks.unseen), static_cast<unsigned long long>(ticks.cuts),
                    static_cast<unsigned long long>(ticks.above), ticks.largest_step, ticks.largest_cut, ticks.largest_force);
      tell(text);
    }
  }
}

}  // namespace

// libfaketime 0.9.10 also shifts waits until a time of CLOCK_MONOTONIC, whatever DONT_FAKE_MONOTONIC says: they end at once then.
// A function of the program comes before that of a preloaded library.
extern "C" int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* rest) {
  return syscall(SYS_clock_nanosleep, clock, flags, time, rest) == 0 ? 0 : errno;
}

int main(int argc, char** argv) {
  const std::string part = argc > 1 ? argv[1] : "";
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // it ends with soak.py
  std::signal(SIGPIPE, SIG_IGN);
  if (part == "virtual" && argc == 4) return run_virtual(std::stoull(argv[2]), std::stoull(argv[3]));
  if (part == "golden" && argc == 2) {
    const Scene scene = make_scene();
    std::printf("golden %016llx\n", static_cast<unsigned long long>(golden(scene.get())));
    return EXIT_SUCCESS;
  }
  if (part == "server" && argc == 5) return run_server(argv[2], argv[3], std::stoi(argv[4]));
  if (part == "client" && argc == 5) return run_client(argv[2], argv[3], std::stoull(argv[4]));
  if (part == "observer" && argc == 3) return run_observer(argv[2]);
  std::fprintf(stderr, "started by tests/soak/run\n");
  return 2;
}
