// The haptic devices on the USB bus, as the system lists them, whether or not there is a driver for them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <forceserver/driver.h>

struct SeenDevice {
  std::uint16_t vendor, product;
  std::string name;    // its kind, and its serial number where it has one
  const char* scheme;  // of the driver that it needs
  std::string node;    // of the device in /dev
};

struct Bus {
  std::vector<SeenDevice> seen;
  std::size_t others = 0;  // devices that are not haptic ones, without hubs
  bool is_there = false;   // the system has a USB
};

Bus look_at_bus();

// What there is instead of a haptic device, and what to look at.
std::string why_none(const Bus& bus);

// Why the device cannot be used; "": nothing stands in the way. cure: what to do, where that is more than the trouble says.
struct Trouble {
  std::string what, cure;
};
Trouble trouble_of(const SeenDevice& seen, const std::vector<fs_driver_info>& known);  // known: the drivers

// The rule that gives users the devices on the USB: where it is installed ("": nowhere), and how to install it.
std::string installed_rule();
std::string install_rule();
