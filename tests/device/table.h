// The row of a device in the table of device/README.md, which must be what the driver and the servo say of it.
#pragma once

#include <cstdio>
#include <fstream>
#include <string>

#include "api/support.h"

namespace scenes {

inline std::string known_or_not(double value, const char* form) {
  char text[32];
  std::snprintf(text, sizeof text, form, value);
  return value > 0 ? text : "not told";
}

// name: the first cell, such as "`dhd:` omega.3".
inline std::string table_row(fs_device* device, const char* name) {
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device, &info));
  const Scene scene = make_scene();
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_CALLER;  // so that no link has been measured yet
  const Servo servo = start_servo(scene.get(), device, options);
  char delay[32];  // ms
  std::snprintf(delay, sizeof delay, info.link_rate > 0 ? "measured" : "%.3g", 1e3 * info.delay);
  char watchdog[32];  // ms
  std::snprintf(watchdog, sizeof watchdog, info.watchdog > 0 ? "%.0f" : info.watchdog < 0 ? "none" : "not known", 1e3 * info.watchdog);
  char text[400];
  std::snprintf(text, sizeof text, "| %s | %.0f, %.0f | %.3g | %s | %s | %s | %s | %.0f | %s | %s | %.0f |", name, 1e3 * info.workspace_radius,
                1e3 * info.workspace_height, info.force_max, info.force_axes == 3 ? "x y z" : info.force_axes == 2 ? "x y" : "x",
                info.torque_axes ? known_or_not(info.torque_max, "%.3g").c_str() : "none", known_or_not(info.mass, "%.3g").c_str(),
                known_or_not(info.damping, "%.3g").c_str(), info.rate, delay, watchdog, stats_of(scene.get()).max_stiffness);
  return text;
}

inline void expect_in_table(fs_device* device, const char* name) {
  const std::string wanted = table_row(device, name);
  std::ifstream page(DEVICE_PAGE);
  for (std::string line; std::getline(page, line);) {
    if (line == wanted) return;
  }
  ck_abort_msg("the table of device/README.md has no row %s", wanted.c_str());
}

}  // namespace scenes
