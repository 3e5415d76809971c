#include "scene/events.h"

#include <algorithm>
#include <utility>

namespace fs {

namespace {
constexpr size_t capacity = 1024;
}

// Events come from several sources; they are kept in the order of their times.
void Events::sort_newest() {
  const auto newest = events_.end() - 1;
  const auto place = std::upper_bound(events_.begin(), newest, newest->time,
                                      [](double time, const fs_event& event) { return time < event.time; });
  std::rotate(place, newest, events_.end());
}

void Events::push(const fs_event& event) {
  events_.push_back(event);
  sort_newest();
  limit();
}

void Events::push(fs_event_kind kind, double time, std::string_view name, std::string_view text) {
  fs_event event{};
  event.kind = kind;
  event.time = time;
  name.copy(event.name, sizeof event.name - 1);
  text.copy(event.text, sizeof event.text - 1);
  push(event);
}

void Events::limit() {
  if (events_.size() <= capacity) return;
  const fs_event& oldest = events_.front();
  lost_ += oldest.kind == FS_EVENT_OVERFLOW ? static_cast<uint64_t>(oldest.value) : 1;
  events_.pop_front();
}

bool Events::take(double now, fs_event& out) {
  if (lost_) {
    out = {};
    out.kind = FS_EVENT_OVERFLOW;
    out.time = now;
    out.value = static_cast<double>(std::exchange(lost_, 0));
    return true;
  }
  if (events_.empty()) return false;
  out = events_.front();
  events_.pop_front();
  return true;
}

void Events::shift(double by) noexcept {
  for (fs_event& event : events_) event.time += by;
}

void Events::attach(const ServoLink& servo) noexcept {
  next_of_servo_ = std::max<uint64_t>(servo.event_count(), 1) - 1;  // the last one tells how the device is
}

// None is taken from the servo before there is room for it.
void Events::collect(const ServoLink& servo) {
  for (;;) {
    events_.emplace_back();
    if (!servo.take_event(next_of_servo_, events_.back())) break;
    sort_newest();
    limit();
  }
  events_.pop_back();
}

}  // namespace fs
