#include "driver/open_devices.h"

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <vector>

#include "base/process.h"
#include "driver/device.h"

namespace fs {
namespace {

std::vector<fs_device*>& open_devices() {  // under the process's mutex
  static std::vector<fs_device*>& all = *new std::vector<fs_device*>;  // never destroyed: see below
  return all;
}

std::atomic<fs_device*> ending{nullptr};  // which the end of the process is dealing with

void end_one(void (fs_device::*step)() noexcept) {
  (ending.load()->*step)();
  ending = nullptr;
  ending.notify_all();
}

// The newest first: a driver may have opened others for its own. All that can be told at once get force 0 before any is
// waited for: a driver that hangs keeps no other device under force.
void end_devices() {
  for (size_t i = 0;; ++i) {
    {
      const std::lock_guard lock(process_mutex());
      if (i >= open_devices().size()) break;
      ending = open_devices()[open_devices().size() - 1 - i];
    }
    end_one(&fs_device::begin_end);
  }
  for (;;) {
    {
      const std::lock_guard lock(process_mutex());
      if (open_devices().empty()) return;
      ending = open_devices().back();
      open_devices().pop_back();
    }
    end_one(&fs_device::end);
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

// What is registered last runs first. So a driver may use what was made static before the last device was opened or the
// last servo started, as long as they are not more than a system surely takes.
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
