// The table of a driver (driver.h) for a class whose objects are devices that are open. The class has
//   void get_info(fs_device_info&) const;  fs_status receive(fs_state&);  fs_status send(const fs_wrench&);
//   fs_status get_link(fs_link&);          std::string control(const std::string& request);
// of which get_info and control may throw a Refusal.
#pragma once

#include <string>

#include <forceserver/driver.h>

#include "device/support/refusal.h"

namespace fs {

// open gives a device at this address, which close deletes; list fills as fs_driver.list. Both may throw a Refusal.
template <class Device, Device* (*open_at)(const char* address), void (*list_all)(fs_device_entry*, size_t, size_t*)>
fs_driver driver_table(const char* scheme, uint32_t flags) {
  fs_driver table{};
  table.struct_size = sizeof table;
  table.scheme = scheme;
  table.flags = flags;
  table.list = [](fs_device_entry* out, size_t capacity, size_t* count) {
    return answer_of([&] { list_all(out, capacity, count); });
  };
  table.open = [](const char* address, void** self) { return answer_of([&] { *self = open_at(address); }); };
  table.close = [](void* self) { delete static_cast<Device*>(self); };
  table.get_info = [](void* self, fs_device_info* out) { return answer_of([&] { static_cast<Device*>(self)->get_info(*out); }); };
  table.receive = [](void* self, fs_state* out) { return static_cast<Device*>(self)->receive(*out); };
  table.send = [](void* self, const fs_wrench* wrench) { return static_cast<Device*>(self)->send(*wrench); };
  table.get_link = [](void* self, fs_link* out) { return static_cast<Device*>(self)->get_link(*out); };
  table.control = [](void* self, const char* request, char* answer, size_t size) {
    return answer_of([&] {
      const std::string text = static_cast<Device*>(self)->control(request);
      answer[text.copy(answer, size - 1)] = 0;
    });
  };
  return table;
}

}  // namespace fs
