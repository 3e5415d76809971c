#include "driver/driver_thread.h"

#include <cmath>
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

constexpr double command_age = 0.02;    // s, after which the force of a servo counts no more
constexpr double shortest_cycle = 5e-5; // s: a driver that does not wait must not take a whole processor
constexpr double retry_after = 0.5;     // s, between two tries to open a device that was lost
constexpr double zero_within = 0.06;    // s: a receive and a send, or more
constexpr double end_within = 1;        // s

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

bool is_same_device(const fs_device_info& a, const fs_device_info& b) {
  return std::strncmp(a.serial, b.serial, sizeof a.serial) == 0 && std::strncmp(a.name, b.name, sizeof a.name) == 0 &&
         a.force_axes == b.force_axes && a.torque_axes == b.torque_axes && a.force_max == b.force_max &&
         a.torque_max == b.torque_max && a.mass == b.mass && a.damping == b.damping && a.rate == b.rate &&
         a.link_rate == b.link_rate && a.controller_rate == b.controller_rate && a.controller_delay == b.controller_delay &&
         a.controller_damping == b.controller_damping;
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
    fail(FS_ERROR_IO, "the driver's thread could not be started: %s", error.what());
  }
  await_change(thread->states_, 0, steady_now() + first_within);
}

void DriverThread::end() noexcept {
  change(is_ending_, 1);
  await_change(has_ended_, 0, steady_now() + end_within);
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
  if (sent == FS_ERROR_DISCONNECTED) return lose("");
  if (steady_now() - begin < shortest_cycle) sleep_until(begin + shortest_cycle);
}

void DriverThread::lend(void* self) noexcept {
  lent_ = self;
  owner_ = servo_has;
  if (!may_lend_) owner_ = thread_has;  // the servo has ended meanwhile, and may not have seen that it has the driver
  while (!await_change(owner_, servo_has, steady_now() + 1)) {
  }
  if (std::exchange(is_lost_, false)) lose("");
}

void DriverThread::publish(const State& state) noexcept {
  const bool is_good = state.status == FS_OK && state.state.flags & FS_STATE_READY && is_finite(state.state.pose);
  if (!is_good) {
    newest_bad_.write(state);
    bad_.fetch_add(1, std::memory_order_release);
  }
  newest_.write(state);
}

void DriverThread::lose(const std::string& why) noexcept {
  State lost;
  lost.status = FS_ERROR_DISCONNECTED;
  publish(lost);
  send_status_ = FS_ERROR_DISCONNECTED;
  std::shared_ptr<Opened> device;  // is closed last
  const std::lock_guard lock(mutex_);
  device.swap(device_);
  trouble_ = why;
}

// Opens the device anew. Another one, or the same with other properties, is not what the servo was started for.
void DriverThread::reconnect() noexcept {
  if (await_change(is_ending_, 0, tried_at_ + retry_after)) return;
  tried_at_ = steady_now();
  std::string trouble;
  try {
    const auto device = std::make_shared<Opened>(driver_, address_);
    fs_device_info info = fs_device_info_init();
    ask_driver(driver_, "get_info", [&] { return driver_.get_info(device->self(), &info); });
    if (is_same_device(info, info_)) {
      send_status_ = FS_OK;
      forgotten_ = commands_;
      const std::lock_guard lock(mutex_);
      device_ = device;
      trouble_.clear();
      return;
    }
    trouble =
        "another device is there, or one with other properties: " + std::string(info.name, strnlen(info.name, sizeof info.name)) +
        ", serial '" + std::string(info.serial, strnlen(info.serial, sizeof info.serial)) + "'";
  } catch (const Error& error) {
    trouble = error.text;
  } catch (...) {  // there is no memory
  }
  {
    const std::lock_guard lock(mutex_);
    trouble_ = trouble;
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

fs_status DriverThread::receive(void* self, uint32_t& before) noexcept {
  State next;
  const fs_status status = call_safely([&] { return driver_.receive(self, &next.state); });
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
  const fs_status status = call_safely([&] {
    return command.is_model ? driver_.write_model(self, &command.model) : driver_.send(self, &command.model.f0);
  });
  send_status_ = status;
  if (status == FS_OK && command.number) change(sent_, command.number);
  return status;
}

DriverThread::Command DriverThread::present() const noexcept {
  Command command;
  if (!command_.read(command)) return {};
  const bool is_present = command.is_lasting || (command.bad_seen == bad_ && steady_now() - command.time <= command_age);
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
  if (!(is_new_bad ? newest_bad_ : newest_).read(newest)) return FS_OK;  // none has come: out is all zeros, and not ready
  if (newest.status == FS_OK) out = newest.state;
  return static_cast<fs_status>(newest.status);
}

fs_status DriverThread::leave(Command command) noexcept {
  if (servos_thread_.load(std::memory_order_relaxed) == this_thread()) {
    const fs_status status = send(lent_, command);
    if (status == FS_ERROR_DISCONNECTED) {
      is_lost_ = true;
      give_back(false);
    }
    return status;
  }
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
  const fs_status status = write({}, true);
  if (servos_thread_ == this_thread()) return status;
  const double deadline = steady_now() + zero_within;
  for (uint32_t sent = before; sent != commands_.load(); sent = sent_) {
    if (!await_change(sent_, sent, deadline)) return FS_ERROR_TIMEOUT;
  }
  return FS_OK;
}

void DriverThread::begin_servo(int priority, bool may_lend) noexcept {
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

double DriverThread::await_state(double soonest, double latest) noexcept {
  if (owner_.load(std::memory_order_acquire) == servo_has) {
    servos_thread_.store(this_thread(), std::memory_order_relaxed);
    for (;;) {
      uint32_t before;
      const fs_status status = receive(lent_, before);
      states_seen_ = states_.load(std::memory_order_relaxed);
      const double now = steady_now();
      if (status == FS_OK) {
        if (now >= soonest) return std::fmin(now, latest);
        continue;
      }
      if (status == FS_ERROR_DISCONNECTED) {
        is_lost_ = true;
        give_back(false);
      }
      sleep_until(latest);
      return latest;
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
    if (!await_change(states_, come, latest)) return latest;
  }
}

void DriverThread::give_back(bool is_for_good) noexcept {
  if (is_for_good) may_lend_ = false;
  servos_thread_ = 0;
  change(owner_, thread_has);
}

std::string DriverThread::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

}  // namespace fs
