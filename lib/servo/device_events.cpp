#include "servo/device_events.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "base/names.h"

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

void DeviceEvents::note(const Tick& tick) noexcept {
  const bool is_ready = !(tick.faults & device_fault) && tick.status == FS_OK;
  const uint32_t latched = tick.faults & ~device_fault;
  const Reason reason = tick.status != FS_OK ? lost : !(tick.flags & FS_STATE_READY) ? not_ready : too_old;
  const uint32_t why = is_ready ? 0 : tick.flags & state_reason_bits;
  const bool is_gone = tick.status == FS_ERROR_DISCONNECTED;
  const auto add = [&](fs_status status, uint32_t faults) {
    leave({written_.load(std::memory_order_relaxed), tick.time, status, faults, latched, reason, static_cast<uint16_t>(why),
           tick.age});
  };
  if (is_ready && !is_ready_) add(FS_OK, 0);
  if (!is_ready && (is_ready_ || (why && why != told_) || (is_gone && !is_gone_)))
    add(tick.status != FS_OK ? tick.status : FS_ERROR_STATE, device_fault);
  if (const uint32_t fresh = latched & ~latched_) add(FS_ERROR_STATE, fresh);
  told_ = why;
  is_ready_ = is_ready;
  is_gone_ = is_gone;
  latched_ = latched;
}

bool DeviceEvents::take(uint64_t& next, const fs_device_info& device, double pose_age, const std::string& trouble,
                        fs_event& out) const {
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
  std::memcpy(out.name, device.name, sizeof device.name);
  const size_t size = sizeof out.text;
  if (event.faults & device_fault) {
    std::string why;
    if (event.reason == lost) {
      why = "lost: it failed to read or write";
      if (!trouble.empty()) why += " (" + trouble + ")";
    } else if (event.reason == not_ready) {
      why = "not ready";
      if (event.flags) why += std::string(": ") + state_reason(event.flags);
    } else {
      char old[64];
      std::snprintf(old, sizeof old, "its pose is %.4g ms old, must be at most %.4g ms", 1e3 * event.age, 1e3 * pose_age);
      why = old;
    }
    std::snprintf(out.text, size, "%s; the force will ramp up again", why.c_str());
  } else if (event.faults) {
    std::snprintf(out.text, size, "stopped: ");
    append_faults(event.faults, out.text, size);
  } else if (event.latched) {
    std::snprintf(out.text, size, "ready, but the servo is stopped until it is enabled: ");
    append_faults(event.latched, out.text, size);
  } else {
    std::snprintf(out.text, size, "ready");
  }
  return true;
}

}  // namespace fs
