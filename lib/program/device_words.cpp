#include "device_words.h"

#include <unistd.h>

#include <algorithm>
#include <numbers>
#include <stdexcept>

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

}  // namespace

std::vector<std::string> to_text(const fs_device_info& info) {
  const double degrees = info.workspace_angle * 180 / std::numbers::pi;
  std::vector<std::string> lines;
  lines.push_back(format("name        %s%s%s", info.name, *info.serial ? ", serial " : "", info.serial));
  lines.push_back(format("workspace   a cylinder about z: %g mm in radius, %g mm high, with the origin at its centre; ",
                         info.workspace_radius * 1e3, info.workspace_height * 1e3) +
                  (degrees > 0 ? format("the handle rotates %.0f degrees each way", degrees) : "the handle does not rotate"));
  lines.push_back("force       " + most("along", info.force_axes, info.force_max, "N"));
  lines.push_back("torque      " + most("about", info.torque_axes, info.torque_max, "N m"));
  lines.push_back(format("rate        %g Hz; %s from pose to force, in addition to the period", info.rate,
                         milliseconds(info.delay).c_str()));
  lines.push_back("resolution  " + (info.resolution > 0 ? format("%.3g um", info.resolution * 1e6) : "exact, or not known"));
  lines.push_back("moving      " + (info.mass > 0 ? format("%g kg", info.mass) : "mass unknown") +
                  (info.damping > 0 ? format(", %g N s/m of damping", info.damping) : ", damping unknown"));
  lines.push_back("watchdog    " + (info.watchdog > 0   ? "the device itself ends its force " + milliseconds(info.watchdog) +
                                                              " after the last command"
                                    : info.watchdog < 0 ? std::string("NONE: ") + no_watchdog
                                                        : "not known: who kills the program may have to switch the device off"));
  if (info.link_rate > 0) lines.push_back(format("link        %g times a second", info.link_rate));
  if (info.controller_rate > 0) {
    lines.push_back(format("controller  its own, %g Hz, %g ms of delay, %g N s/m of local damping", info.controller_rate,
                           info.controller_delay * 1e3, info.controller_damping));
  }
  return lines;
}

void load_driver(const std::string& file) {
  if (file.empty()) return;
  try {
    forceserver::throw_on_error(fs_driver_load(file.c_str()));
  } catch (const Error& failure) {
    const bool is_here = file.find('/') == file.npos && access(file.c_str(), F_OK) == 0;
    if (!is_here) throw;
    throw std::runtime_error(failure.what() + ("; for the file in this folder write ./" + file));
  }
}

std::vector<fs_driver_info> drivers() {
  size_t count = 0;
  forceserver::throw_on_error(fs_driver_list(nullptr, 0, &count));
  std::vector<fs_driver_info> all(count);
  forceserver::throw_on_error(fs_driver_list(all.data(), all.size(), &count));
  all.resize(std::min(count, all.size()));
  return all;
}

std::string place_of(const fs_driver_info& info) { return *info.path ? info.path : "part of forceserver"; }

std::string origin(const fs_driver_info& info) { return *info.trouble ? info.trouble : place_of(info); }

std::string why_not_ready(const Device& device) {
  try {
    const fs_state state = device.read();
    if (state.flags & FS_STATE_READY) return "";
    const std::string reason = fs_state_reason(state.flags);
    return reason.empty() ? "the driver does not say why" : reason;
  } catch (const Error& failure) {
    return failure.what();
  }
}
