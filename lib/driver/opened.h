// A device that a driver has opened. Whoever calls the driver holds a reference; the last one closes the device.
#pragma once

#include <string>

#include "base/process.h"
#include "driver/call_driver.h"

namespace fs {

class Opened {
 public:
  Opened(const fs_driver& driver, const std::string& address) : driver_(driver) {  // throws what the driver says
    ask_driver(driver_, "open", [&] { return driver_.open(address.c_str(), &self_); });
  }
  ~Opened() {
    if (process_ != this_process()) return;  // it is the parent's
    call_safely([&] {
      driver_.close(self_);
      return FS_OK;
    });
  }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;

  void* self() const noexcept { return self_; }  // the driver's own handle

 private:
  const fs_driver driver_;
  const uint32_t process_ = this_process();
  void* self_ = nullptr;
};

}  // namespace fs
