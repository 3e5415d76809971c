#include "bus.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "words.h"

namespace {

struct KnownDevice {
  std::uint16_t vendor, product;  // product 0: any of this vendor
  const char* product_text;       // which the device must say of itself; null: any
  const char* kind;
  const char* scheme;               // of its driver
};

constexpr KnownDevice known_devices[] = {
    {0x0403, 0xcb48, nullptr, "Novint Falcon", "falcon"},
    {0x1209, 0x0001, "FIDEL", "FIDEL", "fidel"},
    {0x1451, 0, nullptr, "device of Force Dimension", "dhd"},
    {0x2988, 0, nullptr, "Touch", "openhaptics"},
};

constexpr const char* rule_name = "60-forceserver.rules";

// The first line of a file that describes a device; "" where there is none.
std::string line_of(const std::filesystem::path& file) {
  std::string line;
  std::ifstream stream(file);
  std::getline(stream, line);
  return line;
}

unsigned long number_of(const std::string& text, int base) { return std::strtoul(text.c_str(), nullptr, base); }

const KnownDevice* find_known(std::uint16_t vendor, std::uint16_t product, const std::string& text) {
  for (const KnownDevice& known : known_devices) {
    if (known.vendor != vendor || (known.product && known.product != product)) continue;
    if (!known.product_text || text == known.product_text) return &known;
  }
  return nullptr;
}

}  // namespace

Bus look_at_bus() {
  Bus bus;
  std::error_code none;  // a machine without USB
  bus.is_there = std::filesystem::exists("/sys/bus/usb", none);
  for (const auto& entry : std::filesystem::directory_iterator("/sys/bus/usb/devices", none)) {
    const std::filesystem::path& folder = entry.path();
    const auto vendor = static_cast<std::uint16_t>(number_of(line_of(folder / "idVendor"), 16));
    const auto product = static_cast<std::uint16_t>(number_of(line_of(folder / "idProduct"), 16));
    const KnownDevice* const known = find_known(vendor, product, line_of(folder / "product"));
    if (!known) {
      constexpr unsigned long hub = 9;
      const bool is_device = vendor != 0;  // not one of its interfaces
      if (is_device && number_of(line_of(folder / "bDeviceClass"), 16) != hub) ++bus.others;
      continue;
    }
    const std::string serial = line_of(folder / "serial");
    bus.seen.push_back({vendor, product, known->kind + (serial.empty() ? "" : ", serial " + serial), known->scheme,
                        format("/dev/bus/usb/%03lu/%03lu", number_of(line_of(folder / "busnum"), 10),
                               number_of(line_of(folder / "devnum"), 10))});
  }
  std::sort(bus.seen.begin(), bus.seen.end(), [](const SeenDevice& a, const SeenDevice& b) { return a.node < b.node; });
  return bus;
}

std::string why_none(const Bus& bus) {
  if (!bus.is_there) return "this machine or container has no USB: there is no /sys/bus/usb";
  return format(
      "no haptic device that forceserver knows, and %zu other device%s; look at the power supply of the device and at its "
      "cable, and try a socket of the machine itself, without a hub",
      bus.others, bus.others == 1 ? "" : "s");
}

Trouble trouble_of(const SeenDevice& seen, const std::vector<fs_driver_info>& known) {
  const auto driver = std::find_if(known.begin(), known.end(),
                                   [&](const fs_driver_info& info) { return std::strcmp(info.scheme, seen.scheme) == 0; });
  if (driver == known.end()) return {format("it needs the driver %s, which is not installed", seen.scheme), ""};
  if (*driver->trouble) return {format("it needs the driver %s, which cannot be used (see above)", seen.scheme), ""};
  if (access(seen.node.c_str(), R_OK | W_OK) == 0) return {};
  if (errno == ENOENT) return {"the system has made no node for it", ""};
  const std::string rule = installed_rule();
  if (!rule.empty()) return {"this user may not open it", "unplug the device and plug it in again; for use over ssh see " + rule};
  return {"this user may not open it", install_rule() + "\nthen unplug the device and plug it in again"};
}

std::string installed_rule() {
  for (const char* folder : {"/etc/udev/rules.d/", "/run/udev/rules.d/", "/usr/local/lib/udev/rules.d/", "/usr/lib/udev/rules.d/",
                             "/lib/udev/rules.d/"}) {
    const std::string file = std::string(folder) + rule_name;
    if (access(file.c_str(), F_OK) == 0) return file;
  }
  return "";
}

std::string install_rule() {
  std::vector<std::string> folders;  // of the installation or sources that this program is in
  std::error_code none;
  std::filesystem::path above = std::filesystem::read_symlink("/proc/self/exe", none).parent_path();
  for (; above.has_relative_path(); above = above.parent_path()) {
    for (const char* folder : {"/lib/udev/rules.d/", "/device/udev/"}) folders.push_back(above.string() + folder);
  }
  folders.push_back(FORCESERVER_RULES_FOLDER "/");
  const std::string reload = " && sudo udevadm control --reload";
  for (const std::string& folder : folders) {
    const std::string file = folder + rule_name;
    if (access(file.c_str(), F_OK) == 0) return "sudo cp " + in_shell(file) + " /etc/udev/rules.d/" + reload;
  }
  return std::string("put ") + rule_name +
         ", which the package forceserver and the folder device/udev of its sources have, into "
         "/etc/udev/rules.d; then: sudo udevadm control --reload";
}
