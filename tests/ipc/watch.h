// Reads the flight record of a running servo: each of its ticks, once.
#pragma once

#include <vector>

#include "api/world.h"

namespace life {

class Watch {
 public:
  explicit Watch(fs_servo* servo) : servo_(servo), record_(4096) {}
  void skip() {  // what has been so far
    look([](const fs_tick&, const fs_tick*) {});
    ticks_ = late_ = gaps_ = 0;
  }

  // Calls f(tick, before) for the ticks since the last look, which must be at most 2 s ago, the length of the record.
  // before: null if the previous tick is not in the record, at its beginning or after a longer pause.
  template <class F>
  void look(F&& f) {
    size_t count = 0;
    OK(fs_servo_get_record(servo_, record_.data(), record_.size(), &count));
    count = std::min(count, record_.size());
    // If the machine is too slow for the servo's thread, servo and record stop, which is not a client's fault.
    if (count && record_[count - 1].faults == FS_FAULT_LATE) OK(fs_servo_set_enabled(servo_, true));
    for (size_t i = 0; i < count; ++i) {
      const fs_tick& tick = record_[i];
      if (tick.state.time <= last_.state.time) continue;
      const fs_tick* before = i > 0 ? &record_[i - 1] : nullptr;
      if (before && last_.state.time > 0 && before->state.time > last_.state.time && is_first_) ++gaps_;
      is_first_ = false;
      ++ticks_;
      late_ += tick.faults == FS_FAULT_LATE;
      f(tick, before);
      last_ = tick;
    }
    is_first_ = true;
  }

  uint64_t ticks() const { return ticks_; }
  uint64_t late() const { return late_; }  // ticks at which the machine was too slow
  uint64_t gaps() const { return gaps_; }  // how often some of the record was lost

 private:
  fs_servo* const servo_;
  std::vector<fs_tick> record_;
  fs_tick last_{};
  bool is_first_ = true;
  uint64_t ticks_ = 0, late_ = 0, gaps_ = 0;
};

// What must hold at every tick, whichever clients are connected: the force that the device gets is finite and within
// the limit, and only a machine that is too slow ever stops it.
inline void check_tick(const fs_tick& tick, double force_limit) {
  using namespace scenes;
  const fs_vec3 force = tick.response.wrench.force, torque = tick.response.wrench.torque, sent = tick.sent.force;
  ck_assert(std::isfinite(norm(force)) && std::isfinite(norm(torque)) && std::isfinite(norm(tick.sent.torque)));
  ck_assert_msg(norm(sent) <= force_limit * (1 + 1e-12), "%g N are sent, %g are allowed", norm(sent), force_limit);
  ck_assert_msg((tick.faults & ~uint32_t{FS_FAULT_LATE}) == 0, "fault %u", tick.faults);
  ck_assert_int_eq(tick.device, FS_OK);
}

}  // namespace life
