// The handle of a device that the stand-in of a maker's interface shows: the plant of tests/stability at the time of the clock, in
// the device frame of forceserver (x right, y away, z up). It notes what tests and benchmarks ask for. Any thread may call it.
#pragma once

#include <cstdint>
#include <mutex>
#include <vector>

#include "stability/plant/plant.h"

namespace makers {

class Handle {
 public:
  // watchdog: s after the last command, until the motors have no force; 0: never.
  Handle(const stability::DeviceModel& device, const stability::HandModel& hand, double watchdog);

  // Another device, another hand: at rest in the origin.
  void become(const stability::DeviceModel& device, const stability::HandModel& hand);
  void set_watchdog(double watchdog);

  // The stand-in calls these.
  struct Measured {
    fs_vec3 position;  // m, as the encoders have it
    fs_vec3 rotation;  // rad, a small rotation vector
  };
  Measured measure();
  void command(fs_vec3 force, fs_vec3 torque = {});  // N, N m; at most the device's maxima is given
  void rest();                                       // the motors have no power
  void note_caller();  // in each function of the maker's interface: the servo's thread must never be there

  // Tests call these.
  template <class Change>
  void with_plant(Change change) {  // at the present time
    const std::lock_guard lock(mutex_);
    advance();
    change(plant_);
  }
  fs_vec3 position();
  fs_vec3 force();              // N, that the motors give now
  double largest_rise();        // N, of the force from one command to the next, beyond what a ramp does in that time
  double last_force_time();     // s, monotonic clock: when they last gave any; 0: never
  uint64_t commands();          // how many have come
  uint64_t calls_of_servo();    // calls by the servo's thread
  // From now on the handle goes slowly along x, whatever the motors do, and each force tells by its size which position it answers: it
  // must be that of a spring of 100 N/m at the origin. out: s, from that measurement to the command; null: no more.
  void note_turnarounds(std::vector<double>* out);

 private:
  void advance();
  void give(fs_vec3 force, fs_vec3 torque, double time);

  std::mutex mutex_;
  stability::Plant plant_;
  double watchdog_;             // s
  const double begin_;          // s, monotonic clock, at which the plant's time is 0
  double commanded_ = 0;        // s, monotonic clock: the last command
  double noting_since_ = 0;     // s: since when turnarounds are noted
  double answered_ = 0;         // N, along x: the newest force of those
  double had_force_ = 0;        // s
  double given_ = 0, largest_rise_ = 0;  // N
  double given_at_ = 0;         // s
  uint64_t commands_ = 0, calls_of_servo_ = 0;
  bool has_force_ = false;
  std::vector<double>* turnarounds_ = nullptr;
};

}  // namespace makers
