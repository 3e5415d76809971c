#include "driver/open_devices.h"

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <vector>

#include "base/clock.h"
#include "base/process.h"
#include "driver/device.h"

namespace fs {
namespace {

std::vector<fs_device*>& open_devices() {  // guarded by process_mutex()
  static std::vector<fs_device*>& all = *new std::vector<fs_device*>;  // never destroyed: see below
  return all;
}

std::atomic<fs_device*> ending{nullptr};  // the device that the process's end is using

template <class Step>
void end_one(Step&& step) {
  step(*ending.load());
  ending = nullptr;
  ending.notify_all();
}

// Goes from the newest device to the oldest, because a driver may have opened other devices for its own use. First it
// sets force 0 on every device that is free at once, and only then waits for the others: a driver that hangs leaves no
// other device with a force, and all that hang together hold the process up for a second.
void end_devices() {
  constexpr double end_within = 1;  // s
  for (size_t i = 0;; ++i) {
    {
      const std::lock_guard lock(process_mutex());
      if (i >= open_devices().size()) break;
      ending = open_devices()[open_devices().size() - 1 - i];
    }
    end_one([](fs_device& device) { device.begin_end(); });
  }
  const double deadline = steady_now() + end_within;
  for (;;) {
    {
      const std::lock_guard lock(process_mutex());
      if (open_devices().empty()) return;
      ending = open_devices().back();
      open_devices().pop_back();
    }
    end_one([&](fs_device& device) { device.end(deadline); });
  }
}

}  // namespace

void add_open_device(fs_device& device) {
  const std::lock_guard lock(process_mutex());
  open_devices().push_back(&device);
}

void remove_open_device(fs_device& device) noexcept {
  {
    const std::lock_guard lock(process_mutex());
    std::erase(open_devices(), &device);
  }
  ending.wait(&device);
}

// Exit functions run in reverse order of registration, so registering again at each new device or servo lets a driver
// use static objects that were made before. `most` is the number of exit functions that every system accepts.
void guard_process_end() noexcept {
  constexpr int most = 32;
  static int registered = 0;
  const std::lock_guard lock(process_mutex());
  if (registered == most) return;
  ++registered;
  std::atexit(end_devices);
  std::at_quick_exit(end_devices);
}

}  // namespace fs
