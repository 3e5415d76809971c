// How long it takes from the pose that a device gives to the force that answers it, at the device: by a servo with a driver, and by the
// plainest loop that a program can have, which take turns in the same run.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <thread>
#include <vector>

#include "scenes/scenes.h"

namespace bench {

inline constexpr std::chrono::milliseconds round_time{3000}, warm_up{300};

// What is measured of one side.
class Turnarounds {
 public:
  explicit Turnarounds(const char* name) : name_(name) {}

  // A round, during which the device notes its times: set gives it the list, and then null.
  template <class Set, class Wait>
  void measure(Set set, Wait wait) {
    const double before = processor_time();
    set(&times_);
    wait();
    set(nullptr);
    processor_ += processor_time() - before;
    seconds_ += std::chrono::duration<double>(round_time).count();
  }
  void print() {
    if (times_.empty()) {
      std::printf("%-26s nothing was measured\n", name_);
      return;
    }
    std::sort(times_.begin(), times_.end());
    const auto at = [&](double part) { return 1e6 * times_[static_cast<size_t>(part * static_cast<double>(times_.size() - 1))]; };
    std::printf("%-26s %6.0f a second, p50 %6.1f us, p99 %6.1f us, p99.9 %6.1f us; %4.1f %% of a processor\n", name_,
                static_cast<double>(times_.size()) / seconds_, at(0.5), at(0.99), at(0.999), 100 * processor_ / seconds_);
  }

 private:
  static double processor_time() {  // s, of the process, with the model of the device
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }

  const char* name_;
  std::vector<double> times_;  // s
  double processor_ = 0, seconds_ = 0;
};

// A servo that renders a spring at the origin on the device, for a round.
template <class Set>
void run_servo(fs_device* device, Turnarounds& out, Set set) {
  using namespace scenes;
  const Scene scene = make_scene();
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 3);
  require(fs_object_set(scene.get(), &spring), "fs_object_set");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_THREAD;
  options.damping = options.max_stiffness = options.ramp = options.fade = -1;  // the force is that of the spring alone
  std::vector<double> ignored;
  set(&ignored);
  const Servo servo = start_servo(scene.get(), device, options);
  std::this_thread::sleep_for(warm_up);
  out.measure(set, [] { std::this_thread::sleep_for(round_time); });
}

// Calls step, which reads a pose and answers it, again and again for a round, in an ordinary thread.
template <class Set, class Step>
void run_plain(Turnarounds& out, Set set, Step step) {
  const auto repeat = [&](std::chrono::milliseconds time) {
    for (const auto end = std::chrono::steady_clock::now() + time; std::chrono::steady_clock::now() < end;) step();
  };
  std::thread([&] {
    std::vector<double> ignored;
    set(&ignored);
    repeat(warm_up);
    out.measure(set, [&] { repeat(round_time); });
  }).join();
}

}  // namespace bench
