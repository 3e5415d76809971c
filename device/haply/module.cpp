// The driver "haply": "haply:0" or "haply:DEVICE_ID", for an Inverse3 behind the Haply Inverse Service.
#include <cstdio>

#include "device/haply/inverse.h"
#include "device/support/driver_table.h"

namespace {

using namespace fs::haply;

void list_all(fs_device_entry* out, size_t capacity, size_t* count) {
  Service service(default_host, default_port);
  const Message inventory = inventory_of(service);
  *count = inventory.arms.size();
  for (size_t i = 0; i < inventory.arms.size() && i < capacity; ++i) {
    const Arm& arm = inventory.arms[i];
    std::snprintf(out[i].uri, sizeof out[i].uri, "haply:%s", arm.id.c_str());
    std::snprintf(out[i].label, sizeof out[i].label, "Haply %s '%s'", arm.kind.empty() ? "Inverse3" : arm.kind.c_str(),
                  arm.id.c_str());
  }
}

Inverse* open_at(const char* address) {
  return new Inverse(fs::Address(address, {"host", "port", "grip", "rate", "force", "dialect"}));
}

}  // namespace

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = fs::driver_table<Inverse, open_at, list_all>("haply", FS_DRIVER_IN_SERVO);
  return &driver;
}
