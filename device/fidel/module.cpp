// The driver "fidel": "fidel:usb" and "fidel:udp:HOST:PORT".
#include <string_view>

#include "device/fidel/connection.h"
#include "device/support/driver_table.h"

namespace {

using fs::FidelConnection;

FidelConnection* open_at(const char* address) {
  const std::string_view way = std::string_view(address).substr(0, std::string_view(address).find_first_of(":?"));
#ifdef FORCESERVER_FIDEL_USB
  if (way == "usb") return fs::connect_fidel_usb(address).release();
#else
  if (way == "usb") {
    fs::refuse(FS_ERROR_UNSUPPORTED, "this forceserver was built without libusb, so it has no FIDEL on the USB");
  }
#endif
  if (way == "udp") return fs::connect_fidel_udp(address).release();
  fs::refuse(FS_ERROR_INVALID, "address is '%s', must be usb or udp:HOST:PORT", fs::shortened(address).c_str());
}

void list_all([[maybe_unused]] fs_device_entry* out, [[maybe_unused]] size_t capacity, size_t* count) {
  *count = 0;
#ifdef FORCESERVER_FIDEL_USB
  fs::list_fidel_usb(out, capacity, count);
#endif
}

fs_status write_model(void* self, const fs_model* model) { return static_cast<FidelConnection*>(self)->write_model(*model); }

}  // namespace

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table = fs::driver_table<FidelConnection, open_at, list_all>("fidel", FS_DRIVER_IN_SERVO);
    table.write_model = write_model;
    return table;
  }();
  return &driver;
}
