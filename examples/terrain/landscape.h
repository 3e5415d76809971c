// What the quickstart and the testbed are made of: what can be felt on a terrain, and a hand that visits all of it.
#pragma once

#include <string>

#include "terrain.h"

// The hand's 0.2 m are 30 km here: what it feels as k N/m is k / scale for each metre of the landscape.
inline constexpr double scale = 150000;
inline constexpr double exaggeration = 2;  // of heights

// Throws std::runtime_error with the sentence of the failure.
void check(fs_status status);

// Sets the frame of a scene to that scale. What touches the landscape is not a point but a finger tip, 16 points on a
// ball 8 mm wide, which is 1200 m here. The force is the mean of theirs, so that one point that falls into the next
// valley makes no great step.
void set_view(fs_scene* scene);

// A mesh, "ground", that pushes the hand out again, the harder the deeper it is.
void add_ground(fs_scene* scene, const Terrain& terrain);

// A round border, draped on the ground, that keeps the hand away with `newtons` at most.
void add_hazard(fs_scene* scene, const Terrain& terrain, const char* name, double x, double y, double radius,
                double newtons);

// A pull that grows from 0 to `newtons` half-way and is 0 again at `reach` (m): the hand comes and goes without a jump.
// Its curve is the caller's.
fs_profile pull(double newtons, double reach);

// A rover that drives over the ground and steers to a goal.
struct Rover {
  fs_vec3 position = {6000, 5000, 0};
  double heading = 0;   // rad, from east to north
  double rate = 0;      // rad/s, of the heading: it steers to the goal, but not at once
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

// The rover drives to the goal for `period` s, and its plane goes with it. The twist that goes along lets the servo
// move and turn the plane until the next call. time: when the rover is there, s on the scene's clock; a caller that
// gives times exactly one period apart makes no jump when it is called a little late.
void drive_rover(fs_scene* scene, const char* name, Rover& rover, const Terrain& terrain, const fs_vec3& goal,
                 double period, double time);

// The pose at this moment of the rover that was added under this name (another client's: "client/name"). False: there
// is none, and *pose stays as it is.
bool find_rover(fs_scene* scene, const char* name, fs_pose* pose);

// How long and how hard somebody pushed. All but `most` are sums over time: N s.
struct Felt {
  double seconds = 0, sum = 0, most = 0;       // s with a force; N s; N
  double sideways = 0, forward = 0, up = 0;    // N s: the sizes of its parts along the axles of the rover and so on

  void add(const fs_vec3& force, const fs_pose& rover, double period);
  double mean(double part) const { return seconds > 0 ? part / seconds : 0; }  // N
};

// Where a simulated hand wants to be (sim:?path=FILE): from `begin` s on, for `seconds`, a tour of all there is.
void write_tour(const std::string& path, const Terrain& terrain, double begin, double seconds);
