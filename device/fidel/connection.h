// A FIDEL that is connected, over USB or over UDP: what module.cpp makes a driver's table of. For each function see driver.h.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include <forceserver/driver.h>

namespace fs {

class FidelConnection {
 public:
  virtual ~FidelConnection() = default;  // as close

  virtual void get_info(fs_device_info& out) const = 0;
  virtual fs_status receive(fs_state& out) noexcept = 0;
  virtual fs_status send(const fs_wrench& wrench) noexcept = 0;
  virtual fs_status write_model(const fs_model& model) noexcept = 0;  // called only where get_info tells of a controller
  virtual fs_status get_link(fs_link& out) noexcept = 0;
  virtual std::string control(const std::string& request) = 0;  // the answer; throws a Refusal
};

// text: what follows "fidel:". Throw a Refusal.
std::unique_ptr<FidelConnection> connect_fidel_usb(const char* text);
std::unique_ptr<FidelConnection> connect_fidel_udp(const char* text);

// Those on the USB, as fs_driver.list.
void list_fidel_usb(fs_device_entry* out, size_t capacity, size_t* count);

}  // namespace fs
