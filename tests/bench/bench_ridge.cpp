// What the blend at ridges costs: the search of a closest point alone, and with find_ridge() (lib/shape/ridge.h), in time of this
// thread and in visits, for ways of 3000 places. README.md says how to read it.
//
//   bench_ridge
#include <ctime>

#include <cstdio>
#include <limits>

#include "meshes.h"
#include "shape/ridge.h"

using namespace bench;
using namespace fs;

namespace {

double cpu_ns() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

// A rectangle of n * n cells.
void add_wall(Mesh& mesh, Vec3 from, Vec3 u, Vec3 v, uint32_t n) {
  const auto first = static_cast<uint32_t>(mesh.points.size());
  for (uint32_t i = 0; i <= n; ++i) {
    for (uint32_t j = 0; j <= n; ++j) mesh.points.push_back(from + (double(i) / n) * u + (double(j) / n) * v);
  }
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t j = 0; j < n; ++j) {
      const uint32_t a = first + i * (n + 1) + j, b = a + n + 1;
      mesh.corners.insert(mesh.corners.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  }
}
Mesh corner(uint32_t n) {
  Mesh out;
  add_wall(out, {0, 0, -0.05}, {0, 0, 0.1}, {0.1, 0, 0}, n);
  add_wall(out, {0, 0, -0.05}, {0, 0.1, 0}, {0, 0, 0.1}, n);
  return out;
}

void row(const char* name, const Mesh& mesh, Vec3 from, Vec3 to, double l) {
  constexpr int places = 3000, rounds = 9;
  enum { alone, without_hint, with_hint, ways };
  const Ref<const Shape> shape = make_mesh(mesh.points.data(), mesh.points.size(), mesh.corners.data(), mesh.count());
  shape->build();
  double least[ways], visits[ways];
  int ridges = 0;
  for (double& time : least) time = std::numeric_limits<double>::infinity();
  for (int round = 0; round < rounds; ++round) {
    for (int way = 0; way < ways; ++way) {
      Hint hint;
      Effort effort;
      ridges = 0;
      double taken = 0;
      const double begin = cpu_ns();
      for (int i = 0; i < places; ++i) {
        const Vec3 x = from + (double(i) / places) * (to - from);
        Closest closest;
        const auto find = way == with_hint ? closest_point_ahead : closest_point;
        find(FS_PRIMITIVE_MESH, shape.get(), x, 1, closest, &hint, &effort);
        Ridge ridge;
        if (way != alone && find_ridge(FS_PRIMITIVE_MESH, shape.get(), x, closest, l, ridge,
                                       way == with_hint ? &hint : nullptr, &effort)) {
          ++ridges;
        }
        taken += std::numeric_limits<uint32_t>::max() - effort.visits;
        effort.visits = std::numeric_limits<uint32_t>::max();
      }
      least[way] = std::min(least[way], (cpu_ns() - begin) / places);
      visits[way] = taken / places;
    }
  }
  std::printf("| %-28s | %4.1f | %3d %% | %5.0f | %5.2f | %5.2f | %5.2f | %5.2f |\n", name, 1e3 * l, 100 * ridges / places,
              least[alone], least[with_hint] / least[alone], visits[with_hint] / visits[alone],
              least[without_hint] / least[alone], visits[without_hint] / visits[alone]);
}

}  // namespace

int main() {
  std::puts("| a way | l, mm | at a ridge | search alone, ns | with ridge: time | visits | without hint: time | visits |");
  std::puts("|---|---|---|---|---|---|---|---|");
  const Mesh fine = corner(71), coarse = corner(1), ball = sphere(70'000);
  for (const double l : {0.001, 0.003}) {
    row("corner of 20,164, far", fine, {0.03, 0.005, -0.02}, {0.06, 0.006, 0.02}, l);
    row("corner of 20,164, across", fine, {0.007, 0.003, -0.01}, {0.003, 0.007, 0.01}, l);
    row("corner of 20,164, along", fine, {0.006, 0.005, -0.02}, {0.007, 0.0072, 0.02}, l);
    row("corner of 4, far", coarse, {0.03, 0.005, -0.02}, {0.06, 0.006, 0.02}, l);
    row("corner of 4, along", coarse, {0.006, 0.005, -0.02}, {0.007, 0.0072, 0.02}, l);
    row("sphere of 70,000, outside", ball, {0.11, 0, 0.01}, {0.1, 0.06, 0.01}, l);
    row("sphere of 70,000, inside", ball, {0.09, 0, 0.01}, {0.085, 0.02, 0.01}, l);
  }
}
