// Three sites of a room, and who works at each: at the lab an application moves a rock, at the plant there is a wall, and at a desk
// without a device somebody looks on, makes the rock stronger and at last stops all hands. Each has a connection to the server of
// its own machine and knows nothing of the others: forceserver-bridge joins them.
//
//     sites shm:LAB shm:PLANT shm:DESK
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>

#include <forceserver/forceserver.hpp>

using forceserver::Scene;

namespace {

void wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

// Waits until the server has the object. A bridge needs a moment to meet the others.
bool comes(const Scene& scene, const char* object) {
  fs_report report;
  for (int i = 0; i < 300; ++i) {
    if (fs_scene_get_report(scene.get(), object, &report) == FS_OK && report.weight == 1) return true;
    wait(0.1);
  }
  std::fprintf(stderr, "%s has not come within 30 s\n", object);
  return false;
}

// The hand of a site, and what it feels of its own objects and of those of other sites.
void print(const char* site, const Scene& scene) {
  fs_state hand{};
  fs_wrench sent{};
  scene.get_hand(&hand, nullptr, &sent);
  std::string felt;
  for (const fs_report& report : scene.get_reports()) {
    const fs_vec3& f = report.wrench.force;
    char text[200];
    std::snprintf(text, sizeof text, "  %s %.2f N", report.name, std::hypot(f.x, f.y, f.z));
    if (std::hypot(f.x, f.y, f.z) > 0.005) felt += text;
  }
  const fs_vec3 &x = hand.pose.position, &f = sent.force;
  std::printf("  %-6s hand %6.1f %6.1f %6.1f mm, %.2f N:%s\n", site, 1e3 * x.x, 1e3 * x.y, 1e3 * x.z, std::hypot(f.x, f.y, f.z),
              felt.empty() ? "  nothing" : felt.c_str());
}

int run(char** endpoints) {
  const Scene rock = Scene::connect(std::string(endpoints[0]) + "?timeout=10", "rover");
  const Scene wall = Scene::connect(std::string(endpoints[1]) + "?timeout=10", "robot");
  const Scene desk = Scene::connect(std::string(endpoints[2]) + "?timeout=30", "desk");

  fs_object object = fs_object_init("rock", FS_PRIMITIVE_POINT);
  object.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 2, 0.02, 2);
  rock.object_set(object);
  wall.object_set(fs_wall_init("wall", {0, 0, -0.005}, {0, 0, 1}, 400, 5));
  if (!comes(desk, "rover@lab/rock") || !comes(desk, "robot@plant/wall")) return 1;
  if (!comes(wall, "rover@lab/rock") || !comes(rock, "robot@plant/wall")) return 1;

  std::puts("The rock of the lab goes round; the wall of the plant stands. Both are felt by both hands:");
  const double start = rock.get_time();
  for (int i = 0; i < 150; ++i) {  // 25 moves a second
    const double angle = 2 * M_PI * (rock.get_time() - start) / 3;
    const fs_pose pose = {{0.05 * std::cos(angle), 0.05 * std::sin(angle), 0}, {1, 0, 0, 0}};
    rock.object_move("rock", pose, nullptr, FS_NOW);
    if (i % 45 == 44) {
      print("lab", rock);
      print("plant", wall);
      print("desk", desk);
    }
    wait(0.04);
  }

  std::puts("The desk makes the rock of the lab stronger:");
  forceserver::Object edited = desk.object_get("rover@lab/rock");
  edited.front.gain = edited.front.limit = 4;
  desk.object_change(edited, FS_PART_PROFILES);
  for (int i = 0; i < 50 && rock.object_get("rock").front.gain != 4; ++i) wait(0.1);
  std::printf("  at the lab its gain is %g N now\n", rock.object_get("rock").front.gain);

  std::puts("The desk stops all force:");
  desk.stop_force();
  for (int i = 0; i < 50 && (rock.get_servo_stats().enabled || wall.get_servo_stats().enabled); ++i) wait(0.1);
  const bool is_stopped = !rock.get_servo_stats().enabled && !wall.get_servo_stats().enabled;
  print("lab", rock);
  print("plant", wall);
  return is_stopped && rock.object_get("rock").front.gain == 4 ? 0 : 1;
}

}  // namespace

int main(int count, char** words) {
  if (count != 4) {
    std::fprintf(stderr, "usage: sites ENDPOINT ENDPOINT ENDPOINT\n");
    return 2;
  }
  try {
    return run(words + 1);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
