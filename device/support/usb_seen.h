// Devices on the USB as the system lists them, without libusb: for drivers whose devices are opened by a maker's library.
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

// How this user may come to open the devices that the udev keys in `match` name. Where udev does not read our file of rules yet, an
// administrator copies it. A wheel or a jar brings none, so there the rule stands in the command.
std::string usb_rule_advice(const std::string& match);

}  // namespace fs
