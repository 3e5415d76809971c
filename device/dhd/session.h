// A device of Force Dimension that this process has open, by the ID that the SDK gave it. A device is open once in a process.
#pragma once

#include <string>

#include <forceserver/driver.h>

#include "device/dhd/api.h"

namespace fs::dhd {

constexpr int falcon_type = 60;  // of dhdGetSystemType

class Session {
 public:
  // place: "0", "1", .., the order of the SDK, which changes when a device comes or goes; or a serial number. A Novint Falcon
  // counts only if takes_falcon is set, as it has a driver of its own. Throws a Refusal: NOT_FOUND, DENIED, IO (in use).
  Session(const Api& api, const std::string& place, bool takes_falcon);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  char id() const noexcept { return id_; }
  const std::string& serial() const noexcept { return serial_; }
  int type() const noexcept { return type_; }

 private:
  bool open(int index, std::string& busy);
  void close() noexcept;

  const Api& api_;
  char id_ = -1;
  std::string serial_;
  int type_ = 0;
};

// As fs_driver.list: all that the SDK counts.
void list_arms(fs_device_entry* out, size_t capacity, size_t* count);

}  // namespace fs::dhd
