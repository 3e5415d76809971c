#include "scene/bounding.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace fs {

// What is bounded, and changes by more than a tenth, is told at most once a second of each object; the rest later.
void Bounding::note_slope(const Object& object, double slope, double to_device, double time) {
  const bool takes_what_it_gets = object.is_solid() && object.contact.stiffness == 0;
  const bool is_bounded = slope < object.steepest_slope && !takes_what_it_gets;
  auto told = told_.find(object.name);
  if (told == told_.end()) {
    if (!is_bounded && !takes_what_it_gets) return;
    const double before = takes_what_it_gets ? slope : object.steepest_slope;
    told = told_.emplace(object.name, Told{to_device * before, -never, 0}).first;
  }
  Told& last = told->second;
  last.update = updates_;
  const double now = to_device * slope;
  if (now >= 0.9 * last.slope && now <= 1.1 * last.slope) return;
  has_untold_ = true;
  if (std::fabs(time - last.time) < 1 || events_left_ == 0) return;
  --events_left_;
  last.slope = now;
  last.time = time;
  fs_event event{};
  event.kind = FS_EVENT_CAPPED;
  event.time = time;
  event.value = now;
  object.name.copy(event.name, sizeof event.name - 1);
  if (takes_what_it_gets) {
    std::snprintf(event.text, sizeof event.text, "its contact gets %.4g N/m at the device", now);
  } else if (!is_bounded) {
    std::snprintf(event.text, sizeof event.text, "its slope is no longer bounded: %.4g N/m at the device", now);
  } else if (object.steepest_slope < never) {
    std::snprintf(event.text, sizeof event.text, "its slope is bounded to %.4g N/m at the device, of %.4g", now,
                  to_device * object.steepest_slope);
  } else {
    std::snprintf(event.text, sizeof event.text, "its force jumps: its slope is bounded to %.4g N/m at the device", now);
  }
  evaluated_.events.push(event);
}

void Bounding::set_max_stiffness(double stiffness) {
  max_stiffness_.store(stiffness);
  const std::lock_guard lock(mutex_);
  if (!evaluated_.servo() || updates_ == 0) return;
  const double blend = evaluated_.servo_reader()->memory->spread.blend;
  // What is set from now on begins within it; the rest comes with the next update.
  evaluated_.objects.rows.set_bounds(bounds_alone(share_of(*evaluated_.views.views(), seen_.loop, stiffness, blend)));
}

void Bounding::update(const LoopShare& loop) {
  const double most = max_stiffness_.load();
  KeptSnapshot kept(mutex_);
  double time, blend;
  {
    const std::lock_guard lock(mutex_);
    if (!evaluated_.servo()) return;
    if (!evaluated_.is_held()) evaluated_.settle(false);  // what has faded out leaves its share
    const bool is_same = loop == seen_.loop && most == seen_.most && !seen_.is_to_be_repeated;
    if (seen_.sequence != 0 && is_same && evaluated_.sequence() == seen_.sequence) return;
    // A held scene with edits that are not posted yet is skipped; after its next post this is called again.
    kept.snapshot = evaluated_.is_held() ? evaluated_.newest() : evaluated_.post_newest();
    if (!kept.snapshot) return;
    time = evaluated_.clock.now();
    blend = evaluated_.servo_reader()->memory->spread.blend;
  }
  const SceneShare share = share_of(*kept.snapshot->views, loop, most, blend);
  const std::vector<Admitted> all = admit(*kept.snapshot, share, time);

  const std::lock_guard lock(mutex_);
  if (!evaluated_.servo()) return;
  // If edits came meanwhile, the next call begins anew.
  const bool is_newest = evaluated_.newest() && evaluated_.sequence() == kept.snapshot->sequence;
  evaluated_.prepare();
  Objects& objects = evaluated_.objects;
  objects.rows.set_bounds(bounds_alone(share));
  bool has_changed = false;
  Seen seen{0, loop, most, false};
  ++updates_;
  has_untold_ = false;
  if (std::fabs(time - events_since_) >= 1) {
    events_since_ = time;
    events_left_ = most_events;
  }
  try {
    for (const Admitted& one : all) {
      seen.is_to_be_repeated |= one.is_moving;
      const Objects::Bound bound = objects.bound(one.row, *one.object, one.bounds);
      has_changed |= bound.has_changed;
      if (bound.object && share.to_device > 0) note_slope(*bound.object, bound.slope, share.to_device, time);
    }
  } catch (...) {  // no memory
    evaluated_.changed();
    throw;
  }
  if (has_changed) evaluated_.changed();
  seen.is_to_be_repeated |= has_untold_;
  std::erase_if(told_, [&](const auto& told) { return told.second.update != updates_; });
  const auto wants = [](const Admitted& one) { return one.object->steepest_slope > 0 || one.object->damping > 0; };
  wants_stiffness_.store(std::any_of(all.begin(), all.end(), wants), std::memory_order_relaxed);
  if (is_newest) seen.sequence = evaluated_.sequence();
  seen_ = seen;
}

}  // namespace fs
