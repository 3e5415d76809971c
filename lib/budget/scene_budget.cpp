#include "budget/scene_budget.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <string_view>
#include <thread>
#include <utility>

#include "base/text.h"

namespace fs {
namespace {

constexpr double exact_every = 1;  // s
// The work between two pauses: a bound that is looked at and stays counts as 1, one that changes as 32.
constexpr size_t work_of_change = 32, portion = 256 * work_of_change;

Box widened(const Box& box, double by) { return {box.lower - Vec3{by, by, by}, box.upper + Vec3{by, by, by}}; }
bool is_within(const Box& box, const Box& whole) { return whole.is_empty() || (!box.is_empty() && box.is_inside(whole)); }
double size_of(const Box& box) { return norm(box.upper - box.lower); }

auto count_of(const Views& views) {
  return std::count_if(std::begin(views.rows), std::end(views.rows), [](const View& view) { return view.version != 0; });
}

}  // namespace

SceneBudget::SceneBudget(Ref<LocalScene> scene, const ServoReader& reader)
    : scene_(std::move(scene)), reader_(reader), mutex_(scene_->mutex_), evaluated_(scene_->evaluated_) {}

// What is bounded, and changes by more than a tenth, is told of each object: the first time at once, then after 1 s, 2 s, 4 s,
// up to 32 s. One of which there was nothing to tell for a minute begins anew.
void SceneBudget::note(const Object& object, double slope, double texture_part, double impact_lost, double to_device) {
  const bool takes_what_it_gets = object.is_solid() && object.contact.stiffness == 0;
  const bool is_bounded = slope < object.steepest_slope && !takes_what_it_gets;
  const double now = to_device * slope, wanted = to_device * object.steepest_slope;
  auto told = told_.find(object.name);
  if (told == told_.end()) {
    if (!is_bounded && !takes_what_it_gets && !(impact_lost > 0)) return;
    told = told_
               .emplace(object.name, Announcement{takes_what_it_gets ? now : wanted, now, -never, 0.5, wanted, takes_what_it_gets,
                                                  texture_part, 0, impact_lost})
               .first;
  }
  told->second.now = now;
  told->second.wanted = wanted;
  told->second.takes_what_it_gets = takes_what_it_gets;
  told->second.texture_part = texture_part;
  told->second.impact_lost_now = impact_lost;
  has_untold_ |= !told->second.is_told();
}

std::string SceneBudget::text_of(const Announcement& told) {
  const bool is_bounded = told.now < told.wanted;
  std::string out;
  if (told.takes_what_it_gets) {
    out = formatted("its contact gets %.4g N/m at the device", told.now);
  } else if (!is_bounded && told.impact_lost_now > 0) {
    out = formatted("its slope is %.4g N/m at the device", told.now);
  } else if (!is_bounded) {
    out = formatted("its slope is no longer bounded: %.4g N/m at the device", told.now);
  } else if (told.wanted < never) {
    out = formatted("its slope is bounded to %.4g N/m at the device, of %.4g", told.now, told.wanted);
  } else {
    out = formatted("its force jumps: its slope is bounded to %.4g N/m at the device", told.now);
  }
  const auto add_part = [&](double part, const char* what) { out += formatted(", with %.0f %% of its %s", 100 * part, what); };
  if (told.texture_part < 1) add_part(told.texture_part, "texture's heights");
  if (told.impact_lost_now >= 1) out += ", without its impact";
  else if (told.impact_lost_now > 0) add_part(1 - told.impact_lost_now, "impact at 0.3 m/s");
  return out;
}

void SceneBudget::tell(double time) {
  if (!has_untold_ || std::fabs(time - looked_at_) < 0.1) return;
  looked_at_ = time;
  if (std::fabs(time - events_since_) >= 1) {
    events_since_ = time;
    events_left_ = most_events;
  }
  if (events_left_ == 0) return;
  has_untold_ = false;
  for (auto each = told_.begin(); each != told_.end();) {
    auto& [name, told] = *each++;
    if (told.is_told()) continue;
    if (!evaluated_.objects.has(name)) {
      told_.erase(std::prev(each));
      continue;
    }
    has_untold_ = true;
    if (events_left_ == 0) return;
    const double since = std::fabs(time - told.time);
    if (since < told.wait) continue;
    fs_event event{};
    event.kind = FS_EVENT_CAPPED;
    event.time = time;
    event.value = told.now;
    name.copy(event.name, sizeof event.name - 1);
    const std::string text = text_of(told);
    text.copy(event.text, sizeof event.text - 1);
    const size_t size = std::min(text.size(), sizeof event.text - 1);
    constexpr std::string_view joint = "; it shares with ";
    const size_t room = sizeof event.text - 1 - size - std::min(joint.size(), sizeof event.text - 1 - size);
    const auto shared = sharing_ ? sharing_->find(name) : Sharing::const_iterator{};
    const std::string with = sharing_ && shared != sharing_->end() ? shared->second.text(room) : "";
    const std::string told_with = with.empty() ? "" : std::string(joint) + with;
    told_with.copy(event.text + size, sizeof event.text - 1 - size);
    evaluated_.events.push(event);
    --events_left_;
    told.slope = told.now;
    told.impact_lost = told.impact_lost_now;
    told.wait = since > 60 ? 1 : std::min(2 * told.wait, 32.0);
    told.time = time;
  }
}

void SceneBudget::take_max_stiffness() {
  const double blend = reader_.memory->spread.blend;
  // The objects that are there come with the next update.
  evaluated_.objects.rows.set_bounds(bounds_alone(scene_limit(*evaluated_.views.views(), seen_.limit, scene_->max_stiffness_,
                                                              blend, 0)));
}

// Where the tool may be before the next bounds are in use; empty: nobody knows. scene.ahead: s, until then.
//
// The hand is where the last tick saw it, goes on as fast as it does, and is quickened as much as a strong arm can, but is
// never faster than the speed at which the servo stops the force. If it stands still, that is 4 cm.
Box SceneBudget::reach_of_hand(const SceneLimit& scene, const DeviceLimit& limit, double time) {
  constexpr double hardest = 50;  // m/s2 of the device
  TickSample tick;
  const Views& views = *evaluated_.views.views();
  const View& view = views.now();
  if (!(limit.speed < never) || count_of(views) != 1 || !reader_.newest.read(tick) || !(tick.weight > 0) ||
      tick.view != view.version) {
    hand_time_ = never;
    been_.fill({});
    return {};
  }
  const double scale = view.frame.scale, span = scene.ahead + std::fmax(0, time - tick.time);
  speed_ = norm(tick.twist.linear);
  if (tick.time > hand_time_) speed_ = std::fmax(speed_, norm(tick.tool.position - hand_) / (tick.time - hand_time_));
  if (tick.time != hand_time_) hand_ = tick.tool.position;
  hand_time_ = tick.time;
  if (!(std::fabs(tick.time - been_since_) < been_for)) {
    std::copy_backward(been_.begin(), been_.end() - 1, been_.end());
    been_[0] = {};
    been_since_ = tick.time;
  }
  const double fastest = std::fmax(speed_, std::fmin(speed_ + 0.5 * scale * hardest * span, scale * limit.speed));
  Box out;
  out.add(tick.tool.position);
  out = widened(out, fastest * span + scene.arm);
  been_[0].add(out);
  return out;
}

// Whether bounds are to be worked out. reach: of the hand; within: for which they would be worked out.
bool SceneBudget::is_due(const DeviceLimit& limit, double most, const Box& reach, const Box& within, double time,
                         double rest) const {
  if (seen_.sequence == 0 || !(limit == seen_.limit) || most != seen_.most) return true;
  if (reach.is_empty() != seen_.within.is_empty() || !is_within(reach, seen_.clear)) return true;
  if (std::fabs(time - seen_.time) < std::fmax(0.035, rest)) return false;  // what objects do can wait so long
  const bool is_far_less = !reach.is_empty() && size_of(seen_.within) > 2 * size_of(within);
  // What the hand has left gives its part back to the others; looked at every `been_for` at most, because it costs time.
  const bool has_left = seen_.has_any && std::fabs(time - seen_.time) >= been_for && !reach.is_empty() &&
                        (!is_within(reach, seen_.within) || !is_within(seen_.within, widened(within, 0.25 * size_of(reach))));
  const bool is_to_be_exact = seen_.time != exact_at_ && time - exact_at_ >= exact_every;
  return evaluated_.sequence() != seen_.sequence || seen_.is_moving || is_far_less || has_left || is_to_be_exact || is_rising_;
}

// Lets go of what has faded out. Where none of it counted in the bounds that were worked out last, these stay valid.
void SceneBudget::settle() {
  const bool is_seen = evaluated_.sequence() == seen_.sequence && !seen_.has_fading;
  const auto views = count_of(*evaluated_.views.views());
  evaluated_.settle(false);
  if (is_seen && views == count_of(*evaluated_.views.views())) seen_.sequence = evaluated_.sequence();
}

bool SceneBudget::update(const DeviceLimit& limit, double ahead, double rest) {
  KeptSnapshot kept(mutex_);
  SceneLimit scene;
  double time;
  bool rises_at_once;
  Ref<const Memory> memory;
  {
    const std::lock_guard lock(mutex_);
    if (!is_at_work()) return false;
    if (!evaluated_.is_held()) settle();
    time = evaluated_.clock.now();
    memory = reader_.memory;
    const double blend = memory->spread.blend;
    const double most = scene_->max_stiffness_;
    scene = scene_limit(*evaluated_.views.views(), limit, most, blend, ahead + blend);
    const Box reach = reach_of_hand(scene, limit, time);
    const double size = 0.5 * (reach.upper.x - reach.lower.x), slack = std::clamp(speed_ * rest, 0.5 * size, size);
    Box within;
    if (!reach.is_empty()) {
      within = widened(reach, slack);
      // What the hand has left counts for a while, so that a bound which moves the hand does not come and go.
      for (const Box& been : been_) {
        if (!been.is_empty()) within.add(been);
      }
    }
    if (!is_due(limit, most, reach, within, time, rest)) {
      tell(time);
      return false;
    }
    // A held scene with edits that are not posted yet is skipped; after its next post this is called again.
    kept.snapshot = evaluated_.is_held() ? evaluated_.newest() : evaluated_.post_newest();
    if (!kept.snapshot) return false;
    if (!reach.is_empty()) scene.within = within;
    // Where nobody knew where the hand is nothing was felt. A limit that changes for all scenes is followed at once, as it does
    // not depend on where the hand is; and so is what the application asks for.
    rises_at_once = seen_.within.is_empty() || limit.whole != seen_.limit.whole || most != seen_.most;
    seen_ = {0, limit, most, time, false, false, false, within, {}};  // 0: until it is done
  }
  scene.ahead += 0.06;  // s: what moves is looked at anew less often
  const SceneBounds all = bounds_of(*kept.snapshot, scene, time, memory.get());
  seen_.has_fading = all.has_fading;
  seen_.has_any = !all.objects.empty();
  if (!seen_.within.is_empty()) seen_.clear = widened(seen_.within, std::min(all.clear, 1e9));

  Lock lock(mutex_);
  if (!is_at_work()) return true;
  // If edits came meanwhile, they are looked at later.
  const bool was_newest = evaluated_.newest() && evaluated_.sequence() == kept.snapshot->sequence;
  const bool is_newest = enter(all, scene, next_pace(rises_at_once), lock) && was_newest;
  if (!is_at_work()) return true;
  seen_.sequence = is_newest ? evaluated_.sequence() : kept.snapshot->sequence;
  tell(time);
  return true;
}

// A little more than is wanted, so that the limits of other scenes change seldom.
void SceneBudget::note_wanted(double wanted) noexcept {
  const double before = wanted_.load(std::memory_order_relaxed);
  if (wanted > before || wanted < 0.7 * before) wanted_.store(1.1 * wanted, std::memory_order_relaxed);
}

// Bounds are entered exactly once a second. They rise to twice as much in a quarter of a second, by steps of a seventh or more.
// at_once: they rise in full now.
Pace SceneBudget::next_pace(bool at_once) {
  const bool is_exact = !(std::fabs(seen_.time - exact_at_) < exact_every);
  if (is_exact) exact_at_ = seen_.time;
  constexpr double step = 0.05, doubling = 0.25;  // s
  const double since = std::fabs(seen_.time - rose_at_);
  double growth = 1;
  if (since >= step) {
    growth = std::exp2((is_rising_ ? std::min(since, 1.0) : step) / doubling);
    rose_at_ = seen_.time;
  }
  return {is_exact ? Pace::exact : 0.9, at_once ? never : growth};
}

// Leaves the lock to others for a moment. False: meanwhile they have changed something.
bool SceneBudget::give_way(Lock& lock) {
  const uint64_t sequence = evaluated_.sequence();
  lock.unlock();
  std::this_thread::sleep_for(std::chrono::microseconds(100));  // at once it would have the lock again before any that waits
  lock.lock();
  const bool is_alone = evaluated_.newest() && evaluated_.sequence() == sequence;
  if (is_at_work()) evaluated_.prepare();
  return is_alone;
}

// Has the servo evaluate these within their bounds. False: others have changed something meanwhile.
bool SceneBudget::enter(const SceneBounds& all, const SceneLimit& limit, const Pace& pace, Lock& lock) {
  evaluated_.prepare();
  Objects& objects = evaluated_.objects;
  if (scene_->max_stiffness_ == seen_.most) objects.rows.set_bounds(bounds_alone(limit));  // else they are set already
  auto sharing = std::make_shared<Sharing>();
  const fs_frame frame = evaluated_.views.frame();
  bool has_changed = false, wants = false, has_damping = false, is_alone = true;
  is_rising_ = false;
  // In portions, so that a call among many objects need not wait for all of them. Between two portions all objects together never
  // have more than is due, because what becomes less comes before what becomes more.
  size_t work = 0;
  const auto goes_on = [&] {
    if (work < portion) return true;
    work = 0;
    if (std::exchange(has_changed, false)) evaluated_.changed();
    is_alone &= give_way(lock);
    return is_at_work();
  };
  const auto enter_one = [&](const ObjectBounds& one, const Pace& its_pace) {
    const Objects::Bound bound = objects.bound(one.row, *one.object, one.bounds, its_pace);
    work += bound.has_changed ? work_of_change : 1;
    has_changed |= bound.has_changed;
    return bound;
  };
  try {
    if (all.objects.size() * work_of_change > portion) {
      for (const ObjectBounds& one : all.objects) {
        if (!goes_on()) return false;
        enter_one(one, {pace.least, 0});
      }
    }
    for (const ObjectBounds& one : all.objects) {
      if (!goes_on()) return false;
      seen_.is_moving |= one.is_moving;
      wants |= one.object->steepest_slope > 0;
      has_damping |= one.object->damping > 0 || (one.object->is_solid() && one.object->contact.damping > 0);
      const Objects::Bound bound = enter_one(one, pace);
      is_rising_ |= bound.is_rising;
      if (bound.object && !bound.is_rising && limit.to_device > 0) {
        const double lost = impact_lost(*bound.object, seen_.limit.impact, frame);
        note(*bound.object, bound.slope, bound.texture_part, lost, limit.to_device);
      }
      SharedWith with = one.shared_with;
      const bool takes_what_it_gets = one.object->is_solid() && one.object->contact.stiffness == 0;
      const bool is_less = takes_what_it_gets || (bound.object && bound.slope < bound.object->steepest_slope);
      with.has_clients = is_less && limit.is_split && !(seen_.most > 0 && seen_.most <= seen_.limit.stiffness);
      if (with.count > 0 || with.has_clients) sharing->emplace(one.object->name, std::move(with));
    }
  } catch (...) {  // no memory
    evaluated_.changed();
    throw;
  }
  if (has_changed) evaluated_.changed();
  sharing_ = std::move(sharing);
  note_wanted(wants ? all.wanted : 0);
  has_damping_.store(has_damping, std::memory_order_relaxed);
  if (told_.size() > most_told_) {
    most_told_ = 2 * told_.size();
    std::erase_if(told_, [&](const auto& told) { return !objects.has(told.first); });
  }
  return is_alone;
}

}  // namespace fs
