// What is odd in the forces of an object, where the hand gets.
#pragma once

#include <forceserver/forceserver.h>

#include <vector>

#include "findings.h"

inline constexpr double faint = 1e-3;  // N: nobody feels a smaller force

struct Workspace {  // of the tool on the device, in scene metres: the device's cylinder, and as much more as the tool is long
  fs_vec3 centre, axis;
  double cylinder_radius, half_height, tool_length;
  double radius;  // of the sphere around all that
};

// The range of distances between one side of an object and the hand, m. If the hand never comes to this side, `least`
// is larger than `most`.
struct Distances {
  double least, most;
};

// The distances on both sides; an object without sides has only a front.
struct Sides {
  Distances front, back;
};

// Lower and upper bounds of the distances between an object and the hand in the workspace.
Sides distances_of(const fs_object& object, const Workspace& workspace);

bool has_sides(const fs_object& object);
// The parts of a mesh, which no corner joins: m^3 that each encloses; below 0: its triangles face inwards.
std::vector<double> volumes_of(const fs_shape* shape);
double volume_of(const fs_shape* shape);  // of all parts
double most(const fs_profile& profile, const Distances& range);  // its largest force within these distances, N

// Reports where and when the force jumps, profiles with a wrong sense or on the wrong side, and what pulls from nearly
// everywhere. force_max: of the device, N of the scene.
void check_forces(const fs_object& object, const Sides& distances, double force_max, Findings& findings);
