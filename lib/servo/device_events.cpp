#include "servo/device_events.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace fs {
namespace {

constexpr uint32_t device_fault = FS_FAULT_DEVICE;

// Appends the reasons why the force stopped.
void append_faults(uint32_t faults, char* text, size_t size) {
  const struct {
    uint32_t bit;
    const char* text;
  } reasons[]{{FS_FAULT_SPEED, "the hand was above speed_limit"},
              {FS_FAULT_NUMBER, "a pose or force was not finite"},
              {FS_FAULT_LATE, "20 ticks in a row were each later than a period"}};
  const char* separator = "";
  for (const auto& reason : reasons) {
    if (!(faults & reason.bit)) continue;
    const size_t length = std::strlen(text);
    std::snprintf(text + length, size - length, "%s%s", separator, reason.text);
    separator = "; ";
  }
}

}  // namespace

void DeviceEvents::leave(const Event& event) noexcept {
  events_[event.number % capacity].write(event);
  written_.store(event.number + 1, std::memory_order_release);
}

void DeviceEvents::note(double time, fs_status status, uint32_t faults) noexcept {
  const auto number = [this] { return written_.load(std::memory_order_relaxed); };
  const bool is_ready = !(faults & device_fault) && status == FS_OK;
  const uint32_t latched = faults & ~device_fault;
  if (is_ready && !is_ready_) leave({number(), time, FS_OK, 0, latched});
  if (!is_ready && is_ready_) {
    leave({number(), time, status != FS_OK ? status : FS_ERROR_STATE, device_fault, latched});
  }
  if (const uint32_t fresh = latched & ~latched_) leave({number(), time, FS_ERROR_STATE, fresh, latched});
  is_ready_ = is_ready;
  latched_ = latched;
}

bool DeviceEvents::take(uint64_t& next, const fs_device_info& device, double pose_age, fs_event& out) const {
  const uint64_t end = count();
  if (next == end) return false;
  out = {};
  Event event;
  const uint64_t oldest = end - std::min<uint64_t>(end, capacity);
  if (next < oldest || !events_[next % capacity].read(event) || event.number != next) {
    const uint64_t first = std::max(oldest, next + 1);
    out.kind = FS_EVENT_OVERFLOW;
    out.value = static_cast<double>(first - next);
    next = first;
    return true;
  }
  ++next;
  out.kind = FS_EVENT_DEVICE;
  out.status = event.status;
  out.time = event.time;
  out.value = event.faults;
  std::memcpy(out.name, device.name, sizeof out.name - 1);
  const size_t size = sizeof out.text;
  if (event.faults & device_fault) {
    std::snprintf(out.text, size, "lost, not ready, or its pose older than %g ms; the force will ramp up again",
                  1e3 * pose_age);
  } else if (event.faults) {
    std::snprintf(out.text, size, "stopped: ");
    append_faults(event.faults, out.text, size);
  } else if (event.latched) {
    std::snprintf(out.text, size, "ready, but the servo is stopped until it is enabled: ");
    append_faults(static_cast<uint32_t>(event.latched), out.text, size);
  } else {
    std::snprintf(out.text, size, "ready");
  }
  return true;
}

}  // namespace fs
