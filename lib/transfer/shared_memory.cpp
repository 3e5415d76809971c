#include "transfer/shared_memory.h"

namespace fs {

void push_event(Outbox& outbox, const fs_event& event) noexcept {
  const uint64_t number = outbox.events_written.load(std::memory_order_relaxed);
  if (event.kind == FS_EVENT_OVERFLOW) {  // skips numbers: the client counts them among those it missed
    outbox.events_written.store(number + static_cast<uint64_t>(event.value), std::memory_order_release);
    return;
  }
  outbox.events[number % kept_events].write({number, event});
  outbox.events_written.store(number + 1, std::memory_order_release);
}

bool EventReader::read(const Outbox& outbox, fs_event& out) noexcept {
  const uint64_t written = outbox.events_written.load(std::memory_order_acquire);
  uint64_t lost = 0;
  if (written - read_ > kept_events) {
    lost = written - kept_events - read_;
    read_ = written - kept_events;
  }
  wire::NumberedEvent entry;
  const auto read_next = [&] { return outbox.events[read_ % kept_events].read(entry) && entry.number == read_; };
  for (; read_ != written && !read_next(); ++read_) ++lost;  // overwritten meanwhile
  out = {};
  if (lost) {
    out.kind = FS_EVENT_OVERFLOW;
    out.value = static_cast<double>(lost);
    return true;
  }
  if (read_ == written) return false;
  ++read_;
  out = entry.event;
  out.name[sizeof out.name - 1] = out.text[sizeof out.text - 1] = 0;
  return true;
}

}  // namespace fs
