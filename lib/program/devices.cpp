// forceserver devices: lists the devices that can be opened, and their properties.
#include <algorithm>
#include <cstdio>
#include <numbers>

#include "json.h"
#include "words.h"

namespace {

// The names of the first `count` axes, such as "x, y, z".
std::string axes(std::uint32_t count) {
  const std::vector<std::string> all{"x", "y", "z"};
  return join({all.begin(), all.begin() + std::min<std::uint32_t>(count, 3)}, "none");
}

std::string most(const char* way, std::uint32_t axis_count, double value, const char* unit) {
  return axis_count == 0 ? "none" : format("%s %s, at most %g %s", way, axes(axis_count).c_str(), value, unit);
}

std::vector<std::string> to_text(const fs_device_info& info) {
  const double degrees = info.workspace_angle * 180 / std::numbers::pi;
  std::vector<std::string> lines;
  lines.push_back(format("name        %s%s%s", info.name, *info.serial ? ", serial " : "", info.serial));
  lines.push_back(format("workspace   a cylinder about z: %g mm in radius, %g mm high, with the origin at its centre; ",
                         info.workspace_radius * 1e3, info.workspace_height * 1e3) +
                  (degrees > 0 ? format("the handle rotates %.0f degrees each way", degrees) : "the handle does not rotate"));
  lines.push_back("force       " + most("along", info.force_axes, info.force_max, "N"));
  lines.push_back("torque      " + most("about", info.torque_axes, info.torque_max, "N m"));
  lines.push_back(format("rate        %g Hz; %g ms from pose to force, in addition to the period", info.rate, info.delay * 1e3));
  lines.push_back("resolution  " + (info.resolution > 0 ? format("%g um", info.resolution * 1e6) : "not quantised"));
  lines.push_back("moving      " + (info.mass > 0 ? format("%g kg", info.mass) : "mass unknown") +
                  format(", %g N s/m of damping", info.damping));
  if (info.link_rate > 0) lines.push_back(format("link        %g times a second", info.link_rate));
  if (info.controller_rate > 0) {
    lines.push_back(format("controller  its own, %g Hz, %g ms of delay, %g N s/m of local damping", info.controller_rate,
                           info.controller_delay * 1e3, info.controller_damping));
  }
  return lines;
}

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
          {"controller_damping", info.controller_damping}};
}

// Opens the device to ask for its properties. If another program has it, or it has gone, lists it with the reason.
void add(const fs_device_entry& entry, bool as_json, Json& list) {
  Json listed = {{"uri", entry.uri}, {"label", entry.label}};
  if (!as_json) std::printf("%s  %s\n", entry.uri, entry.label);
  fs_device_info info = fs_device_info_init();
  try {
    const Device device = Device::open(entry.uri);
    info = device.get_info();
  } catch (const Error& failure) {
    if (!as_json) std::printf("    cannot be opened now: %s\n", failure.what());
    listed["status"] = fs_status_name(failure.status());
    listed["error"] = failure.what();
    list.push_back(listed);
    return;
  }
  if (!as_json) {
    for (const std::string& line : to_text(info)) std::printf("    %s\n", line.c_str());
  }
  listed["info"] = to_json(info);
  list.push_back(listed);
}

std::vector<fs_driver_info> drivers() {
  size_t count = 0;
  forceserver::throw_on_error(fs_driver_list(nullptr, 0, &count));
  std::vector<fs_driver_info> all(count);
  forceserver::throw_on_error(fs_driver_list(all.data(), all.size(), &count));
  all.resize(std::min(count, all.size()));
  return all;
}

void add(const fs_driver_info& driver, bool as_json, Json& list) {
  const char* const path = *driver.path ? driver.path : "part of forceserver";
  if (!as_json) std::printf("driver %s: %s\n", driver.scheme, *driver.trouble ? driver.trouble : path);
  list.push_back({{"scheme", driver.scheme}, {"path", driver.path}, {"trouble", driver.trouble}});
}

}  // namespace

int devices(const DevicesOptions& options) {
  load_driver(options.driver);
  Json list = Json::array();
  for (const fs_device_entry& entry : forceserver::device_list()) add(entry, options.json, list);
  Json all = {{"devices", list}};
  if (options.why) {
    Json known = Json::array();
    for (const fs_driver_info& driver : drivers()) add(driver, options.json, known);
    all["drivers"] = known;
  }
  if (options.json) std::puts(dump(all, 2).c_str());
  write_out();
  return exit_fine;
}
