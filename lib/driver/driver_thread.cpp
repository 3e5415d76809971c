#include "driver/driver_thread.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <thread>
#include <utility>

#include "base/clock.h"
#include "base/error.h"
#include "base/futex.h"
#include "base/process.h"
#include "base/realtime.h"
#include "base/signals.h"
#include "math/pose.h"

namespace fs {
namespace {

// s: a period and so much after a tick its force counts no more. That is later than the 20 ms of the guard, so that a servo whose
// force has been dropped knows of the pause, and begins again by the ramp.
constexpr double command_age = 0.025;
constexpr double shortest_cycle = 5e-5; // s: a driver that does not wait must not take a whole processor
constexpr double retry_after = 0.5;     // s, between two tries to open a device that was lost
constexpr double zero_within = 0.06;    // s: a receive and a send, or more
constexpr double measure_after = 0.04;  // s, from one look at the link to the next

// Waits until the number is no longer `present`; false: it still is at the deadline.
bool await_change(const std::atomic<uint32_t>& number, uint32_t present, double deadline) noexcept {
  while (number.load(std::memory_order_acquire) == present) {
    if (steady_now() >= deadline) return false;
    wait_for_change(number, present, deadline);
  }
  return true;
}

void change(std::atomic<uint32_t>& number, uint32_t value) noexcept {
  number.store(value);
  wake_waiters(number);
}

// Why the device `now` is not what the servo was started for; "": it is.
std::string difference(const fs_device_info& now, const fs_device_info& before) {
  char text[200] = "";
  const auto differs = [&](const char (&a)[64], const char (&b)[64]) { return std::strncmp(a, b, sizeof a) != 0; };
  if (differs(now.name, before.name) || differs(now.serial, before.serial)) {
    std::snprintf(text, sizeof text, "another device is there: %.63s, serial number '%.63s'", now.name, now.serial);
    return text;
  }
  const struct {
    const char* name;
    double now, before;
  } fields[]{{"force_axes", double(now.force_axes), double(before.force_axes)},
             {"torque_axes", double(now.torque_axes), double(before.torque_axes)},
             {"force_max", now.force_max, before.force_max},
             {"torque_max", now.torque_max, before.torque_max},
             {"mass", now.mass, before.mass},
             {"damping", now.damping, before.damping},
             {"rate", now.rate, before.rate},
             {"link_rate", now.link_rate, before.link_rate},
             {"controller_rate", now.controller_rate, before.controller_rate},
             {"controller_delay", now.controller_delay, before.controller_delay},
             {"controller_damping", now.controller_damping, before.controller_damping}};
  for (const auto& field : fields) {
    if (field.now == field.before) continue;
    std::snprintf(text, sizeof text,
                  "the device is there again, but its %s is now %.9g, and was %.9g; close it and open it again", field.name,
                  field.now, field.before);
    break;
  }
  return text;
}

}  // namespace

DriverThread::DriverThread(const fs_driver& driver, std::string address, std::shared_ptr<Opened> device,
                           const fs_device_info& info)
    : driver_(driver), address_(std::move(address)), info_(info), period_(1 / info.rate), device_(std::move(device)) {}

void DriverThread::start(const Ref<DriverThread>& thread) {
  constexpr double first_within = 0.05;  // s
  try {
    const SignalsBlocked blocked;
    std::thread([thread] {
      begin_thread("fs-driver");
      thread->run();
    }).detach();  // a driver that hangs must not hold up the process
  } catch (const std::system_error& error) {
    fail_to_start("the driver's thread", error.what());
  }
  await_change(thread->states_, 0, steady_now() + first_within);
}

void DriverThread::begin_end() noexcept { change(is_ending_, 1); }

void DriverThread::end(double deadline) noexcept {
  begin_end();
  await_change(has_ended_, 0, deadline);
}

std::shared_ptr<Opened> DriverThread::device() const noexcept {
  const std::lock_guard lock(mutex_);
  return device_;
}

// ---------------------------------------------------------------------------------------------------------- the thread

void DriverThread::run() noexcept {
  int priority = -1;
  while (!is_ending_) {
    if (const int wanted = priority_; wanted != priority) {
      if (wanted < 0) end_realtime();
      else request_realtime(wanted, -1);
      priority = wanted;
    }
    const std::shared_ptr<Opened> device = this->device();
    if (!device) {
      reconnect();
    } else if (may_lend_) {
      lend(device->self());
    } else {
      exchange(device->self());
    }
  }
  finish();
}

void DriverThread::exchange(void* self) noexcept {
  const double begin = steady_now();
  uint32_t before = 0;
  const fs_status status = receive(self, before);
  if (status == FS_OK && has_servo_) await_change(commands_, before, steady_now() + period_ / 2);
  Command command = present();
  if (status != FS_OK && status != FS_ERROR_TIMEOUT) command = {};
  const fs_status sent = status == FS_ERROR_DISCONNECTED ? status : send(self, command);
  if (sent == FS_ERROR_DISCONNECTED) return lose();
  if (steady_now() - begin < shortest_cycle) sleep_until(begin + shortest_cycle);
}

void DriverThread::lend(void* self) noexcept {
  lent_ = self;
  owner_ = servo_has;
  if (!may_lend_) owner_ = thread_has;  // the servo has ended meanwhile, and may not have seen that it has the driver
  while (!await_change(owner_, servo_has, steady_now() + 1)) {
  }
  if (std::exchange(is_lost_, false)) lose();
}

void DriverThread::publish(const State& state) noexcept {
  const bool is_good = state.status == FS_OK && state.state.flags & FS_STATE_READY && is_finite(state.state.pose);
  if (!is_good) {
    newest_bad_.write(state);
    bad_.fetch_add(1, std::memory_order_release);
  }
  newest_.write(state);
}

void DriverThread::lose() noexcept {
  State lost;
  lost.status = FS_ERROR_DISCONNECTED;
  publish(lost);
  send_status_ = FS_ERROR_DISCONNECTED;
  std::shared_ptr<Opened> device;  // is closed last
  const std::lock_guard lock(mutex_);
  device.swap(device_);
}

// Opens the device anew. Another one, or the same with other properties, is not what the servo was started for.
void DriverThread::reconnect() noexcept {
  if (await_change(is_ending_, 0, tried_at_ + retry_after)) return;
  tried_at_ = steady_now();
  Trouble trouble{FS_ERROR_DISCONNECTED, ""};
  try {
    const auto device = std::make_shared<Opened>(driver_, address_);
    fs_device_info info = fs_device_info_init();
    ask_driver(driver_, "get_info", [&] { return driver_.get_info(device->self(), &info); });
    trouble.words = difference(info, info_);
    if (trouble.words.empty()) {
      send_status_ = FS_OK;
      forgotten_ = commands_;
      const std::lock_guard lock(mutex_);
      device_ = device;
      return;
    }
  } catch (const Error& error) {
    trouble.words = error.text;
  } catch (...) {  // there is no memory
  }
  {
    const std::lock_guard lock(mutex_);
    tell(std::move(trouble));
  }
}

void DriverThread::finish() noexcept {
  constexpr int most_tries = 20;
  if (std::shared_ptr<Opened> device = this->device()) {
    for (int i = 0; i < most_tries && send(device->self(), {}) != FS_OK; ++i) sleep_until(steady_now() + 1e-3);
    const std::lock_guard lock(mutex_);
    device_ = nullptr;
  }
  change(has_ended_, 1);
}

// --------------------------------------------------------------------------------------- who has the driver calls these

// What the driver says by fs_fail becomes the trouble, unless somebody else has the lock.
template <class F>
fs_status DriverThread::call(F&& f, fs_status usual) noexcept {
  set_last_error_literal(FS_OK, "");
  const fs_status status = call_safely(f);
  if (status == FS_OK || status == usual) return status;
  try {
    Trouble trouble{status, last_error()};
    if (const std::unique_lock lock(mutex_, std::try_to_lock); lock) tell(std::move(trouble));
  } catch (...) {  // there is no memory
  }
  return status;
}

void DriverThread::measure(void* self) noexcept {
  fs_link link{};
  link.struct_size = sizeof link;
  if (call_safely([&] { return driver_.get_link(self, &link); }) != FS_OK) return;
  link_.write(link);
  links_.fetch_add(1, std::memory_order_release);
}

fs_status DriverThread::receive(void* self, uint32_t& before) noexcept {
  if (driver_.get_link && has_servo_ && steady_now() - measured_at_ >= measure_after) {
    measured_at_ = steady_now();
    measure(self);
  }
  State next;
  const fs_status status = call([&] { return driver_.receive(self, &next.state); }, FS_ERROR_TIMEOUT);
  if (status == FS_ERROR_TIMEOUT) return status;
  next.came = steady_now();
  if (status != FS_OK) next.state = {};
  else if (next.state.time == 0) next.state.time = next.came;
  next.status = status;
  before = commands_.load(std::memory_order_acquire);
  publish(next);
  change(states_, static_cast<uint32_t>(++number_));
  return status;
}

fs_status DriverThread::send(void* self, const Command& command) noexcept {
  const auto send = [&] {
    return command.is_model ? driver_.write_model(self, &command.model) : driver_.send(self, &command.model.f0);
  };
  const fs_status status = call(send, FS_OK);
  send_status_ = status;
  if (status == FS_OK && command.number) change(sent_, command.number);
  return status;
}

DriverThread::Command DriverThread::present() const noexcept {
  Command command;
  if (!command_.read(command)) return {};
  const bool is_present =
      command.is_lasting || (command.bad_seen == bad_ && steady_now() - command.time <= command_age + servos_period_);
  if (is_present && command.number != forgotten_) return command;
  Command none;
  none.number = command.number;
  return none;
}

// -------------------------------------------------------------------------------------------------------- for the device

fs_status DriverThread::read(fs_state& out) noexcept {
  State newest;
  const uint32_t bad = bad_.load(std::memory_order_acquire);
  const bool is_new_bad = std::exchange(bad_seen_, bad) != bad && has_servo_;
  if (!(is_new_bad ? newest_bad_ : newest_).read(newest)) {  // none has come
    out.flags = FS_STATE_CONNECTING;
    return FS_OK;
  }
  if (newest.status == FS_OK) out = newest.state;
  return static_cast<fs_status>(newest.status);
}

fs_status DriverThread::leave(Command command) noexcept {
  command.time = steady_now();
  command.bad_seen = bad_seen_;
  command.number = commands_.load(std::memory_order_relaxed) + 1;
  command_.write(command);
  change(commands_, command.number);
  return static_cast<fs_status>(send_status_.load());
}

fs_status DriverThread::write(const fs_wrench& wrench, bool is_lasting) noexcept {
  Command command;
  command.model.f0 = wrench;
  command.is_lasting = is_lasting;
  return leave(command);
}

fs_status DriverThread::write_model(const fs_model& model) noexcept {
  Command command;
  command.model = model;
  command.is_model = true;
  return leave(command);
}

fs_status DriverThread::write_zero() noexcept {
  if (!device()) return FS_ERROR_DISCONNECTED;
  const uint32_t before = sent_;
  write({}, true);
  if (servos_thread_ == this_thread()) return send(lent_, {});  // a driver in the servo's thread has called exit
  const double deadline = steady_now() + zero_within;
  for (uint32_t sent = before; sent != commands_.load(); sent = sent_) {
    if (!await_change(sent_, sent, deadline)) return FS_ERROR_TIMEOUT;
  }
  return FS_OK;
}

fs_status DriverThread::get_link(fs_link& out) noexcept {
  const uint32_t measured = links_.load(std::memory_order_acquire);
  return std::exchange(links_seen_, measured) != measured && link_.read(out) ? FS_OK : FS_ERROR_UNSUPPORTED;
}

void DriverThread::begin_servo(int priority, bool may_lend, double period) noexcept {
  servos_period_ = period;
  priority_ = priority > 1 ? priority - 1 : priority;  // below the servo's
  has_servo_ = true;
  may_lend_ = may_lend && (driver_.flags & FS_DRIVER_IN_SERVO);
}

// The servo's thread is no longer there.
void DriverThread::end_servo() noexcept {
  has_servo_ = false;
  priority_ = -1;
  give_back(true);
}

double DriverThread::await_state(double soonest, double usual, double latest) noexcept {
  if (owner_.load(std::memory_order_acquire) == servo_has) {
    servos_thread_.store(this_thread(), std::memory_order_relaxed);
    for (;;) {
      uint32_t before;
      fs_status status = send(lent_, present());
      if (status != FS_ERROR_DISCONNECTED) status = receive(lent_, before);
      states_seen_ = states_.load(std::memory_order_relaxed);
      if (status == FS_ERROR_DISCONNECTED) {
        is_lost_ = true;
        give_back(false);
      }
      if (status != FS_OK) sleep_until(soonest);
      const double now = steady_now();
      if (status != FS_OK || now >= soonest) return now;
    }
  }
  sleep_until(soonest);
  for (;;) {
    const uint32_t come = states_.load(std::memory_order_acquire);
    if (come != states_seen_) {
      states_seen_ = come;
      State newest;
      return newest_.read(newest) ? std::fmin(std::fmax(newest.came, soonest), latest) : soonest;
    }
    if (!await_change(states_, come, latest)) return usual;
  }
}

void DriverThread::give_back(bool is_for_good) noexcept {
  if (is_for_good) may_lend_ = false;
  servos_thread_ = 0;
  change(owner_, thread_has);
}

void DriverThread::tell(Trouble trouble) noexcept {
  const uint32_t told = troubles_told_.load(std::memory_order_relaxed);
  if (told > 0) {
    const Trouble& newest = troubles_[(told - 1) % troubles_.size()];
    if (newest.status == trouble.status && newest.words == trouble.words) return;
  }
  troubles_[told % troubles_.size()] = std::move(trouble);
  troubles_told_.store(told + 1, std::memory_order_release);
}

Trouble DriverThread::trouble(uint32_t number) const {
  const std::lock_guard lock(mutex_);
  const uint32_t told = troubles();
  if (told == 0 || number == 0) return {};
  if (told - number >= troubles_.size()) number = told;
  return troubles_[(number - 1) % troubles_.size()];
}

}  // namespace fs
