#include "scene/edits.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "base/error.h"
#include "base/serial.h"

namespace fs {
namespace {

std::string_view text_of(const char* name) { return {name, strnlen(name, 2 * FS_NAME_SIZE)}; }

void refuse_solid_mesh(const Object& object, double radius) {
  if (!(radius > 0) || !object.is_solid() || object.primitive != FS_PRIMITIVE_MESH) return;
  fail(FS_ERROR_UNSUPPORTED,
       "'%s' is a solid mesh, and the tool's points have a radius of %.9g m: a solid mesh can hold points of radius 0 only",
       object.name.c_str(), radius);
}

}  // namespace

ObjectState* OpenGroup::find(std::string_view name) {
  const auto found = changes.find(name);
  return found == changes.end() ? nullptr : &found->second;
}

void OpenGroup::put(std::string_view name, ObjectState wanted, bool is_new) {
  auto entry = changes.lower_bound(name);
  if (entry != changes.end() && entry->first == name) {
    wanted.is_more_than_moved |= entry->second.is_more_than_moved;
    wanted.parts |= entry->second.parts;
    wanted.is_change &= entry->second.is_change;
    entry->second = std::move(wanted);
    return;
  }
  entry = changes.emplace_hint(entry, name, std::move(wanted));
  try {
    order.push_back(&*entry);
  } catch (...) {
    changes.erase(entry);
    throw;
  }
  added += is_new;
}

void OpenGroup::shift(double by) noexcept {
  for (auto& [name, known] : changes) {
    known.motion.time += by;
    if (by != 0) known.motion_revision = next_serial();
    known.track.shift(by);
    known.start += by;
    known.expiry += by;
  }
}

// ---------------------------------------------------------------------------------------- the scene as a group has it

bool Edits::find(std::string_view name, ObjectState& out) const {
  if (const ObjectState* const wanted = group_ ? group_->find(name) : nullptr) {
    out = *wanted;
    return !wanted->is_removed;
  }
  return evaluated_.objects.find(name, out);
}

ObjectState Edits::require(std::string_view name) const {
  ObjectState known;
  if (!find(name, known)) fail_unknown(name);
  return known;
}

ObjectState Edits::require(const char* name) const { return require(text_of(name)); }

fs_frame Edits::frame() const { return group_ && group_->view.frame ? *group_->view.frame : evaluated_.views.frame(); }

const std::vector<Vec3>& Edits::tool() const {
  return group_ && group_->view.points ? *group_->view.points : evaluated_.views.now().tool->points;
}

double Edits::tool_radius() const {
  return group_ && group_->view.point_radius ? *group_->view.point_radius : evaluated_.views.now().tool->point_radius;
}

size_t Edits::count() const {
  if (!group_) return evaluated_.objects.count();
  size_t count = 0;
  for_each([&](const std::string&, const ObjectState&) { ++count; });
  return count;
}

fs_view Edits::view(bool with_group) const {
  const ViewRows& views = evaluated_.views;
  fs_view out{};
  out.frame = with_group ? frame() : views.frame();
  const std::vector<Vec3>& points = with_group ? tool() : views.now().tool->points;
  std::copy(points.begin(), points.end(), out.points);
  out.point_count = static_cast<uint32_t>(points.size());
  out.point_radius = with_group ? tool_radius() : views.now().tool->point_radius;
  out.held = with_group && group_ && group_->view.held ? *group_->view.held : views.now().is_held;
  HandSample hand;
  out.tool = evaluated_.servo() && evaluated_.output->hand.read(hand) ? hand.state.pose : identity_pose();
  views.get_held(out.tool);
  return out;
}

// ------------------------------------------------------------------------------------------------------------- changes

void Edits::require_room(const std::vector<ParsedObject>& objects) {
  size_t added = group_ ? group_->added : 0;
  for (const ParsedObject& object : objects) {
    const std::string& name = object.object->name;
    added += !evaluated_.objects.has_name(name) && !(group_ && group_->find(name));
  }
  if (evaluated_.objects.has_room(added)) return;
  evaluated_.settle_all();
  evaluated_.objects.require_room(added, "would hold more than");
}

void Edits::require_room() {
  assert(group_);
  Objects& objects = evaluated_.objects;
  if (objects.has_room(group_->order.size())) return;
  const auto added =
      static_cast<size_t>(std::count_if(group_->order.begin(), group_->order.end(), [&](OpenGroup::Change* change) {
        return !change->second.is_removed && !objects.has_name(change->first);
      }));
  if (objects.has_room(added)) return;
  evaluated_.settle_all();
  objects.require_room(added, "would hold more than");
}

void Edits::refuse_solid_meshes(double radius, const std::vector<ParsedObject>& objects) const {
  if (!(radius > 0)) return;
  for (const ParsedObject& object : objects) refuse_solid_mesh(*object.object, radius);
  for_each([&](const std::string&, const ObjectState& known) { refuse_solid_mesh(*known.object, radius); });
}

void Edits::put(const ParsedObject& parsed, uint32_t parts, bool is_change) {
  const Object& object = *parsed.object;
  refuse_solid_mesh(object, tool_radius());
  const double time = evaluated_.clock.now();
  ObjectState known;
  const bool is_known = find(object.name, known);  // false also where an object of this name still fades out
  if (!is_known) known = {};
  if (!is_known || (parsed.start != 0 && parsed.start != known.start)) {
    known.start_is_given = parsed.start != 0;
    known.start = parsed.start != 0 ? parsed.start : time;
  }
  if (!known.base) known.base = known.object;
  known.object = parsed.object;
  known.revision = next_serial();
  known.expiry = expiry_of(object, time);
  if (parts & FS_PART_POSE) {
    known.track = {};
    known.motion = known.track.take(parsed.pose, &parsed.twist, parsed.time != 0 ? parsed.time : time);
  }
  known.parts = parts;
  known.is_change = is_change;
  put(object.name, std::move(known), true, is_known);
}

// Puts what an object is to be into the group, or makes it so at once.
void Edits::put(std::string_view name, ObjectState wanted, bool is_more_than_moved, bool is_known) {
  if (group_) wanted.motion_revision = next_serial();  // another comes with the commit
  wanted.is_more_than_moved = is_more_than_moved;
  Objects& objects = evaluated_.objects;
  const bool is_new = !is_known && !objects.has_name(name) && !(group_ && group_->find(name));
  if (const size_t more = group_ ? group_->added + 1 : 1; is_new && !objects.has_room(more)) {
    evaluated_.settle(true);
    objects.require_room(more, "holds");
  }
  if (group_) {
    group_->put(name, std::move(wanted), is_new);
  } else {
    objects.take(name, wanted);
  }
}

void Edits::move(const char* given, const Pose& pose, const Twist* twist, double time) {
  const std::string_view name = text_of(given);
  const double now = evaluated_.clock.now();
  if (!group_) {
    if (!evaluated_.objects.move(name, pose, twist, time, now)) fail_unknown(name);
    return;
  }
  ObjectState known = require(name);
  known.motion = known.track.take(pose, twist, time != 0 ? time : now);
  put_moved(name, std::move(known), now);
}

void Edits::set_movement(const char* given, const Motion& motion, const Track& track) {
  const std::string_view name = text_of(given);
  ObjectState known = require(name);
  known.motion = motion;
  known.track = track;
  put_moved(name, std::move(known), evaluated_.clock.now());
}

bool Edits::move_to(const std::string& name, const Motion& motion, double now) {
  NameId unknown;
  if (!group_) return evaluated_.objects.move_to(name, unknown, motion, now);
  ObjectState known;
  if (!find(name, known)) return false;
  known.track.take(motion.pose, &motion.twist, motion.time);
  known.motion = motion;
  put_moved(name, std::move(known), now);
  return true;
}

void Edits::put_moved(std::string_view name, ObjectState known, double now) {
  known.expiry = expiry_of(*known.object, now);
  known.parts = FS_PART_POSE;
  known.is_change = true;
  put(name, std::move(known), false, true);
}

void Edits::remove(const char* given) {
  const std::string_view name = text_of(given);
  ObjectState known = require(name);
  known.is_removed = true;
  known.parts = 0;
  known.expiry = never;
  put(name, std::move(known), true, true);
}

void Edits::clear() {
  std::vector<std::string> names;
  for_each([&](const std::string& name, const ObjectState&) { names.push_back(name); });
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

bool Edits::commit(size_t most) {
  assert(group_ && most > 0);
  if (group_->committed == 0) {
    refuse_solid_meshes(tool_radius());
    sort();
  }
  const std::vector<OpenGroup::Change*>& order = group_->order;
  try {
    for (size_t i = 0; i < most && group_->committed < order.size(); ++i) {
      auto& [name, wanted] = *order[group_->committed];
      merge(name, wanted);
      evaluated_.objects.take(name, wanted, std::move(group_->new_names[group_->committed]));
      ++group_->committed;
    }
    if (group_->committed < order.size()) return false;
    evaluated_.views.change(group_->view);
  } catch (...) {
    keep_rest();
    throw;
  }
  return true;
}

// After a commit that failed the group has only what is not felt: more may join it, and it can be committed or cancelled.
void Edits::keep_rest() noexcept {
  OpenGroup& group = *group_;
  const auto rest = group.order.begin() + static_cast<ptrdiff_t>(group.committed);
  std::for_each(group.order.begin(), rest,
                [&](OpenGroup::Change* done) { group.changes.erase(group.changes.find(done->first)); });
  group.order.erase(group.order.begin(), rest);
  group.committed = 0;
  group.added = static_cast<size_t>(std::count_if(group.order.begin(), group.order.end(), [this](OpenGroup::Change* change) {
    return !evaluated_.objects.has_name(change->first);
  }));
}

// Sorts a large group: changes of what is there in the order of the rows, so that each chunk is looked up in memory once;
// then new objects by place, so that neighbours get rows in one chunk.
void Edits::sort() {
  std::vector<OpenGroup::Change*>& order = group_->order;
  group_->new_names.clear();
  group_->new_names.resize(order.size());
  if (order.size() < chunk_size) return;
  struct Sorted {
    uint64_t place;
    OpenGroup::Change* change;
    NewName name;
  };
  std::vector<Sorted> known, added;
  Objects& objects = evaluated_.objects;
  for (OpenGroup::Change* const change : order) {
    auto& [name, wanted] = *change;
    if (const uint32_t row = objects.row_of(name, wanted); row != no_row) {
      known.push_back({row, change, {}});
    } else {
      wanted.number = objects.last_number() + 1 + static_cast<uint32_t>(added.size());
      added.push_back({objects.rows.place_of(wanted), change, Objects::make_name(name)});
    }
  }
  size_t next = 0;
  for (auto* const part : {&known, &added}) {
    std::stable_sort(part->begin(), part->end(), [](const Sorted& a, const Sorted& b) { return a.place < b.place; });
    for (Sorted& sorted : *part) {
      order[next] = sorted.change;
      group_->new_names[next++] = std::move(sorted.name);
    }
  }
  for (const Sorted& sorted : known) objects.rows.own_chunk(static_cast<uint32_t>(sorted.place));
}

// What a group changes of an object that somebody else has changed since: the parts that the group does not change stay
// as they are now.
void Edits::merge(std::string_view name, ObjectState& wanted) {
  ObjectState felt;
  if (wanted.is_removed || wanted.parts == all_parts || !wanted.is_more_than_moved) return;
  if (!evaluated_.objects.find(name, felt)) return;
  if (!(wanted.parts & FS_PART_POSE)) {
    wanted.motion = felt.motion;
    wanted.track = felt.track;
  }
  if (!(wanted.parts & FS_PART_PROFILES)) {
    wanted.start = felt.start;
    wanted.start_is_given = felt.start_is_given;
  }
  if (felt.object == wanted.base) return;
  try {
    const Ref<const Object> merged =
        parse_object(merge_parts(to_c(felt), to_c(wanted), wanted.parts), felt.object.get(), false).object;
    refuse_solid_mesh(*merged, tool_radius());
    wanted.object = merged;
  } catch (const Error&) {  // the parts no longer fit together: the object is what the group has made of it
  }
}

}  // namespace fs
