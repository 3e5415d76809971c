// A rover simulator: it drives over the terrain and steers to where the hand is. The hand feels a plane through the
// rover, whose normal is the axle of its wheels: it resists sideways motion. The plane gets a pose and a twist 25 times
// a second, and the servo moves and turns it in between.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "client.h"

static void drive(Client& client, const Arguments&) {
  const double period = 0.04;  // s
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  Rover rover;
  add_rover(client.scene(), "wheels", rover, terrain);
  double time, now;
  check(fs_scene_get_time(client.scene(), &time));
  for (int i = 1; client.wait(period); ++i) {
    check(fs_scene_get_time(client.scene(), &now));
    time = std::max(time + period, now - period);  // exactly one period later, unless this process was delayed for long
    fs_state hand;
    check(fs_scene_get_hand(client.scene(), &hand, nullptr, nullptr));
    drive_rover(client.scene(), "wheels", rover, terrain, hand.pose.position, period, time);
    if (i % 100 == 0) {
      const double heading = 90 - rover.heading * 180 / std::numbers::pi;  // as on a compass
      client.say("at %.1f km east, %.1f km north, heading %.0f degrees, %.1f km driven", rover.position.x / 1e3,
                 rover.position.y / 1e3, heading - 360 * std::floor(heading / 360), rover.distance / 1e3);
    }
  }
}

int main(int argc, char** argv) { return run_client(argc, argv, "rover", "", 0, drive); }
