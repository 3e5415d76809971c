// Three clients share one landscape and one hand, as in the testbed of Flueckiger & Nguyen: an editor, a rover and the
// display of hazards. All is simulated: no device is needed.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "flight.h"
#include "landscape.h"

namespace {

// Client 1, the editor: a spring to the point that its user has chosen.
void add_editor(fs_scene* scene, const Terrain& terrain) {
  fs_object spring = fs_object_init("editor's spring", FS_PRIMITIVE_POINT);
  spring.pose.position = {-8000, 10000, terrain.height(-8000, 10000, 0) + 2000};
  spring.front = pull(3, 4000);
  check(fs_object_set(scene, &spring));
  fs_curve_destroy(spring.front.curve);
}

// Client 2, the rover: it drives over the ground and steers to where the hand is, 25 times a second. The hand feels its
// plane, which resists sideways motion; between two updates the servo moves and turns the plane.
const char* const rover_name = "rover's plane";

void drive(fs_scene* scene, const Terrain& terrain, Rover& rover, double period, double time) {
  fs_state hand;
  check(fs_scene_get_hand(scene, &hand, nullptr, nullptr));
  drive_rover(scene, rover_name, rover, terrain, hand.pose.position, period, time);
}

// Client 3, the display: the borders of two hazardous areas keep the hand away.
void add_display(fs_scene* scene, const Terrain& terrain) {
  add_hazard(scene, terrain, "hazard west", -7000, 3000, 2500, 3);
  add_hazard(scene, terrain, "hazard south", -2500, -8500, 2500, 3);
}

void run(double seconds) {
  Beat beat;
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  const std::string tour = OUTPUT_FOLDER "/quickstart_tour.txt";
  write_tour(tour, terrain, 0, seconds);

  fs_scene* scene;
  check(fs_scene_create(&scene));
  set_view(scene);
  add_ground(scene, terrain);
  add_editor(scene, terrain);
  Rover rover;
  add_rover(scene, rover_name, rover, terrain);
  add_display(scene, terrain);

  fs_device* device;
  fs_servo* servo;
  check(fs_device_open(("sim:?hand=nominal&path=" + tour).c_str(), &device));
  check(fs_servo_start(scene, device, nullptr, &servo));  // from here on a real-time thread renders the scene
  std::printf("the hand is on its way for %g s; Ctrl-C ends it earlier\n", seconds);
  std::fflush(stdout);
  Flight flight(scene, servo, rover_name);
  bool is_whole;
  {
    std::jthread rover_client([&](std::stop_token stop) {
      auto next = std::chrono::steady_clock::now();
      try {
        double time, now;
        check(fs_scene_get_time(scene, &time));
        while (!stop.stop_requested()) {
          drive(scene, terrain, rover, 0.04, time);
          next = std::max(next + std::chrono::milliseconds(40), std::chrono::steady_clock::now());
          std::this_thread::sleep_until(next);
          check(fs_scene_get_time(scene, &now));
          // One period later, unless this thread was delayed for long: then the rover goes on from where it was, so that
          // its plane does not jump under the hand.
          time = std::max(time + 0.04, now - 0.04);
        }
      } catch (const std::exception& error) {
        std::fprintf(stderr, "the rover stopped: %s\n", error.what());
      }
    });
    is_whole = flight.watch(seconds, beat);
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
  if (!is_whole) std::printf("interrupted: this is what was felt until then\n");
  flight.print_table();
  flight.write_ticks(OUTPUT_FOLDER "/quickstart.csv");
  flight.write_samples(OUTPUT_FOLDER "/quickstart_forces.csv");
  flight.require_no_fault();
  if (is_whole) flight.require_all_felt();
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 20;
  if (argc == 3 && std::string(argv[1]) == "--seconds") seconds = std::atof(argv[2]);
  if (argc == 2 || argc > 3 || !(seconds >= 2)) {
    std::fprintf(stderr, "usage: quickstart [--seconds N]    (2 or more; without it 20)\n");
    return 2;
  }
  try {
    run(seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "quickstart: %s\n", error.what());
    return 1;
  }
}
