// Objects, groups and drafts. Readers, servo and time: readers.cpp; frame, clutch and tool: view.cpp; reports: report.cpp.
#include "scene/local_scene.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "base/serial.h"

using namespace fs;

namespace {

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

// A number of what is wanted, in place of that of what is felt: it grows, also where that has changed meanwhile.
uint64_t grown(uint64_t wanted, uint64_t felt) { return wanted >= felt ? wanted : next_serial(); }

fs_object to_contract(const Known& known) {
  fs_object out = fs::to_c(*known.object);
  out.pose = known.motion.pose;
  out.twist = known.motion.twist;
  out.time = known.motion.time;
  out.start = known.start;
  return out;
}

void fail_unknown(std::string_view name) {
  fail(FS_ERROR_NOT_FOUND, "name is '%.*s': there is no such object in the scene", static_cast<int>(name.size()), name.data());
}

}  // namespace

LocalScene::LocalScene(std::shared_ptr<ServoOutput> the_output, ClockKind clock)
    : output(the_output ? std::move(the_output) : std::make_shared<ServoOutput>()),
      objects_(*output),
      views_(*output),
      clock_(*output, clock) {}

bool LocalScene::find(std::string_view name, Known& out) const {
  if (const Known* const wanted = group_ ? group_->find(name) : nullptr) {
    out = *wanted;
    return !wanted->is_removed;
  }
  return objects_.find(name, out);
}

Known LocalScene::require(const char* name, std::string* key) const {
  const std::string_view text(name, strnlen(name, 2 * FS_NAME_SIZE));
  Known known;
  if (!find(text, known)) fail_unknown(text);
  if (key) *key = text;
  return known;
}

// Puts a checked object in, or the parts of it that are named, into the object of its name.
void LocalScene::admit(const ParsedObject& parsed, uint32_t parts) {
  const Object& object = *parsed.object;
  const double time = now();
  if (builds_shapes_ && object.shape) object.shape->build();  // mostly it is, since parse_object

  Known known;
  const bool is_known = find(object.name, known);  // else the name is new, also where its last bearer still fades out
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
  put(object.name, known, true);
}

// Takes what an object shall be: into the group, or at once.
void LocalScene::put(const std::string& name, Known& wanted, bool is_more_than_moved) {
  wanted.motion_revision = next_serial();
  wanted.is_more_than_moved = is_more_than_moved;
  const bool is_new = is_more_than_moved && !objects_.has_name(name) && !(group_ && group_->find(name));
  if (is_new) {
    const size_t others = group_ ? group_->added : 0;
    if (!objects_.has_room(others + 1)) settle(true);
    objects_.require_room(others + 1, "holds");
  }
  if (group_) {
    group_->put(name, wanted, is_new);
  } else {
    objects_.take(name, wanted);
  }
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
      is_done = require(name.c_str(), nullptr).object == object;
      if (is_done) admit(parsed, parts);
    });
  }
  if (parts == 0) {
    const std::lock_guard lock(mutex_);
    require(name.c_str(), nullptr);
  }
}

// In an open group or a draft.
void LocalScene::move_in_group(const char* name, const Pose& pose, const Twist* twist, double time) {
  std::string key;
  Known known = require(name, &key);
  known.motion = known.track.take(pose, twist, time != 0 ? time : now());
  known.expiry = expiry_of(*known.object, now());
  put(key, known, false);
}

void LocalScene::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  mutate([&] {
    if (group_) return move_in_group(name, parsed, twist, time);
    const std::string_view text(name, strnlen(name, 2 * FS_NAME_SIZE));
    if (!objects_.move(text, parsed, twist, time, now())) fail_unknown(text);
  });
}

void LocalScene::remove_one(const char* name) {
  std::string key;
  Known known = require(name, &key);
  known.is_removed = true;
  known.expiry = never;
  put(key, known, true);
}

void LocalScene::remove(const char* name) {
  mutate([&] { remove_one(name); });
}

// Calls f(name, Known) for each object as an open group has it, in the order in which they came.
template <class F>
void LocalScene::for_each(F&& f) const {
  Known known;
  for (const std::string_view name : objects_.in_order()) {
    if (find(name, known)) f(std::string(name), known);
  }
  if (!group_) return;
  for (const std::string* name : group_->order) {
    if (!objects_.has(*name) && find(*name, known)) f(*name, known);
  }
}

void LocalScene::clear() {
  mutate([&] {
    std::vector<std::string> names;
    for_each([&](const std::string& name, const Known&) { names.push_back(name); });
    for (const std::string& name : names) remove_one(name.c_str());
  });
}

Movement LocalScene::movement(const char* name) const {
  const std::lock_guard lock(mutex_);
  const Known known = require(name, nullptr);
  return {known.motion, known.track};
}

void LocalScene::set_movement(const char* name, const Movement& movement) {
  mutate([&] {
    std::string key;
    Known known = require(name, &key);
    known.motion = movement.motion;
    known.track = movement.track;
    known.expiry = expiry_of(*known.object, now());
    put(key, known, false);
  });
}

size_t LocalScene::set_motions(const std::vector<Move>& moves) {
  size_t count = 0;
  mutate([&] {
    const double time = now();
    for (const auto& [name, motion] : moves) {
      if (!group_) {
        count += objects_.move_to(*name, motion, time);
        continue;
      }
      Known known;
      if (!find(*name, known)) continue;
      known.track.take(motion.pose, &motion.twist, motion.time);
      known.motion = motion;
      known.expiry = expiry_of(*known.object, time);
      put(*name, known, false);
      ++count;
    }
  });
  return count;
}

void LocalScene::set_motion(const std::string& name, const Motion& motion) {
  if (set_motions({{&name, motion}}) == 0) fail_unknown(name);
}

Ref<const Object> LocalScene::get(const char* name, fs_object& out) {
  const std::lock_guard lock(mutex_);
  const Known known = require(name, nullptr);
  out = to_contract(known);
  return known.object;
}

Scene::Contents LocalScene::contents() {
  const std::lock_guard lock(mutex_);
  Contents out;
  for_each([&](const std::string&, const Known& known) {
    fs_object object = to_contract(known);
    object.time = 0;
    if (!known.start_is_given) object.start = 0;
    out.objects.push_back(object);
    out.owners.push_back(known.object);
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
    size_t added = group_ ? group_->added : 0;
    for (const ParsedObject& object : parsed) {
      const std::string& name = object.object->name;
      added += !objects_.has_name(name) && !(group_ && group_->find(name));
    }
    objects_.require_room(added, "would hold more than");
    for (const ParsedObject& object : parsed) admit(object, all_parts);
    change_view({parsed_frame, tool, {}});
  });
}

// ----------------------------------------------------------------------------------------------------------- groups

void LocalScene::begin() {
  const std::lock_guard lock(mutex_);
  if (group_) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  settle(true);
  group_ = std::make_unique<OpenGroup>();
}

void LocalScene::commit() { commit(SIZE_MAX); }

// One object of a group or draft: to what is felt, whatever has changed there meanwhile.
void LocalScene::commit_one(const std::string& name, Known& wanted) {
  uint32_t number;
  if (const Row* const felt = objects_.find_row(name, &number)) {
    wanted.motion_revision = grown(wanted.motion_revision, objects_.rows.motion_revision(number));
    if (wanted.is_more_than_moved) wanted.revision = grown(wanted.revision, felt->revision);
  }
  objects_.take(name, wanted);
}

// New objects that lie together in space come together.
void LocalScene::sort_group() {
  if (group_->added < chunk_size) return;
  std::vector<const std::string*>& order = group_->order;
  const auto first = std::stable_partition(order.begin(), order.end(), [&](const auto* name) { return objects_.has(*name); });
  std::vector<std::pair<uint64_t, const std::string*>> places;
  for (auto name = first; name != order.end(); ++name) {
    Known& wanted = *group_->find(**name);
    wanted.number = objects_.last_number() + 1 + static_cast<uint32_t>(places.size());
    places.emplace_back(objects_.rows.place_of(wanted), *name);
  }
  std::stable_sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::transform(places.begin(), places.end(), first, [](const auto& place) { return place.second; });
}

bool LocalScene::commit(size_t most) {
  bool is_done = false;
  mutate([&] {
    if (!group_) fail(FS_ERROR_STATE, "fs_scene_commit: no group is open; fs_scene_begin opens one");
    if (group_->committed == 0) sort_group();
    const std::vector<const std::string*>& order = group_->order;
    for (size_t i = 0; i < most && group_->committed < order.size(); ++i) {
      const std::string& name = *order[group_->committed++];
      commit_one(name, *group_->find(name));
    }
    if (group_->committed < order.size()) return;
    views_.change(group_->view);
    group_ = nullptr;
    is_done = true;
  });
  return is_done;
}

void LocalScene::cancel() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_cancel: no group is open; fs_scene_begin opens one");
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
  Draft out;
  out.group_ = std::make_unique<OpenGroup>();
  return out;
}

void LocalScene::change(Draft& draft, const fs_object& change, uint32_t parts) {
  const std::string name = parse_name(change.name, "name");
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  const Known old = require(name.c_str(), nullptr);
  const ParsedObject parsed = parse_object(merge_parts(to_contract(old), change, parts), old.object.get(), builds_shapes_);
  admit(parsed, parts);
  group_->parts[name] |= parts;
}

void LocalScene::move(Draft& draft, const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  move_in_group(name, parsed, twist, time);
  group_->parts[name] |= FS_PART_POSE;
}

void LocalScene::remove(Draft& draft, const char* name) {
  const std::lock_guard lock(mutex_);
  const InDraft inside(*this, draft);
  remove_one(name);
  group_->parts.try_emplace(name, 0);
}

Ref<const Object> LocalScene::get(const Draft& draft, const char* name, fs_object& out) {
  const std::lock_guard lock(mutex_);
  const std::string_view text(name, strnlen(name, 2 * FS_NAME_SIZE));
  Known known;
  const Known* const wanted = draft.group_->find(text);
  if (wanted ? wanted->is_removed : !objects_.find(text, known)) fail_unknown(text);
  if (wanted) known = *wanted;
  out = to_contract(known);
  return known.object;
}

void LocalScene::take(Draft& draft) {
  mutate([&] {
    const OpenGroup& group = *draft.group_;
    for (const std::string* name : group.order) {
      Known wanted = *draft.group_->find(*name), felt;
      if (!objects_.find(*name, felt)) continue;  // it went meanwhile
      if (!(group.parts.find(*name)->second & FS_PART_POSE)) {
        wanted.motion = felt.motion;
        wanted.track = felt.track;
      }
      commit_one(*name, wanted);  // what the application's open group has changed stays as the group wants it
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
  objects_.set_capacity(capacity);
}

void LocalScene::hold() {
  const std::lock_guard lock(mutex_);
  is_held_ = true;
}

uint64_t LocalScene::sequence() const {
  const std::lock_guard lock(mutex_);
  return sequence_;
}

size_t LocalScene::object_count() const {
  const std::lock_guard lock(mutex_);
  size_t count = 0;
  if (!group_) return objects_.count();
  for_each([&](const std::string&, const Known&) { ++count; });
  return count;
}

bool LocalScene::is_empty() const {
  const std::lock_guard lock(mutex_);
  return objects_.is_empty() && !(group_ && group_->added);
}
