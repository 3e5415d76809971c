// Objects and groups. Snapshots, readers and fades: publish.cpp; servo and clock: clock.cpp; frame, clutch and tool:
// view.cpp; reports and events: report.cpp.
#include "scene/local_scene.h"

#include <cstring>

#include "base/error.h"
#include "base/serial.h"

using namespace fs;

namespace {

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

Ref<Entry> copy(const Entry& entry) { return make_ref<Entry>(entry); }

// A number of what is wanted, in place of that of what is felt: it grows, also where that has changed meanwhile.
uint64_t grown(uint64_t wanted, uint64_t felt) { return wanted >= felt ? wanted : next_serial(); }

}  // namespace

LocalScene::LocalScene(std::shared_ptr<ServoOutput> the_output, ClockKind clock)
    : output(the_output ? std::move(the_output) : std::make_shared<ServoOutput>()), clock_(clock) {}

const Entry* LocalScene::find(std::string_view name, uint32_t& slot) const {
  const auto found = slots_.find(name);
  if (found == slots_.end()) return nullptr;
  slot = found->second;
  return working().get(slot);
}

const Entry& LocalScene::require(const char* name, uint32_t& slot) const {
  const size_t size = strnlen(name, 2 * FS_NAME_SIZE);
  const Entry* entry = find({name, size}, slot);
  if (!entry || entry->is_removed) {
    fail(FS_ERROR_NOT_FOUND, "name is '%.*s': there is no such object in the scene", static_cast<int>(size), name);
  }
  return *entry;
}

uint32_t LocalScene::free_slot() const {
  if (!free_slots_.empty()) return *free_slots_.begin();
  if (slots_end_ == capacity_) {
    fail(FS_ERROR_FULL, "the scene holds %u objects, those that fade out among them: its maximum", capacity_);
  }
  return slots_end_;
}

// Puts a checked object in, or the parts of it that are named, into the object of its name.
void LocalScene::admit(const ParsedObject& parsed, uint32_t parts) {
  const Object& object = *parsed.object;
  const double time = now();
  for (const Reader* reader : readers_) prepare_curves(object, reader->id);
  if (builds_shapes_ && object.shape) object.shape->build();  // mostly it is, since parse_object

  uint32_t slot;
  const Entry* old = find(object.name, slot);
  const bool is_known = old && !old->is_removed;  // else the name is new, also where its last bearer still fades out
  if (!old) {
    if (free_slots_.empty() && slots_end_ == capacity_) settle(true);
    slot = free_slot();
  }

  const Ref<Entry> entry = is_known ? copy(*old) : make_ref<Entry>();
  entry->object = parsed.object;
  entry->revision = next_serial();
  entry->expiry = expiry_of(object, time);
  if (!is_known) entry->felt = make_ref<Felt>();
  if (!is_known || (parsed.start != 0 && parsed.start != old->start)) {
    entry->start_is_given = parsed.start != 0;
    entry->start = parsed.start != 0 ? parsed.start : time;
  }
  if (parts & FS_PART_POSE) {
    entry->track = {};
    entry->motion = entry->track.take(parsed.pose, &parsed.twist, parsed.time != 0 ? parsed.time : time);
  }
  put(slot, entry, true);
}

void LocalScene::move_entry(uint32_t slot, const Entry& old, const fs_pose& pose, const fs_twist* twist, double time) {
  const Ref<Entry> entry = copy(old);
  const double present = now();
  entry->motion = entry->track.take(pose, twist, time != 0 ? time : present);
  entry->expiry = expiry_of(*old.object, present);
  put(slot, entry, old.object->lifetime > 0);
}

void LocalScene::remove_entry(uint32_t slot, const Entry& old) {
  if (old.is_removed) return;
  const Ref<Entry> entry = copy(old);
  entry->is_removed = true;
  entry->expiry = never;
  put(slot, entry, true);
}

// Takes what an entry shall be: into the group, or at once through the fade that it needs.
void LocalScene::put(uint32_t slot, Ref<Entry> entry, bool is_more_than_moved) {
  entry->motion_revision = next_serial();
  const bool is_new = !working().get(slot);
  const bool is_first_touch = group_ && !group_->touched.contains(slot);
  if (is_new) slots_.insert_or_assign(entry->object->name, slot);
  try {
    if (group_) {
      group_->touched[slot] |= is_more_than_moved;
      group_->table.set(slot, entry);
    } else {
      store(slot, is_more_than_moved ? transit(table_.get(slot), *entry) : Ref<const Entry>(entry));
    }
  } catch (...) {
    if (is_first_touch) group_->touched.erase(slot);
    if (is_new) slots_.erase(entry->object->name);
    throw;
  }
  if (!is_new) return;
  free_slots_.erase(slot);
  if (slot == slots_end_) ++slots_end_;
}

// How what is felt becomes what is wanted: without a step. Null: at once gone.
Ref<const Entry> LocalScene::transit(const Entry* felt, const Entry& wanted) {
  const bool in = wanted.object->is_enabled && !wanted.is_removed;
  if (!servo_ || !felt) {
    if (wanted.is_removed) return nullptr;
    const Ref<Entry> entry = copy(wanted);
    entry->previous = nullptr;
    entry->fade = servo_ ? turned(Fade::steady(false), in, wanted.expiry) : Fade::steady(in, wanted.expiry);
    return entry;
  }
  const double time = now();
  const bool is_tailed = felt->previous && felt->previous->fade.weight(time, servo_->fade) > 0;
  const Ref<Entry> entry = copy(wanted.is_removed ? *felt : wanted);
  entry->is_removed = wanted.is_removed;
  entry->expiry = wanted.expiry;
  if (wanted.is_removed || is_tailed || felt->object->is_same_version(*wanted.object)) {
    // The same object, out or in. Also of another version while one fades out behind it: at most one old version is kept,
    // so this one takes the place, and the weight, of the one that is fading in.
    entry->previous = felt->previous;
    entry->fade = turned(felt->fade, in, wanted.expiry);
  } else {
    const Ref<Entry> previous = copy(*felt);
    previous->fade = turned(felt->fade, false, never);
    previous->previous = nullptr;
    previous->felt = nullptr;
    entry->previous = previous;
    entry->fade = turned(Fade::steady(false), in, wanted.expiry);
  }
  if (entry->is_removed || entry->previous) entry->tidy_at = time + servo_->fade;
  return entry;
}

// The one place where the table changes, and the indexes beside it. What can fail is done first.
void LocalScene::store(uint32_t slot, Ref<const Entry> entry) {
  using Key = std::pair<double, uint32_t>;
  const Ref<const Entry> before = Ref<const Entry>::share(table_.get(slot));
  const Key old_tidy{before ? before->tidy_at : never, slot}, old_expiry{before ? before->expiry : never, slot};
  const Key tidy{entry ? entry->tidy_at : never, slot}, expiry{entry ? entry->expiry : never, slot};
  // An expiry that has been announced is so no more than once.
  const bool is_to_announce = expiry.first < never && (expiry != old_expiry || expiries_.contains(old_expiry));
  const bool is_new_tidy = tidy.first < never && tidies_.insert(tidy).second;
  bool is_new_expiry = false;
  try {
    is_new_expiry = is_to_announce && expiries_.insert(expiry).second;
    if (!entry) free_slots_.insert(slot);
    table_.set(slot, entry);
  } catch (...) {
    if (is_new_tidy) tidies_.erase(tidy);
    if (is_new_expiry) expiries_.erase(expiry);
    if (!entry) free_slots_.erase(slot);
    throw;
  }
  posted_ = nullptr;  // also where what comes next fails: the newest snapshot is to have what the table has
  if (old_tidy != tidy) tidies_.erase(old_tidy);
  if (old_expiry != expiry) expiries_.erase(old_expiry);
  if (before && !entry) slots_.erase(before->object->name);
}

void LocalScene::set(const fs_object& object) {
  const ParsedObject parsed = parse_object(object, nullptr, builds_shapes_);
  mutate([&] { admit(parsed, all_parts); });
}

void LocalScene::change(const fs_object& change, uint32_t parts) {
  parse_parts(parts);
  check_struct_size(change.struct_size, sizeof(fs_object), "fs_object");
  const std::string name = parse_name(change.name, "name");
  for (bool is_done = parts == 0; !is_done;) {
    fs_object current;
    const Ref<const Object> object = get(name.c_str(), current);
    // May build a tree, so not under the lock; when another thread comes between, once more.
    const ParsedObject parsed = parse_object(merge_parts(current, change, parts), object.get(), builds_shapes_);
    mutate([&] {
      uint32_t slot;
      is_done = require(name.c_str(), slot).object == object;
      if (is_done) admit(parsed, parts);
    });
  }
  if (parts == 0) {
    const std::lock_guard lock(mutex_);
    uint32_t slot;
    require(name.c_str(), slot);
  }
}

void LocalScene::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  mutate([&] {
    uint32_t slot;
    const Entry& old = require(name, slot);
    move_entry(slot, old, parsed, twist, time);
  });
}

void LocalScene::remove(const char* name) {
  mutate([&] {
    uint32_t slot;
    const Entry& old = require(name, slot);
    remove_entry(slot, old);
  });
}

void LocalScene::clear() {
  mutate([&] {
    std::vector<uint32_t> slots;
    working().for_each([&](uint32_t slot, const Entry&) { slots.push_back(slot); });
    for (const uint32_t slot : slots) remove_entry(slot, *working().get(slot));
  });
}

fs_object LocalScene::to_c(const Entry& entry) const {
  fs_object out = fs::to_c(*entry.object);
  out.pose = entry.motion.pose;
  out.twist = entry.motion.twist;
  out.time = entry.motion.time;
  out.start = entry.start;
  return out;
}

Movement LocalScene::movement(const char* name) const {
  const std::lock_guard lock(mutex_);
  uint32_t slot;
  const Entry& entry = require(name, slot);
  return {entry.motion, entry.track};
}

void LocalScene::set_movement(const char* name, const Movement& movement) {
  mutate([&] {
    uint32_t slot;
    const Entry& old = require(name, slot);
    const Ref<Entry> entry = copy(old);
    entry->motion = movement.motion;
    entry->track = movement.track;
    entry->expiry = expiry_of(*old.object, now());
    put(slot, entry, old.object->lifetime > 0);
  });
}

void LocalScene::set_motion(const char* name, const Motion& motion) {
  mutate([&] {
    uint32_t slot;
    const Entry& old = require(name, slot);
    const Ref<Entry> entry = copy(old);
    entry->track.take(motion.pose, &motion.twist, motion.time);
    entry->motion = motion;
    const bool has_lifetime = old.object->lifetime > 0;
    if (has_lifetime) entry->expiry = expiry_of(*old.object, now());
    put(slot, entry, has_lifetime);
  });
}

Ref<const Object> LocalScene::get(const char* name, fs_object& out) {
  const std::lock_guard lock(mutex_);
  uint32_t slot;
  const Entry& entry = require(name, slot);
  out = to_c(entry);
  return entry.object;
}

Scene::Contents LocalScene::contents() {
  const std::lock_guard lock(mutex_);
  Contents out;
  working().for_each([&](uint32_t, const Entry& entry) {
    if (entry.is_removed) return;
    fs_object object = to_c(entry);
    object.time = 0;
    if (!entry.start_is_given) object.start = 0;
    out.objects.push_back(object);
    out.owners.push_back(entry.object);
  });
  out.frame = present_frame();
  out.tool = present_tool();
  return out;
}

void LocalScene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                            const std::vector<Vec3>& tool) {
  std::vector<ParsedObject> parsed;
  for (const fs_object& object : objects) {
    try {
      parsed.push_back(parse_object(object, nullptr, builds_shapes_));
    } catch (Error& error) {  // by its place, where its name is what is wrong
      if (!error.text.starts_with("object")) error.text = "object " + std::to_string(parsed.size() + 1) + ": " + error.text;
      throw;
    }
  }
  const fs_frame parsed_frame = parse_frame(frame);
  check_tool(tool.data(), tool.size());
  mutate([&] {
    size_t added = 0;
    for (const ParsedObject& object : parsed) added += !slots_.contains(object.object->name);
    if (added > capacity_ - slots_end_ + free_slots_.size()) {
      fail(FS_ERROR_FULL, "the scene would hold more than %u objects, its maximum", capacity_);
    }
    for (const ParsedObject& object : parsed) admit(object, all_parts);
    change_view({parsed_frame, tool, {}});
  });
}

// ----------------------------------------------------------------------------------------------------------- groups

void LocalScene::begin() {
  const std::lock_guard lock(mutex_);
  if (group_) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  settle(true);
  group_ = std::make_unique<Group>();
  group_->table = table_;
}

void LocalScene::commit() { commit(SIZE_MAX); }

bool LocalScene::commit(size_t most) {
  bool is_done = false;
  mutate([&] {
    if (!group_) fail(FS_ERROR_STATE, "fs_scene_commit: no group is open; fs_scene_begin opens one");
    std::map<uint32_t, bool>& touched = group_->touched;
    auto next = group_->committed ? touched.upper_bound(*group_->committed) : touched.begin();
    for (size_t i = 0; i < most && next != touched.end(); ++i, ++next) {
      const auto& [slot, is_more_than_moved] = *next;
      group_->committed = slot;
      const Entry* felt = table_.get(slot);
      const Entry& wanted = *group_->table.get(slot);
      if (!felt && wanted.is_removed) continue;  // came and went
      if (!felt) {
        store(slot, transit(felt, wanted));
      } else if (is_more_than_moved) {
        const Ref<Entry> entry = copy(wanted);
        entry->revision = grown(wanted.revision, felt->revision);
        entry->motion_revision = grown(wanted.motion_revision, felt->motion_revision);
        store(slot, transit(felt, *entry));
      } else {
        const Ref<Entry> entry = copy(*felt);
        entry->motion = wanted.motion;
        entry->track = wanted.track;
        entry->motion_revision = grown(wanted.motion_revision, felt->motion_revision);
        store(slot, entry);
      }
    }
    if (next != touched.end()) return;
    transit_view(group_->view);
    forget_new_names();
    group_ = nullptr;
    is_done = true;
  });
  return is_done;
}

void LocalScene::cancel() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_cancel: no group is open; fs_scene_begin opens one");
  forget_new_names();
  group_ = nullptr;
}

// ----------------------------------------------------------------------------------------------------------- drafts

// Under the lock: the changes that follow go into the draft, as if it were the open group.
struct LocalScene::InDraft {
  InDraft(LocalScene& the_scene, Draft& the_draft) : scene(the_scene), draft(the_draft) { std::swap(scene.group_, draft.group_); }
  ~InDraft() { std::swap(scene.group_, draft.group_); }
  LocalScene& scene;
  Draft& draft;
};

LocalScene::Draft LocalScene::draft() {
  const std::lock_guard lock(mutex_);
  Draft out;
  out.group_ = std::make_unique<Group>();
  out.group_->table = table_;
  return out;
}

void LocalScene::change(Draft& draft, const fs_object& change, uint32_t parts) {
  const std::string name = parse_name(change.name, "name");
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  uint32_t slot;
  const Entry& old = require(name.c_str(), slot);
  const ParsedObject parsed = parse_object(merge_parts(to_c(old), change, parts), old.object.get(), builds_shapes_);
  admit(parsed, parts);
  draft.parts_[slot] |= parts;
}

void LocalScene::move(Draft& draft, const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  uint32_t slot;
  const Entry& old = require(name, slot);
  move_entry(slot, old, parsed, twist, time);
  draft.parts_[slot] |= FS_PART_POSE;
}

void LocalScene::remove(Draft& draft, const char* name) {
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  uint32_t slot;
  const Entry& old = require(name, slot);
  remove_entry(slot, old);
  draft.parts_.try_emplace(slot, 0);
}

Ref<const Object> LocalScene::get(const Draft& draft, const char* name, fs_object& out) {
  const std::lock_guard lock(mutex_);
  const auto found = slots_.find(std::string_view(name));
  const Entry* entry = found == slots_.end() ? nullptr : draft.group_->table.get(found->second);
  if (!entry || entry->is_removed) fail(FS_ERROR_NOT_FOUND, "name is '%.80s': there is no such object in the scene", name);
  out = to_c(*entry);
  return entry->object;
}

void LocalScene::take(Draft& draft) {
  mutate([&] {
    for (const auto& [slot, is_more_than_moved] : draft.group_->touched) {
      const Entry* felt = table_.get(slot);
      const Entry& wanted = *draft.group_->table.get(slot);
      if (!felt || felt->is_removed || felt->object->name != wanted.object->name) continue;  // it went meanwhile
      const Ref<Entry> entry = copy(is_more_than_moved ? wanted : *felt);
      const Entry& mover = draft.parts_.at(slot) & FS_PART_POSE ? wanted : *felt;
      entry->motion = mover.motion;
      entry->track = mover.track;
      entry->revision = grown(entry->revision, felt->revision);
      entry->motion_revision = grown(wanted.motion_revision, felt->motion_revision);
      store(slot, is_more_than_moved ? transit(felt, *entry) : Ref<const Entry>(entry));
      if (!group_ || group_->touched.contains(slot)) continue;
      group_->table.set(slot, Ref<const Entry>::share(table_.get(slot)));
    }
    if (group_) changed();  // what is evaluated has changed, beside the group
  });
}

void LocalScene::discard(Draft& draft) noexcept {
  const std::lock_guard lock(mutex_);
  draft.group_ = nullptr;
}

void LocalScene::set_capacity(uint32_t capacity) {
  const std::lock_guard lock(mutex_);
  capacity_ = capacity;
}

void LocalScene::hold() {
  const std::lock_guard lock(mutex_);
  is_held_ = true;
}

void LocalScene::post() {
  const std::lock_guard lock(mutex_);
  newest();
  for (Reader* reader : readers_) reader->mailbox.tidy();
}

uint64_t LocalScene::sequence() const {
  const std::lock_guard lock(mutex_);
  return sequence_;
}

// Of names that came with the group, those that did not get into the scene. All that can fail is done first.
void LocalScene::forget_new_names() {
  std::set<uint32_t> freed;
  for (const auto& [slot, is_more_than_moved] : group_->touched) {
    if (!table_.get(slot)) freed.insert(slot);
  }
  for (const uint32_t slot : freed) slots_.erase(group_->table.get(slot)->object->name);
  free_slots_.merge(freed);
}
