#include "scenes/fake_device.h"

#include <cstring>
#include <map>

namespace scenes {
namespace {

std::mutex names_mutex;
std::map<std::string, FakeDevice*>& names() {
  static std::map<std::string, FakeDevice*> all;
  return all;
}

FakeDevice& device_of(void* self) { return *static_cast<FakeDevice*>(self); }

fs_status open_fake(const char* address, void** self) {
  const std::lock_guard lock(names_mutex);
  const auto found = names().find(std::string(address, std::strcspn(address, "?")));
  if (found == names().end()) return fs_fail(FS_ERROR_NOT_FOUND, "fake: no test has made this device");
  FakeDevice& device = *found->second;
  const std::lock_guard device_lock(device.mutex);
  device.address = address;
  if (device.sentence) fs_fail(device.open_status, device.sentence);
  if (device.open_status != FS_OK) return device.open_status;
  device.is_open = true;
  *self = &device;
  return FS_OK;
}

void close_fake(void* self) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  device.is_open = false;
  if (device.on_close) device.on_close(device);
}

fs_status get_info(void* self, fs_device_info* out) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  const uint32_t size = out->struct_size;
  std::memcpy(out, &device.info, size < sizeof device.info ? size : sizeof device.info);
  out->struct_size = size;
  return device.info_status;
}

fs_status read(void* self, fs_state* out) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  static const fs_state zeros{};
  device.has_clean_reads &= std::memcmp(out, &zeros, sizeof zeros) == 0;
  ++device.reads;
  if (device.on_read) device.on_read(device, device.time);
  *out = device.state;
  return device.read_status;
}

fs_status write(void* self, const fs_wrench* wrench) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  ++device.writes;
  device.written = *wrench;
  if (device.log) device.log->push_back(*wrench);
  if (device.on_write) device.on_write(device);
  return device.write_status;
}

fs_status advance(void* self, double time) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  device.time = time;
  return device.advance_status;
}

fs_status get_link(void* self, fs_link* out) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  return device.on_link ? device.on_link(device, *out) : FS_ERROR_UNSUPPORTED;
}

fs_status write_model(void* self, const fs_model* model) {
  FakeDevice& device = device_of(self);
  const std::lock_guard lock(device.mutex);
  return device.on_model(device, *model);
}

void register_drivers() {
  const auto register_as = [](const char* scheme, bool is_simulated, bool has_link, bool takes_models) {
    fs_driver driver = fake_driver(scheme);
    if (!is_simulated) driver.advance = nullptr;
    if (has_link) driver.get_link = get_link;
    if (takes_models) driver.write_model = write_model;
    require(fs_driver_register(&driver), "fs_driver_register");
  };
  register_as("fakereal", false, false, false);
  register_as("fake", true, false, false);
  register_as("fakereallink", false, true, false);
  register_as("fakelink", true, true, false);
  register_as("fakemodel", true, true, true);
}

}  // namespace

fs_driver fake_driver(const char* scheme) {
  fs_driver driver{};
  driver.struct_size = sizeof driver;
  driver.scheme = scheme;
  driver.open = open_fake;
  driver.close = close_fake;
  driver.get_info = get_info;
  driver.read = read;
  driver.write = write;
  driver.advance = advance;
  return driver;
}

FakeDevice::FakeDevice(std::string name) : info(fs_device_info_init()), name_(std::move(name)) {
  static const bool registered = (register_drivers(), true);
  (void)registered;
  std::strcpy(info.name, "fake device");
  info.force_axes = info.torque_axes = 3;
  info.workspace_radius = info.workspace_height = 0.2;
  info.workspace_angle = 1;
  info.force_max = 10;
  info.torque_max = 1;
  info.resolution = 1e-5;
  info.rate = 1000;
  state.flags = FS_STATE_READY;
  const std::lock_guard lock(names_mutex);
  names()[name_] = this;
}

FakeDevice::~FakeDevice() {
  const std::lock_guard lock(names_mutex);
  names().erase(name_);
}

Device FakeDevice::open(bool is_simulated) const {
  const std::string scheme = std::string(is_simulated ? "fake" : "fakereal") + (on_model ? "model" : on_link ? "link" : "");
  return open_device((scheme + ":" + name_).c_str());
}

}  // namespace scenes
