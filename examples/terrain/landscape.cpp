#include "landscape.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numbers>
#include <stdexcept>

namespace {

const double speed = 600, wheelbase = 800;  // of the rover: m/s, in time lapse; m

}  // namespace

void check(fs_status status) {
  if (status < 0) throw std::runtime_error(fs_last_error());
}

void set_view(fs_scene* scene) {
  fs_frame frame = fs_frame_init();
  frame.scale = scale;
  check(fs_scene_set_frame(scene, &frame));
  fs_vec3 points[16];
  for (int i = 0; i < 16; ++i) {  // evenly, along a spiral
    const double z = (2 * i + 1) / 16.0 - 1, angle = 2.4 * i, radius = std::sqrt(1 - z * z);
    points[i] = {600 * radius * std::cos(angle), 600 * radius * std::sin(angle), 600 * z};
  }
  check(fs_scene_set_tool(scene, points, 16));
}

void add_ground(fs_scene* scene, const Terrain& terrain) {
  fs_object ground = fs_object_init("ground", FS_PRIMITIVE_MESH);
  ground.shape = terrain.mesh();
  ground.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400 / scale, 0, 5);
  check(fs_object_set(scene, &ground));
  fs_shape_destroy(ground.shape);  // the scene keeps what it needs
}

void add_hazard(fs_scene* scene, const Terrain& terrain, const char* name, double x, double y, double radius,
                double newtons) {
  fs_vec3 border[60];
  for (int i = 0; i < 60; ++i) {
    const double angle = i * 2 * std::numbers::pi / 60;
    border[i] = {x + radius * std::cos(angle), y + radius * std::sin(angle), 0};
    border[i].z = terrain.height(border[i].x, border[i].y, 300);
  }
  fs_object hazard = fs_object_init(name, FS_PRIMITIVE_POLYLINE);
  check(fs_shape_create_polyline(border, 60, true, &hazard.shape));
  hazard.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, newtons, 800, newtons);
  check(fs_object_set(scene, &hazard));
  fs_shape_destroy(hazard.shape);
}

fs_profile pull(double newtons, double reach) {
  const double factors[] = {0, 1, 0};
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, newtons, 0, newtons);
  check(fs_curve_create_table(factors, 3, reach / 2, &profile.curve));
  return profile;
}

void Rover::drive(const Terrain& terrain, const fs_vec3& goal, double period) {
  const double forward_x = std::cos(heading), forward_y = std::sin(heading);
  const double left = forward_x * (goal.y - position.y) - forward_y * (goal.x - position.x);
  heading += std::clamp(left / 3000, -1.0, 1.0) * period;
  position.x += forward_x * speed * period;
  position.y += forward_y * speed * period;
  position.z = terrain.height(position.x, position.y, wheelbase);
  distance += speed * period;
}

fs_pose Rover::wheels(const Terrain& terrain) const {
  fs_pose pose;
  check(fs_pose_from_z(position, terrain.normal(position.x, position.y, wheelbase), &pose));
  return pose;
}

void write_tour(const std::string& path, const Terrain& terrain, double begin, double seconds) {
  // Mostly a little below the ground (z: above it).
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
    file << begin + t << ' ' << x / scale << ' ' << y / scale << ' ' << z / scale << '\n';
  }
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}
