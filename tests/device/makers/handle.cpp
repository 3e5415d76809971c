#include "device/makers/handle.h"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

namespace makers {

using scenes::norm;
using stability::Plant;

namespace {

constexpr double ramp_speed = 12;  // N/s, at most, of 3 N within the 0.5 s of a servo
constexpr double way_begins = 0, way_speed = 0.008, way_stiffness = 100;  // m, m/s, N/m, of note_turnarounds

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

Handle::Handle(const stability::DeviceModel& device, const stability::HandModel& hand, double watchdog)
    : plant_(device, hand, device.rate), watchdog_(watchdog), begin_(now_s()) {}

void Handle::become(const stability::DeviceModel& device, const stability::HandModel& hand) {
  const std::lock_guard lock(mutex_);
  Plant plant(device, hand, device.rate);
  plant.is_held_by_stage = true;  // so that the time until now costs nothing that moves
  plant.advance(now_s() - begin_);
  plant.is_held_by_stage = false;
  plant.put({});
  plant_ = std::move(plant);
  has_force_ = false;
}

void Handle::set_watchdog(double watchdog) {
  const std::lock_guard lock(mutex_);
  watchdog_ = watchdog;
}

void Handle::give(fs_vec3 force, fs_vec3 torque, double time) {
  plant_.command(force, torque);
  const double before = std::exchange(given_, norm(force)), since = time - std::exchange(given_at_, time);
  const double ramp = before > 0 ? ramp_speed * since : 0;
  largest_rise_ = std::max(largest_rise_, given_ - before - ramp);
  if (has_force_) had_force_ = time;
  has_force_ = norm(force) + norm(torque) > 0;
}

void Handle::advance() {
  const double now = now_s(), end = commanded_ + watchdog_;
  if (watchdog_ > 0 && has_force_ && now > end) {
    plant_.advance(end - begin_);
    give({}, {}, end);
  }
  plant_.advance(now - begin_);
  if (has_force_) had_force_ = now;
}

Handle::Measured Handle::measure() {
  const std::lock_guard lock(mutex_);
  advance();
  if (turnarounds_) return {{way_begins + way_speed * (now_s() - noting_since_), 0, 0}, {}};
  return {plant_.measured(), plant_.measured_rotation()};
}

void Handle::command(fs_vec3 force, fs_vec3 torque) {
  const std::lock_guard lock(mutex_);
  advance();
  commanded_ = now_s();
  ++commands_;
  if (turnarounds_ && norm(force) > 0 && force.x != answered_) {  // each pose counts when it is first answered
    answered_ = force.x;
    const double measured = noting_since_ + (force.x / -way_stiffness - way_begins) / way_speed;
    if (measured >= noting_since_) turnarounds_->push_back(commanded_ - measured);
  }
  if (!turnarounds_) give(force, torque, commanded_);
}

void Handle::rest() {
  const std::lock_guard lock(mutex_);
  advance();
  give({}, {}, now_s());
}

void Handle::note_caller() {
  char name[16] = "";
  pthread_getname_np(pthread_self(), name, sizeof name);
  if (std::strcmp(name, "fs-servo") != 0) return;
  const std::lock_guard lock(mutex_);
  ++calls_of_servo_;
}

fs_vec3 Handle::position() {
  const std::lock_guard lock(mutex_);
  advance();
  return plant_.position();
}

fs_vec3 Handle::force() {
  const std::lock_guard lock(mutex_);
  advance();
  return plant_.applied();
}

double Handle::largest_rise() {
  const std::lock_guard lock(mutex_);
  return largest_rise_;
}

double Handle::last_force_time() {
  const std::lock_guard lock(mutex_);
  advance();
  return had_force_;
}

uint64_t Handle::commands() {
  const std::lock_guard lock(mutex_);
  return commands_;
}

uint64_t Handle::calls_of_servo() {
  const std::lock_guard lock(mutex_);
  return calls_of_servo_;
}

void Handle::note_turnarounds(std::vector<double>* out) {
  const std::lock_guard lock(mutex_);
  if (!turnarounds_) {
    advance();
    give({}, {}, now_s());
    plant_.put({});
    noting_since_ = now_s();
  }
  turnarounds_ = out;
}

}  // namespace makers
