// The driver "fidel": "fidel:usb" and "fidel:udp:HOST:PORT".
#include <algorithm>
#include <string>
#include <string_view>

#include "device/fidel/connection.h"
#include "device/support/refusal.h"

namespace fs {
namespace {

FidelConnection& connection(void* self) { return *static_cast<FidelConnection*>(self); }

std::unique_ptr<FidelConnection> connect(const char* text) {
  const std::string_view way = std::string_view(text).substr(0, std::string_view(text).find_first_of(":?"));
#ifdef FORCESERVER_FIDEL_USB
  if (way == "usb") return connect_fidel_usb(text);
#endif
  if (way == "udp") return connect_fidel_udp(text);
  refuse(FS_ERROR_INVALID, "address is '%s', must be usb or udp:HOST:PORT", text);
}

fs_status open(const char* address, void** self) {
  return answer_of([&] { *self = connect(address).release(); });
}

#ifdef FORCESERVER_FIDEL_USB
fs_status list(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] { list_fidel_usb(out, capacity, count); });
}
#endif

void close(void* self) { delete &connection(self); }

fs_status get_info(void* self, fs_device_info* out) {
  return answer_of([&] { connection(self).get_info(*out); });
}

fs_status receive(void* self, fs_state* out) { return connection(self).receive(*out); }
fs_status send(void* self, const fs_wrench* wrench) { return connection(self).send(*wrench); }
fs_status write_model(void* self, const fs_model* model) { return connection(self).write_model(*model); }
fs_status get_link(void* self, fs_link* out) { return connection(self).get_link(*out); }

fs_status control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = connection(self).control(request);
    answer[text.copy(answer, size - 1)] = 0;
  });
}

}  // namespace
}  // namespace fs

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table{};
    table.struct_size = sizeof table;
    table.scheme = "fidel";
#ifdef FORCESERVER_FIDEL_USB
    table.list = fs::list;
#endif
    table.open = fs::open;
    table.close = fs::close;
    table.get_info = fs::get_info;
    table.receive = fs::receive;
    table.send = fs::send;
    table.write_model = fs::write_model;
    table.get_link = fs::get_link;
    table.control = fs::control;
    return table;
  }();
  return &driver;
}
