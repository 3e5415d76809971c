#include "lateness.h"

#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cmath>
#include <ctime>
#include <thread>
#include <vector>

#include "device_page.h"
#include "program.h"

namespace {

constexpr double rate_of_servo = 1000;  // Hz

// Asks for what a servo asks for (fs_servo_options.priority).
void ask_for_priority() {
  sched_param parameter{};
  parameter.sched_priority = servo_priority;
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0) return;
  prctl(PR_SET_TIMERSLACK, 1UL);
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), -15);
}

double to_seconds(const timespec& time) { return double(time.tv_sec) + double(time.tv_nsec) * 1e-9; }

// Wakes `count` times at the rate, and keeps how late each was.
void idle(std::vector<double>& late) {
  ask_for_priority();
  timespec due{}, now{};
  clock_gettime(CLOCK_MONOTONIC, &due);
  for (double& each : late) {
    due.tv_nsec += std::lround(1e9 / rate_of_servo);
    if (due.tv_nsec >= 1000000000) {
      due.tv_nsec -= 1000000000;
      ++due.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr);
    clock_gettime(CLOCK_MONOTONIC, &now);
    each = to_seconds(now) - to_seconds(due);
    if (each > 1 / rate_of_servo) due = now;  // as a servo, which skips the ticks that it missed
  }
}

}  // namespace

Lateness measure_lateness(double seconds) {
  const Scene scene = Scene::create();
  const Device device = Device::open("sim:");
  fs_servo_options options = fs_servo_options_init();
  options.rate = rate_of_servo;
  std::vector<double> late(static_cast<std::size_t>(std::ceil(seconds * rate_of_servo)));
  const Servo servo = Servo::start(scene, device, &options);
  std::thread waits([&] { idle(late); });
  waits.join();
  const fs_servo_stats stats = scene.get_servo_stats();
  Durations idle_late;
  for (const double each : late) idle_late.add(each);
  return {{stats.late_p50, stats.late_p99, stats.late_max},
          {idle_late.quantile(0.5), idle_late.quantile(0.99), idle_late.longest()},
          stats};
}
