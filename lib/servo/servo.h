// The loop device.read -> evaluate -> guard -> device.write at a fixed rate. It is the fs_servo of the C contract itself.
#pragma once

#include <pthread.h>

#include <functional>
#include <mutex>
#include <optional>

#include "driver/device.h"
#include "servo/channel.h"
#include "servo/device_events.h"
#include "servo/flight_record.h"
#include "servo/guard.h"
#include "servo/memory.h"
#include "servo/settings.h"
#include "servo/statistics.h"

struct fs_servo final : fs::Counted<fs_servo>, fs::ServoLink {
  // Takes scene and device and, in THREAD mode, runs. STATE, IO.
  fs_servo(fs::Ref<fs::LocalScene> scene, fs::Ref<fs::Device> device, const fs::ServoSettings& settings);
  ~fs_servo() { stop(); }

  // It has pages of its own, for the lock of its memory.
  static void* operator new(size_t size) { return fs::map_pages(size); }
  static void operator delete(void* servo, size_t size) noexcept { fs::unmap_pages(servo, size); }

  // First the force is 0, and stays so. Then tells the listeners and lets go of device and scenes. A second call waits
  // until the first has done it. In a forked child it does nothing.
  void stop() noexcept;
  bool is_of_this_process() const noexcept { return device_->is_of_this_process(); }

  // More scenes, beside the servo's own: what they add is felt from the next tick on. Any thread; not [rt].
  fs::Ref<fs::Channel> add_channel(fs::Ref<fs::LocalScene> scene, const fs::Channel::Limits& limits);  // STATE
  fs::Wrench own_wrench();  // what the servo's own scene added at the last tick, device frame
  void reap_channels();  // lets go of those that have faded out
  size_t channel_count();  // beside the servo's own; those that fade out are among them
  const fs::Ref<fs::LocalScene>& scene() const noexcept { return scene_; }
  double time() const noexcept override { return newest_time_.load(std::memory_order_relaxed); }  // s, of the newest tick
  // s, monotonic clock: when the last tick was due; they come a period apart. 0: it has no thread that keeps to a time.
  double due() const noexcept { return due_.load(std::memory_order_relaxed); }

  // f is called once, by the thread that stops the servo, when the force is 0; not after remove_listener has returned.
  void add_listener(const void* owner, std::function<void()> f);  // STATE
  void remove_listener(const void* owner) noexcept;

  fs_status step(uint64_t ticks) noexcept;            // [rt] STATE, UNSUPPORTED, DISCONNECTED
  void set_enabled(bool enabled) noexcept;            // [rt]
  const fs::FlightRecord& record() const noexcept { return record_; }

  const fs::ServoSettings& settings() const noexcept { return settings_; }
  double fade() const noexcept override { return settings_.fade; }  // s; 0: none
  fs::ClockKind clock() const noexcept override;

  void get_stats(fs_servo_stats& out) const override;        // all but struct_size
  void get_device_info(fs_device_info& out) const override;  // all but struct_size
  bool take_event(uint64_t& next, fs_event& out) const override;  // of the device: see DeviceEvents
  uint64_t event_count() const noexcept override { return events_.count(); }

 private:
  void start_thread();  // IO; the last that can fail
  void run() noexcept;
  void tick(double now, double late) noexcept;
  void drop_channels() noexcept;

  const fs::Ref<fs::LocalScene> scene_;
  const fs::Ref<fs::Device> device_;
  const fs::ServoSettings settings_;
  const double period_;

  // The channels: their list reaches the tick as snapshots do.
  std::mutex channels_mutex_;
  fs::Ref<const fs::ChannelList> posted_channels_;
  fs::Mailbox<fs::Ref<const fs::ChannelList>> channels_;

  std::mutex listeners_mutex_;
  std::vector<std::pair<const void*, std::function<void()>>> listeners_;

  // The servo thread's own.
  fs::Guard guard_;
  uint64_t tick_ = 0;
  double last_time_ = -1;
  fs_status write_status_ = FS_OK;
  bool is_recording_ = true;
  uint64_t enable_seen_ = 1;

  // Shared: written by the servo, but for enable_ and the stop.
  std::atomic<uint64_t> enable_{1};  // bit 0: enabled; bits 1..31 count the trues, bits 32.. the falses
  std::atomic<bool> is_stopping_{false}, is_stopped_{false};
  std::atomic<double> due_{0};
  std::atomic<uint64_t> ticks_{0}, misses_{0}, device_errors_{0}, guarded_{0}, approximated_{0};
  std::atomic<uint32_t> faults_{0};
  std::atomic<int> realtime_{FS_REALTIME_NONE};
  std::atomic<double> first_time_{0}, newest_time_{0};
  fs::RollingHistogram late_, compute_;
  fs::FlightRecord record_;
  fs::DeviceEvents events_;

  std::optional<fs::Stack> stack_;  // of the thread; none: others call step
  pthread_t thread_{};
  fs::MemoryLock memory_lock_;
};

namespace fs {
using Servo = fs_servo;
}
