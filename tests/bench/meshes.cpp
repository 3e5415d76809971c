#include "meshes.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "scenes/scenes.h"

using namespace fs;

namespace bench {
namespace {

constexpr double pi = 3.14159265358979;

// Two triangles for each cell of a grid of rows x columns points; columns, and perhaps rows, close to a ring.
void add_cells(Mesh& mesh, uint32_t rows, uint32_t columns, bool rows_close, bool columns_close) {
  for (uint32_t i = 0; i < (rows_close ? rows : rows - 1); ++i) {
    for (uint32_t j = 0; j < (columns_close ? columns : columns - 1); ++j) {
      const uint32_t below = (i + 1) % rows * columns, right = (j + 1) % columns;
      const uint32_t a = i * columns + j, b = i * columns + right, c = below + j, d = below + right;
      mesh.corners.insert(mesh.corners.end(), {a, c, d, a, d, b});
    }
  }
}

// A ball of 0.2 m in rings of latitude; its poles are tiny holes with a fan.
template <class Radius>
Mesh ball(size_t triangles, Radius radius) {
  const auto rows = static_cast<uint32_t>(std::sqrt(static_cast<double>(triangles) / 4)), columns = 2 * rows;
  Mesh mesh;
  for (uint32_t i = 0; i < rows; ++i) {
    const double a = pi * (i + 0.5) / rows;
    for (uint32_t j = 0; j < columns; ++j) {
      const double b = 2 * pi * j / columns;
      mesh.points.push_back(radius(a, b) * Vec3{std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)});
    }
  }
  add_cells(mesh, rows, columns, false, true);
  for (const bool is_last : {false, true}) {
    const uint32_t first = is_last ? (rows - 1) * columns : 0;
    const auto pole = static_cast<uint32_t>(mesh.points.size());
    mesh.points.push_back({0, 0, (is_last ? -1 : 1) * radius(is_last ? pi : 0, 0)});
    for (uint32_t j = 0; j < columns; ++j) {
      const uint32_t a = first + j, b = first + (j + 1) % columns;
      if (is_last) {
        mesh.corners.insert(mesh.corners.end(), {a, pole, b});
      } else {
        mesh.corners.insert(mesh.corners.end(), {a, b, pole});
      }
    }
  }
  return mesh;
}

}  // namespace

Mesh sphere(size_t triangles) {
  return ball(triangles, [](double, double) { return 0.1; });
}

Mesh scan(size_t triangles) {
  Mesh mesh = ball(triangles, [](double a, double b) {
    const double s = std::sin(a);  // so that nothing changes with b at the poles
    return 0.1 * (1 + 0.05 * std::sin(3 * a) * std::sin(4 * b) * s + 0.02 * std::sin(17 * a + 1) * std::sin(13 * b) * s +
                  0.004 * std::sin(61 * a) * std::sin(71 * b + 2) * s + 0.001 * std::sin(230 * a) * std::sin(190 * b) * s +
                  0.0003 * std::sin(610 * a) * std::sin(570 * b) * s);
  });
  scenes::Random random(1);
  for (Vec3& p : mesh.points) p += random.in_box(5e-6);
  return mesh;
}

Mesh terrain(size_t triangles) {
  const auto side = static_cast<uint32_t>(std::sqrt(static_cast<double>(triangles) / 2)) + 1;
  Mesh mesh;
  for (uint32_t i = 0; i < side; ++i) {
    for (uint32_t j = 0; j < side; ++j) {
      const double x = 0.2 * j / (side - 1) - 0.1, y = 0.1 - 0.2 * i / (side - 1);
      // Octaves of ridges: each is turned, half as wide and half as high.
      double z = 0, size = 0.06, high = 0.02, u = x + 0.31, v = y + 0.17;
      for (int octave = 0; octave < 9; ++octave) {
        z += high * (1 - std::fabs(std::sin(pi * u / size) + std::sin(pi * v / size)) / 2);
        const double turned = 0.8 * u - 0.6 * v;
        v = 0.6 * u + 0.8 * v + 0.013;
        u = turned + 0.007;
        size /= 2;
        high /= 2.1;
      }
      mesh.points.push_back({x, y, z});
    }
  }
  add_cells(mesh, side, side, false, false);
  return mesh;
}

Mesh part(size_t triangles) {
  constexpr int teeth = 24;
  constexpr double bore = 0.035, root = 0.085, tip = 0.1, half_height = 0.02;
  // Around the ring 4 sides a tooth, and around its section 4 sides: of n pieces each.
  const auto n = std::max(static_cast<uint32_t>(std::sqrt(static_cast<double>(triangles) / (2 * 16 * teeth))), 1u);
  Mesh mesh;
  for (uint32_t i = 0; i < 4 * teeth * n; ++i) {
    // Flank, tip, flank, gap: straight between the corners of the outline.
    const uint32_t corner = i / n % 4, tooth = i / n / 4;
    const double along = static_cast<double>(i % n) / n;
    const double angles[] = {0, 0.08, 0.5, 0.58, 1}, radii[] = {root, tip, tip, root, root};
    const auto at = [&](uint32_t k) {
      const double a = 2 * pi * (tooth + angles[k]) / teeth;
      return radii[k] * Vec3{std::cos(a), std::sin(a), 0};
    };
    const Vec3 outer = (1 - along) * at(corner) + along * at(corner + 1);
    const Vec3 inner = (bore / norm(outer)) * outer;
    const Vec3 up{0, 0, half_height};
    const Vec3 section[] = {inner - up, outer - up, outer + up, inner + up, inner - up};
    for (uint32_t k = 0; k < 4 * n; ++k) {
      const double part = static_cast<double>(k % n) / n;
      mesh.points.push_back((1 - part) * section[k / n] + part * section[k / n + 1]);
    }
  }
  // Towards a greater angle and then around the section the sides look outwards.
  add_cells(mesh, 4 * teeth * n, 4 * n, true, true);
  return mesh;
}

Mesh mesh_of(const std::string& name, size_t triangles) {
  if (name == "scan") return scan(triangles);
  if (name == "terrain") return terrain(triangles);
  if (name == "part") return part(triangles);
  if (name == "sphere") return sphere(triangles);
  std::fprintf(stderr, "there is no mesh \"%s\": it is scan, terrain, part or sphere\n", name.c_str());
  std::exit(2);
}

const char* name_of(Way way) {
  return way == Way::sliding ? "sliding" : way == Way::free ? "free space" : "jumps";
}

std::vector<Vec3> walk(const Mesh& mesh, const MeshTree& tree, Way way, size_t ticks) {
  scenes::Random random(7);
  Box box;
  for (const Vec3& p : mesh.points) box.add(p);
  const Vec3 middle = 0.5 * (box.lower + box.upper), size = box.upper - box.lower;
  std::vector<Vec3> out;
  if (way == Way::jumps) {
    while (out.size() < ticks) {
      out.push_back(middle + Vec3{size.x * random.between(-0.55, 0.55), size.y * random.between(-0.55, 0.55),
                                  size.z * random.between(-0.55, 0.55)});
    }
    return out;
  }
  // The hand heads for a triangle and keeps a distance from the surface meanwhile; then for another triangle.
  constexpr double step = 0.00018;  // m
  const bool is_near = way == Way::sliding;
  const double middle_gap = is_near ? 0.0025 : 0.055, sway = is_near ? 0.0025 : 0.045, rate = is_near ? 0.8 : 0.12;  // Hz
  Vec3 x = middle + Vec3{0.03, 0.01, size.z / 2 + middle_gap};
  Vec3 goal{};
  uint32_t hint = MeshTree::no_triangle;
  constexpr size_t settling = 2000;
  for (size_t k = 0; out.size() < ticks; ++k) {
    if (k % 1500 == 0) goal = mesh.points[mesh.corners[3 * random.below(mesh.count())]];
    const MeshTree::Found found = tree.find({x, std::numeric_limits<double>::infinity(), hint});
    hint = found.triangle;
    const Closest closest = tree.tell(x, found, nullptr);
    const double sign = closest.side == Side::front ? 1 : -1;
    const Vec3 outwards = sign * closest.direction;
    const double wanted = middle_gap - sway * std::cos(2 * pi * rate * 0.001 * static_cast<double>(k));
    const Vec3 heading = goal - x;
    const Vec3 beside = heading - dot(heading, outwards) * outwards;
    const double correction = std::clamp(wanted - sign * closest.distance, -0.7 * step, 0.7 * step);
    const double rest = std::sqrt(step * step - correction * correction);
    x += correction * outwards + rest * normalized(beside);
    if (k >= settling) out.push_back(x);
  }
  return out;
}

}  // namespace bench
