#include <forceserver/driver.h>

#include <cmath>
#include <cstring>
#include <utility>

#include "api/guarded.h"
#include "base/grown.h"
#include "driver/call_driver.h"
#include "driver/device.h"
#include "driver/registry.h"
#include "math/pose.h"
#include "scene/local_scene.h"

using namespace fs;

// What a driver says when it cannot look for devices, such as that the library of their maker is missing; "": it can.
static std::string trouble_of(const fs_driver& driver) {
  if (!driver.list) return "";
  size_t count = 0;
  std::string sentence;
  const fs_status status = call_driver([&] { return driver.list(nullptr, 0, &count); }, sentence);
  return status == FS_OK ? "" : sentence.empty() ? fs_status_name(status) : sentence;
}

fs_status fs_device_list(fs_device_entry* out, size_t capacity, size_t* count) {
  return guarded([&] {
    std::vector<fs_device_entry> entries;
    list_drivers();  // a device of a module is found, too
    for (const fs_driver* driver : all_drivers()) {
      if (!driver->list) continue;
      size_t found = 0;
      std::string sentence;  // nobody is told it: one bad driver does not hide the others
      const auto list = [&](fs_device_entry* to, size_t room) {
        return call_driver([&] { return driver->list(to, room, &found); }, sentence) == FS_OK;
      };
      if (!list(nullptr, 0) || found > 1024) continue;
      std::vector<fs_device_entry> own(found);
      if (found && !list(own.data(), own.size())) continue;
      own.resize(std::min(found, own.size()));
      for (fs_device_entry& entry : own) {
        entry.uri[sizeof entry.uri - 1] = entry.label[sizeof entry.label - 1] = 0;
        entries.push_back(entry);
      }
    }
    copy_list(entries, out, capacity, count);
  });
}

fs_status fs_device_open(const char* uri, fs_device** out) {
  return guarded([&] {
    require_pointer(uri, "uri");
    require_pointer(out, "out");
    *out = make_ref<Device>(uri).detach();
  });
}

void fs_device_close(fs_device* device) {
  if (!device) return;
  if (!device->is_of_this_process()) return;
  {
    const std::lock_guard lock(device->mutex);
    if (!device->is_owned()) device->zero();
  }
  device->release();
}

fs_status fs_device_get_info(fs_device* device, fs_device_info* out) {
  return guarded([&] {
    require_pointer(device, "device");
    require_pointer(out, "out");
    write_grown(device->info(), out);
  });
}

namespace {

// Calls f(device), unless a servo owns the device.
template <class F>
fs_status on_device(fs_device* device, F&& f) {
  return guarded([&] {
    require_pointer(device, "device");
    if (!device->is_of_this_process()) fail(FS_ERROR_STATE, "the device was opened by the parent of this process");
    const std::lock_guard lock(device->mutex);
    if (device->is_owned()) fail(FS_ERROR_STATE, "a servo has the device; stop it first");
    if (!device->take_turn()) fail(FS_ERROR_STATE, "the process is ending, and the device with it");
    struct Turn {
      fs_device* device;
      ~Turn() { device->end_turn(); }
    } const turn{device};
    std::string sentence;
    const fs_status status = call_driver(f, sentence);
    if (status == FS_OK) return;
    if (sentence.empty()) sentence = device->newest_trouble().of(status);
    if (sentence.empty()) sentence = fs_status_name(status);
    fail(status, "the device %s: %s", device->info().name, sentence.c_str());
  });
}

}  // namespace

fs_status fs_device_read(fs_device* device, fs_state* out) {
  return on_device(device, [&] {
    require_pointer(out, "out");
    fs_state state;
    const fs_status status = device->read(steady_now(), state);
    if (status != FS_OK) return status;
    if (!is_finite(state.pose) || !is_finite(state.twist)) {
      fail(FS_ERROR_INVALID, "the device %s: its driver gave a pose or twist that is not finite", device->info().name);
    }
    *out = state;
    return status;
  });
}

fs_status fs_device_write(fs_device* device, const fs_wrench* wrench) {
  return on_device(device, [&] {
    require_pointer(wrench, "wrench");
    const Vec3 &f = wrench->force, &t = wrench->torque;
    const std::pair<const char*, double> all[]{{"force.x", f.x},  {"force.y", f.y},  {"force.z", f.z},
                                               {"torque.x", t.x}, {"torque.y", t.y}, {"torque.z", t.z}};
    for (const auto& [field, value] : all) {
      if (!std::isfinite(value)) fail(FS_ERROR_INVALID, "wrench.%s is %g, must be finite", field, value);
    }
    return device->write(*wrench);
  });
}

fs_status fs_device_control(fs_device* device, const char* request, fs_answer* out) {
  return guarded([&] {
    require_pointer(device, "device");
    require_pointer(request, "request");
    require_pointer(out, "out");
    fs_answer answer{};
    device->control(request, answer);
    *out = answer;
  });
}

fs_status fs_driver_register(const fs_driver* driver) {
  return guarded([&] {
    require_pointer(driver, "driver");
    register_driver(*driver);
  });
}

fs_status fs_driver_list(fs_driver_info* out, size_t capacity, size_t* count) {
  return guarded([&] {
    std::vector<fs_driver_info> drivers = list_drivers();
    for (const fs_driver* driver : all_drivers()) {
      for (fs_driver_info& info : drivers) {
        if (std::strcmp(info.scheme, driver->scheme) == 0) trouble_of(*driver).copy(info.trouble, sizeof info.trouble - 1);
      }
    }
    copy_list(drivers, out, capacity, count);
  });
}

fs_status fs_driver_load(const char* path) {
  return guarded([&] {
    require_pointer(path, "path");
    load_driver(path);
  });
}

fs_status fs_fail(fs_status status, const char* message) { return set_last_error(status, message ? message : ""); }
