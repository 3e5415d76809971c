// forceserver devices: lists the devices that can be opened, and their properties.
#include <cstdio>

#include "bus.h"
#include "device_words.h"
#include "json.h"
#include "words.h"

namespace {

Json to_json(const fs_device_info& info) {
  return {{"name", info.name},
          {"serial", info.serial},
          {"workspace_radius", info.workspace_radius},
          {"workspace_height", info.workspace_height},
          {"workspace_angle", info.workspace_angle},
          {"force_axes", info.force_axes},
          {"torque_axes", info.torque_axes},
          {"force_max", info.force_max},
          {"torque_max", info.torque_max},
          {"resolution", info.resolution},
          {"rate", info.rate},
          {"delay", info.delay},
          {"damping", info.damping},
          {"mass", info.mass},
          {"link_rate", info.link_rate},
          {"controller_rate", info.controller_rate},
          {"controller_delay", info.controller_delay},
          {"controller_damping", info.controller_damping},
          {"watchdog", info.watchdog}};
}

// Opens the device to ask for its properties. If another program has it, or it has gone, lists it with the reason.
void add(const fs_device_entry& entry, bool as_json, Json& list) {
  Json listed = {{"uri", entry.uri}, {"label", entry.label}};
  if (!as_json) std::printf("%s  %s\n", entry.uri, entry.label);
  fs_device_info info = fs_device_info_init();
  std::string reason;
  try {
    const Device device = Device::open(entry.uri);
    info = device.get_info();
    reason = why_not_ready(device);
  } catch (const Error& failure) {
    if (!as_json) std::printf("    cannot be opened now: %s\n", failure.what());
    listed["status"] = fs_status_name(failure.status());
    listed["error"] = failure.what();
    list.push_back(listed);
    return;
  }
  if (!as_json) {
    for (const std::string& line : to_text(info)) std::printf("    %s\n", line.c_str());
    if (!reason.empty()) std::printf("    not ready   %s\n", reason.c_str());
  }
  listed["not_ready"] = reason;
  listed["info"] = to_json(info);
  list.push_back(listed);
}

void add(const fs_driver_info& driver, bool as_json, Json& list) {
  if (!as_json) std::printf("driver %s: %s\n", driver.scheme, origin(driver).c_str());
  list.push_back({{"scheme", driver.scheme}, {"path", driver.path}, {"trouble", driver.trouble}});
}

// A device on the USB bus: whether there is a driver for it, and whether this user may open it.
void add(const SeenDevice& seen, const std::vector<fs_driver_info>& known, bool as_json, Json& list) {
  const auto [what, cure] = trouble_of(seen, known);
  const std::string trouble = what + (cure.empty() ? "" : ": " + cure);
  if (!as_json) {
    std::printf("usb %04x:%04x, %s at %s: %s\n", seen.vendor, seen.product, seen.name.c_str(), seen.node.c_str(),
                trouble.empty() ? format("for the driver %s", seen.scheme).c_str() : trouble.c_str());
  }
  list.push_back({{"vendor", seen.vendor},
                  {"product", seen.product},
                  {"name", seen.name},
                  {"node", seen.node},
                  {"scheme", seen.scheme},
                  {"trouble", trouble}});
}

}  // namespace

int devices(const DevicesOptions& options) {
  load_driver(options.driver);
  Json list = Json::array();
  for (const fs_device_entry& entry : forceserver::device_list()) add(entry, options.json, list);
  Json all = {{"devices", list}};
  if (options.why) {
    Json told = Json::array(), on_bus = Json::array();
    const std::vector<fs_driver_info> known = drivers();
    for (const fs_driver_info& driver : known) add(driver, options.json, told);
    const Bus bus = look_at_bus();
    for (const SeenDevice& seen : bus.seen) add(seen, known, options.json, on_bus);
    if (bus.seen.empty() && !options.json) std::printf("usb: %s\n", why_none(bus).c_str());
    all["drivers"] = told;
    all["usb"] = on_bus;
    all["usb_trouble"] = bus.seen.empty() ? why_none(bus) : "";
  }
  if (options.json) std::puts(dump(all, 2).c_str());
  write_out();
  return exit_fine;
}
