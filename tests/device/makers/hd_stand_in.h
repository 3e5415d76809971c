// A stand-in for the library of OpenHaptics, libHD.so.3.4: the functions that the driver openhaptics finds in it, in front of models of
// devices. It behaves as its headers and open programs tell of the real one; what is not known is as bad as it may be. Built as a library
// of that name, which the driver loads; a test finds the same one by hd_stand_in_here.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "device/makers/handle.h"

namespace makers {

// A Touch as the models have it: assumed, but for its force.
inline stability::DeviceModel touch_model() {
  stability::DeviceModel model;
  model.mass = 0.1;
  model.friction = 0.05;
  model.encoder = 50e-6;
  model.force_max = 3.3;
  model.torque_max = 0.1;
  return model;
}

// A device. Its handle is in the device frame of forceserver, with the origin in the middle of its box; the functions turn it into
// that of OpenHaptics.
struct HdDevice {
  HdDevice(std::string configured, std::string serial_number)
      : handle(touch_model(), stability::light, 0), name(std::move(configured)), serial(std::move(serial_number)) {}

  Handle handle;

  // What a test sets, with the stand-in's mutex (HdStandIn::change).
  std::string name, serial, model = "Touch";
  int output_axes = 3;
  double max_force = 3.3;                                // N
  double box[6] = {-160, -70, -40, 160, 90, 60};         // mm: least x, y, z, largest x, y, z
  int style = 4;                                         // of the calibration: by the inkwell
  unsigned calibration = 0x5000;
  bool is_in_inkwell = false;
  fs_quat orientation{1, 0, 0, 0};                       // of the handle, device frame
  int buttons = 0;
  double temperature = 0.2;
  bool gives_nan = false;
  bool is_there = true;                                  // false: unplugged
  std::vector<unsigned> errors;                          // of the next frame

  // What it sees.
  bool is_open = false, is_enabled = false, is_clamped = false, is_in_frame = false;
  int updates = 0;                                       // of its calibration
  int times_opened = 0, last_style = 0;
  int closed_pushing = 0, stopped_pushing = 0;           // how often it had a force when it was closed, or the thread stopped
  fs_vec3 force{}, torque{};                             // N, N m, that were set in this frame, device frame
};

class HdStandIn {
 public:
  HdStandIn();

  std::vector<std::shared_ptr<HdDevice>> devices;        // those that are configured; the first is the default
  double block = 250e-6;                                 // s, that the end of a frame takes, and its begin
  bool thread_stands = false;                            // the thread of OpenHaptics does nothing any more
  bool refuses_null = false;                             // as some versions do: the default device has a name
  std::string default_name = "Default Device";
  uint64_t frames = 0, nested = 0, outside = 0, opened_beside = 0;  // frames; begun twice; calls outside of one; opened while it runs
  int callbacks = 0;                                     // that are scheduled
  bool is_running = false;
  std::mutex mutex;

  template <class Change>
  auto change(Change change_it) {
    const std::lock_guard lock(mutex);
    return change_it(*this);
  }
};

}  // namespace makers
