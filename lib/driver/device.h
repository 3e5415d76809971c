// A device behind its driver. It is the fs_device of the C contract itself.
#pragma once

#include <atomic>
#include <mutex>

#include <forceserver/driver.h>

#include "base/counted.h"
#include "math/filters.h"

struct fs_device : fs::Counted<fs_device> {
  // Opens through the driver of the URI's scheme. Throws NOT_FOUND, UNSUPPORTED, INVALID, or what the driver says.
  explicit fs_device(const char* uri);
  ~fs_device();

  const fs_device_info& info() const noexcept { return info_; }  // checked once, when it was opened
  bool is_simulated() const noexcept { return driver_.advance; }        // it follows the clock that read is given

  // The owner is a servo, or nobody. A servo calls read and write from its one thread; the C calls are refused
  // meanwhile: they hold `mutex` while they ask is_owned and act, and acquire waits for one that is under way.
  bool acquire() noexcept;
  void release_ownership() noexcept;
  bool is_owned() const noexcept { return owned_.load(std::memory_order_acquire); }

  // [rt] time: s, the servo's (see fs_driver.advance). The newest state: a time left 0 becomes `time`; an orientation
  // left 0 the identity; the twist of a driver that leaves it 0 is worked out. A pose or twist that is not finite comes
  // through as it is: the guard faults on it. On failure out is zeros; a time that is not finite or a quaternion more
  // than 1e-3 off unit length is one.
  fs_status read(double time, fs_state& out) noexcept;
  // [rt] Scaled into the device's maxima, direction kept. A device with n < 3 force axes has the first n of x, y, z (so
  // with its torque axes); the others are set to 0. Not finite: INVALID, and the device gets 0.
  fs_status write(const fs_wrench& wrench) noexcept;

  std::mutex mutex;  // of the C calls fs_device_read, _write

 private:
  fs_driver driver_;
  void* self_ = nullptr;
  fs_device_info info_;
  std::atomic<bool> owned_{false};
  fs::VelocityEstimator velocity_;
  bool gives_twist_ = false;  // it gave one before: then its zeros are meant
};

namespace fs {
using Device = fs_device;
}
