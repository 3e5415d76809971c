// What the tests of the driver haply share: a service, a device, and a servo that pushes it.
#pragma once

#include <forceserver/driver.h>

#include "device/makers/haply_service.h"
#include "device/makers/rig.h"

namespace makers {

inline std::string uri(unsigned short port, const std::string& place = "0", const std::string& options = "") {
  return "haply:" + place + "?port=" + std::to_string(port) + (options.empty() ? "" : "&" + options);
}
inline Device opened(const HaplyService& service, const std::string& place = "0", const std::string& options = "") {
  return open_device(uri(service.port(), place, options).c_str());
}

inline double push_of(HaplyDevice& device) { return norm(device.handle.force()); }

// A service, a device, and a servo that pushes it.
struct HaplyRig {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  Device device = opened(service);
  Pushing pushing{device};

  HaplyRig() { ck_assert(pushes()); }
  bool pushes() {
    return until([&] { return push_of(arm) > 0.5; });
  }
  // The force ends for good, at the latest by the idle of the service, and what a busy machine adds.
  void expect_end() {
    const double begin = now_s();
    ck_assert(until([&] { return push_of(arm) == 0; }));
    std::printf("  the force ended after %.0f ms\n", 1e3 * (arm.handle.last_force_time() - begin));
  }
  template <class Change>
  void change(Change change) {
    service.with([&](HaplyService& it) { return change(it), 0; });
  }
};

}  // namespace makers
