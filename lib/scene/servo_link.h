// The servo of a scene, as far as the scene needs it.
#pragma once

#include <vector>

#include <forceserver/servo.h>

#include "field/servo_output.h"
#include "scene/budget_link.h"
#include "scene/reader.h"

namespace fs {

class ServoLink {
 public:
  virtual double fade() const noexcept = 0;      // s; 0: none
  virtual ClockKind clock() const noexcept = 0;
  virtual double time() const noexcept = 0;      // s, of its newest tick
  virtual ImpactLimit impact_limit() const noexcept = 0;        // of its loop
  virtual void get_stats(fs_servo_stats& out) const = 0;        // all but struct_size
  virtual void get_device_info(fs_device_info& out) const = 0;  // all but struct_size
  // Adds the recorded ticks with numbers above `after` to out: so many of the oldest at most.
  virtual void add_record(uint64_t after, size_t most, std::vector<fs_recorded_tick>& out) const = 0;
  virtual void set_enabled(bool enabled) noexcept = 0;          // [rt]
  virtual uint64_t event_count() const noexcept = 0;            // of the device
  virtual bool take_event(uint64_t& next, fs_event& out) const = 0;  // number `next`, to which it adds 1; false: none yet

 protected:
  ~ServoLink() = default;
};

// What a tick tells about where it evaluated a scene, for reports.
struct TickSample {
  uint64_t tick = 0;
  double time = 0;     // s
  double weight = 0;   // of the newest view, times that of the whole scene; 0: it evaluated nothing there
  uint64_t view = 0;   // version of that view
  Pose tool{};         // scene frame
  Twist twist{};
};

// The servo's reader of a scene.
struct ServoReader : Reader {
  using Reader::Reader;
  Latest<TickSample> newest;
  BudgetLink* budget = nullptr;  // set before the scene knows the reader; null: nothing is bounded
};

}  // namespace fs
