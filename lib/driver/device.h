// A device behind its driver. It is the fs_device of the C contract itself.
#pragma once

#include <pthread.h>

#include <atomic>
#include <mutex>

#include <forceserver/driver.h>

#include "base/counted.h"
#include "base/process.h"
#include "math/filters.h"

struct fs_device : fs::Counted<fs_device> {
  // Opens through the driver of the URI's scheme. Throws NOT_FOUND, UNSUPPORTED, INVALID, or what the driver says.
  explicit fs_device(const char* uri);
  ~fs_device();

  const fs_device_info& info() const noexcept { return info_; }  // checked once, when it was opened
  bool is_simulated() const noexcept { return driver_.advance; }        // it follows the clock that read is given

  // The owner is a servo, or nobody. The C calls that read and write are refused while it has an owner: they hold
  // `mutex` while they ask is_owned and act, and acquire waits for one that is under way.
  void acquire();                      // STATE
  void release_ownership() noexcept;   // it may be used again
  bool is_owned() const noexcept { return owned_.load(std::memory_order_acquire); }

  // The driver is asked by one thread at a time: the one whose turn it is.
  bool take_turn() noexcept;  // [rt] false: it is another thread's turn, or the device is silent
  void end_turn() noexcept;   // [rt]

  // Silent, it has force 0, and nobody gets a turn. The tick under way sees is_silent and writes 0 as well.
  bool is_silent() const noexcept;  // [rt]
  void silence() noexcept;          // until its owner lets go of it; waits for the turn under way
  void zero() noexcept;             // force 0 now; waits for the turn under way, and tries for 20 ms
  void begin_end() noexcept;        // at the process's end: silent for good, and force 0 if it is nobody's turn now
  void end() noexcept;              // at the process's end: silent for good; closed if it was ever given a force

  bool is_of_this_process() const noexcept { return process_ == fs::this_process(); }  // [rt]

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
  const uint32_t process_ = fs::this_process();  // that has opened it
  std::atomic<bool> owned_{false}, is_silent_{false}, has_ended_{false};
  std::atomic<pthread_t> turn_{0};  // 0: nobody's

  // Of whoever has the turn.
  bool was_pushing_ = false;  // it was given a force since it was opened
  bool is_closed_ = false;
  fs::VelocityEstimator velocity_;
  bool gives_twist_ = false;  // it gave one before: then its zeros are meant

  class Turn;
  void write_zero() noexcept;
};

namespace fs {
using Device = fs_device;
}
