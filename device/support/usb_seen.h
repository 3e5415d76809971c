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

// The command by which an administrator lets users open the devices that the udev keys in `match` name: it installs our file of rules
// where there is one. A wheel or a jar brings none, so there the rule stands in the command.
std::string usb_rule_command(const std::string& match);

}  // namespace fs
