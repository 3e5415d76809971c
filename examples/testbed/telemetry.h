// Recorded telemetry of a rover, the scout: telemetry.csv. The columns are the time (s); the scout's x, y, z (m) and
// the charge of its battery (1: full); x, y, z (m) of two dust devils that it has seen.
#pragma once

#include "../quickstart_source/landscape.h"

struct Telemetry {
  double time;
  fs_vec3 scout;
  double battery;
  fs_vec3 devils[2];
};
