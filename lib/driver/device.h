// A device behind its driver. It is the fs_device of the C contract itself.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include <forceserver/driver.h>

#include "base/counted.h"
#include "math/filters.h"

struct fs_device : fs::Counted<fs_device> {
  // Opens through the driver of the URI's scheme. Throws NOT_FOUND, UNSUPPORTED, INVALID, or what the driver says.
  explicit fs_device(const char* uri);
  ~fs_device();

  const fs_device_info& info() const noexcept { return info_; }  // checked once, when it was opened

  // The owner is a servo, or nobody. A servo calls read and write from its one thread; the C calls are refused meanwhile.
  bool acquire() noexcept;
  void release_ownership() noexcept;
  bool is_owned() const noexcept { return owned_.load(std::memory_order_acquire); }

  // [rt] time: s, the servo's (see fs_driver.advance). The newest state; a twist left 0 is worked out, and a time left 0
  // becomes `time`. On failure out is zeros.
  fs_status read(double time, fs_state& out) noexcept;
  // [rt] Scaled into the device's maxima, direction kept; axes that the device does not have are set to 0.
  fs_status write(const fs_wrench& wrench) noexcept;

  std::mutex mutex;  // of the C calls fs_device_read, _write

 private:
  fs_driver driver_;
  void* self_ = nullptr;
  fs_device_info info_;
  std::atomic<bool> owned_{false};
  fs::VelocityEstimator velocity_;
};

namespace fs {
using Device = fs_device;
}
