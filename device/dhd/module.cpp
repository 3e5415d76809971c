// The driver "dhd": "dhd:0" or "dhd:SERIAL", for the omega, delta, sigma and lambda of Force Dimension.
#include <string>

#include "device/dhd/arm.h"
#include "device/support/refusal.h"

namespace fs::dhd {
namespace {

Arm& arm(void* self) { return *static_cast<Arm*>(self); }

fs_status list_devices(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] { list_arms(out, capacity, count); });
}

fs_status open(const char* address, void** self) {
  return answer_of([&] { *self = new Arm(Address(address, {"library", "home", "rate", "falcon"})); });
}

void close(void* self) { delete &arm(self); }

fs_status get_info(void* self, fs_device_info* out) {
  return answer_of([&] { arm(self).get_info(*out); });
}

fs_status receive(void* self, fs_state* out) { return arm(self).receive(*out); }
fs_status send(void* self, const fs_wrench* wrench) { return arm(self).send(*wrench); }
fs_status get_link(void* self, fs_link* out) { return arm(self).get_link(*out); }

fs_status control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = arm(self).control(request);
    answer[text.copy(answer, size - 1)] = 0;
  });
}

}  // namespace
}  // namespace fs::dhd

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "dhd";
    table.list = fs::dhd::list_devices;
    table.open = fs::dhd::open;
    table.close = fs::dhd::close;
    table.get_info = fs::dhd::get_info;
    table.receive = fs::dhd::receive;
    table.send = fs::dhd::send;
    table.get_link = fs::dhd::get_link;
    table.control = fs::dhd::control;
    return table;  // no FS_DRIVER_IN_SERVO: a closed library does the work
  }();
  return &driver;
}
