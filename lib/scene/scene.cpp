// Objects and groups. Snapshots, readers and fades: publish.cpp; servo and clock: clock.cpp; frame, clutch and tool:
// view.cpp; reports and events: report.cpp.
#include "scene/scene.h"

#include <cstring>

#include "base/error.h"

using namespace fs;

namespace {

constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

Ref<Entry> copy(const Entry& entry) { return make_ref<Entry>(entry); }

}  // namespace

// ---------------------------------------------------------------------------------------------------------- objects

const Entry* fs_scene::find(std::string_view name, uint32_t& slot) const {
  const auto found = slots_.find(name);
  if (found == slots_.end()) return nullptr;
  slot = found->second;
  return table_.get(slot);
}

const Entry& fs_scene::require(const char* name, uint32_t& slot) const {
  const size_t size = strnlen(name, 2 * FS_NAME_SIZE);
  const Entry* entry = find({name, size}, slot);
  if (!entry || entry->is_removed) {
    fail(FS_ERROR_NOT_FOUND, "name is '%.*s': there is no such object in the scene", static_cast<int>(size), name);
  }
  return *entry;
}

uint32_t fs_scene::take_slot() {
  if (!free_slots_.empty()) return *free_slots_.begin();
  if (slots_end_ == Table<Entry>::capacity) {
    fail(FS_ERROR_FULL, "the scene holds %u objects, its maximum", Table<Entry>::capacity);
  }
  return slots_end_++;
}

// The one place where the table changes; keeps the indexes beside it true, and the group's undo list.
void fs_scene::put(uint32_t slot, Ref<const Entry> entry) {
  const Ref<const Entry> before = Ref<const Entry>::share(table_.get(slot));
  if (group_) group_->undo.emplace_back(slot, before);
  if (before) {
    if (before->fade.expiry() < never) expiries_.erase({before->fade.expiry(), slot});
    if (before->previous || before->is_removed) fading_.erase(slot);
    if (!entry) {
      slots_.erase(before->object->name);
      free_slots_.insert(slot);
    }
  } else if (entry) {
    slots_[entry->object->name] = slot;
    free_slots_.erase(slot);
  }
  if (entry) {
    const double expiry = entry->fade.expiry();
    if (expiry < never && !entry->is_removed && expiry > now()) expiries_.insert({expiry, slot});
    if (entry->previous || entry->is_removed) fading_.insert(slot);
  }
  table_.set(slot, std::move(entry));
}

// Puts a checked object in, or the parts of it that are named, into the object of its name.
void fs_scene::admit(const ParsedObject& parsed, uint32_t parts) {
  const Object& object = *parsed.object;
  const double time = now();
  for (const Reader* reader : readers_) prepare_curves(object, reader->id.get());

  uint32_t slot;
  const Entry* old = find(object.name, slot);
  const bool is_known = old && !old->is_removed;  // else the name is new, also where its last bearer still fades out
  if (!old) slot = take_slot();

  Ref<Entry> entry = old ? copy(*old) : make_ref<Entry>();
  entry->object = parsed.object;
  entry->is_removed = false;
  entry->revision = ++revision_;
  if (!is_known || !entry->felt) entry->felt = make_ref<Felt>();
  if (!is_known || (parsed.start != 0 && parsed.start != old->start)) {
    entry->start_is_given = parsed.start != 0;
    entry->start = parsed.start != 0 ? parsed.start : time;
  }
  if (parts & FS_PART_POSE) {
    entry->track = {};
    entry->motion = entry->track.take(parsed.pose, &parsed.twist, parsed.time != 0 ? parsed.time : time);
  }

  const double expiry = expiry_of(object, time);
  if (!servo_) {
    entry->fade = Fade::steady(object.is_enabled, expiry);
  } else if (!old) {
    entry->fade = turned(Fade::steady(false), object.is_enabled, expiry);
  } else if (old->object->is_same_version(object)) {
    entry->fade = turned(old->fade, object.is_enabled, expiry);
  } else if (old->previous && old->previous->fade.weight(time, servo_->fade) > 0) {
    // At most one old version is kept: this one takes the place, and the weight, of the one that is fading in.
    entry->fade = turned(old->fade, object.is_enabled, expiry);
  } else {
    const Ref<Entry> previous = copy(*old);
    previous->fade = turned(old->fade, false, never);
    previous->previous = nullptr;
    previous->felt = nullptr;
    entry->previous = previous;
    entry->fade = turned(Fade::steady(false), object.is_enabled, expiry);
  }
  put(slot, entry);
}

void fs_scene::set(const fs_object& object) {
  const ParsedObject parsed = parse_object(object);
  const std::lock_guard lock(mutex_);
  settle(false);
  admit(parsed, all_parts);
  changed();
}

void fs_scene::change(const fs_object& change, uint32_t parts) {
  if (parts & ~all_parts) fail(FS_ERROR_INVALID, "parts is 0x%x, must be of the fs_part bits 0x%x", parts, all_parts);
  check_struct_size(change.struct_size, sizeof(fs_object), "fs_object");
  const std::string name = parse_name(change.name, "name");
  for (;;) {
    fs_object current;
    const Ref<const Object> object = get(name.c_str(), current);
    if (parts == 0) return;
    const ParsedObject parsed = parse_object(merge_parts(current, change, parts));  // may build a tree: not under the lock
    const std::lock_guard lock(mutex_);
    settle(false);
    uint32_t slot;
    if (!(require(name.c_str(), slot).object == object)) continue;  // another thread came between: once more
    admit(parsed, parts);
    changed();
    return;
  }
}

void fs_scene::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  const std::lock_guard lock(mutex_);
  settle(false);
  uint32_t slot;
  const Entry& old = require(name, slot);
  const Ref<Entry> entry = copy(old);
  const double present = now();
  entry->motion = entry->track.take(parsed, twist, time != 0 ? time : present);
  if (old.object->lifetime > 0) {
    entry->fade = turned(old.fade, old.object->is_enabled, expiry_of(*old.object, present));
  }
  put(slot, entry);
  changed();
}

void fs_scene::remove_slot(uint32_t slot) {
  const Entry& old = *table_.get(slot);
  if (old.is_removed) return;
  if (!servo_) return put(slot, nullptr);
  const Ref<Entry> entry = copy(old);
  entry->is_removed = true;
  entry->fade = turned(old.fade, false, never);
  put(slot, entry);
}

void fs_scene::remove(const char* name) {
  const std::lock_guard lock(mutex_);
  settle(false);
  uint32_t slot;
  require(name, slot);
  remove_slot(slot);
  changed();
}

void fs_scene::clear() {
  const std::lock_guard lock(mutex_);
  settle(false);
  std::vector<uint32_t> slots;
  table_.for_each([&](uint32_t slot, const Entry&) { slots.push_back(slot); });
  for (const uint32_t slot : slots) remove_slot(slot);
  changed();
}

fs_object fs_scene::to_c(const Entry& entry) const {
  fs_object out = fs::to_c(*entry.object);
  out.pose = entry.motion.pose;
  out.twist = entry.motion.twist;
  out.time = entry.motion.time;
  out.start = entry.start;
  return out;
}

Ref<const Object> fs_scene::get(const char* name, fs_object& out) const {
  const std::lock_guard lock(mutex_);
  uint32_t slot;
  const Entry& entry = require(name, slot);
  out = to_c(entry);
  return entry.object;
}

fs_scene::Contents fs_scene::contents() const {
  const std::lock_guard lock(mutex_);
  Contents out;
  table_.for_each([&](uint32_t, const Entry& entry) {
    if (entry.is_removed) return;
    fs_object object = to_c(entry);
    object.time = 0;
    if (!entry.start_is_given) object.start = 0;
    out.objects.push_back(object);
    out.owners.push_back(entry.object);
  });
  views_.view->get_frame(out.frame);
  out.tool = views_.view->points;
  return out;
}

void fs_scene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                            const std::vector<Vec3>& tool) {
  std::vector<ParsedObject> parsed;
  for (const fs_object& object : objects) parsed.push_back(parse_object(object));
  const fs_frame parsed_frame = parse_frame(frame);
  check_tool(tool.data(), tool.size());
  const std::lock_guard lock(mutex_);
  settle(false);
  size_t added = 0;
  for (const ParsedObject& object : parsed) added += !slots_.contains(object.object->name);
  if (added > Table<Entry>::capacity - slots_end_ + free_slots_.size()) {
    fail(FS_ERROR_FULL, "the scene would hold more than %u objects, its maximum", Table<Entry>::capacity);
  }
  for (const ParsedObject& object : parsed) admit(object, all_parts);
  apply_view(&parsed_frame, tool.data(), tool.size());
  changed();
}

// ----------------------------------------------------------------------------------------------------------- groups

void fs_scene::begin() {
  const std::lock_guard lock(mutex_);
  if (group_) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  settle(true);
  group_ = std::make_unique<Group>();
  group_->views = views_;
}

void fs_scene::commit() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_commit: no group is open; fs_scene_begin opens one");
  group_ = nullptr;
  changed();
}

void fs_scene::cancel() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_cancel: no group is open; fs_scene_begin opens one");
  const std::unique_ptr<Group> group = std::move(group_);
  for (auto undo = group->undo.rbegin(); undo != group->undo.rend(); ++undo) put(undo->first, undo->second);
  views_ = group->views;
  pending_epoch_ = nullptr;
  changed();
}
