// Writes the path of the simulated hand: a tour of all objects of the testbed.
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "../quickstart_source/landscape.h"

int main(int argc, char** argv) {
  const double seconds = argc == 4 ? std::atof(argv[2]) : 0, lead = argc == 4 ? std::atof(argv[3]) : 0;
  if (!(seconds > 0 && lead >= 0)) {
    std::fprintf(stderr, "usage: tour FILE SECONDS LEAD    (it begins after LEAD s)\n");
    return 2;
  }
  try {
    write_tour(argv[1], load_terrain(TERRAIN_FILE, exaggeration), lead, seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tour: %s\n", error.what());
    return 1;
  }
}
