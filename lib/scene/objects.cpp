#include "scene/objects.h"

#include <algorithm>

#include "base/error.h"
#include "base/serial.h"
#include "base/text.h"

namespace fs {
namespace {

// The number of a change: its own, or a new one where the object has been changed since.
uint64_t grown(uint64_t wanted, uint64_t felt) { return wanted >= felt ? wanted : next_serial(); }

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

}  // namespace

fs_object to_c(const Known& known) {
  fs_object out = to_c(*known.object);
  out.pose = known.motion.pose;
  out.twist = known.motion.twist;
  out.time = known.motion.time;
  out.start = known.start;
  return out;
}

const Objects::Item* Objects::find_item(std::string_view name) const noexcept {
  const auto found = names_.find(name);
  return found == names_.end() || found->second.is_removed ? nullptr : &found->second;
}

const Row* Objects::find_row(std::string_view name, uint32_t* number) const noexcept {
  const Item* const item = find_item(name);
  if (!item) return nullptr;
  if (number) *number = item->row;
  return &rows.row(item->row);
}

bool Objects::find(std::string_view name, Known& out) const {
  const Item* const item = find_item(name);
  if (!item) return false;
  static_cast<Entry&>(out) = rows.entry(item->row);
  out.track = item->track ? *item->track : Track::of(out.motion);
  out.start_is_given = item->start_is_given;
  out.base = out.object;
  return true;
}

void fail_unknown(std::string_view name) {
  fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object in the scene", shortened(name).c_str());
}

Known Objects::require(std::string_view name) const {
  Known out;
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

// False when it was listed already.
bool Objects::list(const std::string& name, Item& item) {
  if (item.is_listed) return false;
  fading_.push_back(name);
  return item.is_listed = true;
}

// Replaces the expiry that is to be announced; one that was announced is no longer in the set.
void Objects::set_expiry(const std::string& name, double before, double after) {
  if (before == after) return;
  if (after < never) expiries_.emplace(after, name);
  if (before < never) expiries_.erase({before, name});
}

void Objects::take(std::string_view given, Known& wanted) {
  auto found = names_.find(given);
  const bool is_there = found != names_.end() && !found->second.is_removed;
  if (!is_there && (wanted.is_removed || wanted.parts != all_parts)) return;  // it is gone, and not set as a whole
  std::unique_ptr<Track> track;
  if (!wanted.is_removed && wanted.track.before.is_known) track = std::make_unique<Track>(wanted.track);
  if (found == names_.end()) {
    found = names_.try_emplace(std::string(given)).first;
    try {
      set_expiry(found->first, never, wanted.expiry);
      found->second.row = rows.add(wanted);
    } catch (...) {
      if (wanted.expiry < never) expiries_.erase({wanted.expiry, found->first});
      names_.erase(found);
      throw;
    }
    found->second.number = wanted.number ? wanted.number : last_number_ + 1;
    last_number_ = std::max(last_number_, found->second.number);
    found->second.start_is_given = wanted.start_is_given;
    found->second.track = std::move(track);
    return;
  }
  const std::string& name = found->first;
  Item& item = found->second;
  wanted.revision = grown(wanted.revision, rows.row(item.row).revision);
  wanted.motion_revision = grown(wanted.motion_revision, rows.motion_revision(item.row));
  const bool is_only_moved = !wanted.is_more_than_moved && !item.is_removed;
  const double before = item.is_removed ? never : rows.row(item.row).expiry;
  const double after = wanted.is_removed ? never : wanted.expiry;
  const bool is_newly_listed = !is_only_moved && list(name, item);  // something may fade out from now on
  const auto unlist = [&] {
    if (is_newly_listed) fading_.pop_back();
    if (is_newly_listed) item.is_listed = false;
  };
  set_expiry(name, before, after);
  try {
    if (wanted.is_removed) {
      item.row = rows.remove(item.row);
    } else if (is_only_moved) {
      rows.move(item.row, wanted.motion, wanted.expiry, wanted.motion_revision);
    } else {
      item.row = rows.set(item.row, wanted);
    }
  } catch (...) {
    if (before != after && after < never) expiries_.erase({after, name});
    unlist();
    throw;
  }
  if (item.row == no_row || !rows.is_fading(item.row)) unlist();
  removed_ += wanted.is_removed;
  removed_ -= item.is_removed;
  item.is_removed = wanted.is_removed;
  if (wanted.is_more_than_moved) item.start_is_given = wanted.start_is_given;
  item.track = std::move(track);
  if (item.row != no_row) return;
  removed_ -= item.is_removed;
  names_.erase(found);
}

bool Objects::move(std::string_view name, const Pose& pose, const Twist* twist, double time, double now) {
  return move(name, now, [&](Track& track) { return track.take(pose, twist, time != 0 ? time : now); });
}

bool Objects::move_to(std::string_view name, const Motion& motion, double now) {
  return move(name, now, [&](Track& track) {
    track.take(motion.pose, &motion.twist, motion.time);
    return motion;
  });
}

// take: enters the move in the object's track, and returns its motion.
template <class F>
bool Objects::move(std::string_view name, double now, F&& take) {
  const auto found = names_.find(name);
  if (found == names_.end() || found->second.is_removed) return false;
  Item& item = found->second;
  const Row& row = rows.row(item.row);
  if (!item.track) item.track = std::make_unique<Track>(Track::of(rows.motion(item.row)));
  Track track = *item.track;
  const Motion motion = take(track);
  const double before = row.expiry, after = expiry_of(*row.object, now);
  set_expiry(found->first, before, after);
  try {
    rows.move(item.row, motion, after, next_serial());
  } catch (...) {
    if (before != after && after < never) expiries_.erase({after, found->first});
    throw;
  }
  *item.track = track;
  return true;
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
    const bool was_fading = rows.is_fading(item.row);
    const uint32_t rest = was_fading ? rows.tidy(item.row) : item.row;
    if (rest == no_row) {
      removed_ -= item.is_removed;
      names_.erase(found);
      fading_.pop_front();
    } else if (!rows.is_fading(rest)) {
      item.is_listed = false;
      fading_.pop_front();
    } else {
      fading_.push_back(std::move(fading_.front()));
      fading_.pop_front();
      continue;
    }
    is_changed |= was_fading;
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

Objects::Shifted Objects::shifted(double shift) const {
  Shifted out{rows.shifted(shift), {}};
  for (const auto& [time, name] : expiries_) out.expiries.emplace(time + shift, name);
  return out;
}

void Objects::take(Shifted& shifted, double shift) noexcept {
  rows.take(shifted.rows);
  std::swap(expiries_, shifted.expiries);
  for (auto item = names_.begin(); item != names_.end();) {
    if (item->second.track) item->second.track->shift(shift);
    item->second.is_listed = false;
    item = item->second.is_removed ? names_.erase(item) : std::next(item);
  }
  removed_ = 0;
  fading_.clear();
}

}  // namespace fs
