// A client for tests and measurements in a network of several sites (namespaces.sh). Its places are functions of the time of the
// day, which all sites of the network share, so that another one knows where things are at each instant.
//
//   probe server NAME DEVICE             a server until its standard input ends
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
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include <forceserver/forceserver.hpp>

using forceserver::Device;
using forceserver::Scene;
using forceserver::Server;
using forceserver::Servo;
using forceserver::Shape;

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

int serve(const char* name, const char* uri) {
  const Scene scene = Scene::create();
  const Device device = Device::open(uri);
  fs_servo_options options = fs_servo_options_init();
  options.priority = -1;
  const Servo servo = Servo::start(scene, device, &options);
  fs_server_options server_options = fs_server_options_init();
  server_options.max_clients = 1000;
  server_options.max_objects = 20000;
  const Server server = Server::start(servo, std::string("shm:") + name, &server_options);
  std::puts("ready");
  std::fflush(stdout);
  while (!input_ends_within(1)) {
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

int mesh(const Scene& scene, double megabytes, double seconds) {
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
  const Shape shape = Shape::create_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3);
  fs_object object = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  object.shape = shape.get();
  object.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  scene.object_set(object);
  std::printf("%.6f\n", day_time());
  std::fflush(stdout);
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
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
  if (what == "server") return serve(words[2], count > 3 ? words[3] : "sim:?hold=0,0,0");
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
