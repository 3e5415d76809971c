// The weight of what comes and goes: linear in time, from 0 to 1 and back over the servo's `fade`, so that no change makes
// a step in force. It is data: the servo works it out from the time of its tick. A change begins to count at the first
// tick that uses it (its Epoch), not when it was made: a client that was held up between the two makes no step either.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "base/counted.h"

namespace fs {

inline constexpr double never = std::numeric_limits<double>::infinity();

// The time at which the servo first used a group of changes; NaN before that. Written once, by the servo.
struct Epoch : Counted<Epoch> {
  void stamp(double now) const noexcept {  // [rt]
    if (!is_stamped()) time_.store(now, std::memory_order_release);
  }
  double time() const noexcept { return time_.load(std::memory_order_acquire); }
  bool is_stamped() const noexcept { return !std::isnan(time()); }

 private:
  mutable std::atomic<double> time_{std::numeric_limits<double>::quiet_NaN()};
};

class Fade {
 public:
  // In full, or not at all, since ever.
  static Fade steady(bool is_on, double expiry = never) { return Fade({-never, is_on ? 1.0 : 0.0, 0, expiry}); }

  // From `now` on it goes in (true) or out; until the epoch it goes on as before. `duration` is the servo's fade, s.
  Fade turned(bool in, double expiry, Ref<const Epoch> epoch, double duration) const {
    Fade next(*this);
    if (epoch_ && !(epoch_ == epoch)) {
      if (epoch_->is_stamped()) {
        next.before_ = {epoch_->time(), weight_before(epoch_->time(), duration), direction_, expiry_};
        next.earlier_ = nullptr;
      } else {  // the servo is about to stamp it
        next.earlier_ = Ref<const Earlier>(make_ref<Earlier>(*this));
      }
    }
    next.epoch_ = std::move(epoch);
    next.direction_ = in ? 1 : -1;
    next.expiry_ = expiry;
    return next;
  }

  double weight(double now, double duration) const noexcept {  // [rt]
    if (!epoch_) return before_.at(now, duration);
    const double start = epoch_->time();
    const bool is_used = duration > 0 ? now > start : now >= start;
    if (!is_used) return weight_before(now, duration);
    return Segment{start, weight_before(start, duration), direction_, expiry_}.at(now, duration);
  }

  bool is_going_in() const noexcept { return epoch_ ? direction_ > 0 : before_.weight > 0; }
  bool is_pending() const noexcept { return epoch_ && !epoch_->is_stamped(); }

 private:
  struct Segment {
    double time, weight;  // s; 0..1 at that time
    int direction;        // +1, -1; 0: stays
    double expiry;        // s; from then on, but not before `time`, it goes out

    double at(double now, double duration) const noexcept {
      const double out_since = std::max(expiry, time);
      double line = weight, end = 1;
      if (!(duration > 0)) {
        if (direction) line = direction > 0 ? 1 : 0;
        if (now >= out_since) end = 0;
      } else {
        if (direction) line += direction * (now - time) / duration;
        if (now > out_since) end -= (now - out_since) / duration;
      }
      return std::clamp(std::min(line, end), 0.0, 1.0);
    }
  };
  struct Earlier;

  explicit Fade(const Segment& before) : before_(before), expiry_(before.expiry) {}

  double weight_before(double now, double duration) const noexcept;

  Segment before_;              // how it went before the epoch,
  Ref<const Earlier> earlier_;  // or this, where that had not begun yet
  Ref<const Epoch> epoch_;
  int direction_ = 0;
  double expiry_;
};

struct Fade::Earlier : Counted<Earlier> {
  explicit Earlier(const Fade& f) : fade(f) {}
  Fade fade;
};

inline double Fade::weight_before(double now, double duration) const noexcept {
  return earlier_ ? earlier_->fade.weight(now, duration) : before_.at(now, duration);
}

}  // namespace fs
