// The driver "fidel": "fidel:usb" and "fidel:udp:HOST:PORT".
#include <algorithm>
#include <string>
#include <string_view>

#include "device/fidel/connection.h"
#include "device/support/refusal.h"

namespace fs {
namespace {

FidelConnection& connected(void* self) { return *static_cast<FidelConnection*>(self); }

std::unique_ptr<FidelConnection> connect_fidel(const char* text) {
  const std::string_view way = std::string_view(text).substr(0, std::string_view(text).find_first_of(":?"));
#ifdef FORCESERVER_FIDEL_USB
  if (way == "usb") return connect_fidel_usb(text);
#else
  if (way == "usb") refuse(FS_ERROR_UNSUPPORTED, "this forceserver was built without libusb, so it has no FIDEL on the USB");
#endif
  if (way == "udp") return connect_fidel_udp(text);
  refuse(FS_ERROR_INVALID, "address is '%s', must be usb or udp:HOST:PORT", text);
}

fs_status fidel_open(const char* address, void** self) {
  return answer_of([&] { *self = connect_fidel(address).release(); });
}

#ifdef FORCESERVER_FIDEL_USB
fs_status fidel_list(fs_device_entry* out, size_t capacity, size_t* count) {
  return answer_of([&] { list_fidel_usb(out, capacity, count); });
}
#endif

void fidel_close(void* self) { delete &connected(self); }

fs_status fidel_get_info(void* self, fs_device_info* out) {
  return answer_of([&] { connected(self).get_info(*out); });
}

fs_status fidel_receive(void* self, fs_state* out) { return connected(self).receive(*out); }
fs_status fidel_send(void* self, const fs_wrench* wrench) { return connected(self).send(*wrench); }
fs_status fidel_write_model(void* self, const fs_model* model) { return connected(self).write_model(*model); }
fs_status fidel_get_link(void* self, fs_link* out) { return connected(self).get_link(*out); }

fs_status fidel_control(void* self, const char* request, char* answer, size_t size) {
  return answer_of([&] {
    const std::string text = connected(self).control(request);
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
    table.list = fs::fidel_list;
#endif
    table.open = fs::fidel_open;
    table.close = fs::fidel_close;
    table.get_info = fs::fidel_get_info;
    table.receive = fs::fidel_receive;
    table.send = fs::fidel_send;
    table.write_model = fs::fidel_write_model;
    table.get_link = fs::fidel_get_link;
    table.control = fs::fidel_control;
    table.flags = FS_DRIVER_IN_SERVO;
    return table;
  }();
  return &driver;
}
