// A rover simulator: it drives over the terrain and steers to where the hand is. The hand feels the plane of its
// wheels, which rises and tilts with it: moved 25 times a second, and by the servo in between, with the twist given.
#include <cmath>
#include <numbers>

#include "client.h"

static const double period = 0.04;  // s

// How the wheels move: from where they are to where they would be a period later, with the same goal.
static fs_twist twist_of(const Rover& rover, const Terrain& terrain, const fs_vec3& goal) {
  Rover next = rover;
  next.drive(terrain, goal, period);
  const auto up = [&](const Rover& at) {
    const fs_vec3 n = terrain.normal(at.position.x, at.position.y, 800);
    const double length = std::hypot(n.x, n.y, n.z);
    return fs_vec3{n.x / length, n.y / length, n.z / length};
  };
  const fs_vec3 a = up(rover), b = up(next), &p = rover.position, &q = next.position;
  return {{(q.x - p.x) / period, (q.y - p.y) / period, (q.z - p.z) / period},
          {(a.y * b.z - a.z * b.y) / period, (a.z * b.x - a.x * b.z) / period, (a.x * b.y - a.y * b.x) / period}};
}

static void drive(Client& client, const Arguments&) {
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  Rover rover;
  fs_object plane = fs_object_init("wheels", FS_PRIMITIVE_PLANE);
  plane.pose = rover.wheels(terrain);
  plane.front = plane.back = pull(1.5, 2000);
  check(fs_object_set(client.scene(), &plane));
  fs_curve_destroy(plane.front.curve);

  for (int i = 1; client.wait(period); ++i) {
    fs_state hand;
    check(fs_scene_get_hand(client.scene(), &hand, nullptr, nullptr));
    const fs_vec3 goal = hand.pose.position;
    rover.drive(terrain, goal, period);
    const fs_pose wheels = rover.wheels(terrain);
    const fs_twist twist = twist_of(rover, terrain, goal);
    check(fs_object_move(client.scene(), "wheels", &wheels, &twist, FS_NOW));
    if (i % 100 == 0) {
      const double heading = 90 - rover.heading * 180 / std::numbers::pi;  // as on a compass
      client.say("at %.1f km east, %.1f km north, heading %.0f degrees, %.1f km driven", rover.position.x / 1e3,
                 rover.position.y / 1e3, heading - 360 * std::floor(heading / 360), rover.distance / 1e3);
    }
  }
}

int main(int argc, char** argv) { return run_client(argc, argv, "rover", "", 0, drive); }
