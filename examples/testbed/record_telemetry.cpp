// Makes telemetry.csv: the hand takes its tour through the quickstart's landscape, in virtual time, and a rover, the
// scout, follows it. The scout reports where it is, the charge of its battery, and two dust devils that drift with the
// wind and run down into the valleys. Every run gives the same file.
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "telemetry.h"

namespace {

const double seconds = 20, step = 0.04;  // s

fs_vec3 drift(const fs_vec3& devil, const fs_vec3& wind, const Terrain& terrain) {
  const fs_vec3 up = terrain.normal(devil.x, devil.y, 800);  // points downhill, too
  const double x = devil.x + (wind.x + 600 * up.x) * step, y = devil.y + (wind.y + 600 * up.y) * step;
  return {x, y, terrain.height(x, y, 800)};
}

void record(const std::string& tour) {
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  write_tour(tour, terrain, 0, seconds);
  fs_scene* scene;
  fs_device* device;
  fs_servo* servo;
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  check(fs_scene_create(&scene));
  set_view(scene);
  add_ground(scene, terrain);
  check(fs_device_open(("sim:?hand=nominal&path=" + tour).c_str(), &device));
  check(fs_servo_start(scene, device, &options, &servo));

  Rover scout;
  scout.position = {1000, 3000, terrain.height(1000, 3000, 800)};
  double battery = 0.95;
  fs_vec3 devils[] = {{9500, 4000, 0}, {-8500, 3500, 0}};
  const fs_vec3 winds[] = {{-500, 50, 0}, {150, -450, 0}};  // m/s, in time lapse
  for (fs_vec3& devil : devils) devil.z = terrain.height(devil.x, devil.y, 800);
  std::printf(
      "# made by: examples/testbed/make_telemetry > examples/testbed/telemetry.csv\n"
      "time,scout_x,scout_y,scout_z,battery,devil_1_x,devil_1_y,devil_1_z,devil_2_x,devil_2_y,devil_2_z\n");
  for (int i = 0; i * step <= seconds; ++i) {
    if (i % 5 == 0) {
      const fs_vec3 &s = scout.position, &a = devils[0], &b = devils[1];
      std::printf("%.1f,%.0f,%.0f,%.0f,%.3f,%.0f,%.0f,%.0f,%.0f,%.0f,%.0f\n", i * step, s.x, s.y, s.z, battery, a.x, a.y, a.z,
                  b.x, b.y, b.z);
    }
    check(fs_servo_step(servo, 40));
    fs_state hand;
    check(fs_scene_get_hand(scene, &hand, nullptr, nullptr));
    const double height = scout.position.z, distance = scout.distance;
    scout.drive(terrain, hand.pose.position, step);
    // The battery would be empty after 20 km on level ground; a metre up costs as much as four metres ahead.
    battery -= (scout.distance - distance + 4 * std::max(0.0, scout.position.z - height)) / 20000;
    for (int k = 0; k < 2; ++k) devils[k] = drift(devils[k], winds[k], terrain);
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: record_telemetry TOUR_FILE    (where the tour of the hand may be written)\n");
    return 2;
  }
  try {
    record(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "record_telemetry: %s\n", error.what());
    return 1;
  }
}
