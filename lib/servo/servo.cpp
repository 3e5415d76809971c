#include "servo/servo.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "base/futex.h"
#include "base/realtime.h"
#include "base/signals.h"
#include "driver/open_devices.h"
#include "servo/local_model.h"

using namespace fs;

namespace {

constexpr double record_length = 2;  // s
constexpr size_t stack_size = 256 << 10;  // bytes, beside the thread-local data
constexpr int not_asked = -1;  // in place of an fs_realtime: the thread has not asked the system yet

Guard::Limits with_loop(Guard::Limits limits, const LoopValues& loop) {
  limits.damping = loop.own_damping;
  limits.slew = loop.slew;
  return limits;
}

}  // namespace

fs_servo::fs_servo(Ref<LocalScene> scene, Ref<Device> device, const ServoSettings& settings)
    : scene_(std::move(scene)), device_(std::move(device)), settings_(settings), period_(1 / settings.rate),
      guard_(with_loop(settings.limits, settings.first)), loop_now_(settings.first), model_stiffness_(loop_now_.model_stiffness),
      record_(static_cast<size_t>(std::ceil(record_length * settings.rate))),
      loop_(settings.loop, settings.first, device_->info()) {
  device_->acquire(settings.priority, settings.mode == FS_SERVO_THREAD, period_);
  try {
    channels_.start(make_ref<Channel>(*this, settings_.spread, period_, scene_, Channel::Limits{}, true, Channel::Owner{"", 0}));
    guard_process_end();
    start_budget();
    if (settings.mode == FS_SERVO_THREAD) start_thread();
  } catch (...) {
    budget_.reset();
    channels_.stop();
    device_->release_ownership();
    throw;
  }
}

void fs_servo::start_budget() {
  const bool is_bounded = loop_now_.max_stiffness < never || loop_now_.object_damping < never;
  if (!is_bounded && !device_->measures_link()) return;
  budget_.emplace([this] { return limit(); }, [this] { return channels_.budgets(); });
  if (settings_.mode == FS_SERVO_VIRTUAL) {
    budget_->run_once();
  } else {
    budget_->start();
  }
}

DeviceLimit fs_servo::limit() {
  const fs_device_info& device = device_->info();
  const std::string& refusal = loop_.measure(*device_, settings_.mode == FS_SERVO_VIRTUAL ? time() : steady_now());
  if (!refusal.empty()) {
    fs_event event{};
    event.kind = FS_EVENT_DEVICE;
    event.status = FS_ERROR_INVALID;
    static_assert(sizeof event.name >= sizeof device.name);
    std::memcpy(event.name, device.name, sizeof device.name);
    refusal.copy(event.text, sizeof event.text - 1);
    channels_.note(event);
  }
  return loop_.limit(device, settings_.limits.speed);
}

void fs_servo::start_thread() {
  const auto entry = [](void* data) -> void* {
    begin_thread("fs-servo");
    fs_servo* servo = static_cast<fs_servo*>(data);
    servo->realtime_.store(request_realtime(servo->settings_.priority, servo->settings_.cpu));
    servo->realtime_.notify_one();
    servo->run();
    servo->has_run_ = 1;
    wake_waiters(servo->has_run_);
    return nullptr;
  };
  realtime_.store(not_asked);
  stack_.emplace(stack_size + thread_local_bytes());
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstack(&attributes, stack_->begin(), stack_->size());
  const int error = [&] {
    const SignalsBlocked blocked;
    return pthread_create(&thread_, &attributes, entry, this);
  }();
  pthread_attr_destroy(&attributes);
  if (error) {
    stack_.reset();
    fail_to_start("the servo's thread", std::strerror(error));
  }
  realtime_.wait(not_asked);
  if (realtime_.load() == FS_REALTIME_FIFO &&
      memory_lock_.lock({{{this, sizeof *this}, {stack_->begin(), stack_->size()}, record_.pages()}})) {
    realtime_.store(FS_REALTIME_FIFO_LOCKED);
  }
}

void fs_servo::stop() noexcept {
  if (!is_of_this_process()) return;
  if (is_stopping_.exchange(true)) return is_stopped_.wait(false);
  device_->silence();  // before anything that may wait
  {
    const std::lock_guard lock(listener_mutex_);
    if (listener_owner_) listener_();
    listener_owner_ = nullptr;
    listener_ = nullptr;
  }
  const bool has_ended = join();
  if (budget_) budget_->stop();
  memory_lock_.unlock();
  channels_.stop();
  if (has_ended) device_->release_ownership();
  else retain();  // the thread uses this servo until the driver returns, so it is never destroyed; it keeps the device, silent
  is_stopped_.store(true);
  is_stopped_.notify_all();
}

// False: a driver that lends itself to the thread hangs there. Nothing else can: a tick waits for nobody.
bool fs_servo::join() noexcept {
  constexpr double within = 1;  // s
  if (!stack_) return true;
  const double deadline = steady_now() + within;
  while (device_->lends_itself() && !has_run_) {
    if (steady_now() >= deadline) {
      pthread_detach(thread_);
      return false;
    }
    wait_for_change(has_run_, 0, deadline);
  }
  pthread_join(thread_, nullptr);
  return true;
}

ClockKind fs_servo::clock() const noexcept {
  return settings_.mode == FS_SERVO_VIRTUAL ? ClockKind::virtual_time : ClockKind::steady;
}

Ref<Channel> fs_servo::add_channel(Ref<LocalScene> scene, const Channel::Limits& limits, Channel::Owner owner) {
  const Ref<Channel> channel =
      make_ref<Channel>(*this, settings_.spread, period_, std::move(scene), limits, false, std::move(owner));
  if (budget_) budget_->add(*channel->budget());
  channels_.add(channel);
  return channel;
}

void fs_servo::set_listener(const void* owner, std::function<void()> f) {
  const std::lock_guard lock(listener_mutex_);
  if (is_stopping_) fail(FS_ERROR_STATE, "the servo has been stopped");
  if (listener_owner_) fail(FS_ERROR_STATE, "the servo has a server already: a servo has one at most; stop it first");
  listener_owner_ = owner;
  listener_ = std::move(f);
}

void fs_servo::remove_listener(const void* owner) noexcept {
  const std::lock_guard lock(listener_mutex_);
  if (listener_owner_ != owner) return;
  listener_owner_ = nullptr;
  listener_ = nullptr;
}

void fs_servo::run() noexcept {
  double next = steady_now() + period_;
  for (;;) {
    next = device_->await_tick(next, period_);
    const double now = steady_now();
    const double late = std::fmax(0, now - next);
    const double missed = std::floor(late / period_);  // missed ticks are skipped: no burst makes up for them
    statistics_.note_missed(static_cast<uint64_t>(missed));
    next += missed * period_;
    due_.store(next, std::memory_order_relaxed);
    if (!device_->take_turn()) return device_->leave_servo();  // fails only when another thread is stopping this servo
    tick(now, late);
    device_->end_turn();
    next += period_;
  }
}

fs_status fs_servo::step(uint64_t ticks) noexcept {
  const auto stopped = [] { return set_last_error_literal(FS_ERROR_STATE, "fs_servo_step: the servo has been stopped"); };
  if (has_stop_begun()) return stopped();
  if (settings_.mode == FS_SERVO_THREAD) {
    return set_last_error_literal(FS_ERROR_UNSUPPORTED, "fs_servo_step: this servo has a thread of its own that steps it");
  }
  if (!device_->take_turn()) {
    if (device_->is_silent()) return stopped();
    return set_last_error_literal(FS_ERROR_STATE, "fs_servo_step: another thread is stepping this servo");
  }
  if (is_stopping_.load()) {  // stopped since the check above: the scenes are detached
    device_->end_turn();
    return stopped();
  }
  for (uint64_t i = 0; i < ticks && !has_stop_begun(); ++i) {
    if (settings_.mode == FS_SERVO_VIRTUAL) {
      if (budget_ && static_cast<double>(tick_ - budget_tick_) >= fs::Budget::interval * settings_.rate) {
        budget_tick_ = tick_;
        budget_->run_once();
      }
      tick(static_cast<double>(tick_ + 1) / settings_.rate, 0);
    } else {
      const double now = steady_now();
      const double late = last_time_ < 0 ? 0 : std::fmax(0, now - last_time_ - period_);
      statistics_.note_missed(static_cast<uint64_t>(late / period_));
      tick(now, late);
    }
  }
  const bool is_lost = tick_ > 0 && !events_.is_ready(), is_stopped = has_stop_begun();
  device_->end_turn();  // from here on another thread may stop and destroy the servo
  if (is_stopped) return stopped();
  if (is_lost) {
    return set_last_error_literal(FS_ERROR_DISCONNECTED, "the device was lost or not ready at the last tick");
  }
  return FS_OK;
}

// The device falls silent a moment after a stop has begun, or without one when the process ends.
bool fs_servo::has_stop_begun() const noexcept { return is_stopping_.load() || device_->is_silent(); }

// What has been asked for since the last tick: another loop, force or none.
void fs_servo::follow_requests() noexcept {
  if (loop_.fetch(loop_now_)) {
    guard_.follow(loop_now_.own_damping, loop_now_.slew);
    model_stiffness_.go_to(loop_now_.model_stiffness, settings_.spread.blend * settings_.rate);
  }
  const uint64_t requested = enable_.load(std::memory_order_acquire);
  if (requested == enable_seen_) return;
  if ((requested ^ enable_seen_) >> 32) guard_.set_enabled(false);  // even if it was enabled again meanwhile
  if (requested & 1) {
    guard_.set_enabled(true);
    events_.forget_faults();
    is_recording_ = true;
  }
  enable_seen_ = requested;
}

// One pass of the loop. It never allocates, locks, logs, throws or waits for another thread.
void fs_servo::tick(double now, double late) noexcept {
  ++tick_;
  last_time_ = now;
  const double begin = steady_now();
  follow_requests();

  fs_state hand;
  const fs_status read_status = device_->read(now, hand);
  // In virtual time the age of a real device's pose is unknown: its time is that of another clock.
  const bool has_age = clock() != ClockKind::virtual_time || device_->is_simulated();
  const double age = has_age ? now - hand.time : 0;
  const bool says_ready = hand.flags & FS_STATE_READY;
  const bool is_known = read_status == FS_OK && says_ready && age <= loop_now_.pose_age;
  const bool is_ready = is_known && write_status_ == FS_OK;
  // Until the device is ready for the first time nobody knows where the hand is: it may say 0.
  was_ready_ |= read_status == FS_OK && says_ready;
  const bool has_pose = was_ready_ && read_status == FS_OK && is_finite(hand.pose) && is_finite(hand.twist);

  // After a moment without the hand the solids hold it as before. After a longer one it may be anywhere, and begins anew.
  constexpr double begins_anew_after = 0.1;  // s
  const bool begins_anew = is_known && now - known_at_ > begins_anew_after;
  if (is_known) known_at_ = now;

  const double charged = settings_.mode == FS_SERVO_THREAD ? period_ : 0;
  fs_response response = channels_.evaluate(hand, has_pose, begins_anew, loop_now_.impact, now, charged);
  Guard::GuardedForce guarded_response = guard_.apply({hand, is_ready, late}, response);
  if (has_stop_begun()) guarded_response = {};
  const Wrench& sent = guarded_response.wrench;
  const uint32_t guarded = guard_.has_guarded() ? FS_RESPONSE_GUARDED : 0;
  response.flags |= guarded;
  const double model_stiffness = model_stiffness_.next();
  write_status_ = model_stiffness > 0
                      ? device_->write_model(hand.pose, sent, local_model(guarded_response.stiffness, model_stiffness))
                      : device_->write(sent);

  channels_.publish(sent, guarded, tick_);
  events_.note({now, read_status, write_status_, hand.flags, age, guard_.faults(), device_->troubles()});
  const fs_status status = read_status != FS_OK ? read_status : write_status_;

  const double compute = steady_now() - begin;
  statistics_.note({tick_, now, late, compute, status != FS_OK, guarded != 0, response.error_bound > 0, guard_.faults(),
                    guard_.energy()});
  if (is_recording_) {
    record_.add({hand, response, sent, late, compute, status, guard_.faults()});
    if (guard_.is_latched()) is_recording_ = false;  // keeps the ticks before the fault, to find its cause
  }
}

void fs_servo::add_record(uint64_t after, size_t most, std::vector<fs_recorded_tick>& out) const {
  record_.for_each(after, most, [&](const fs_recorded_tick& each) { out.push_back(each); });
}

bool fs_servo::take_event(uint64_t& next, fs_event& out) const {
  if (next == events_.count()) return false;
  return events_.take(next, {*device_, loop_.values().pose_age, settings_.limits.speed}, out);
}

void fs_servo::set_enabled(bool enabled) noexcept {
  uint64_t before = enable_.load(std::memory_order_relaxed);
  const auto next = [&] {
    const uint64_t trues = before & 0xffffffff, falses = before >> 32;
    return enabled ? falses << 32 | ((trues | 1) + 2) % 0x100000000 : (falses + 1) << 32 | (trues & ~uint64_t{1});
  };
  while (!enable_.compare_exchange_weak(before, next(), std::memory_order_acq_rel)) {
  }
}

void fs_servo::get_stats(fs_servo_stats& out) const {
  const LoopValues loop = loop_.values();
  const fs_link link = loop_.link();
  statistics_.tell(out);
  out.realtime = static_cast<fs_realtime>(std::max<int>(realtime_.load(), FS_REALTIME_NONE));
  out.protections_off = settings_.protections_off;
  out.max_stiffness = loop.max_stiffness;
  out.damping = loop.damping;
  out.enabled = static_cast<uint32_t>(enable_.load(std::memory_order_relaxed) & 1);
  out.reserved = 0;
  out.delay = loop.delay;
  out.link_delay_p50 = link.delay;
  out.link_delay_p99 = link.delay_p99;
  out.link_rate = link.rate;
  out.link_loss = link.loss;
}

void fs_servo::get_device_info(fs_device_info& out) const {
  const uint32_t size = out.struct_size;
  out = device_->info();
  out.struct_size = size;
}
