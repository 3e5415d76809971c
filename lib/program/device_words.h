// What the commands about devices say of a device and its driver.
#pragma once

#include <string>
#include <vector>

#include "program.h"

// What it means that a device has none.
inline constexpr const char* no_watchdog = "a force stays when the program is killed, until somebody switches it off";

std::vector<std::string> to_text(const fs_device_info& info);  // a line for each kind of property

std::vector<fs_driver_info> drivers();           // all, by scheme
std::string place_of(const fs_driver_info& info);  // where it is from
std::string origin(const fs_driver_info& info);    // the same, or why it cannot be used
std::string why_not_ready(const Device& device);  // "": it is ready
