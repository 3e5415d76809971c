// The driver "openhaptics": "openhaptics:" or "openhaptics:NAME", for the Touch, the Touch X and the Phantoms of 3D Systems.
#include <string>

#include "device/openhaptics/touch.h"
#include "device/support/refusal.h"

namespace fs::openhaptics {
namespace {

Touch& touch(void* self) { return *static_cast<Touch*>(self); }

fs_status list_devices(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] { list_touches(out, capacity, count); });
}

fs_status open(const char* address, void** self) {
  return answer_of([&] { *self = new Touch(Address(address, {"library"})); });
}

void close(void* self) {
  if (touch(self).end()) delete &touch(self);
}

fs_status get_info(void* self, fs_device_info* out) {
  return answer_of([&] { touch(self).get_info(*out); });
}

fs_status receive(void* self, fs_state* out) { return touch(self).receive(*out); }
fs_status send(void* self, const fs_wrench* wrench) { return touch(self).send(*wrench); }
fs_status get_link(void* self, fs_link* out) { return touch(self).get_link(*out); }

fs_status control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = touch(self).control(request);
    answer[text.copy(answer, size - 1)] = 0;
  });
}

}  // namespace
}  // namespace fs::openhaptics

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "openhaptics";
    table.list = fs::openhaptics::list_devices;
    table.open = fs::openhaptics::open;
    table.close = fs::openhaptics::close;
    table.get_info = fs::openhaptics::get_info;
    table.receive = fs::openhaptics::receive;
    table.send = fs::openhaptics::send;
    table.get_link = fs::openhaptics::get_link;
    table.control = fs::openhaptics::control;
    table.flags = FS_DRIVER_IN_SERVO;  // the library does its work in another thread
    return table;
  }();
  return &driver;
}
