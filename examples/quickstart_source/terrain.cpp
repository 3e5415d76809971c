#include "terrain.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <stdexcept>

Terrain load_terrain(const std::string& path, double exaggeration) {
  std::ifstream file(path);
  std::string word;
  double west, south, cell;  // degrees
  Terrain terrain;
  file >> word >> terrain.columns >> word >> terrain.rows >> word >> west >> word >> south >> word >> cell;
  if (!file || terrain.columns < 2 || terrain.rows < 2) throw std::runtime_error("cannot read the terrain " + path);

  const double metres_per_degree = 111200;
  const double latitude = (south + terrain.rows * cell / 2) * std::numbers::pi / 180;
  terrain.step_x = cell * metres_per_degree * std::cos(latitude);
  terrain.step_y = cell * metres_per_degree;

  terrain.heights.resize(std::size_t(terrain.columns) * terrain.rows);
  for (int row = terrain.rows - 1; row >= 0; --row) {  // the file has the northern row first
    for (int column = 0; column < terrain.columns; ++column) {
      file >> terrain.heights[std::size_t(row) * terrain.columns + column];
    }
  }
  if (!file) throw std::runtime_error("the terrain ends too early: " + path);

  const auto [low, high] = std::minmax_element(terrain.heights.begin(), terrain.heights.end());
  const double middle = (*low + *high) / 2;
  for (double& height : terrain.heights) height = (height - middle) * exaggeration;
  return terrain;
}

double Terrain::height(double x, double y, double span) const {
  const double column = (x + width() / 2) / step_x, row = (y + depth() / 2) / step_y;
  const int reach_x = int(span / step_x) + 1, reach_y = int(span / step_y) + 1;
  double sum = 0, weights = 0;
  for (int r = int(row) - reach_y; r <= int(row) + reach_y + 1; ++r) {
    for (int c = int(column) - reach_x; c <= int(column) + reach_x + 1; ++c) {
      const double weight = std::max(0.0, reach_x - std::abs(c - column)) * std::max(0.0, reach_y - std::abs(r - row));
      sum += weight * heights[std::size_t(std::clamp(r, 0, rows - 1)) * columns + std::clamp(c, 0, columns - 1)];
      weights += weight;
    }
  }
  return sum / weights;
}

fs_vec3 Terrain::normal(double x, double y, double span) const {
  const double east = height(x + span, y, span) - height(x - span, y, span);
  const double north = height(x, y + span, span) - height(x, y - span, span);
  return {-east / (2 * span), -north / (2 * span), 1};
}

fs_shape* Terrain::mesh() const {
  std::vector<fs_vec3> points;
  std::vector<std::uint32_t> triangles;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto corner = std::uint32_t(points.size());  // and the square to the north-east of it
      points.push_back({column * step_x - width() / 2, row * step_y - depth() / 2, heights[corner]});
      if (row + 1 == rows || column + 1 == columns) continue;
      const std::uint32_t east = corner + 1, north = corner + std::uint32_t(columns), across = north + 1;
      triangles.insert(triangles.end(), {corner, east, across, corner, across, north});
    }
  }
  fs_shape* shape = nullptr;
  fs_shape_create_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3, &shape);
  return shape;
}
