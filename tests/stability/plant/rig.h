// A scene, a servo in virtual time and a plant behind a fake device: what runs is the whole library, through its C interface
// and its driver table.
#pragma once

#include <forceserver/forceserver.h>

#include "plant/plant.h"
#include "scenes/fake_device.h"

namespace stability {

// All protections that an option can switch off are off; the force limit stays.
fs_servo_options raw_options();
// The defaults, in virtual time.
fs_servo_options default_options();

class Rig {
 public:
  Rig(const DeviceModel& device, const HandModel& hand);
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  // False when the library refuses the options: fs_last_error() says why.
  bool start(const fs_servo_options& options);

  // Runs for this time. each(t) is called before each tick, t being the time of the last tick.
  template <class F>
  void run(double seconds, F&& each) {
    const uint64_t end = ticks_ + static_cast<uint64_t>(seconds / period_ + 0.5);
    for (; ticks_ < end; ++ticks_) {
      each(time());
      step();
    }
  }
  double time() const { return static_cast<double>(ticks_) * period_; }
  double period() const { return period_; }

  void set(const fs_object& object) { scenes::require(fs_object_set(scene.get(), &object), "fs_object_set"); }
  fs_servo_stats stats() const;

  scenes::Scene scene;
  Plant plant;
  bool tells_no_mass = false;  // the driver says that the device's mass is not known; before start

 private:
  void step();
  void read(fs_state& out, double time);

  double period_, last_time_ = -1;  // s
  uint64_t ticks_ = 0;
  scenes::FakeDevice fake_;
  scenes::Device device_;
  scenes::Servo servo_;
};

}  // namespace stability
