// Three clients share one landscape and one hand, as in the testbed of Flueckiger & Nguyen: an editor, a rover and the
// display of hazards. All is simulated: no device is needed.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <stdexcept>
#include <thread>

#include "flight.h"
#include "terrain.h"

namespace {

// The hand's 0.2 m are 30 km here: what it feels as k N/m is k / scale for each metre of the landscape.
const double scale = 150000;

void check(fs_status status) {
  if (status < 0) throw std::runtime_error(fs_last_error());
}

// What touches the landscape: not a point but a finger tip, 16 points on a ball 8 mm wide, which is 1200 m here. The
// force is the mean of theirs, so that one point that falls into the next valley makes no great step.
void set_finger(fs_scene* scene) {
  fs_vec3 points[16];
  for (int i = 0; i < 16; ++i) {  // evenly, along a spiral
    const double z = (2 * i + 1) / 16.0 - 1, angle = 2.4 * i, radius = std::sqrt(1 - z * z);
    points[i] = {600 * radius * std::cos(angle), 600 * radius * std::sin(angle), 600 * z};
  }
  check(fs_scene_set_tool(scene, points, 16));
}

// The ground: a mesh that pushes the hand out again, the harder the deeper it is.
void add_ground(fs_scene* scene, const Terrain& terrain) {
  fs_object ground = fs_object_init("ground", FS_PRIMITIVE_MESH);
  ground.shape = terrain.mesh();
  ground.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400 / scale, 0, 5);
  check(fs_object_set(scene, &ground));
  fs_shape_destroy(ground.shape);  // the scene keeps what it needs
}

// A pull that grows from 0 to `newtons` half-way and is 0 again at `reach` (m): the hand comes and goes without a jump.
fs_profile pull(double newtons, double reach) {
  const double factors[] = {0, 1, 0};
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, newtons, 0, newtons);
  check(fs_curve_create_table(factors, 3, reach / 2, &profile.curve));
  return profile;
}

// Client 1, the editor: a spring to the point that its user has chosen.
void add_editor(fs_scene* scene, const Terrain& terrain) {
  fs_object spring = fs_object_init("editor's spring", FS_PRIMITIVE_POINT);
  spring.pose.position = {-8000, 10000, terrain.height(-8000, 10000, 0) + 2000};
  spring.front = pull(3, 4000);
  check(fs_object_set(scene, &spring));
  fs_curve_destroy(spring.front.curve);
}

// Client 2, the rover: it drives over the ground and steers to where the hand is. The hand feels the plane of its
// wheels, which rises and tilts with it: moved 25 times a second, and by the servo in between.
struct Rover {
  fs_vec3 position = {6000, 5000, 0};
  double heading = 0;  // rad, from east to north
};

void add_rover(fs_scene* scene) {
  fs_object plane = fs_object_init("rover's plane", FS_PRIMITIVE_PLANE);
  plane.pose.position = Rover().position;
  plane.front = plane.back = pull(1.5, 2000);
  check(fs_object_set(scene, &plane));
  fs_curve_destroy(plane.front.curve);
}

// A step of `period` seconds.
fs_status drive(Rover& rover, fs_scene* scene, const Terrain& terrain, double period) {
  const double speed = 600, wheelbase = 800;  // m/s, in time lapse; m
  fs_state hand;
  if (fs_status status = fs_scene_get_hand(scene, &hand, nullptr, nullptr); status < 0) return status;
  fs_vec3& at = rover.position;
  const double forward_x = std::cos(rover.heading), forward_y = std::sin(rover.heading);
  const double left = forward_x * (hand.pose.position.y - at.y) - forward_y * (hand.pose.position.x - at.x);
  rover.heading += std::clamp(left / 3000, -1.0, 1.0) * period;
  at.x += forward_x * speed * period;
  at.y += forward_y * speed * period;
  at.z = terrain.height(at.x, at.y, wheelbase);
  fs_pose pose;
  if (fs_status status = fs_pose_from_z(at, terrain.normal(at.x, at.y, wheelbase), &pose); status < 0) return status;
  return fs_object_move(scene, "rover's plane", &pose, nullptr, FS_NOW);
}

// Client 3, the display: the borders of two hazardous areas, draped on the ground, keep the hand away.
void add_hazard(fs_scene* scene, const Terrain& terrain, const char* name, double x, double y, double radius) {
  fs_vec3 border[60];
  for (int i = 0; i < 60; ++i) {
    const double angle = i * 2 * std::numbers::pi / 60;
    border[i] = {x + radius * std::cos(angle), y + radius * std::sin(angle), 0};
    border[i].z = terrain.height(border[i].x, border[i].y, 300);
  }
  fs_object hazard = fs_object_init(name, FS_PRIMITIVE_POLYLINE);
  check(fs_shape_create_polyline(border, 60, true, &hazard.shape));
  hazard.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 3, 800, 3);
  check(fs_object_set(scene, &hazard));
  fs_shape_destroy(hazard.shape);
}

// Where the simulated hand wants to be: a tour of all three clients, mostly a little below the ground (z: above it).
void write_tour(const std::string& path, const Terrain& terrain, double seconds) {
  const fs_vec3 stops[] = {{0, 0, 0}, {6000, 5000, -900}, {9000, 1000, -900}, {2000, 9000, -900}, {-8500, 9500, 1500},
    {-8000, 9000, 1000}, {-7000, 4000, 500}, {-7000, -1000, 500}, {-2500, -8000, 500}, {4000, -6000, -900}};
  const int legs = int(std::size(stops)) - 1;
  std::ofstream file(path);
  file.precision(9);
  for (double t = 0; t <= seconds; t += 0.02) {
    const double way = std::min(t / seconds, 0.999) * legs;
    const double part = (1 - std::cos(std::fmod(way, 1) * std::numbers::pi)) / 2;  // slow at the stops
    const fs_vec3 &from = stops[int(way)], &to = stops[int(way) + 1];
    const double x = std::lerp(from.x, to.x, part), y = std::lerp(from.y, to.y, part);
    const double z = std::lerp(from.z, to.z, part) + terrain.height(x, y, 1000);
    file << t << ' ' << x / scale << ' ' << y / scale << ' ' << z / scale << '\n';
  }
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

void run(double seconds) {
  const double exaggeration = 2;  // of heights
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  const std::string tour = OUTPUT_FOLDER "/quickstart_tour.txt", record = OUTPUT_FOLDER "/quickstart.csv";
  write_tour(tour, terrain, seconds);

  fs_scene* scene;
  check(fs_scene_create(&scene));
  fs_frame frame = fs_frame_init();
  frame.scale = scale;
  check(fs_scene_set_frame(scene, &frame));
  set_finger(scene);
  add_ground(scene, terrain);
  add_editor(scene, terrain);
  add_rover(scene);
  add_hazard(scene, terrain, "hazard west", -7000, 3000, 2500);
  add_hazard(scene, terrain, "hazard south", -2500, -8500, 2500);

  fs_device* device;
  fs_servo* servo;
  check(fs_device_open(("sim:?hand=nominal&path=" + tour).c_str(), &device));
  check(fs_servo_start(scene, device, nullptr, &servo));  // from here on a real-time thread makes the scene felt
  Flight flight(scene, servo);
  {
    std::jthread rover_client([&](std::stop_token stop) {
      Rover rover;
      auto next = std::chrono::steady_clock::now();
      while (!stop.stop_requested() && drive(rover, scene, terrain, 0.04) == FS_OK) {
        std::this_thread::sleep_until(next += std::chrono::milliseconds(40));
      }
      if (!stop.stop_requested()) std::fprintf(stderr, "the rover stopped: %s\n", fs_last_error());
    });
    flight.watch(seconds);
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
  flight.print_table();
  flight.write_csv(record);
  flight.require_all_felt();
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 20;
  if (argc == 3 && std::string(argv[1]) == "--seconds") seconds = std::atof(argv[2]);
  if (argc == 2 || argc > 3 || !(seconds >= 2)) {
    std::fprintf(stderr, "usage: quickstart [--seconds N]    (2 or more; without it 20)\n");
    return 2;
  }
  try {
    run(seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "quickstart: %s\n", error.what());
    return 1;
  }
}
