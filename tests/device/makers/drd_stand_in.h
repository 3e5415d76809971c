// A stand-in for the library of Force Dimension, libdrd.so.3: the functions that the driver dhd finds in it, in front of models of
// devices. It behaves as open programs that use the real one tell of it; what is not known is as bad as it may be. Built as a library
// of that name, which the driver loads; a test finds the same one by drd_stand_in_here.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "device/makers/handle.h"

namespace makers {

// An omega.3 as the models have it: assumed, but for its force.
inline stability::DeviceModel omega() {
  stability::DeviceModel model;
  model.mass = 0.25;
  model.friction = 0.1;
  model.encoder = 10e-6;
  model.force_max = 12;
  model.torque_max = 0.2;
  return model;
}

// A device. Its handle is in the device frame of forceserver; the functions turn it into the SDK's.
struct DrdDevice {
  explicit DrdDevice(unsigned short number) : handle(omega(), stability::light, 0), serial(number) {}

  Handle handle;

  // What a test sets, with the stand-in's mutex (DrdStandIn::change).
  unsigned short serial;
  int type = 33;                       // omega.3
  const char* name = "omega.3";
  bool has_wrist = false, has_active_wrist = false, has_gripper = false, can_home = true;
  bool has_power = true, is_initialized = true;
  bool is_taken = false;               // by another program
  bool has_watchdog = true;            // its firmware
  bool has_force = false;              // its motors are on
  int cause = 0;                       // why not
  bool has_brakes = false;
  double weight = 0;                   // N, of its arms: carried by the SDK if that is asked for
  double fastest = 0;                  // m/s, at which it brakes; 0: never
  fs_quat orientation{1, 0, 0, 0};     // of the handle, device frame
  unsigned buttons = 0;
  double grip = 0;                     // rad
  double limit = -1;                   // N, that somebody has set; negative: none
  double stuck_for = 0;                // s, that the next call takes longer
  bool has_status = true;              // it tells its status
  int odd_answer = 0;                  // instead of a pose: -1 an error once, 7 a number that is none

  // What it sees.
  bool is_open = false, is_carried = false, is_homing = false, buttons_emulated = false;
  int watchdog = 0;                    // in units of 125 us
  int times_homed = 0, times_enabled = 0;
  fs_vec3 asked{}, asked_torque{};     // N, N m, of the newest command, device frame
  fs_vec3 asked_when_homing{};         // N, of the newest command when it began to home
  double asked_when_enabled = 0;       // N, the largest of the newest commands when its motors were switched on
  double asked_at = 0;                 // s
  double last_force_asked = 0;         // s, when one other than 0 was last asked for
  double fetched_at = 0;               // s
  Handle::Measured fetched{};
};

class DrdStandIn {
 public:
  DrdStandIn();

  std::vector<std::shared_ptr<DrdDevice>> devices;  // those that are plugged in, in the SDK's order
  std::array<int, 4> version{3, 17, 1, 0};
  double block = 250e-6;                            // s, that each call takes that goes to the device
  double time_guard = 300e-6;                       // s: a pose that is younger is given again
  std::atomic<uint64_t> calls{0};
  std::mutex mutex;

  template <class Change>
  auto change(Change change_it) {
    const std::lock_guard lock(mutex);
    return change_it(*this);
  }
};

}  // namespace makers
