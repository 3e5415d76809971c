#include "scene/edits.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "base/serial.h"
#include "base/text.h"

namespace fs {
namespace {

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

// The number of a committed change: that of the group, or a new one where the object has been changed meanwhile.
uint64_t grown(uint64_t wanted, uint64_t felt) { return wanted >= felt ? wanted : next_serial(); }

std::string_view text_of(const char* name) { return {name, strnlen(name, 2 * FS_NAME_SIZE)}; }

void fail_unknown(std::string_view name) {
  fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object in the scene", shortened(name).c_str());
}

}  // namespace

Known* OpenGroup::find(std::string_view name) {
  const auto found = changes.find(name);
  return found == changes.end() ? nullptr : &found->second;
}

void OpenGroup::put(std::string_view name, const Known& wanted, bool is_new) {
  const auto found = changes.find(name);
  if (found != changes.end()) {
    const bool was_more = found->second.is_more_than_moved;
    const uint32_t parts = found->second.parts;
    found->second = wanted;
    found->second.is_more_than_moved |= was_more;
    found->second.parts |= parts;
    return;
  }
  const auto made = changes.try_emplace(std::string(name), wanted).first;
  try {
    order.push_back(&made->first);
  } catch (...) {
    changes.erase(made);
    throw;
  }
  added += is_new;
}

// ---------------------------------------------------------------------------------------- the scene as a group has it

bool Edits::find(std::string_view name, Known& out) const {
  if (const Known* const wanted = group_ ? group_->find(name) : nullptr) {
    out = *wanted;
    return !wanted->is_removed;
  }
  return evaluated_.objects.find(name, out);
}

Known Edits::require(const char* name, std::string* key) const {
  const std::string_view text = text_of(name);
  Known known;
  if (!find(text, known)) fail_unknown(text);
  if (key) *key = text;
  return known;
}

fs_frame Edits::frame() const { return group_ && group_->view.frame ? *group_->view.frame : evaluated_.views.frame(); }

const std::vector<Vec3>& Edits::tool() const {
  return group_ && group_->view.points ? *group_->view.points : evaluated_.views.now().tool->points;
}

bool Edits::is_held() const {
  return group_ && group_->view.held ? *group_->view.held : evaluated_.views.now().is_held;
}

// ------------------------------------------------------------------------------------------------------------- changes

void Edits::require_room(const std::vector<ParsedObject>& objects) const {
  size_t added = group_ ? group_->added : 0;
  for (const ParsedObject& object : objects) {
    const std::string& name = object.object->name;
    added += !evaluated_.objects.has_name(name) && !(group_ && group_->find(name));
  }
  evaluated_.objects.require_room(added, "would hold more than");
}

void Edits::put(const ParsedObject& parsed, uint32_t parts) {
  const Object& object = *parsed.object;
  const double time = evaluated_.clock.now();
  Known known;
  const bool is_known = find(object.name, known);  // false also where an object of this name still fades out
  if (!is_known) known = {};
  if (!is_known || (parsed.start != 0 && parsed.start != known.start)) {
    known.start_is_given = parsed.start != 0;
    known.start = parsed.start != 0 ? parsed.start : time;
  }
  known.object = parsed.object;
  known.revision = next_serial();
  known.expiry = expiry_of(object, time);
  if (parts & FS_PART_POSE) {
    known.track = {};
    known.motion = known.track.take(parsed.pose, &parsed.twist, parsed.time != 0 ? parsed.time : time);
  }
  known.parts = parts;
  put(object.name, known, true);
}

// Puts what an object is to be into the group, or makes it so at once.
void Edits::put(const std::string& name, Known& wanted, bool is_more_than_moved) {
  wanted.motion_revision = next_serial();
  wanted.is_more_than_moved = is_more_than_moved;
  Objects& objects = evaluated_.objects;
  const bool is_new = !objects.has_name(name) && !(group_ && group_->find(name));
  if (is_new) {
    const size_t others = group_ ? group_->added : 0;
    if (!objects.has_room(others + 1)) evaluated_.settle(true);
    objects.require_room(others + 1, "holds");
  }
  if (group_) {
    group_->put(name, wanted, is_new);
  } else {
    objects.take(name, wanted);
  }
}

void Edits::move(const char* name, const Pose& pose, const Twist* twist, double time) {
  const double now = evaluated_.clock.now();
  if (!group_) {
    if (!evaluated_.objects.move(text_of(name), pose, twist, time, now)) fail_unknown(text_of(name));
    return;
  }
  Known known = require(name);
  const Motion motion = known.track.take(pose, twist, time != 0 ? time : now);
  move_to(name, motion, known.track);
}

void Edits::move_to(const char* name, const Motion& motion, const Track& track) {
  std::string key;
  Known known = require(name, &key);
  known.motion = motion;
  known.track = track;
  known.expiry = expiry_of(*known.object, evaluated_.clock.now());
  known.parts = FS_PART_POSE;
  put(key, known, false);
}

bool Edits::move_to(const std::string& name, const Motion& motion, double now) {
  if (!group_) return evaluated_.objects.move_to(name, motion, now);
  Known known;
  if (!find(name, known)) return false;
  known.track.take(motion.pose, &motion.twist, motion.time);
  move_to(name.c_str(), motion, known.track);
  return true;
}

void Edits::remove(const char* name) {
  std::string key;
  Known known = require(name, &key);
  known.is_removed = true;
  known.parts = 0;
  known.expiry = never;
  put(key, known, true);
}

void Edits::clear() {
  std::vector<std::string> names;
  for_each([&](const std::string& name, const Known&) { names.push_back(name); });
  for (const std::string& name : names) remove(name.c_str());
}

void Edits::change_view(ViewChange change) {
  if (group_) {
    group_->view.add(std::move(change));
  } else {
    evaluated_.views.change(change);
  }
}

// --------------------------------------------------------------------------------------------------- groups

void Edits::begin() {
  if (group_) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  evaluated_.settle(true);
  group_ = std::make_unique<OpenGroup>();
}

void Edits::cancel() {
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_cancel: no group is open; fs_scene_begin opens one");
  group_ = nullptr;
}

bool Edits::commit(size_t most) {
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_commit: no group is open; fs_scene_begin opens one");
  if (group_->committed == 0) sort();
  const std::vector<const std::string*>& order = group_->order;
  for (size_t i = 0; i < most && group_->committed < order.size(); ++i) {
    const std::string& name = *order[group_->committed++];
    commit_one(name, *group_->find(name));
  }
  if (group_->committed < order.size()) return false;
  evaluated_.views.change(group_->view);
  group_ = nullptr;
  return true;
}

// Makes one object of a group or draft what is wanted, whatever has been changed there since.
void Edits::commit_one(const std::string& name, Known& wanted) {
  Objects& objects = evaluated_.objects;
  uint32_t number;
  if (const Row* const felt = objects.find_row(name, &number)) {
    wanted.motion_revision = grown(wanted.motion_revision, objects.rows.motion_revision(number));
    if (wanted.is_more_than_moved) wanted.revision = grown(wanted.revision, felt->revision);
  }
  objects.take(name, wanted);
}

// New objects come in an order in which those that lie together in space come together.
void Edits::sort() {
  if (group_->added < chunk_size) return;
  Objects& objects = evaluated_.objects;
  std::vector<const std::string*>& order = group_->order;
  const auto first = std::stable_partition(order.begin(), order.end(), [&](const auto* name) { return objects.has(*name); });
  std::vector<std::pair<uint64_t, const std::string*>> places;
  for (auto name = first; name != order.end(); ++name) {
    Known& wanted = *group_->find(**name);
    wanted.number = objects.last_number() + 1 + static_cast<uint32_t>(places.size());
    places.emplace_back(objects.rows.place_of(wanted), *name);
  }
  std::stable_sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::transform(places.begin(), places.end(), first, [](const auto& place) { return place.second; });
}

void Edits::shift(double by) noexcept {
  if (!group_) return;
  for (auto& [name, known] : group_->changes) {
    known.motion.time += by;
    if (by != 0) known.motion_revision = next_serial();
    known.track.shift(by);
    known.start += by;
    known.expiry += by;
  }
}

void Edits::take(OpenGroup& draft) {
  for (const std::string* name : draft.order) {
    Known wanted = *draft.find(*name), felt;
    if (!evaluated_.objects.find(*name, felt)) continue;  // it was removed meanwhile
    if (!(wanted.parts & FS_PART_POSE)) {
      wanted.motion = felt.motion;
      wanted.track = felt.track;
    }
    commit_one(*name, wanted);
  }
}

}  // namespace fs
