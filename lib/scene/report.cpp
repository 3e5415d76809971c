// What became of the objects, and events, which are polled.
#include <chrono>
#include <cstdio>
#include <thread>

#include "base/error.h"
#include "scene/moment.h"

using namespace fs;

namespace {
constexpr size_t event_capacity = 1024;
}

LocalScene::ReportBasis LocalScene::report_basis() const {
  return {now(), servo_ ? servo_->fade : -1, output->tick.load(std::memory_order_acquire), present_frame()};
}

fs_report LocalScene::make_report(const Entry& entry, const Entry* evaluated, const ReportBasis& basis) {
  const bool has_servo = basis.fade >= 0;
  const Object& object = *entry.object;
  fs_report out{};
  object.name.copy(out.name, FS_NAME_SIZE - 1);
  out.primitive = object.primitive;
  out.revision = entry.revision;
  if (evaluated) {
    out.weight = has_servo ? evaluated->fade.weight(basis.time, basis.fade) : evaluated->is_present(basis.time);
  }
  const bool is_new = !evaluated || evaluated->is_removed;  // also where its name still fades out from before
  const bool is_pending = is_new || (has_servo && evaluated->fade.is_pending());
  if (is_pending && out.weight == 0 && object.is_enabled) {
    out.state = FS_OBJECT_PENDING;
  } else if (!object.is_enabled && out.weight == 0) {
    out.state = FS_OBJECT_DISABLED;
  } else {
    out.state = out.weight < 1 ? FS_OBJECT_FADING : FS_OBJECT_FELT;
  }
  const double slope_scale = basis.frame.scale * basis.frame.force_scale;
  out.stiffness_wanted = slope_scale > 0 ? slope_scale * object.steepest_slope : 0;
  out.stiffness_applied = out.stiffness_wanted;
  out.distance = never;
  FeltSample felt;
  if (has_servo && entry.felt->sample.read(felt) && felt.tick >= basis.tick) {
    out.distance = felt.distance;
    out.point = felt.point;
    out.wrench = felt.wrench;
  }
  return out;
}

std::vector<fs_report> LocalScene::reports() {
  const std::lock_guard lock(mutex_);
  std::vector<fs_report> out;
  const ReportBasis basis = report_basis();
  working().for_each([&](uint32_t slot, const Entry& entry) {  // what an open group has changed is not felt yet
    if (!entry.is_removed) out.push_back(make_report(entry, table_.get(slot), basis));
  });
  return out;
}

std::vector<fs_motion> LocalScene::motions(const char* client) {
  require_no_client(client);
  const Moment moment(Ref<LocalScene>::share(this), true);
  std::vector<fs_motion> out;
  moment.for_each_motion("", [&](const fs_motion& motion) { out.push_back(motion); });
  return out;
}

size_t LocalScene::object_count() const {
  const std::lock_guard lock(mutex_);
  size_t count = 0;
  working().for_each([&](uint32_t, const Entry& entry) { count += !entry.is_removed; });
  return count;
}

bool LocalScene::is_empty() const {
  const std::lock_guard lock(mutex_);
  return slots_.empty();
}

fs_report LocalScene::report(const char* name) {
  const std::lock_guard lock(mutex_);
  uint32_t slot;
  const Entry& entry = require(name, slot);
  return make_report(entry, table_.get(slot), report_basis());
}

// None is taken from the servo before there is room for it.
void LocalScene::collect_events(ServoLink& servo) {
  for (;;) {
    events_.emplace_back();
    if (!servo.take_event(events_.back())) break;
    limit_events();
  }
  events_.pop_back();
}

void LocalScene::push_event(const fs_event& event) {
  events_.push_back(event);
  limit_events();
}

void LocalScene::limit_events() {
  if (events_.size() <= event_capacity) return;
  const fs_event& oldest = events_.front();
  lost_events_ += oldest.kind == FS_EVENT_OVERFLOW ? static_cast<uint64_t>(oldest.value) : 1;
  events_.pop_front();
}

bool LocalScene::take_event(fs_event& out) {
  const std::lock_guard lock(mutex_);
  settle(true);
  if (servo_) collect_events(*servo_);
  if (lost_events_) {
    out = {};
    out.kind = FS_EVENT_OVERFLOW;
    out.time = now();
    out.value = static_cast<double>(std::exchange(lost_events_, 0));
    return true;
  }
  if (events_.empty()) return false;
  out = events_.front();
  events_.pop_front();
  return true;
}

void LocalScene::note_edit(const char* name, const char* editor) {
  fs_event event{};
  event.kind = FS_EVENT_EDITED;
  event.time = now();
  std::snprintf(event.name, sizeof event.name, "%s", name);
  std::snprintf(event.text, sizeof event.text, "%s", editor);
  const std::lock_guard lock(mutex_);
  push_event(event);
}

fs_event LocalScene::next_event(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    fs_event event;
    if (take_event(event)) return event;
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    // The servo makes no system call to wake anyone, so this side looks, often enough for a person.
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}
