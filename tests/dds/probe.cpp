// A client for tests and measurements in a network of several sites (namespaces.sh). Its places are functions of the time of the
// day, which all sites of the network share, so that another one knows where things are at each instant.
//
//   probe server NAME DEVICE [RATE]      a server until its standard input ends; RATE of the servo, Hz
//   probe wall ENDPOINT SECONDS          moves the plane "wall" by 10 mm up and down, once a second, 25 moves a second with twist
//   probe follow ENDPOINT OBJECT SECONDS where the wall is there: prints as JSON the error (m) in its place: rms and max; and
//                                        what it would be if a move counted from its arrival: rms_on_arrival
//   probe steps ENDPOINT COUNT           puts the spring "spring" to and fro; prints the time of each
//   probe feel ENDPOINT SECONDS          prints the time of each tick at which the force has begun to follow
//   probe many ENDPOINT COUNT SECONDS    moves so many springs, 25 times a second, one group each time
//   probe mesh ENDPOINT MEGABYTES SECONDS   sets a mesh of that size, and keeps it
//   probe count ENDPOINT CLIENT          prints how many objects a client has, 20 times a second, with the time, until its input ends
//   probe weight ENDPOINT OBJECT         prints its weight in the same way; -1: it is not there
//   probe lateness ENDPOINT              prints the servo's late_p50, late_p99, late_max (s) and misses
//   probe puppet ENDPOINT NAME           does what lines of its standard input say, and answers each with "ok" or "error: ...":
//     add FIRST COUNT                    sets springs s<FIRST>, ... in one group
//     contents MEGABYTES                 sets a mesh, and springs with a curve: an expression f(d, t), a table, a surface
//     wander FIRST COUNT SECONDS         moves springs 25 times a second, in one group, and leaves each at a place of its own
//     gain OBJECT GAIN                   changes a spring; OBJECT may be another client's, as CLIENT/NAME
//     remove OBJECT                      COUNT springs from FIRST on: remove FIRST COUNT
//     stop                               ends the force
//     look CLIENT                        answers with a line of JSON: all that a client has. What must be the same at all sites
//                                        is one text for each object; and there is its start (s)
//     force                              answers with "on" or "off"
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <thread>

#include <forceserver/forceserver.hpp>

using forceserver::Curve;
using forceserver::Device;
using forceserver::Scene;
using forceserver::Server;
using forceserver::Servo;
using forceserver::Shape;
using forceserver::Surface;

namespace {

double day_time() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }
void wait_until(double time) {
  const double left = time - day_time();
  if (left > 0) std::this_thread::sleep_for(std::chrono::duration<double>(left));
}
bool input_ends_within(double seconds) {
  pollfd input{0, POLLIN, 0};
  return poll(&input, 1, static_cast<int>(1000 * seconds)) > 0;
}

constexpr double height = 0.01, turn = 2 * M_PI;  // m, rad/s
double wall_at(double time) { return height * std::sin(turn * time); }
double wall_speed_at(double time) { return height * turn * std::cos(turn * time); }

fs_object spring(const char* name, double x) {
  fs_object out = fs_object_init(name, FS_PRIMITIVE_POINT);
  out.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 5);
  out.pose.position.x = x;
  return out;
}

int serve(const char* name, const char* uri, double rate) {
  const Scene scene = Scene::create();
  const Device device = Device::open(uri);
  fs_servo_options options = fs_servo_options_init();
  options.priority = -1;
  options.rate = rate;
  const Servo servo = Servo::start(scene, device, &options);
  fs_server_options server_options = fs_server_options_init();
  server_options.max_clients = 1000;
  server_options.max_objects = 20000;
  const Server server = Server::start(servo, std::string("shm:") + name, &server_options);
  std::puts("ready");
  std::fflush(stdout);
  while (!input_ends_within(1)) {
    for (fs_event event; (event = scene.next_event(0)).kind != FS_EVENT_NONE;) {
      if (event.status < 0) std::fprintf(stderr, "probe server: %s: %s\n", event.name, event.text);
    }
  }
  return 0;
}

int wall(const Scene& scene, double seconds) {
  const fs_vec3 up = {0, 0, 1};
  fs_object object = fs_wall_init("wall", {0, 0, -1}, up, 500, 5);
  object.pose.position.z = wall_at(day_time());
  scene.object_set(object);
  const double start = day_time();
  for (int i = 0; day_time() < start + seconds; ++i) {
    wait_until(start + 0.04 * i);
    const double time = day_time();
    const fs_pose pose = {{0, 0, wall_at(time)}, {1, 0, 0, 0}};
    const fs_twist twist = {{0, 0, wall_speed_at(time)}, {0, 0, 0}};
    scene.object_move("wall", pose, &twist, FS_NOW);
  }
  return 0;
}

int follow(const Scene& scene, const std::string& name, double seconds) {
  const std::string client = name.substr(0, name.find('/'));
  double sum = 0, most = 0, sum_on_arrival = 0, arrived = 0;
  uint64_t revision = 0;
  int count = 0;
  for (double start = day_time(), next = start; next < start + seconds; next += 0.002) {
    wait_until(next);
    fs_motion motion{};
    for (const fs_motion& each : scene.get_motions(client.c_str())) {
      if (name == each.name) motion = each;
    }
    if (motion.motion_revision == 0) continue;
    const double time = scene.get_time(), truth = wall_at(day_time());
    if (motion.motion_revision != revision) arrived = time;
    revision = motion.motion_revision;
    fs_pose there;
    forceserver::throw_on_error(fs_motion_at(&motion, time, &there));
    const double error = there.position.z - truth;
    motion.time = arrived;
    forceserver::throw_on_error(fs_motion_at(&motion, time, &there));
    const double error_on_arrival = there.position.z - truth;
    sum += error * error;
    sum_on_arrival += error_on_arrival * error_on_arrival;
    most = std::fmax(most, std::fabs(error));
    ++count;
  }
  std::printf("{\"rms\": %.3g, \"max\": %.3g, \"rms_on_arrival\": %.3g, \"looks\": %d}\n", std::sqrt(sum / count), most,
              std::sqrt(sum_on_arrival / count), count);
  return 0;
}

int steps(const Scene& scene, int count) {
  scene.object_set(spring("spring", 0.03));
  std::this_thread::sleep_for(std::chrono::seconds(3));  // until it is felt
  for (int i = 0; i < count; ++i) {
    const fs_pose pose = {{0.03, i % 2 ? 0 : 0.01, 0}, {1, 0, 0, 0}};
    const fs_twist rests{};
    const double time = day_time();
    scene.object_move("spring", pose, &rests, FS_NOW);
    std::printf("%.6f\n", time);
    std::this_thread::sleep_for(std::chrono::duration<double>(0.3 + 0.04 * std::fabs(std::sin(i))));  // at any phase of the bridge
  }
  return 0;
}

int feel(const Scene& scene, double seconds) {
  const double day = day_time() - scene.get_time();
  uint64_t after = 0;
  double level = 0, changed = 0;
  for (const double start = day_time(); day_time() < start + seconds;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    for (const fs_recorded_tick& each : scene.get_record(after)) {
      after = each.number;
      const double y = each.tick.response.wrench.force.y, time = each.tick.state.time;
      // Within 0.1 s the force follows a step; until the next it is still.
      const bool is_still = time > changed + 0.15;
      if (is_still && changed > 0 && std::fabs(y - level) > 0.02) {
        std::printf("%.6f\n", time + day);
        changed = time;
      } else if (changed == 0) {
        changed = time;
      }
      if (time > changed + 0.1 && time < changed + 0.15) level = y;
    }
  }
  return 0;
}

int many(const Scene& scene, int count, double seconds) {
  std::vector<std::string> names;
  {
    forceserver::Group group(scene);
    for (int i = 0; i < count; ++i) {
      names.push_back("s" + std::to_string(i));
      scene.object_set(spring(names.back().c_str(), 0.001 * i));
    }
    group.commit();
  }
  const double start = day_time();
  for (int k = 0; day_time() < start + seconds; ++k) {
    wait_until(start + 0.04 * k);
    forceserver::Group group(scene);
    for (int i = 0; i < count; ++i) {
      const fs_pose pose = {{0.001 * i, 0.01 * std::sin(0.1 * k), 0}, {1, 0, 0, 0}};
      scene.object_move(names[static_cast<size_t>(i)], pose, nullptr, FS_NOW);
    }
    group.commit();
  }
  return 0;
}

Shape make_mesh(double megabytes) {
  const auto n = static_cast<uint32_t>(std::sqrt(megabytes * 1e6 / 48));  // 24 bytes of a point, two triangles of 12
  std::vector<fs_vec3> points;
  std::vector<uint32_t> triangles;
  for (uint32_t y = 0; y <= n; ++y) {
    for (uint32_t x = 0; x <= n; ++x) points.push_back({0.001 * x, 0.001 * y, 1 + 1e-4 * std::sin(0.1 * x * y)});
  }
  for (uint32_t y = 0; y < n; ++y) {
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t a = y * (n + 1) + x, b = a + n + 1;
      for (const uint32_t i : {a, a + 1, b, b, a + 1, b + 1}) triangles.push_back(i);
    }
  }
  return Shape::create_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3);
}

fs_object object_of(const char* name, const Shape& shape) {
  fs_object out = fs_object_init(name, FS_PRIMITIVE_MESH);
  out.shape = shape.get();
  out.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  return out;
}

int mesh(const Scene& scene, double megabytes, double seconds) {
  const Shape shape = make_mesh(megabytes);
  scene.object_set(object_of("mesh", shape));
  std::printf("%.6f\n", day_time());
  std::fflush(stdout);
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  return 0;
}

// ---------------------------------------------------------------------------------------------------------- puppet

std::string spring_name(int i) { return "s" + std::to_string(i); }

void add_springs(const Scene& scene, int first, int count) {
  forceserver::Group group(scene);
  for (int i = first; i < first + count; ++i) scene.object_set(spring(spring_name(i).c_str(), 0.0005 * i + 1.0 / 3));
  group.commit();
}

void add_contents(const Scene& scene, double megabytes) {
  const Shape shape = make_mesh(megabytes);
  fs_surface_settings settings = fs_surface_settings_init();
  settings.static_friction = 0.5;
  settings.dynamic_friction = 0.3;
  const Surface surface = Surface::create(settings);
  fs_object solid = object_of("mesh", shape);
  solid.surface = surface.get();
  scene.object_set(solid);
  std::vector<double> forces;
  for (int i = 0; i < 20000; ++i) forces.push_back(std::sin(0.01 * i));  // in three pieces
  const Curve waves = Curve::create_expression("2+sin(6.283*t)*exp(-d/0.02)"),
              table = Curve::create_table(forces.data(), forces.size(), 1e-5);
  for (const auto& [name, curve] : {std::pair{"waves", &waves}, {"table", &table}}) {
    fs_object object = spring(name, 0.02);
    object.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 5);
    object.front.curve = curve->get();
    scene.object_set(object);
  }
}

void wander(const Scene& scene, int first, int count, double seconds) {
  const double start = day_time();
  for (int k = 0; day_time() < start + seconds; ++k) {
    wait_until(start + 0.04 * k);
    forceserver::Group group(scene);
    for (int i = first; i < first + count; ++i) {
      const double phase = 0.1 * k + i;
      const fs_pose pose = {{0.0005 * i, 0.01 * std::sin(phase), 0.01 * day_time() / 1e9}, {1, 0, 0, 0}};
      const fs_twist twist = {{0, 0.025 * std::cos(phase), 0}, {0, 0, 0.1}};
      scene.object_move(spring_name(i), pose, &twist, FS_NOW);
    }
    group.commit();
  }
}

uint64_t hash_of(const void* data, size_t size) {
  uint64_t out = 0xcbf29ce484222325;
  for (size_t i = 0; i < size; ++i) out = (out ^ static_cast<const unsigned char*>(data)[i]) * 0x100000001b3;
  return out;
}

void tell(std::ostream& out, const fs_profile& p) {
  out << ' ' << p.kind << ' ' << p.sense;
  for (const double value : {p.gain, p.width, p.limit, p.reach, p.offset}) out << ' ' << value;
  if (!p.curve) return;
  const char* const expression = fs_curve_get_expression(p.curve);
  size_t count = 0;
  double step = 0;
  const double* const table = expression ? nullptr : fs_curve_get_table(p.curve, &count, &step);
  if (expression) out << ' ' << expression;
  if (table) out << " table " << step << ' ' << count << ' ' << hash_of(table, count * sizeof *table);
}

// All that must be the same at all sites, with all digits.
// Where it is going to stand counts, as the motion that led there may be over at one site already.
std::string text_of(const fs_object& object, const fs_motion& motion) {
  std::ostringstream out;
  out << std::hexfloat << object.primitive << ' ' << object.enabled << ' ' << object.tool_points << ' ' << object.damping << " at";
  fs_pose p;
  forceserver::throw_on_error(fs_motion_at(&motion, motion.time + 1, &p));
  const fs_quat& q = p.orientation;
  for (const double value : {p.position.x, p.position.y, p.position.z, q.w, q.x, q.y, q.z}) out << ' ' << value;
  out << " feels";
  tell(out, object.front);
  tell(out, object.back);
  const fs_contact& c = object.contact;
  out << " contact " << c.keep << ' ' << c.stiffness << ' ' << c.limit << ' ' << c.damping << ' ' << c.friction;
  if (object.shape) {
    fs_shape_info info = fs_shape_info_init();
    forceserver::throw_on_error(fs_shape_get_info(object.shape, &info));
    size_t points = 0, triangles = 0;
    const fs_vec3* const p0 = fs_shape_get_points(object.shape, &points);
    const uint32_t* const t0 = fs_shape_get_triangles(object.shape, &triangles);
    out << " shape " << points << ' ' << hash_of(p0, points * sizeof *p0) << ' ' << triangles << ' ' << hash_of(t0, triangles * 12);
  }
  if (object.surface) {
    fs_surface_settings settings = fs_surface_settings_init();
    forceserver::throw_on_error(fs_surface_get_settings(object.surface, &settings));
    out << " surface " << settings.static_friction << ' ' << settings.dynamic_friction;
  }
  return out.str();
}

std::string look(const Scene& scene, const std::string& client) {
  std::ostringstream out;
  out.precision(15);
  out << '{';
  size_t count = 0;
  if (fs_scene_get_motions(scene.get(), client.c_str(), nullptr, 0, &count) == FS_OK) {  // else there is no such client
    for (const fs_motion& each : scene.get_motions(client.c_str())) {
      const forceserver::Object object = scene.object_get(each.name);
      const std::string name = each.name;
      out << (out.tellp() > 1 ? ", " : "") << '"' << name.substr(name.find('/') + 1) << "\": [\"" << text_of(object, each)
          << "\", " << object.start << ']';
    }
  }
  out << '}';
  return out.str();
}

std::string obey(const Scene& scene, const std::string& line) {
  std::istringstream words(line);
  std::string what, name;
  int first = 0, count = 0;
  double number = 0;
  words >> what;
  if (what == "add" && words >> first >> count) {
    add_springs(scene, first, count);
  } else if (what == "contents" && words >> number) {
    add_contents(scene, number);
  } else if (what == "wander" && words >> first >> count >> number) {
    wander(scene, first, count, number);
  } else if (what == "gain" && words >> name >> number) {
    forceserver::Object object = scene.object_get(name);
    object.front.gain = number;
    scene.object_change(object, FS_PART_PROFILES);
  } else if (what == "remove" && words >> name) {
    if (words >> count) {
      forceserver::Group group(scene);
      for (int i = 0; i < count; ++i) scene.object_remove(spring_name(std::atoi(name.c_str()) + i));
      group.commit();
    } else {
      scene.object_remove(name);
    }
  } else if (what == "stop") {
    scene.stop_force();
  } else if (what == "look" && words >> name) {
    return look(scene, name);
  } else if (what == "force") {
    return scene.get_servo_stats().enabled ? "on" : "off";
  } else {
    return "error: what is \"" + line + "\"?";
  }
  scene.sync(5);
  return "ok";
}

int puppet(const Scene& scene) {
  for (std::string line; std::getline(std::cin, line);) {
    std::string answer;
    try {
      answer = obey(scene, line);
    } catch (const std::exception& error) {
      answer = std::string("error: ") + error.what();
    }
    std::cout << answer << std::endl;
  }
  return 0;
}

template <class F>
int print_often(F&& value) {
  do {
    std::printf("%.3f %g\n", day_time(), value());
    std::fflush(stdout);
  } while (!input_ends_within(0.05));
  return 0;
}

int run(int count, char** words) {
  if (count < 3) throw std::runtime_error("see the top of probe.cpp");
  const std::string what = words[1];
  if (what == "server") {
    return serve(words[2], count > 3 ? words[3] : "sim:?hold=0,0,0", count > 4 ? std::atof(words[4]) : 0);
  }
  if (what == "puppet" && count > 3) return puppet(Scene::connect(words[2], words[3]));
  const Scene scene = Scene::connect(words[2], what == "wall" || what == "steps" || what == "many" || what == "mesh"
                                                   ? what
                                                   : what + std::to_string(getpid()));
  const auto number = [&](int i) { return count > i ? std::atof(words[i]) : throw std::runtime_error("a number is missing"); };
  if (what == "wall") return wall(scene, number(3));
  if (what == "follow") return follow(scene, words[3], number(4));
  if (what == "steps") return steps(scene, static_cast<int>(number(3)));
  if (what == "feel") return feel(scene, number(3));
  if (what == "many") return many(scene, static_cast<int>(number(3)), number(4));
  if (what == "mesh") return mesh(scene, number(3), number(4));
  if (what == "count") {
    return print_often([&] {
      size_t objects = 0;
      return fs_scene_get_motions(scene.get(), words[3], nullptr, 0, &objects) == FS_OK ? static_cast<double>(objects) : 0;
    });
  }
  if (what == "weight") {
    return print_often([&] {
      fs_report report{};
      return fs_scene_get_report(scene.get(), words[3], &report) == FS_OK ? report.weight : -1;
    });
  }
  if (what == "lateness") {
    const fs_servo_stats stats = scene.get_servo_stats();
    std::printf("%g %g %g %llu\n", stats.late_p50, stats.late_p99, stats.late_max, static_cast<unsigned long long>(stats.misses));
    return 0;
  }
  throw std::runtime_error("there is no probe " + what);
}

}  // namespace

int main(int count, char** words) {
  try {
    return run(count, words);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "probe: %s\n", error.what());
    return 1;
  }
}
