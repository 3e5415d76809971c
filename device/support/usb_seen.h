// Devices on the USB as the system lists them, without opening any: for drivers whose devices are opened by a maker's library.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace fs {

struct UsbSeen {
  uint16_t product;
  std::string node;  // "/dev/bus/usb/001/004"
  bool may_open;     // by this user
};

std::vector<UsbSeen> usb_seen(uint16_t vendor);  // in the order of their nodes

}  // namespace fs
