#include "scene/bounding.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace fs {

// At most one event a second, about a slope that has changed by more than a tenth.
void Bounding::note_capped(const Object& object, double before, double after, double to_device) {
  const double time = evaluated_.clock.now(), wanted = object.steepest_slope;
  const bool has_changed = after < 0.9 * before || after > 1.1 * before;  // before may be infinite
  if (!has_changed || !(after < never) || std::fabs(time - last_capped_) < 1) return;
  last_capped_ = time;
  fs_event event{};
  event.kind = FS_EVENT_CAPPED;
  event.time = time;
  event.value = to_device * after;
  object.name.copy(event.name, sizeof event.name - 1);
  if (after < wanted) {
    std::snprintf(event.text, sizeof event.text, "its slope is bounded to %.4g N/m at the device, of %.4g", event.value,
                  to_device * wanted);
  } else {
    std::snprintf(event.text, sizeof event.text, "its slope is no longer bounded: %.4g N/m at the device", event.value);
  }
  evaluated_.events.push(event);
}

void Bounding::update(const LoopShare& loop) {
  const double most = max_stiffness_.load();
  KeptSnapshot kept(mutex_);
  double time, blend;
  {
    const std::lock_guard lock(mutex_);
    if (!evaluated_.servo()) return;
    if (!evaluated_.is_held()) evaluated_.settle(false);  // what has faded out leaves its share
    const bool is_same = loop == seen_.loop && most == seen_.most && !seen_.is_any_moving;
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
  try {
    for (const Admitted& one : all) {
      seen.is_any_moving |= one.is_moving;
      const Objects::Bound bound = objects.bound(one.row, *one.object, one.bounds);
      if (!bound.has_changed) continue;
      has_changed = true;
      note_capped(*one.object, bound.before, bound.after, share.to_device);
    }
  } catch (...) {  // no memory
    evaluated_.changed();
    throw;
  }
  if (has_changed) evaluated_.changed();
  const auto wants = [](const Admitted& one) { return one.object->steepest_slope > 0 || one.object->damping > 0; };
  wants_stiffness_.store(std::any_of(all.begin(), all.end(), wants), std::memory_order_relaxed);
  if (is_newest) seen.sequence = evaluated_.sequence();
  seen_ = seen;
}

}  // namespace fs
