// What test-device and hello-device do with a device.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device_page.h"
#include "ending.h"
#include "program.h"

double now();  // s, monotonic clock
void sleep_for(double seconds);

// Ends a command in between, with the force at 0, when the user asks for it.
struct Interrupted {};

// While there may be a force, a signal is kept until pause() sees it. At any other time it ends the process at once, even
// while the driver hangs.
class ForceEnding {
 public:
  void pause(double seconds) const {
    if (ending_.wait(seconds)) throw Interrupted();
  }

 private:
  Ending ending_;
};

void describe_machine(DevicePage& page, const std::string& uri);         // this machine, and the driver
void describe_device(DevicePage& page, const Device& device);            // its properties, and its answer to "status"

// Sends the requests that the user named, waits until the device is ready, and notes whether it is. wait: s, after requests.
bool make_ready(DevicePage& page, const Device& device, const std::vector<std::string>& requests, double wait);

double age_max(const fs_device_info& info);  // s, how old a pose may be in a servo: see fs_device_info.delay

// The position of the handle, where it is known; otherwise why not.
struct Place {
  std::optional<fs_vec3> position;  // m
  std::string why;
};
Place fresh_place(const Device& device, const fs_device_info& info);

// Until the handle has stood for 0.2 s, or 3 s are over.
void wait_for_rest(const Device& device, const ForceEnding& ending);
