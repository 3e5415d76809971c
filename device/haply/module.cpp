// The driver "haply": "haply:0" or "haply:DEVICE_ID", for an Inverse3 behind the Haply Inverse Service.
#include <cstdio>
#include <string>

#include "device/haply/inverse.h"
#include "device/support/refusal.h"

namespace fs::haply {
namespace {

Inverse& inverse(void* self) { return *static_cast<Inverse*>(self); }

fs_status list_devices(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] {
    Service service(default_host, default_port);
    const Message inventory = inventory_of(service);
    *count = inventory.arms.size();
    for (size_t i = 0; i < inventory.arms.size() && i < capacity; ++i) {
      const Arm& arm = inventory.arms[i];
      std::snprintf(out[i].uri, sizeof out[i].uri, "haply:%s", arm.id.c_str());
      std::snprintf(out[i].label, sizeof out[i].label, "Haply %s '%s'", arm.kind.empty() ? "Inverse3" : arm.kind.c_str(),
                    arm.id.c_str());
    }
  });
}

fs_status open(const char* address, void** self) {
  return answer_of([&] { *self = new Inverse(Address(address, {"host", "port", "grip", "rate", "force", "dialect"})); });
}

void close(void* self) { delete &inverse(self); }

fs_status get_info(void* self, fs_device_info* out) {
  return answer_of([&] { inverse(self).get_info(*out); });
}

fs_status receive(void* self, fs_state* out) { return inverse(self).receive(*out); }
fs_status send(void* self, const fs_wrench* wrench) { return inverse(self).send(*wrench); }
fs_status get_link(void* self, fs_link* out) { return inverse(self).get_link(*out); }

fs_status control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = inverse(self).control(request);
    answer[text.copy(answer, size - 1)] = 0;
  });
}

}  // namespace
}  // namespace fs::haply

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "haply";
    table.list = fs::haply::list_devices;
    table.open = fs::haply::open;
    table.close = fs::haply::close;
    table.get_info = fs::haply::get_info;
    table.receive = fs::haply::receive;
    table.send = fs::haply::send;
    table.get_link = fs::haply::get_link;
    table.control = fs::haply::control;
    table.flags = FS_DRIVER_IN_SERVO;
    return table;
  }();
  return &driver;
}
