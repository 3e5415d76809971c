// Recorded telemetry of a rover, the scout: telemetry.csv. The columns: time (s); of the scout x, y, z (m) and what is
// left in its battery (1: full); x, y, z of two dust devils that it has seen.
#pragma once

#include "../terrain/landscape.h"

struct Telemetry {
  double time;
  fs_vec3 scout;
  double battery;
  fs_vec3 devils[2];
};
