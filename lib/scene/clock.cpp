// The scene's clock and its servo, which may bring a clock of its own.
#include <cmath>
#include <ctime>

#include "base/error.h"
#include "scene/scene.h"

using namespace fs;

double fs::steady_now() noexcept {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double fs_scene::now(ClockKind clock) const noexcept {
  if (clock == ClockKind::virtual_time) return output.time.load(std::memory_order_acquire);
  if (clock == ClockKind::caller) {
    const double told = told_time_.load(std::memory_order_acquire);
    if (!std::isnan(told)) return told;
  }
  return steady_now();
}

fs_status fs_scene::set_time(double time) noexcept {
  if (!(time > 0) || !(time <= 1e15)) {
    return set_last_error_literal(FS_ERROR_INVALID, "time must be > 0 s and at most 1e15 s");
  }
  if (has_servo()) return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene's servo has the clock");
  told_time_.store(time, std::memory_order_release);
  return FS_OK;
}

// Shifts every stored time and brings what fades to its end.
void fs_scene::retime(double shift) {
  const auto retimed = [&](const Entry& old) {
    const Ref<Entry> entry = make_ref<Entry>(old);
    entry->motion.time += shift;
    entry->track.shift(shift);
    entry->start += shift;
    entry->fade = old.fade.settled(shift);
    entry->previous = nullptr;
    return entry;
  };
  std::vector<std::pair<uint32_t, Ref<const Entry>>> entries;
  table_.for_each([&](uint32_t slot, const Entry& old) {
    entries.emplace_back(slot, old.is_removed ? nullptr : Ref<const Entry>(retimed(old)));
  });
  std::unique_ptr<Group> group = std::move(group_);  // an open group stays open, and its undo list is retimed too
  expiries_.clear();
  for (auto& [slot, entry] : entries) put(slot, entry);
  settled_at_ = -never;
  pending_epoch_ = nullptr;
  epochs_.clear();

  const auto settle_views = [](ViewFade& views) {
    const Ref<View> view = make_ref<View>();
    views.view->get_frame(view->frame);
    view->points = views.view->points;
    view->kind = views.view->kind == View::Kind::held ? View::Kind::held : View::Kind::free;
    views = {view, nullptr, Fade::steady(view->kind == View::Kind::free), Fade::steady(false)};
  };
  settle_views(views_);
  if (group) {
    for (auto& [slot, before] : group->undo) {
      if (before) before = before->is_removed ? nullptr : Ref<const Entry>(retimed(*before));
    }
    settle_views(group->views);
  }
  posted_ = nullptr;
  group_ = std::move(group);
}

void fs_scene::switch_clock(ClockKind clock) {
  const double before = now();
  const bool was_told = !std::isnan(told_time_.exchange(std::numeric_limits<double>::quiet_NaN()));
  const ClockKind old = clock_.exchange(clock);
  const bool same = (old == ClockKind::virtual_time) == (clock == ClockKind::virtual_time) && !was_told;
  retime(same ? 0 : now() - before);
}

void fs_scene::attach_servo(ServoLink& servo) {
  const std::lock_guard lock(mutex_);
  if (servo_) fail(FS_ERROR_STATE, "scene has a servo already; stop it first");
  settle(true);
  output.time.store(0);
  output.tick.store(0);
  output.used.store(0);
  HandSample hand{};
  hand.state.pose = hand.response.proxy = identity_pose();
  output.hand.write(hand);
  has_servo_.store(true);
  servo_ = &servo;
  switch_clock(servo.clock);
  table_.for_each([&](uint32_t, const Entry& entry) { prepare_curves(*entry.object, servo.reader.id.get()); });
  readers_.push_back(&servo.reader);
  const Ref<const Snapshot> newest = snapshot();
  for (Reader* reader : readers_) reader->mailbox.post(newest);
}

void fs_scene::detach_servo(ServoLink& servo) {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &servo.reader);
  servo.reader.mailbox.clear();
  for (fs_event event; servo.take_event(event);) push_event(event);
  servo_ = nullptr;
  has_servo_.store(false);
  switch_clock(ClockKind::caller);
  const Ref<const Snapshot> newest = snapshot();
  for (Reader* reader : readers_) reader->mailbox.post(newest);
}

void fs_scene::get_servo_stats(fs_servo_stats& out) const {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo; fs_servo_start gives it one");
  servo_->get_stats(out);
}

void fs_scene::get_device_info(fs_device_info& out) const {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo, so no device; fs_servo_start gives it one");
  servo_->get_device_info(out);
}
