// What the quickstart and the testbed share: objects to be felt on a terrain, and the tour of a hand to all of them.
#pragma once

#include <string>

#include "terrain.h"

// 0.2 m of the hand are 30 km of the landscape: a stiffness of k N/m at the hand is k / scale in the landscape.
inline constexpr double scale = 150000;
inline constexpr double exaggeration = 2;  // of heights

// Throws std::runtime_error with the library's error sentence if the call failed.
void check(fs_status status);

// Sets the frame of a scene to that scale, and its tool to a finger tip: 16 points on a ball 8 mm wide, which is 1200 m
// in the landscape. The force is the mean of the points' forces, so it makes no great step when one point falls into
// the next valley.
void set_view(fs_scene* scene);

// Adds a mesh, "ground", that pushes the hand out, and harder the deeper the hand is.
void add_ground(fs_scene* scene, const Terrain& terrain);

// Adds a round border, draped on the ground, that keeps the hand away with `newtons` at most.
void add_hazard(fs_scene* scene, const Terrain& terrain, const char* name, double x, double y, double radius, double newtons);

// A pull that grows from 0 to `newtons` half-way and is 0 again at `reach` (m), so the force does not jump anywhere.
// The caller destroys its curve.
fs_profile pull(double newtons, double reach);

// A rover that drives over the ground and steers to a goal.
struct Rover {
  fs_vec3 position = {6000, 5000, 0};
  double heading = 0;   // rad, from east to north
  double rate = 0;      // rad/s, of the heading: the rover turns to the goal gradually
  double distance = 0;  // m, driven so far

  void drive(const Terrain& terrain, const fs_vec3& goal, double period);  // a step of `period` s
  // Where it stands on the ground: x points forward, y up from the ground, z to the right along the axles of its
  // wheels.
  fs_pose pose(const Terrain& terrain) const;
  // How it moves and turns in the next `period` s, while it steers to the goal.
  fs_twist twist(const Terrain& terrain, const fs_vec3& goal, double period) const;
};

// What the hand feels of the rover: a plane through the rover, upright, with its normal along the axles. It draws the
// hand back from either side, as wheels resist a push sideways. Forward, backward, up and down the hand is free.
void add_rover(fs_scene* scene, const char* name, const Rover& rover, const Terrain& terrain);

// Drives the rover to the goal for `period` s and moves its plane along, with a twist by which the servo moves and
// turns the plane until the next call. time: when the rover is at the new pose, s on the scene's clock. If the times
// are exactly one period apart, the plane does not jump when a call comes a little late.
void drive_rover(fs_scene* scene, const char* name, Rover& rover, const Terrain& terrain, const fs_vec3& goal, double period,
                 double time);

// Gives the present pose of the rover that was added under this name (another client's: "client/name"). Returns false
// when there is none, and leaves *pose as it is.
bool find_rover(fs_scene* scene, const char* name, fs_pose* pose);

// How long and how hard an object or a client pushed. All forces but `most` are sums over time: N s.
struct Felt {
  double seconds = 0, sum = 0, most = 0;       // s with a force; N s; N
  double sideways = 0, forward = 0, up = 0;    // N s: the sizes of the force's parts in the rover's axes

  void add(const fs_vec3& force, const fs_pose& rover, double period);
  double mean(double part) const { return seconds > 0 ? part / seconds : 0; }  // N
};

// Writes the file of a simulated hand's path (sim:?path=FILE): a tour of all objects, from `begin` s on, for `seconds`.
void write_tour(const std::string& path, const Terrain& terrain, double begin, double seconds);
