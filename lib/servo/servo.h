// The servo loop: device.read -> evaluate -> guard -> device.write at a fixed rate. This class is the fs_servo of the C
// functions.
#pragma once

#include <pthread.h>

#include <functional>
#include <mutex>
#include <optional>

#include "budget/budget.h"
#include "driver/device.h"
#include "servo/channels.h"
#include "servo/device_events.h"
#include "servo/flight_record.h"
#include "servo/guard.h"
#include "servo/live_loop.h"
#include "servo/locked_memory.h"
#include "servo/settings.h"
#include "servo/statistics.h"

struct fs_servo final : fs::Counted<fs_servo>, fs::ServoLink {
  // Takes the scene and the device and, in THREAD mode, starts the thread. STATE, IO.
  fs_servo(fs::Ref<fs::LocalScene> scene, fs::Ref<fs::Device> device, const fs::ServoSettings& settings);
  ~fs_servo() { stop(); }

  // A servo has pages of its own, so that its memory can be locked.
  static void* operator new(size_t size) { return fs::map_pages(size); }
  static void operator delete(void* servo, size_t size) noexcept { fs::unmap_pages(servo, size); }

  // Sets the force to 0 for good, then calls the listener, and releases the device and the scenes. A second call waits
  // until the first has finished. In a forked child it does nothing.
  void stop() noexcept;
  bool is_of_this_process() const noexcept { return device_->is_of_this_process(); }

  // Adds a scene beside the servo's own; its forces are felt from the next tick on. Any thread; not [rt].
  fs::Ref<fs::Channel> add_channel(fs::Ref<fs::LocalScene> scene, const fs::Channel::Limits& limits,
                                   fs::Channel::Owner owner);  // STATE
  fs::Channels& channels() noexcept { return channels_; }
  const fs::Ref<fs::LocalScene>& scene() const noexcept { return scene_; }
  double time() const noexcept override { return statistics_.time(); }  // s, of the newest tick
  // s, monotonic clock: when the last tick was due; ticks are due one period apart. 0: the servo has no thread of its
  // own, or has not ticked yet.
  double due() const noexcept { return due_.load(std::memory_order_relaxed); }

  // The listener is the servo's server. The thread that stops the servo calls f once, when the force is 0. After
  // remove_listener has returned, f is not called. A servo has one listener at most.
  void set_listener(const void* owner, std::function<void()> f);  // STATE
  void remove_listener(const void* owner) noexcept;

  fs_status step(uint64_t ticks) noexcept;            // [rt] STATE, UNSUPPORTED, DISCONNECTED
  void set_enabled(bool enabled) noexcept override;   // [rt]
  const fs::FlightRecord& record() const noexcept { return record_; }

  const fs::ServoSettings& settings() const noexcept { return settings_; }
  double fade() const noexcept override { return settings_.spread.fade; }  // s; 0: none
  double period() const noexcept { return period_; }                // s
  fs::ClockKind clock() const noexcept override;
  fs::ImpactLimit impact_limit() const noexcept override { return loop_.values().impact; }

  void get_stats(fs_servo_stats& out) const override;        // all but struct_size
  void get_device_info(fs_device_info& out) const override;  // all but struct_size
  void add_record(uint64_t after, size_t most, std::vector<fs_recorded_tick>& out) const override;
  bool take_event(uint64_t& next, fs_event& out) const override;  // of the device: see DeviceEvents
  uint64_t event_count() const noexcept override { return events_.count(); }

 private:
  void start_thread();  // IO; nothing after it can fail
  void run() noexcept;
  bool join() noexcept;
  void tick(double now, double late) noexcept;
  void follow_requests() noexcept;
  bool has_stop_begun() const noexcept;
  void start_budget();  // IO
  fs::DeviceLimit limit();  // of the loop, which is measured first; the budget calls this

  const fs::Ref<fs::LocalScene> scene_;
  const fs::Ref<fs::Device> device_;
  const fs::ServoSettings settings_;
  const double period_;

  fs::Channels channels_;

  std::mutex listener_mutex_;
  const void* listener_owner_ = nullptr;
  std::function<void()> listener_;

  // Only the tick uses these.
  fs::Guard guard_;
  fs::LoopValues loop_now_;
  fs::Blend model_stiffness_;  // N/m; see LoopValues
  uint64_t tick_ = 0;
  double last_time_ = -1;
  fs_status write_status_ = FS_OK;
  bool is_recording_ = true;
  bool was_ready_ = false;
  double known_at_ = -fs::never;  // s, of the last tick in which the place of the hand was known
  uint64_t enable_seen_ = 1;

  // Shared. The servo's thread writes these; other threads write only enable_, is_stopping_, is_stopped_ and, as
  // it starts, realtime_.
  std::atomic<uint64_t> enable_{1};  // bit 0: enabled; bits 1..31 count the trues, bits 32.. the falses
  std::atomic<bool> is_stopping_{false}, is_stopped_{false};
  std::atomic<double> due_{0};
  std::atomic<uint32_t> has_run_{0};  // 1: the thread is at its end
  std::atomic<int> realtime_{FS_REALTIME_NONE};
  fs::Statistics statistics_;
  fs::FlightRecord record_;
  fs::DeviceEvents events_;

  fs::LiveLoop loop_;
  std::optional<fs::Budget> budget_;  // none: nothing is bounded, and no link is measured
  uint64_t budget_tick_ = 0;          // VIRTUAL: before which it ran last
  std::optional<fs::Stack> stack_;  // of the servo's thread; none: the application calls step
  pthread_t thread_{};
  fs::MemoryLock memory_lock_;
};

namespace fs {
using Servo = fs_servo;
}
