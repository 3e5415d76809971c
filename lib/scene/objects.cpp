#include "scene/objects.h"

#include <algorithm>

#include "base/error.h"
#include "base/serial.h"
#include "base/text.h"

namespace fs {
namespace {

// The number of a change: its own, or a new one where the object has been changed since.
uint64_t later_revision(uint64_t wanted, uint64_t felt) { return wanted >= felt ? wanted : next_serial(); }

}  // namespace

fs_object to_c(const ObjectState& known) {
  fs_object out = to_c(*known.object);
  out.pose = known.motion.pose;
  out.twist = known.motion.twist;
  out.time = known.motion.time;
  out.start = known.start;
  return out;
}

const Item* Objects::find_item(std::string_view name) const noexcept {
  const auto found = names_.find(name);
  return found == names_.end() || found->second.is_removed ? nullptr : &found->second;
}

Named* Objects::find_named(std::string_view name, NameId id) noexcept {
  if (id.index < by_index_.size()) {
    Named* const named = by_index_[id.index];
    if (named && named->second.number == id.number) return named;
  }
  const auto found = names_.find(name);
  return found == names_.end() ? nullptr : &*found;
}

uint32_t Objects::row_of(std::string_view name, const ObjectState& known) noexcept {
  const Named* const named = find_named(name, known.id);
  return named && !named->second.is_removed ? named->second.row : no_row;
}

bool Objects::find(std::string_view name, ObjectState& out) {
  const auto found = names_.find(name);
  if (found == names_.end() || found->second.is_removed) return false;
  const Item& item = found->second;
  static_cast<Entry&>(out) = rows.entry(item.row);
  out.track = item.track ? *item.track : Track::of(out.motion);
  out.start_is_given = item.start_is_given;
  out.id = id_of(item);
  return true;
}

void fail_unknown(std::string_view name) {
  fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object in the scene", shortened(name).c_str());
}

ObjectState Objects::require(std::string_view name) {
  ObjectState out;
  if (!find(name, out)) fail_unknown(name);
  return out;
}

std::vector<std::string_view> Objects::in_order() const {
  std::vector<std::pair<uint32_t, std::string_view>> all;
  for (const auto& [name, item] : names_) {
    if (!item.is_removed) all.emplace_back(item.number, name);
  }
  std::sort(all.begin(), all.end());
  std::vector<std::string_view> out;
  for (const auto& [number, name] : all) out.push_back(name);
  return out;
}

void Objects::require_room(size_t more, const char* verb) const {
  if (has_room(more)) return;
  fail(FS_ERROR_FULL, "the scene %s its maximum of %u objects, including those that fade out", verb, capacity_);
}

void Objects::erase(const Named& named) noexcept {
  free_index(named.second);
  names_.erase(names_.find(named.first));
}

void Objects::free_index(const Item& item) noexcept {
  by_index_[item.index] = nullptr;
  free_indices_.push_back(item.index);
}

// False when it was listed already.
bool Objects::list(Named& named) {
  if (named.second.is_listed) return false;
  fading_.push_back(named.first);
  return named.second.is_listed = true;
}

// Takes back what list() has just done.
void Objects::unlist(Item& item, bool is_newly_listed) noexcept {
  if (!is_newly_listed) return;
  fading_.pop_back();
  item.is_listed = false;
}

// The expiries that are to be announced: the new one is noted before an object is changed, as that may fail, and the old one
// goes when it has been changed. One that was announced is no longer in the set.
void Objects::note_expiry(const std::string& name, double before, double after) {
  if (before != after && after < never) expiries_.emplace(after, name);
}
void Objects::drop_expiry(const std::string& name, double old, double kept) {
  if (old != kept && old < never) expiries_.erase({old, name});
}

NewName Objects::make_name(std::string_view name) {
  NameMap<Item> made;
  made.try_emplace(std::string(name));
  return made.extract(made.begin());
}

void Objects::take(std::string_view name, ObjectState& wanted, NewName new_name) {
  Named* const named = find_named(name, wanted.id);
  const bool is_there = named && !named->second.is_removed;
  if (!is_there && (wanted.is_removed || wanted.is_change)) return;  // it is gone
  wanted.motion_revision = next_serial();  // it is seen from now on, however long ago it was wanted
  if (!named) return add(new_name ? std::move(new_name) : make_name(name), wanted);
  Item& item = named->second;
  wanted.revision = later_revision(wanted.revision, rows.row(item.row).revision);
  if (!wanted.is_more_than_moved) return move(*named, wanted.track, wanted.motion, wanted.expiry, wanted.motion_revision);
  auto track = !wanted.is_removed && wanted.track.before.is_known ? std::make_unique<Track>(wanted.track) : nullptr;
  const double before = item.is_removed ? never : rows.row(item.row).expiry;
  const double after = wanted.is_removed ? never : wanted.expiry;
  const bool is_newly_listed = list(*named);  // something may fade out from now on
  try {
    note_expiry(named->first, before, after);
    item.row = wanted.is_removed ? rows.remove(item.row) : rows.set(item.row, wanted);
  } catch (...) {
    drop_expiry(named->first, after, before);
    unlist(item, is_newly_listed);
    throw;
  }
  drop_expiry(named->first, before, after);
  if (item.row == no_row || !rows.is_fading(item.row)) unlist(item, is_newly_listed);
  removed_ += wanted.is_removed;
  removed_ -= item.is_removed;
  item.is_removed = wanted.is_removed;
  item.start_is_given = wanted.start_is_given;
  item.track = std::move(track);
  if (item.row != no_row) return;
  removed_ -= item.is_removed;
  erase(*named);
}

void Objects::add(NewName name, const ObjectState& wanted) {
  Item& item = name.mapped();
  item.number = wanted.number ? wanted.number : last_number_ + 1;
  item.start_is_given = wanted.start_is_given;
  if (wanted.track.before.is_known) item.track = std::make_unique<Track>(wanted.track);
  if (free_indices_.empty()) {
    by_index_.push_back(nullptr);
    free_indices_.reserve(by_index_.capacity());
    free_indices_.push_back(static_cast<uint32_t>(by_index_.size() - 1));
  }
  Named& named = *names_.insert(std::move(name)).position;
  named.second.index = free_indices_.back();
  free_indices_.pop_back();
  by_index_[named.second.index] = &named;
  try {
    note_expiry(named.first, never, wanted.expiry);
    named.second.row = rows.add(wanted);
  } catch (...) {
    drop_expiry(named.first, wanted.expiry, never);
    erase(named);
    throw;
  }
  last_number_ = std::max(last_number_, named.second.number);
}

void Objects::move(Named& named, const Track& track, const Motion& motion, double expiry, uint64_t motion_revision) {
  auto& [name, item] = named;
  if (!item.track) item.track = std::make_unique<Track>(Track::of(rows.motion(item.row)));
  const double before = rows.row(item.row).expiry;
  const bool jumps = rows.is_jump(item.row, motion);
  const bool is_newly_listed = jumps && list(named);
  try {
    note_expiry(name, before, expiry);
    if (jumps) {
      Entry entry = rows.entry(item.row);
      entry.motion = motion;
      entry.expiry = expiry;
      entry.motion_revision = motion_revision;
      item.row = rows.set(item.row, entry);
    } else {
      rows.move(item.row, motion, expiry, motion_revision);
    }
  } catch (...) {
    drop_expiry(name, expiry, before);
    unlist(item, is_newly_listed);
    throw;
  }
  drop_expiry(name, before, expiry);
  if (!rows.is_fading(item.row)) unlist(item, is_newly_listed);
  *item.track = track;
}

bool Objects::move(std::string_view name, const Pose& pose, const Twist* twist, double time, double now) {
  return move(find_named(name, {}), now, [&](Track& track) { return track.take(pose, twist, time != 0 ? time : now); });
}

bool Objects::move_to(std::string_view name, NameId& id, const Motion& motion, double now) {
  Named* const named = find_named(name, id);
  if (named) id = id_of(named->second);
  return move(named, now, [&](Track& track) {
    track.take(motion.pose, &motion.twist, motion.time);
    return motion;
  });
}

// take: enters the move in the object's track, and returns its motion.
template <class F>
bool Objects::move(Named* named, double now, F&& take) {
  if (!named || named->second.is_removed) return false;
  const Item& item = named->second;
  Track track = item.track ? *item.track : Track::of(rows.motion(item.row));
  const Motion motion = take(track);
  move(*named, track, motion, expiry_of(*rows.row(item.row).object, now), next_serial());
  return true;
}

Objects::Bound Objects::bound(uint32_t row, const Object& object, const Bounds& bounds, const Pace& pace) {
  if (rows.is_bound(row, object, bounds, pace.least)) {  // the usual case, for which no name need be found
    const Object& felt = rows.row(row).as_felt(true);
    return {false, &object, felt.steepest_slope, felt.texture_part};
  }
  const auto found = names_.find(object.name);
  if (found == names_.end() || found->second.is_removed) return {};
  Item& item = found->second;
  const Object* const before = &rows.row(item.row).as_felt(true);
  const bool is_newly_listed = list(*found);
  bool is_rising = false;
  try {
    item.row = rows.bound(item.row, bounds, pace, is_rising);
  } catch (...) {
    unlist(item, is_newly_listed);
    throw;
  }
  if (!rows.is_fading(item.row)) unlist(item, is_newly_listed);
  const Row& now = rows.row(item.row);
  const Object& felt = now.as_felt(true);
  return {&felt != before, now.object.get(), felt.steepest_slope, felt.texture_part, is_rising};
}

bool Objects::tidy() {
  bool is_changed = false;
  const size_t count = std::min(fading_.size(), tidied_at_once);
  for (size_t k = 0; k < count; ++k) {
    const auto found = names_.find(fading_.front());
    if (found == names_.end()) {
      fading_.pop_front();
      continue;
    }
    Item& item = found->second;
    const uint32_t rest = rows.is_fading(item.row) ? rows.tidy(item.row, is_changed) : item.row;
    if (rest == no_row) {
      removed_ -= item.is_removed;
      erase(*found);
      fading_.pop_front();
    } else if (!rows.is_fading(rest)) {
      item.is_listed = false;
      fading_.pop_front();
    } else {
      fading_.push_back(std::move(fading_.front()));
      fading_.pop_front();
    }
  }
  return is_changed;
}

const std::string* Objects::next_expired(double time, double& expiry) {
  if (expiries_.empty() || expiries_.begin()->first > time) return nullptr;
  const auto first = expiries_.begin();
  expiry = first->first;
  const auto found = names_.find(first->second);
  expiries_.erase(first);
  return &found->first;
}

Objects::TimeShift Objects::shifted(double shift) const {
  TimeShift out{rows.shifted(shift), {}};
  for (const auto& [time, name] : expiries_) out.expiries.emplace(time + shift, name);
  return out;
}

void Objects::take(TimeShift& shifted, double shift) noexcept {
  rows.take(shifted.rows);
  std::swap(expiries_, shifted.expiries);
  for (auto item = names_.begin(); item != names_.end();) {
    if (item->second.track) item->second.track->shift(shift);
    item->second.is_listed = false;
    if (item->second.is_removed) {
      free_index(item->second);
      item = names_.erase(item);
    } else {
      ++item;
    }
  }
  removed_ = 0;
  fading_.clear();
}

}  // namespace fs
