// A device behind its driver. It is the fs_device of the C contract itself.
#pragma once

#include <pthread.h>

#include <atomic>
#include <mutex>
#include <string>

#include <forceserver/driver.h>

#include "base/counted.h"
#include "base/error.h"
#include "base/process.h"
#include "driver/driver_thread.h"
#include "math/filters.h"

struct fs_device : fs::Counted<fs_device> {
  // Opens through the driver of the URI's scheme. Throws NOT_FOUND, UNSUPPORTED, INVALID, or what the driver says.
  explicit fs_device(const char* uri);
  ~fs_device();

  const fs_device_info& info() const noexcept { return info_; }  // checked once, when it was opened
  bool lends_itself() const noexcept { return driver_.flags & FS_DRIVER_IN_SERVO; }  // to a servo's thread, where it may hang
  bool is_simulated() const noexcept { return driver_.advance; }        // it advances with the time given to read

  // The owner, if any, is a servo. fs_device_read and fs_device_write are refused while the device has an owner: they
  // hold `mutex` from the test of is_owned to the end of the call, and acquire waits for a call under way.
  // priority, has_thread, period: of the servo, see DriverThread::begin_servo.
  void acquire(int priority, bool has_thread, double period);  // throws STATE
  void release_ownership() noexcept;            // also ends a silence
  bool is_owned() const noexcept { return owned_.load(std::memory_order_acquire); }

  // Only one thread at a time calls the driver: the one that has the turn.
  bool take_turn() noexcept;  // [rt] false: another thread has the turn, or the device is silent
  void end_turn() noexcept;   // [rt]

  // A silent device has force 0, and no thread gets its turn. The tick under way sees is_silent and writes 0 too.
  bool is_silent() const noexcept;  // [rt]
  void silence() noexcept;          // until its owner releases it; waits for the turn under way
  void zero() noexcept;             // sets force 0; waits for the turn under way, then tries for 20 ms
  void begin_end() noexcept;  // when the process ends, without waiting: silent for good; force 0 if no thread has the turn
  // When the process ends: silent for good; closed if it was ever given a force, which waits until `deadline` at most (s, monotonic
  // clock).
  void end(double deadline) noexcept;

  bool is_of_this_process() const noexcept { return process_ == fs::this_process(); }  // [rt]

  // [rt] Reads the newest state. time: s, on the servo's clock (see fs_driver.advance). Where the driver leaves 0, the
  // state's time becomes `time`, its orientation the identity, and its twist an estimate from the poses, which also replaces one
  // that is slower by more than 1 m/s. A pose or
  // twist that is not finite is passed on unchanged, and the guard faults on it. The call fails, with out all zeros,
  // when the driver fails, the time is not finite, or the quaternion's length differs from 1 by more than 1e-3.
  fs_status read(double time, fs_state& out) noexcept;
  // [rt] Writes the wrench, scaled to the device's maxima with its direction kept. A device with n < 3 force axes has
  // the first n of x, y, z; the other components are set to 0. The same holds for torque axes. A wrench that is not
  // finite is INVALID, and the device gets 0.
  fs_status write(const fs_wrench& wrench) noexcept;
  // [rt] The same for a device that renders models (info().controller_rate is above 0): force + stiffness * (x - pose).
  // Where one of them is not finite, the stiffness is 0.
  fs_status write_model(const fs_pose& pose, const fs_wrench& force, const fs_mat3& stiffness) noexcept;

  // [rt] For the servo's thread, between two ticks: sleeps until the next one, which is due at `next` (s, monotonic clock), and
  // returns when it was due. A device that waits paces the servo: its tick is due when a state has come, from an eighth of a
  // period before `next` until half a period after it.
  double await_tick(double next, double period) noexcept;
  // [rt] The servo's thread ends.
  void leave_servo() noexcept;

  // Throws UNSUPPORTED, or what the driver says. out: all zeros.
  void control(const char* request, fs_answer& out);
  fs::Trouble trouble(uint32_t number) const;  // of DriverThread
  fs::Trouble newest_trouble() const { return trouble(troubles()); }
  uint32_t troubles() const noexcept { return thread_ ? thread_->troubles() : 0; }  // [rt]

  // What the driver measures of its link, unchecked; UNSUPPORTED: nothing new, or the device is silent. Called by one thread beside
  // the one that has the turn.
  bool measures_link() const noexcept { return driver_.get_link; }
  fs_status get_link(fs_link& out) noexcept;

  std::mutex mutex;  // held by the C calls fs_device_read and fs_device_write

 private:
  fs_driver driver_;
  // One of the two: of a driver that never waits, and of one that waits.
  std::shared_ptr<fs::Opened> opened_;
  fs::Ref<fs::DriverThread> thread_;
  void* self_ = nullptr;  // of opened_
  fs_device_info info_;
  const uint32_t process_ = fs::this_process();  // the process that opened it
  std::atomic<bool> owned_{false}, is_silent_{false}, has_ended_{false};
  std::atomic<pthread_t> turn_{0};  // the thread that has the turn; 0: none
  std::atomic<int> inside_{0};  // threads that are in the driver's get_link or control, so it cannot be closed

  // Used only by the thread that has the turn.
  bool was_pushing_ = false;  // a force was written since the device was opened
  bool is_closed_ = false;
  fs::VelocityEstimator velocity_{0};  // it gets the resolution when that is known
  uint64_t read_number_ = 0;  // of the newest state that a read gave
  double read_time_ = 0;  // s, of that state
  fs::Pose read_pose_{};  // of the newest state that was ready
  bool gives_twist_ = false;  // the driver gave a twist before, so a twist of 0 means rest where the pose stands

  class Turn;
  class Inside;
  void close(double deadline) noexcept;
  fs_wrench limited(const fs_wrench& wrench) noexcept;
  void write_zero() noexcept;
};

namespace fs {

using Device = fs_device;

}  // namespace fs
