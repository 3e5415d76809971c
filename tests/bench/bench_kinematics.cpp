// What the kinematics of FIDEL cost, and how exact they are, over its workspace. Prints a table; README.md has one.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "device/kinematics/fidel.h"

namespace {

namespace fidel = fs::fidel;
using fs::Vec3;
using fs::operator-, fs::operator+=;

struct Place {
  Vec3 position, angles;  // m, frame of the DELTA; rad
};

std::vector<Place> places(size_t count) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> part(-1, 1);
  std::vector<Place> all;
  while (all.size() < count) {
    const Vec3 p{fidel::workspace_radius * part(random), fidel::workspace_radius * part(random),
                 fidel::workspace_height / 2 * part(random)};
    if (std::hypot(p.x, p.y) > fidel::workspace_radius) continue;
    const Vec3 position = fidel::to_delta(p);
    all.push_back({position, *fs::delta_inverse(fidel::geometry, position)});
  }
  return all;
}

// ns for one call: the median of some rounds over all places.
template <class Call>
double cost(const std::vector<Place>& all, Call call) {
  constexpr int rounds = 21;
  std::vector<double> times;
  Vec3 sum{};  // what is worked out must not be left out
  for (int i = 0; i < rounds; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    for (const Place& place : all) sum += call(place);
    times.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count() /
                    static_cast<double>(all.size()));
  }
  if (!fs::is_finite(sum)) std::printf("a result is not finite\n");
  std::nth_element(times.begin(), times.begin() + rounds / 2, times.end());
  return times[rounds / 2];
}

}  // namespace

int main() {
  const std::vector<Place> all = places(100000);
  const auto& g = fidel::geometry;
  const auto jacobian = [&](const Place& p) { return fs::delta_jacobian(g, p.position, p.angles)->jacobian; };
  std::printf("| | ns |\n|---|---|\n");
  std::printf("| forward: three angles to a position | %.0f |\n",
              cost(all, [&](const Place& p) { return *fs::delta_forward(g, p.angles); }));
  std::printf("| inverse: a position to three angles | %.0f |\n",
              cost(all, [&](const Place& p) { return *fs::delta_inverse(g, p.position); }));
  std::printf("| Jacobian | %.0f |\n", cost(all, [&](const Place& p) {
                const fs::Mat3 j = jacobian(p);
                return Vec3{j.xx, j.yy, j.zz};
              }));
  std::printf("| all that a tick needs: forward, Jacobian, torques of a force, scaled together | %.0f |\n",
              cost(all, [&](const Place& p) {
                const Vec3 position = *fs::delta_forward(g, p.angles);
                const auto j = fs::delta_jacobian(g, position, p.angles);
                return fidel::scaled_together(fidel::joint_torques(j->jacobian, {3, 4, 20}), fidel::motor_torque_max);
              }));
  double error = 0;
  for (const Place& p : all) error = std::max(error, fs::norm(*fs::delta_forward(g, p.angles) - p.position));
  std::printf("\nThe largest |FK(IK(x)) - x| at %zu places of the workspace: %.2g m.\n", all.size(), error);
}
