// The scene's clock and its servo, which may bring a clock of its own.
#include <cmath>
#include <ctime>
#include <limits>
#include <new>

#include "base/error.h"
#include "base/serial.h"
#include "scene/local_scene.h"

using namespace fs;

double LocalScene::now(ClockKind clock) const noexcept {
  if (clock == ClockKind::virtual_time) return output->time.load(std::memory_order_acquire);
  if (clock == ClockKind::caller) {
    const double told = told_time_.load(std::memory_order_acquire);
    if (!std::isnan(told)) return told;
  }
  return steady_now();
}

fs_status LocalScene::get_time(double& out) const noexcept {
  out = now();
  return FS_OK;
}

fs_status LocalScene::set_time(double time) noexcept {
  if (!(time > 0) || !(time <= 1e15)) {
    return set_last_error_literal(FS_ERROR_INVALID, "time must be > 0 s and at most 1e15 s");
  }
  if (has_servo()) return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene's servo has the clock");
  told_time_.store(time, std::memory_order_release);
  return FS_OK;
}

// Shifts every stored time and brings what fades to its end. All that can fail is done first.
void LocalScene::retime(double shift) {
  const double time = now();
  const auto retimed = [&](const Entry& old) {
    const Ref<Entry> entry = make_ref<Entry>(old);
    entry->motion.time += shift;
    if (shift != 0) entry->motion_revision = next_serial();
    entry->track.shift(shift);
    entry->start += shift;
    entry->expiry += shift;
    entry->fade = Fade::steady(old.fade.is_going_in() && time < entry->expiry, entry->expiry);
    entry->previous = nullptr;
    entry->tidy_at = never;
    entry->felt = make_ref<Felt>();
    return entry;
  };
  Table<Entry> table, group_table;
  std::set<uint32_t> free_slots = free_slots_;
  std::vector<std::string_view> gone;
  table_.for_each([&](uint32_t slot, const Entry& old) {
    const bool is_in_group = group_ && group_->touched.contains(slot);
    if (!old.is_removed) {
      table.set(slot, retimed(old));
    } else if (!is_in_group) {
      free_slots.insert(slot);
      gone.push_back(old.object->name);
    }
  });
  if (group_) {
    group_->table.for_each([&](uint32_t slot, const Entry& entry) {
      if (group_->touched.contains(slot) || !entry.is_removed) group_table.set(slot, retimed(entry));
    });
  }
  std::set<std::pair<double, uint32_t>> expiries;
  for (const auto& [time, slot] : expiries_) expiries.insert({time + shift, slot});
  const Ref<View> view = make_ref<View>();
  views_.view->get_frame(view->frame);
  view->points = views_.view->points;
  view->kind = views_.view->kind == View::Kind::held ? View::Kind::held : View::Kind::free;

  for (const std::string_view name : gone) {
    if (const auto found = slots_.find(name); found != slots_.end()) slots_.erase(found);
  }
  table_ = table;
  if (group_) group_->table = group_table;
  std::swap(free_slots_, free_slots);
  std::swap(expiries_, expiries);
  tidies_.clear();
  views_ = {view, nullptr, Fade::steady(view->kind == View::Kind::free), Fade::steady(false)};
  for (fs_event& event : events_) event.time += shift;
  settled_at_ = -never;
  posted_ = nullptr;
  pending_epoch_ = open_epoch_ = nullptr;
}

void LocalScene::switch_clock(ClockKind clock) {
  const double before = now();
  const double told = told_time_.exchange(std::numeric_limits<double>::quiet_NaN());
  const ClockKind old = clock_.exchange(clock);
  const bool is_same =
      (old == ClockKind::virtual_time) == (clock == ClockKind::virtual_time) && std::isnan(told);
  try {
    retime(is_same ? 0 : now() - before);
  } catch (...) {
    clock_.store(old);
    told_time_.store(told);
    throw;
  }
}

void LocalScene::attach_servo(ServoLink& servo) {
  const std::lock_guard lock(mutex_);
  if (servo_) fail(FS_ERROR_STATE, "scene has a servo already; stop it first");
  settle(true);
  prepare_all_curves(servo.reader.id);
  readers_.reserve(readers_.size() + 1);
  output->time.store(servo.since);
  output->tick.store(0);
  output->used.store(0);
  HandSample hand{};
  hand.state.pose = hand.response.proxy = identity_pose();
  output->hand.write(hand);
  switch_clock(servo.clock);
  readers_.push_back(&servo.reader);
  servo_ = &servo;
  try {
    servo.reader.mailbox.prime(newest());
  } catch (...) {
    servo_ = nullptr;
    readers_.pop_back();
    throw;
  }
  has_servo_.store(true);
}

void LocalScene::detach_servo(ServoLink& servo) noexcept {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &servo.reader);
  servo.reader.mailbox.clear();
  servo_ = nullptr;
  has_servo_.store(false);
  try {
    collect_events(servo);
    switch_clock(ClockKind::caller);
    newest();
  } catch (const std::bad_alloc&) {  // then the clock stands where it is, so that ages stay
    told_time_.store(now());
    clock_.store(ClockKind::caller);
  }
}

fs_status LocalScene::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  if (!has_servo()) return set_last_error_literal(FS_ERROR_STATE, "the scene has no servo, so no hand");
  return read_hand(*output, state, response, sent);
}

fs_status fs::read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept {
  HandSample hand;
  if (!output.hand.read(hand)) return set_last_error_literal(FS_ERROR_INTERNAL, "the hand could not be read");
  if (state) *state = hand.state;
  if (response) *response = hand.response;
  if (sent) *sent = hand.sent;
  return FS_OK;
}

std::vector<fs_client> LocalScene::clients() {
  fail(FS_ERROR_UNSUPPORTED, "the scene is in this process: only one that is connected to a server can tell its clients");
}

void LocalScene::get_servo_stats(fs_servo_stats& out) {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo; fs_servo_start gives it one");
  servo_->get_stats(out);
}

void LocalScene::get_device_info(fs_device_info& out) {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo, so no device; fs_servo_start gives it one");
  servo_->get_device_info(out);
}
