#include "device_steps.h"

#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "device_words.h"
#include "words.h"

double now() {
  timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void sleep_for(double seconds) {
  const timespec time = {time_t(seconds), long((seconds - std::floor(seconds)) * 1e9)};
  nanosleep(&time, nullptr);
}

void describe_machine(DevicePage& page, const std::string& uri) {
  utsname system;
  uname(&system);
  char date[32];
  const std::time_t time = std::time(nullptr);
  std::strftime(date, sizeof date, "%Y-%m-%d %H:%M UTC", std::gmtime(&time));
  page.heading("What was tested");
  page.figure("forceserver", fs_version());
  page.figure("system", format("%s %s, %s, %s", system.sysname, system.release, system.machine, date));
  const std::string scheme = uri.substr(0, uri.find(':'));
  for (const fs_driver_info& driver : drivers()) {
    if (scheme == driver.scheme) page.figure("driver", scheme + ": " + place_of(driver));
  }
}

void describe_device(DevicePage& page, const Device& device) {
  const fs_device_info info = device.get_info();
  if (info.watchdog < 0) page.note(Verdict::odd, std::string("it has no watchdog: ") + no_watchdog);
  for (const std::string& line : to_text(info)) page.figure(line.substr(0, 12).c_str(), line.substr(12));
  try {
    page.figure("status", device.control("status").text);
  } catch (const Error& failure) {
    if (failure.status() != FS_ERROR_UNSUPPORTED) page.figure("status", std::string("not told: ") + failure.what());
  }
}

bool make_ready(DevicePage& page, const Device& device, const std::vector<std::string>& requests, double wait) {
  for (const std::string& request : requests) page.figure("request", request + ": " + device.control(request).text);
  if (requests.empty()) wait = 0.5;  // the first states may not be believed yet
  std::string reason = why_not_ready(device);
  for (const double begin = now(); !reason.empty() && now() - begin < wait; reason = why_not_ready(device)) sleep_for(0.02);
  page.expect(reason.empty(), Verdict::odd, reason.empty() ? "it is ready" : "it is not ready: " + reason);
  return reason.empty();
}

double age_max(const fs_device_info& info) {
  return std::min(0.1, 0.020 + info.delay + (info.link_rate > 0 ? 1 / info.link_rate : 0));
}

Place fresh_place(const Device& device, const fs_device_info& info) {
  const fs_state state = device.read();
  const double age = now() - state.time;
  const bool is_ready = state.flags & FS_STATE_READY;
  if (is_ready && age <= age_max(info)) return {state.pose.position, ""};
  return {std::nullopt, is_ready ? format("no state for %.0f ms", age * 1e3) : "it is no longer ready"};
}

void wait_for_rest(const Device& device, const ForceEnding& ending) {
  const double begin = now();
  fs_vec3 before = device.read().pose.position;
  for (int still = 0; still < 2 && now() - begin < 3;) {
    ending.pause(0.1);
    const fs_vec3 position = device.read().pose.position;
    still = length(minus(position, before)) < 2e-4 ? still + 1 : 0;
    before = position;
  }
}
