#include "device/support/usb_seen.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#ifndef FORCESERVER_RULES_FOLDER  // as CMake sets it; this is for tools that read this file without it
#define FORCESERVER_RULES_FOLDER "/usr/lib/udev/rules.d"
#endif

namespace fs {
namespace {

unsigned long number_in(const std::filesystem::path& file, int base) {
  std::string line;
  std::ifstream stream(file);
  std::getline(stream, line);
  return std::strtoul(line.c_str(), nullptr, base);
}

}  // namespace

std::vector<UsbSeen> usb_seen(uint16_t vendor) {
  std::vector<UsbSeen> out;
  std::error_code none;  // a machine without USB
  for (const auto& entry : std::filesystem::directory_iterator("/sys/bus/usb/devices", none)) {
    const std::filesystem::path& folder = entry.path();
    if (number_in(folder / "idVendor", 16) != vendor) continue;
    char node[64];
    std::snprintf(node, sizeof node, "/dev/bus/usb/%03lu/%03lu", number_in(folder / "busnum", 10),
                  number_in(folder / "devnum", 10));
    out.push_back({static_cast<uint16_t>(number_in(folder / "idProduct", 16)), node, access(node, R_OK | W_OK) == 0});
  }
  std::sort(out.begin(), out.end(), [](const UsbSeen& a, const UsbSeen& b) { return a.node < b.node; });
  return out;
}

std::string usb_rule_advice(const std::string& match) {
  const std::string name = "60-forceserver.rules", folder = "/etc/udev/rules.d/";
  for (const std::string read : {"/etc/udev/rules.d/", "/usr/local/lib/udev/rules.d/", "/usr/lib/udev/rules.d/"}) {  // by udev
    if (access((read + name).c_str(), R_OK) != 0) continue;
    return "the rule " + read + name +
           " is there, so plug the device in again; if you are not logged in at the screen, that file says what to add";
  }
  const std::string file = FORCESERVER_RULES_FOLDER "/" + name;
  const std::string command = access(file.c_str(), R_OK) == 0 ? "sudo cp " + file + " " + folder
                                                              : "echo 'SUBSYSTEM==\"usb\", ENV{DEVTYPE}==\"usb_device\", " +
                                                                    match + ", TAG+=\"uaccess\"' | sudo tee -a " + folder + name;
  return "install the rule for it, once: " + command + " && sudo udevadm control --reload; then plug the device in again";
}

}  // namespace fs
