// What the budget of a servo costs, the thread that bounds the objects: its processor time while the hand moves beside
// many objects that stand still. Prints a table; README.md has one. bench_budget [SECONDS]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>

#include <forceserver/forceserver.h>

#include "scenes/fake_device.h"
#include "scenes/random.h"
#include "scenes/scenes.h"

using namespace scenes;

namespace {

double budget_time() {  // s of a processor
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::string name;
    std::getline(std::ifstream(task.path() / "comm"), name);
    double nanoseconds = 0;
    if (name == "fs-budget" && std::ifstream(task.path() / "schedstat") >> nanoseconds) return 1e-9 * nanoseconds;
  }
  return 0;
}

// Percent of a core. The hand goes round on a circle of `radius` m, 0.2 m/s fast; so many objects lie at least `away` m from
// its middle.
double cost(int count, double radius, double away, double seconds) {
  FakeDevice fake("budget");
  fake.info.mass = 0.3;
  fake.info.workspace_radius = 1;
  fake.info.workspace_height = 2;
  fake.on_read = [radius](FakeDevice& f, double) {
    const double now = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    const double speed = radius > 0 ? 0.2 : 0, angle = radius > 0 ? speed / radius * now : 0;
    f.state.pose.position = {radius * std::cos(angle), radius * std::sin(angle), 0};
    f.state.twist.linear = {-speed * std::sin(angle), speed * std::cos(angle), 0};
    f.state.time = now;
  };
  const Scene scene = make_scene();
  Random random(1);
  require(fs_scene_begin(scene.get()), "fs_scene_begin");
  for (int i = 0; i < count; ++i) {
    fs_object o = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    do o.pose.position = random.in_box(1);
    while (norm(o.pose.position) < away);
    o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 2, 0.005, 2);
    o.front.reach = 0.015;
    require(fs_object_set(scene.get(), &o), "fs_object_set");
  }
  require(fs_scene_commit(scene.get()), "fs_scene_commit");
  const Device device = fake.open(false);
  const Servo servo = start_servo(scene.get(), device.get(), fs_servo_options_init());
  std::this_thread::sleep_for(std::chrono::seconds(3));  // at first there is more to do
  const double begin = budget_time();
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  return 100 * (budget_time() - begin) / seconds;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10;
  std::printf("%% of a core, objects that stand still, a hand at 0.2 m/s\n%10s %16s %16s %16s\n", "objects", "none near, rests",
              "none near", "among them");
  for (const int count : {0, 1000, 100'000}) {
    std::printf("%10d %16.2f %16.2f %16.2f\n", count, cost(count, 0, 0.3, seconds), cost(count, 0.05, 0.3, seconds),
                cost(count, 0.05, 0, seconds));
    std::fflush(stdout);
  }
}
