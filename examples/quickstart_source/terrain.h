// A grid of heights as a landscape to be felt: in real metres, x east, y north, z up, the origin in its middle.
#pragma once

#include <string>
#include <vector>

#include <forceserver/forceserver.h>

struct Terrain {
  int columns = 0, rows = 0;
  double step_x = 0, step_y = 0;  // m between neighbours
  std::vector<double> heights;    // m, exaggerated; the southern row first

  double width() const { return step_x * (columns - 1); }
  double depth() const { return step_y * (rows - 1); }

  // The mean height around (x, y), with weights that fall to 0 at +-span metres. Beyond the edge of the grid the ground
  // goes on level.
  double height(double x, double y, double span) const;
  // The upward normal of the ground, from its slope over +-span metres; not of unit length.
  fs_vec3 normal(double x, double y, double span) const;
  // A mesh with two triangles for each square of the grid, their front up. Returns null on failure: see fs_last_error.
  fs_shape* mesh() const;
};

// Reads an Esri ASCII grid in degrees. Throws std::runtime_error.
Terrain load_terrain(const std::string& path, double exaggeration);
