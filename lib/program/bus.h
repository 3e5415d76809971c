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

std::vector<SeenDevice> haptic_devices_on_bus();

// Why the device cannot be used, and what to do; "": nothing stands in the way. known: the drivers.
std::string trouble_of(const SeenDevice& seen, const std::vector<fs_driver_info>& known);
