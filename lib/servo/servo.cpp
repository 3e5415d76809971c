#include "servo/servo.h"

#include <sched.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <ctime>
#include <unistd.h>

#include "base/enum.h"
#include "base/error.h"
#include "base/signals.h"
#include "servo/realtime.h"

using namespace fs;

namespace {

constexpr double pose_age_limit = 0.02;  // s: an older pose is a lost device
constexpr double record_length = 2;      // s
constexpr size_t stack_size = 256 * 1024;
constexpr int not_asked = -1;            // of fs_realtime: the thread has not come so far

double parse_limit(double given, double device, const char* field) {
  if (!(given >= 0 && given <= device)) {
    fail(FS_ERROR_INVALID, "%s is %g, must be within 0..%g, what the device can", field, given, device);
  }
  return given > 0 ? given : device;
}

// 0: the default; negative: none, told by `off`.
double parse_switch(double given, double standard, double none, double high, uint32_t bit, uint32_t& off,
                    const char* field) {
  if (!(given <= high) || !std::isfinite(given)) {
    fail(FS_ERROR_INVALID, "%s is %g, must be finite and at most %g", field, given, high);
  }
  if (given < 0) off |= bit;
  return given < 0 ? none : given == 0 ? standard : given;
}

}  // namespace

ServoSettings fs::parse_options(const fs_servo_options& options, const fs_device_info& device) {
  ServoSettings out{};
  const int32_t mode = raw_value(options.mode);
  if (mode < FS_SERVO_THREAD || mode > FS_SERVO_VIRTUAL) {
    fail(FS_ERROR_INVALID, "mode is %d, must be an fs_servo_mode (0..2)", mode);
  }
  out.mode = options.mode;
  if (options.rate != 0 && !(options.rate >= 100 && options.rate <= 20000)) {
    fail(FS_ERROR_INVALID, "rate is %g, must be within 100..20000 Hz, or 0 for the device's", options.rate);
  }
  out.rate = options.rate != 0 ? options.rate : device.rate;
  out.limits.period = 1 / out.rate;
  out.limits.force_axes = device.force_axes;
  out.limits.torque_axes = device.torque_axes;
  out.limits.force = parse_limit(options.force_limit, device.force_max, "force_limit");
  out.limits.torque = parse_limit(options.torque_limit, device.torque_max, "torque_limit");
  uint32_t& off = out.protections_off;
  out.limits.speed = parse_switch(options.speed_limit, 2, never, 1e6, FS_OFF_SPEED, off, "speed_limit");
  out.limits.ramp = parse_switch(options.ramp, 0.5, 0, 1e6, FS_OFF_RAMP, off, "ramp");
  out.fade = parse_switch(options.fade, 1, 0, 1e6, FS_OFF_FADE, off, "fade");
  // These come with the stability part: checked, and said to be off.
  parse_switch(options.slew_limit, 0, 0, 1e12, FS_OFF_SLEW, off, "slew_limit");
  parse_switch(options.blend, 0, 0, 1e6, FS_OFF_BLEND, off, "blend");
  parse_switch(options.damping, 0, 0, 1e9, FS_OFF_DAMPING, off, "damping");
  parse_switch(options.max_stiffness, 0, 0, 1e12, FS_OFF_STIFFNESS, off, "max_stiffness");
  off |= FS_OFF_SLEW | FS_OFF_BLEND | FS_OFF_DAMPING | FS_OFF_STIFFNESS;
  if (!(options.delay >= 0 && options.delay <= 10)) {
    fail(FS_ERROR_INVALID, "delay is %g, must be within 0..10 s", options.delay);
  }
  if (options.priority > 99) fail(FS_ERROR_INVALID, "priority is %d, must be at most 99", options.priority);
  out.priority = options.priority == 0 ? 80 : options.priority;
  const long processors = sysconf(_SC_NPROCESSORS_CONF);
  if (options.cpu < 0 || options.cpu > processors) {
    fail(FS_ERROR_INVALID, "cpu is %d, must be within 0..%ld", options.cpu, processors);
  }
  out.cpu = options.cpu - 1;
  if (out.cpu >= 0 && !may_use_processor(out.cpu)) {
    fail(FS_ERROR_INVALID, "cpu is %d, but this process may not run on processor %d", options.cpu, out.cpu);
  }
  return out;
}

fs_servo::fs_servo(Ref<LocalScene> scene, Ref<Device> device, const ServoSettings& settings)
    : scene_(std::move(scene)),
      device_(std::move(device)),
      settings_(settings),
      period_(1 / settings.rate),
      guard_(settings.limits),
      record_size_(static_cast<size_t>(std::ceil(record_length * settings.rate))),
      record_slots_(record_size_ + 64),
      record_(std::make_unique<Seqlock<RecordSlot>[]>(record_slots_)) {
  if (!device_->acquire()) fail(FS_ERROR_STATE, "device has a servo already; stop it first");
  try {
    const Ref<ChannelList> list = make_ref<ChannelList>();
    list->channels.push_back(make_ref<Channel>(*this, scene_, Channel::Limits{}));
    posted_channels_ = list;
    channels_.prime(posted_channels_);
  } catch (...) {
    device_->release_ownership();
    throw;
  }
  if (settings.mode != FS_SERVO_THREAD) return;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_size);
  realtime_.store(not_asked);
  const auto entry = [](void* data) -> void* {
    fs_servo* servo = static_cast<fs_servo*>(data);
    servo->realtime_.store(request_realtime(servo->settings_.priority, servo->settings_.cpu));
    servo->realtime_.notify_one();
    servo->run();
    return nullptr;
  };
  const int error = [&] {
    const SignalsBlocked blocked;
    return pthread_create(&thread_, &attributes, entry, this);
  }();
  pthread_attr_destroy(&attributes);
  if (error) {
    drop_channels();
    device_->release_ownership();
    fail(FS_ERROR_IO, "the servo's thread could not be started: %s", std::strerror(error));
  }
  has_thread_ = true;
  realtime_.wait(not_asked);
  if (realtime_.load() == FS_REALTIME_FIFO && lock_memory()) realtime_.store(FS_REALTIME_FIFO_LOCKED);
}

void fs_servo::stop() noexcept {
  {
    const std::lock_guard lock(listeners_mutex_);
    if (is_stopping_.exchange(true)) return;
    for (const auto& [owner, listener] : listeners_) listener();
    listeners_.clear();
  }
  if (has_thread_) pthread_join(thread_, nullptr);
  while (is_stepping_.exchange(true, std::memory_order_acquire)) sched_yield();  // a last step in another thread
  device_->write({});
  drop_channels();
  device_->release_ownership();
}

void fs_servo::drop_channels() noexcept {
  const std::lock_guard lock(channels_mutex_);
  for (const Ref<Channel>& channel : posted_channels_->channels) channel->detach();
  posted_channels_ = nullptr;
  channels_.clear();  // those taken out before, too, that the servo had not let go of
}

ClockKind fs_servo::clock() const noexcept {
  return settings_.mode == FS_SERVO_VIRTUAL ? ClockKind::virtual_time : ClockKind::steady;
}

Ref<Channel> fs_servo::add_channel(Ref<LocalScene> scene, const Channel::Limits& limits) {
  const std::lock_guard lock(channels_mutex_);
  if (!posted_channels_) fail(FS_ERROR_STATE, "the servo has been stopped");
  const Ref<ChannelList> list = make_ref<ChannelList>();
  list->channels = posted_channels_->channels;
  list->channels.reserve(list->channels.size() + 1);
  const Ref<Channel> channel = make_ref<Channel>(*this, std::move(scene), limits);
  list->channels.push_back(channel);
  posted_channels_ = list;
  channels_.post(posted_channels_);
  return channel;
}

Wrench fs_servo::own_wrench() {
  const std::lock_guard lock(channels_mutex_);
  return posted_channels_ ? posted_channels_->channels.front()->wrench() : Wrench{};
}

size_t fs_servo::channel_count() {
  const std::lock_guard lock(channels_mutex_);
  return posted_channels_ ? posted_channels_->channels.size() - 1 : 0;
}

void fs_servo::reap_channels() {
  const std::lock_guard lock(channels_mutex_);
  if (!posted_channels_) return;
  const double now = scene_->now();
  const std::vector<Ref<Channel>>& present = posted_channels_->channels;
  const auto is_gone = [now](const Ref<Channel>& channel) { return channel->is_gone(now); };
  if (std::any_of(present.begin(), present.end(), is_gone)) {
    const Ref<ChannelList> list = make_ref<ChannelList>();
    std::remove_copy_if(present.begin(), present.end(), std::back_inserter(list->channels), is_gone);
    posted_channels_ = list;
    channels_.post(posted_channels_);
  } else if (channels_.take_back()) {  // frees the list that the tick has let go of
    channels_.post(posted_channels_);
  }
}

void fs_servo::add_listener(const void* owner, std::function<void()> f) {
  const std::lock_guard lock(listeners_mutex_);
  if (is_stopping_) fail(FS_ERROR_STATE, "the servo has been stopped");
  listeners_.emplace_back(owner, std::move(f));
}

void fs_servo::remove_listener(const void* owner) noexcept {
  const std::lock_guard lock(listeners_mutex_);
  std::erase_if(listeners_, [owner](const auto& listener) { return listener.first == owner; });
}

void fs_servo::run() noexcept {
  double next = steady_now() + period_;
  while (!is_stopping_.load(std::memory_order_relaxed)) {
    timespec deadline;
    deadline.tv_sec = static_cast<time_t>(next);
    deadline.tv_nsec = static_cast<long>((next - static_cast<double>(deadline.tv_sec)) * 1e9);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
    const double now = steady_now();
    const double late = std::fmax(0, now - next);
    const double missed = std::floor(late / period_);  // skipped, never made up for in a burst
    misses_.fetch_add(static_cast<uint64_t>(missed), std::memory_order_relaxed);
    next += missed * period_;
    due_.store(next, std::memory_order_relaxed);
    tick(now, late);
    next += period_;
  }
}

fs_status fs_servo::step(uint64_t ticks) noexcept {
  if (settings_.mode == FS_SERVO_THREAD) {
    return set_last_error_literal(FS_ERROR_UNSUPPORTED, "fs_servo_step: this servo has a thread of its own that steps it");
  }
  if (is_stepping_.exchange(true, std::memory_order_acquire)) {
    return set_last_error_literal(FS_ERROR_STATE, "fs_servo_step: another thread is stepping this servo");
  }
  for (uint64_t i = 0; i < ticks; ++i) {
    if (settings_.mode == FS_SERVO_VIRTUAL) {
      tick(static_cast<double>(tick_ + 1) / settings_.rate, 0);
    } else {
      const double now = steady_now();
      const double late = last_time_ < 0 ? 0 : std::fmax(0, now - last_time_ - period_);
      misses_.fetch_add(static_cast<uint64_t>(late / period_), std::memory_order_relaxed);
      tick(now, late);
    }
  }
  const bool is_lost = tick_ > 0 && !was_ready_;
  is_stepping_.store(false, std::memory_order_release);
  if (is_lost) {
    return set_last_error_literal(FS_ERROR_DISCONNECTED, "the device was lost or not ready at the last tick");
  }
  return FS_OK;
}

// One turn of the loop. It never allocates, locks, logs, throws or waits on anyone.
void fs_servo::tick(double now, double late) noexcept {
  ++tick_;
  last_time_ = now;
  const double begin = steady_now();

  const uint64_t requested = enable_.load(std::memory_order_acquire);
  if (requested != enable_seen_) {
    if ((requested ^ enable_seen_) >> 32) guard_.set_enabled(false);  // also when it was enabled again meanwhile
    if (requested & 1) {
      guard_.set_enabled(true);
      is_recording_ = true;
    }
    enable_seen_ = requested;
  }

  fs_state hand;
  fs_status status = device_->read(now, hand);
  // In virtual time the clock of a real device says nothing about age.
  const bool has_age = clock() != ClockKind::virtual_time || device_->is_simulated();
  const bool is_fresh = !has_age || now - hand.time <= pose_age_limit;
  const bool is_ready =
      status == FS_OK && write_status_ == FS_OK && (hand.flags & FS_STATE_READY) && is_fresh;
  const bool has_pose = status == FS_OK && is_finite(hand.pose) && is_finite(hand.twist);

  channels_.fetch();
  const std::vector<Ref<Channel>>& channels = channels_.front()->channels;
  const bool has_thread = settings_.mode == FS_SERVO_THREAD;
  fs_response response{};
  response.proxy = identity_pose();
  for (size_t i = 0; i < channels.size(); ++i) {
    Channel& channel = *channels[i];
    if (channel.is_gone(now)) continue;
    channel.fetch(now);
    if (!has_pose) {
      channel.lose_hand();
    } else if (i == 0) {
      response = channel.evaluate(hand, now, tick_);  // the servo's own scene: its proxy is the one that is told
    } else {
      const double start = has_thread ? steady_now() : 0;
      add(response, channel.evaluate(hand, now, tick_));
      if (has_thread) channel.charge(steady_now() - start, period_);
    }
  }

  const Wrench sent = guard_.apply({hand, is_ready, late}, response.wrench);
  const uint32_t guarded = guard_.has_guarded() ? FS_RESPONSE_GUARDED : 0;
  response.flags |= guarded;
  write_status_ = device_->write(sent);
  if (status == FS_OK) status = write_status_;

  for (const Ref<Channel>& channel : channels) {
    if (!channel->is_gone(now)) channel->publish(sent, guarded, tick_);
  }
  note_device(now, status);

  const double compute = steady_now() - begin;
  late_.add(late, now);
  compute_.add(compute, now);
  if (tick_ == 1) first_time_.store(now, std::memory_order_relaxed);
  newest_time_.store(now, std::memory_order_relaxed);
  ticks_.store(tick_, std::memory_order_relaxed);
  device_errors_.store(device_errors_.load(std::memory_order_relaxed) + (status != FS_OK), std::memory_order_relaxed);
  guarded_.store(guarded_.load(std::memory_order_relaxed) + (guarded != 0), std::memory_order_relaxed);
  approximated_.store(approximated_.load(std::memory_order_relaxed) + (response.error_bound > 0),
                      std::memory_order_relaxed);
  if (is_recording_) {
    const uint64_t number = recorded_.load(std::memory_order_relaxed);
    record_[number % record_slots_].write(
        {number, {hand, response, sent, late, compute, status, guard_.faults()}});
    recorded_.store(number + 1, std::memory_order_release);
    if (guard_.is_latched()) is_recording_ = false;  // kept for whoever asks why
  }
}

// Keeps the faults for the stats, and leaves an event when the device becomes ready, is lost or is stopped by a fault.
void fs_servo::note_device(double now, fs_status status) noexcept {
  const uint32_t faults = guard_.faults();
  const bool is_ready = !(faults & FS_FAULT_DEVICE) && status == FS_OK;
  const uint32_t latched = faults & ~static_cast<uint32_t>(FS_FAULT_DEVICE);
  faults_.store(faults, std::memory_order_relaxed);
  const auto leave = [&](fs_status what, uint32_t bits) {
    const uint64_t number = events_written_.load(std::memory_order_relaxed);
    device_events_[number % event_capacity].write({number, now, what, bits});
    events_written_.store(number + 1, std::memory_order_release);
  };
  if (is_ready && !was_ready_) leave(FS_OK, 0);
  if (!is_ready && was_ready_) leave(status != FS_OK ? status : FS_ERROR_STATE, FS_FAULT_DEVICE);
  if (latched & ~latched_) leave(FS_ERROR_STATE, latched & ~latched_);
  was_ready_ = is_ready;
  latched_ = latched;
}

bool fs_servo::take_event(uint64_t& next, fs_event& out) const {
  const uint64_t end = event_count();
  if (next == end) return false;
  DeviceEvent event;
  const uint64_t oldest = end - std::min<uint64_t>(end, event_capacity);
  if (next < oldest || !device_events_[next % event_capacity].read(event) || event.number != next) {
    const uint64_t first = std::max(oldest, next + 1);  // what came before has been overwritten
    out = {};
    out.kind = FS_EVENT_OVERFLOW;
    out.time = newest_time_.load(std::memory_order_relaxed);
    out.value = static_cast<double>(first - next);
    next = first;
    return true;
  }
  ++next;
  out = {};
  out.kind = FS_EVENT_DEVICE;
  out.status = event.status;
  out.time = event.time;
  out.value = event.faults;
  const fs_device_info& info = device_->info();
  std::memcpy(out.name, info.name, sizeof out.name - 1);
  const char* text = "ready";
  if (event.faults & FS_FAULT_DEVICE) text = "lost, not ready, or its pose older than 20 ms; the force comes back by the ramp";
  if (event.faults & FS_FAULT_SPEED) text = "stopped: the hand was above speed_limit";
  if (event.faults & FS_FAULT_NUMBER) text = "stopped: a pose or force was not finite";
  if (event.faults & FS_FAULT_LATE) text = "stopped: 20 ticks in a row were each later than a period";
  std::snprintf(out.text, sizeof out.text, "%s", text);
  return true;
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
  const RollingHistogram::Percentiles late = late_.percentiles(), compute = compute_.percentiles();
  const double since = std::fmax(first_time_.load(), late.since), span = newest_time_.load() - since;
  out.realtime = static_cast<fs_realtime>(std::max<int>(realtime_.load(), FS_REALTIME_NONE));
  out.faults = faults_.load();
  out.protections_off = settings_.protections_off;
  out.ticks = ticks_.load();
  out.rate = span > 0 ? static_cast<double>(late.count - (since > late.since)) / span : 0;
  out.max_stiffness = never;
  out.damping = 0;
  out.energy = 0;
  out.misses = misses_.load();
  out.device_errors = device_errors_.load();
  out.guarded = guarded_.load();
  out.approximated = approximated_.load();
  out.late_p50 = late.p50;
  out.late_p99 = late.p99;
  out.late_max = late.max;
  out.compute_p50 = compute.p50;
  out.compute_p99 = compute.p99;
  out.compute_max = compute.max;
}

void fs_servo::get_device_info(fs_device_info& out) const {
  const uint32_t size = out.struct_size;
  out = device_->info();
  out.struct_size = size;
}

size_t fs_servo::record(fs_tick* out, size_t capacity) const {
  const uint64_t end = recorded_.load(std::memory_order_acquire);
  const uint64_t kept = std::min<uint64_t>(end, record_size_);
  const uint64_t wanted = std::min<uint64_t>(kept, capacity);
  size_t written = 0;
  for (uint64_t number = end - wanted; number < end; ++number) {
    RecordSlot slot;
    if (!record_[number % record_slots_].read(slot) || slot.tick != number) continue;  // the servo came round meanwhile
    out[written++] = slot.value;
  }
  return written < wanted ? written : static_cast<size_t>(kept);
}
