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

// It drives over the ground and steers to a goal.
struct Rover {
  fs_vec3 position = {6000, 5000, 0};
  double heading = 0;   // rad, from east to north
  double distance = 0;  // m, driven so far

  void drive(const Terrain& terrain, const fs_vec3& goal, double period);  // a step of `period` s
  fs_pose wheels(const Terrain& terrain) const;                            // z: upwards from the plane of its wheels
};

// Where a simulated hand wants to be (sim:?path=FILE): from `begin` s on, for `seconds`, a tour of all there is.
void write_tour(const std::string& path, const Terrain& terrain, double begin, double seconds);
