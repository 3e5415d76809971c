// The driver "falcon": "falcon:0" or "falcon:SERIAL", for a Novint Falcon on the USB.
#include <algorithm>
#include <string>

#include "device/falcon/falcon.h"
#include "device/falcon/firmware.h"
#include "device/support/refusal.h"

namespace fs::falcon {
namespace {

Falcon& falcon(void* self) { return *static_cast<Falcon*>(self); }

fs_status list_devices(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] { usb_entries(falcon_kind, "falcon:", out, capacity, count); });
}

fs_status open(const char* address, void** self) {
  return answer_of([&] { *self = new Falcon(Address(address, {"firmware", "motor"})); });
}

void close(void* self) { delete &falcon(self); }

fs_status get_info(void* self, fs_device_info* out) {
  return answer_of([&] { falcon(self).get_info(*out); });
}

fs_status receive(void* self, fs_state* out) { return falcon(self).receive(*out); }
fs_status send(void* self, const fs_wrench* wrench) { return falcon(self).send(*wrench); }
fs_status get_link(void* self, fs_link* out) { return falcon(self).get_link(*out); }

fs_status control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = falcon(self).control(request);
    answer[text.copy(answer, size - 1)] = 0;
  });
}

}  // namespace
}  // namespace fs::falcon

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "falcon";
    table.list = fs::falcon::list_devices;
    table.open = fs::falcon::open;
    table.close = fs::falcon::close;
    table.get_info = fs::falcon::get_info;
    table.receive = fs::falcon::receive;
    table.send = fs::falcon::send;
    table.get_link = fs::falcon::get_link;
    table.control = fs::falcon::control;
    table.flags = FS_DRIVER_IN_SERVO;
    return table;
  }();
  return &driver;
}
