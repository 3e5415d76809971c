// What it is worth that a device's states pace the servo: the time from a state to the force that answers it, and how stiff a
// wall may then be for a handle that nobody holds. bench_pacing [SECONDS]
//
// The device is a thread that gives a state each millisecond. How stiff: the exact boundary of stability of FIDEL's handle
// (0.3 kg, 1 N s/m), released, at 1 kHz, with that time as the delay of the loop.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <vector>

#include "boundary.h"
#include "device/waiting_device.h"
#include "scenes/scenes.h"

using namespace scenes;

namespace {

constexpr double stiffness = 100;  // N/m, of the spring that is felt
constexpr double step = 1e-6;      // m, from one state to the next: so a force tells which state it answers
constexpr double period = 1e-3;    // s, of the device

struct Way {
  const char *name, *scheme;
  uint32_t flags;
  bool is_paced;
};
constexpr Way ways[] = {{"each by a clock of its own", "clocks", 0, false},
                        {"a state wakes the servo", "paced", 0, true},
                        {"one thread does all", "one", FS_DRIVER_IN_SERVO, true}};

// s, from a state to the force that answers it.
std::vector<double> delays(const Way& way, double seconds) {
  std::vector<double> begins(static_cast<size_t>(seconds / period) + 10000);  // s, of each state
  WaitingDevice fake(way.scheme, way.flags);
  fake.period = period;
  fake.on_state = [&](fs_state& state, uint64_t number) {
    state.pose.position.x = step * static_cast<double>(number);
    if (number < begins.size()) begins[number] = now_s();
  };
  Device device = fake.open();
  const Scene scene = make_scene();
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, 20);
  require(fs_object_set(scene.get(), &spring), "fs_object_set");
  fs_servo_options options = fs_servo_options_init();
  options.mode = way.is_paced ? FS_SERVO_THREAD : FS_SERVO_CALLER;
  options.ramp = options.fade = options.damping = options.max_stiffness = -1;
  Servo servo = start_servo(scene.get(), device.get(), options);
  const double end = now_s() + seconds;
  if (way.is_paced) std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  // Slightly slower than the device, so that every offset between the two clocks occurs.
  for (double next = now_s(); !way.is_paced && next < end; next += 1.0013 * period) {
    std::this_thread::sleep_for(std::chrono::duration<double>(next - now_s()));
    require(fs_servo_step(servo.get(), 1), "fs_servo_step");
  }
  servo.reset();
  device.reset();
  std::vector<double> out;
  uint64_t newest = 0;  // each state counts once, when it is first answered
  for (const WaitingDevice::Sent& sent : fake.sent()) {
    const auto number = static_cast<uint64_t>(std::llround(-sent.wrench.force.x / stiffness / step));
    if (number > newest && number < begins.size()) out.push_back(sent.time - begins[number]);
    newest = std::max(newest, number);
  }
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

int main(int count, char** arguments) {
  const double seconds = count > 1 ? std::atof(arguments[1]) : 10;
  std::printf("%-28s %8s  %12s  %12s  %22s\n", "", "answers", "p50, us", "p99, us", "N/m at p50, at p99");
  for (const Way& way : ways) {
    const std::vector<double> all = delays(way, seconds);
    const auto at = [&](double part) { return all[static_cast<size_t>(part * static_cast<double>(all.size() - 1))]; };
    const auto bound = [&](double delay) {
      return stability::critical_stiffness(stability::LinearLoop{0.3, 1, 0, 1e-3, delay});
    };
    std::printf("%-28s %8zu  %12.0f  %12.0f  %13.0f, %.0f\n", way.name, all.size(), 1e6 * at(0.5), 1e6 * at(0.99),
                bound(at(0.5)), bound(at(0.99)));
  }
}
