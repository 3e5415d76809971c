#include "landscape.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numbers>
#include <stdexcept>

namespace {

const double speed = 600, wheelbase = 800;  // of the rover: m/s, in time lapse; m

fs_quat product(const fs_quat& a, const fs_quat& b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

// A rotation by `angle` (rad) about an axis of unit length.
fs_quat turn(double x, double y, double z, double angle) {
  const double s = std::sin(angle / 2);
  return {std::cos(angle / 2), s * x, s * y, s * z};
}

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

void add_hazard(fs_scene* scene, const Terrain& terrain, const char* name, double x, double y, double radius, double newtons) {
  fs_vec3 border[60];
  for (int i = 0; i < 60; ++i) {
    const double angle = i * 2 * std::numbers::pi / 60;
    border[i] = {x + radius * std::cos(angle), y + radius * std::sin(angle), 0};
    border[i].z = terrain.height(border[i].x, border[i].y, 300);
  }
  fs_object hazard = fs_object_init(name, FS_PRIMITIVE_POLYLINE);
  check(fs_shape_create_polyline(border, 60, true, &hazard.shape));
  // There is no force on the border itself, where it would reverse with a jump, and none in the middle, where no part of
  // the border is the nearest.
  const double factors[] = {0, 0.7, 1, 0.8, 0.4, 0.1, 0};
  hazard.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, newtons, 0, newtons);
  check(fs_curve_create_table(factors, 7, 0.16 * radius, &hazard.front.curve));
  check(fs_object_set(scene, &hazard));
  fs_shape_destroy(hazard.shape);
  fs_curve_destroy(hazard.front.curve);
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
  rate += (std::clamp(left / 3000, -1.0, 1.0) - rate) * std::min(1.0, period / 0.4);
  heading += rate * period;
  position.x += forward_x * speed * period;
  position.y += forward_y * speed * period;
  position.z = terrain.height(position.x, position.y, wheelbase);
  distance += speed * period;
}

fs_pose Rover::pose(const Terrain& terrain) const {
  const fs_vec3 ground = terrain.normal(position.x, position.y, wheelbase);
  const double ahead = ground.x * std::cos(heading) + ground.y * std::sin(heading);
  const double left = ground.y * std::cos(heading) - ground.x * std::sin(heading);
  const double pitch = std::atan2(ahead, ground.z), roll = std::atan2(-left, std::hypot(ahead, ground.z));
  const fs_quat nose = product(turn(0, 0, 1, heading), turn(0, 1, 0, pitch));  // x ahead, y to the left, z up
  return {position, product(nose, turn(1, 0, 0, roll + std::numbers::pi / 2))};
}

fs_twist Rover::twist(const Terrain& terrain, const fs_vec3& goal, double period) const {
  Rover next = *this;
  next.drive(terrain, goal, period);
  const fs_vec3 &a = position, &b = next.position;
  const fs_quat from = pose(terrain).orientation, to = next.pose(terrain).orientation;
  const fs_quat by = product(to, {from.w, -from.x, -from.y, -from.z});
  const double rate = (by.w < 0 ? -2 : 2) / period;  // correct for small rotations
  return {{(b.x - a.x) / period, (b.y - a.y) / period, (b.z - a.z) / period}, {by.x * rate, by.y * rate, by.z * rate}};
}

void add_rover(fs_scene* scene, const char* name, const Rover& rover, const Terrain& terrain) {
  fs_object plane = fs_object_init(name, FS_PRIMITIVE_PLANE);
  plane.pose = rover.pose(terrain);
  plane.front = plane.back = pull(1.5, 2000);
  check(fs_object_set(scene, &plane));
  fs_curve_destroy(plane.front.curve);
}

void drive_rover(fs_scene* scene, const char* name, Rover& rover, const Terrain& terrain, const fs_vec3& goal, double period,
                 double time) {
  rover.drive(terrain, goal, period);
  const fs_pose pose = rover.pose(terrain);
  const fs_twist twist = rover.twist(terrain, goal, period);
  check(fs_object_move(scene, name, &pose, &twist, time));
}

bool find_rover(fs_scene* scene, const char* name, fs_pose* pose) {
  fs_object plane = fs_object_init("", FS_PRIMITIVE_PLANE);
  double now;
  const fs_status status = fs_object_get(scene, name, &plane);
  if (status == FS_ERROR_NOT_FOUND) return false;
  check(status);
  fs_object_release(&plane);
  check(fs_scene_get_time(scene, &now));
  const double time = std::clamp(now - plane.time, 0.0, 0.1);  // the servo goes on with a twist for 0.1 s
  const fs_vec3 &v = plane.twist.linear, &w = plane.twist.angular;
  const fs_vec3& x = plane.pose.position;
  *pose = {{x.x + v.x * time, x.y + v.y * time, x.z + v.z * time}, plane.pose.orientation};
  const double rate = std::hypot(w.x, w.y, w.z);
  if (rate > 0) pose->orientation = product(turn(w.x / rate, w.y / rate, w.z / rate, rate * time), pose->orientation);
  return true;
}

void Felt::add(const fs_vec3& force, const fs_pose& rover, double period) {
  const double size = std::hypot(force.x, force.y, force.z);
  if (size > 0.01) seconds += period;
  sum += size * period;
  most = std::max(most, size);
  const fs_quat& q = rover.orientation;
  const fs_quat part = product(product({q.w, -q.x, -q.y, -q.z}, {0, force.x, force.y, force.z}), q);
  forward += std::abs(part.x) * period;
  up += std::abs(part.y) * period;
  sideways += std::abs(part.z) * period;
}

void write_tour(const std::string& path, const Terrain& terrain, double begin, double seconds) {
  // z is the height above the ground; most stops are a little below it.
  const fs_vec3 stops[] = {{0, 0, 0},           {6000, 5000, -900},  {9000, 1000, -900}, {2000, 9000, -900},
                           {-8500, 9500, 1500}, {-8000, 9000, 1000}, {-7000, 4000, 500}, {-7000, -1000, 500},
                           {-2500, -8000, 500}, {4000, -6000, -900}};
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
