#include "device/openhaptics/scheduler.h"

#include <array>
#include <atomic>
#include <mutex>

#include "device/openhaptics/quiet.h"
#include "device/openhaptics/touch.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::openhaptics {
namespace {

constexpr size_t most_devices = 8;
constexpr double end_within = 0.05;  // s, for the last force of a device to be 0
constexpr unsigned short middle_priority = 0x7fff;

// Never destroyed, as the thread of OpenHaptics may outlive static objects.
struct Scheduler {
  std::mutex mutex;  // of open and close; the callback never takes it
  std::array<std::atomic<Touch*>, most_devices> devices{};
  std::atomic<bool> is_pausing{false};  // no device gets a force
  std::atomic<uint32_t> cycles{0};
  bool is_running = false;
  unsigned long callback = 0;
};
Scheduler& scheduler() {
  static auto* const it = new Scheduler;
  return *it;
}

unsigned run_all(void* data) {
  Scheduler& all = *static_cast<Scheduler*>(data);
  for (auto& slot : all.devices) {
    Touch* const device = slot.load(std::memory_order_acquire);
    if (device && !device->run(!all.is_pausing)) slot.store(nullptr, std::memory_order_release);
  }
  ++all.cycles;
  return again;
}

bool is_empty(const Scheduler& all) {
  for (const auto& slot : all.devices) {
    if (slot.load()) return false;
  }
  return true;
}

void start(const Api& api, Scheduler& all) {
  api.hdStartScheduler();
  all.callback = api.hdScheduleAsynchronous(run_all, &all, middle_priority);
  all.is_running = true;
  ErrorInfo error{};
  if (api.take_errors(error) > 0) {
    refuse(FS_ERROR_IO, "the thread of OpenHaptics cannot be started: %s", words_of(error).c_str());
  }
}

// Every device has force 0 when the thread of OpenHaptics stands still.
void stop(const Api& api, Scheduler& all) {
  if (!all.is_running) return;
  all.is_pausing = true;
  const uint32_t first = all.cycles;  // it may be under way with a force
  for (const double until = steady_now() + end_within; all.cycles - first < 2 && steady_now() < until;) pause(5e-4);
  api.hdStopScheduler();
  api.hdUnschedule(all.callback);
  all.is_running = all.is_pausing = false;
}

}  // namespace

void attach(const Api& api, Touch& device, const std::function<void()>& initialise) {
  Scheduler& all = scheduler();
  const std::lock_guard lock(all.mutex);
  std::atomic<Touch*>* slot = nullptr;
  for (auto& each : all.devices) {
    if (!slot && !each.load()) slot = &each;
  }
  if (!slot) refuse(FS_ERROR_FULL, "%zu devices of OpenHaptics are open, must be at most %zu", most_devices, most_devices);
  const Quiet quiet;
  stop(api, all);
  try {
    initialise();
  } catch (...) {
    if (!is_empty(all)) start(api, all);
    throw;
  }
  slot->store(&device);
  try {
    start(api, all);
  } catch (...) {
    stop(api, all);
    slot->store(nullptr);
    api.hdDisableDevice(device.handle());
    throw;
  }
}

void detach(const Api& api, Touch& device) noexcept {
  Scheduler& all = scheduler();
  const std::lock_guard lock(all.mutex);
  std::atomic<Touch*>* slot = nullptr;
  for (auto& each : all.devices) {
    if (each.load() == &device) slot = &each;
  }
  for (const double until = steady_now() + end_within; slot && slot->load() && steady_now() < until;) pause(5e-4);
  const Quiet quiet;
  stop(api, all);
  if (slot) slot->store(nullptr);  // the thread stands still, or has not come in time
  api.hdDisableDevice(device.handle());
  try {
    if (!is_empty(all)) start(api, all);
  } catch (...) {  // the other devices fall silent, and are opened anew
  }
}

bool is_attached(Handle handle) noexcept {
  for (const auto& slot : scheduler().devices) {
    const Touch* const device = slot.load();
    if (device && device->handle() == handle) return true;
  }
  return false;
}

}  // namespace fs::openhaptics
