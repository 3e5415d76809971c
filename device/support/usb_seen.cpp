#include "device/support/usb_seen.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#ifndef FORCESERVER_DATA_FOLDER
#define FORCESERVER_DATA_FOLDER "/usr/share/forceserver"
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

std::string usb_rule_command(const std::string& match) {
  const std::string name = "60-forceserver.rules", folder = "/etc/udev/rules.d/";
  const std::string file = FORCESERVER_DATA_FOLDER "/" + name;
  if (access(file.c_str(), R_OK) == 0) return "sudo cp " + file + " " + folder;
  return "echo 'SUBSYSTEM==\"usb\", ENV{DEVTYPE}==\"usb_device\", " + match + ", TAG+=\"uaccess\"' | sudo tee -a " + folder +
         name;
}

}  // namespace fs
