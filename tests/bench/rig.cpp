#include "rig.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "device.h"

namespace bench {

void check(fs_status status, const char* what) {
  if (status == FS_OK) return;
  std::fprintf(stderr, "%s: %s: %s\n", what, fs_status_name(status), fs_last_error());
  std::_Exit(1);
}

Scene make_scene() {
  fs_scene* scene = nullptr;
  check(fs_scene_create(&scene), "fs_scene_create");
  return Scene(scene);
}

Scene connect(const std::string& endpoint, const std::string& client) {
  fs_scene* scene = nullptr;
  check(fs_scene_connect((endpoint + "?timeout=10").c_str(), client.c_str(), &scene), "fs_scene_connect");
  return Scene(scene);
}

Rig::Rig(int priority, double rate)
    : endpoint("shm:bench-" + std::to_string(getpid())), scene(make_scene()), device(open_bench_device()) {
  fs_servo_options options = fs_servo_options_init();
  options.priority = priority;
  options.rate = rate;
  options.ramp = options.fade = -1;
  fs_servo* started = nullptr;
  check(fs_servo_start(scene.get(), device.get(), &options, &started), "fs_servo_start");
  servo.reset(started);
  fs_server_options door = fs_server_options_init();
  door.max_clients = 100;
  fs_server* opened = nullptr;
  check(fs_server_start(servo.get(), endpoint.c_str(), &door, &opened), "fs_server_start");
  server.reset(opened);
}

fs_servo_stats Rig::stats() const {
  fs_servo_stats stats = fs_servo_stats_init();
  check(fs_scene_get_servo_stats(scene.get(), &stats), "fs_scene_get_servo_stats");
  return stats;
}

fs_object drawing_point(const char* name) {
  fs_object object = fs_object_init(name, FS_PRIMITIVE_POINT);
  object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  return object;
}

fs_pose on_circle(int i, int n) {
  const double angle = 2 * M_PI * i / n;
  return {{0.01 * std::cos(angle), 0.01 * std::sin(angle), 0}, {1, 0, 0, 0}};
}

fs_object far_point(const char* name, int i) {
  fs_object object = fs_object_init(name, FS_PRIMITIVE_POINT);
  object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  object.front.reach = 0.005;
  object.pose = {{0.1 + 0.001 * (i % 100), 0.1, 0.001 * (i / 100)}, {1, 0, 0, 0}};
  return object;
}

}  // namespace bench
