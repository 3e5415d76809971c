// The driver "falcon": "falcon:0" or "falcon:SERIAL", for a Novint Falcon on the USB.
#include "device/falcon/falcon.h"
#include "device/falcon/firmware.h"
#include "device/support/driver_table.h"

namespace {

using namespace fs::falcon;

Falcon* open_at(const char* address) { return new Falcon(fs::Address(address, {"firmware", "motor"})); }

void list_all(fs_device_entry* out, size_t capacity, size_t* count) {
  fs::usb_entries(falcon_kind, "falcon:", out, capacity, count);
}

}  // namespace

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = fs::driver_table<Falcon, open_at, list_all>("falcon", FS_DRIVER_IN_SERVO);
  return &driver;
}
