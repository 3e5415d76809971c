#include "servo/device_events.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/names.h"
#include "base/text.h"

namespace fs {
namespace {

constexpr uint32_t device_fault = FS_FAULT_DEVICE;

// The reasons why the force stopped.
std::string words_of(uint32_t faults, double speed_limit) {
  const std::string fast = formatted("the hand was above speed_limit, %.4g m/s", speed_limit);
  const std::pair<uint32_t, const char*> all[]{{FS_FAULT_SPEED, fast.c_str()},
                                               {FS_FAULT_NUMBER, "a pose or force was not finite"},
                                               {FS_FAULT_LATE, "20 ticks in a row were each later than a period"}};
  std::string text;
  for (const auto& [bit, words] : all) {
    if (faults & bit) text += (text.empty() ? "" : "; ") + std::string(words);
  }
  return text;
}

}  // namespace

void DeviceEvents::leave(const Event& event) noexcept {
  events_[event.number % capacity].write(event);
  written_.store(event.number + 1, std::memory_order_release);
}

void DeviceEvents::note(const Tick& tick) noexcept {
  const fs_status failed = tick.read != FS_OK ? tick.read : tick.write;
  const bool is_ready = !(tick.faults & device_fault) && failed == FS_OK;
  const uint32_t latched = tick.faults & ~device_fault;
  const Reason reason = tick.read != FS_OK               ? unread
                        : tick.write != FS_OK            ? unsent
                        : !(tick.flags & FS_STATE_READY) ? not_ready
                                                         : too_old;
  const uint32_t why = is_ready ? 0 : tick.flags & state_reason_bits;
  const bool is_gone = failed == FS_ERROR_DISCONNECTED;
  const auto add = [&](fs_status status, uint32_t faults) {
    leave({written_.load(std::memory_order_relaxed), tick.time, status, faults, latched, reason, static_cast<uint16_t>(why),
           tick.age, tick.troubles});
  };
  if (is_ready && !is_ready_) add(FS_OK, 0);
  const bool stays_gone = is_gone && is_gone_ && tick.troubles != seen_trouble_;  // there is another reason for it
  const bool begins_too_old = !has_begun_ && reason == too_old;  // it has given states, but none for this servo
  if (!is_ready && (is_ready_ || (why && why != told_) || (is_gone && !is_gone_) || stays_gone || begins_too_old))
    add(failed != FS_OK ? failed : FS_ERROR_STATE, device_fault);
  if (const uint32_t fresh = latched & ~latched_) add(FS_ERROR_STATE, fresh);
  has_begun_ = true;
  told_ = why;
  seen_trouble_ = tick.troubles;
  is_ready_ = is_ready;
  is_gone_ = is_gone;
  latched_ = latched;
}

bool DeviceEvents::take(uint64_t& next, const Known& known, fs_event& out) const {
  out = {};
  Event event;
  const uint64_t end = count();
  uint64_t first = std::max(next, end - std::min<uint64_t>(end, capacity));  // that is kept
  while (first < end && !(events_[first % capacity].read(event) && event.number == first)) ++first;
  if (first >= end) return false;
  if (first > next) {
    out.kind = FS_EVENT_OVERFLOW;
    out.value = static_cast<double>(first - next);
    out.time = event.time;
    next = first;
    return true;
  }
  ++next;
  out.kind = FS_EVENT_DEVICE;
  out.status = event.status;
  out.time = event.time;
  out.value = event.faults;
  const fs_device_info& info = known.device.info();
  std::memcpy(out.name, info.name, sizeof info.name);
  std::string text = "ready";
  if (event.faults & device_fault) {
    if (event.reason == unread || event.reason == unsent) {
      text = event.status == FS_ERROR_DISCONNECTED ? "lost: it is not connected"
             : event.reason == unread              ? "lost: its state could not be read"
                                                   : "lost: it did not take the force";
      const std::string why = known.device.trouble(static_cast<uint32_t>(event.trouble)).of(event.status);
      if (!why.empty()) text += " (" + why + ")";
    } else if (event.reason == not_ready) {
      text = "not ready";
      if (event.flags) text += std::string(": ") + state_reason(event.flags);
    } else {
      text = formatted("its pose is %.4g ms old, must be at most %.4g ms", 1e3 * event.age, 1e3 * known.pose_age);
    }
    text += "; the force will ramp up again";
  } else if (event.faults) {
    text = "stopped: " + words_of(event.faults, known.speed_limit);
  } else if (event.latched) {
    text = "ready, but the servo is stopped until it is enabled: " + words_of(event.latched, known.speed_limit);
  }
  text.copy(out.text, sizeof out.text - 1);
  return true;
}

}  // namespace fs
