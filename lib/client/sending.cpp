// Changes of own objects on their way to the server: collected in a group, then sent one behind the other.
#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "base/error.h"
#include "client/remote_scene.h"
#include "scene/transfer.h"

namespace fs {

// ------------------------------------------------------------------------------------------------------- into a group

// Whether there is such an object, as the group has it.
bool RemoteScene::has(const Group& group, std::string_view name) const {
  return group.fresh.contains(name) || (slots_.contains(name) && !group.gone.contains(name));
}

// For so many more objects, and changes.
void RemoteScene::require_room(const Group& group, size_t objects, size_t changes) const {
  const size_t most = connection_.welcome().max_objects;
  if (objects && slots_.size() + group.fresh.size() - group.gone.size() + objects > most) {
    fail(FS_ERROR_FULL, "the scene would hold %zu objects, the server allows a client %zu",
         slots_.size() + group.fresh.size() - group.gone.size() + objects, most);
  }
  const size_t most_changes = 4 * most + 64;
  if (group.changes.size() + changes > most_changes) {
    fail(FS_ERROR_FULL, "the group would be of %zu changes, must be at most %zu", group.changes.size() + changes,
         most_changes);
  }
}

void RemoteScene::add(Group& group, wire::Type type, const char* name, std::span<const std::byte> record) const {
  if (type == wire::type_set && !has(group, name)) {
    if (group.gone.erase(name) == 0) group.fresh.insert(name);
  }
  if (type == wire::type_remove && group.fresh.erase(name) == 0) group.gone.insert(name);
  if (type == wire::type_clear) {
    group.fresh.clear();
    for (const auto& [known, slot] : slots_) group.gone.insert(known);
  }
  group.changes.push_back({type, name, {record.begin(), record.end()}, 0, nullptr});
}

// An object as the replica has it now.
void RemoteScene::add_object(Group& group, wire::Type type, const char* name, uint32_t parts) const {
  fs_object object;
  Ref<const Object> kept = replica_->get(name, object);
  wire::Set set{0, parts, to_record(object)};
  for (double* time : {&set.object.time, &set.object.start}) {
    // The first instant of a virtual clock; in an object 0 would mean now, when it comes there.
    if (*time == 0) *time = std::numeric_limits<double>::min();
  }
  if ((parts & FS_PART_SHAPE) && kept->shape) set.object.shape = kept->shape->serial;
  if ((parts & FS_PART_PROFILES) && kept->front.curve) set.object.front.curve = kept->front.curve->serial;
  if ((parts & FS_PART_PROFILES) && kept->back.curve) set.object.back.curve = kept->back.curve->serial;
  add(group, type, name, bytes_of(&set, 1));
  group.changes.back().parts = parts;
  group.changes.back().object = std::move(kept);
}

void RemoteScene::add_frame(Group& group) const {
  const wire::Frame frame{replica_->get_frame(nullptr)};
  add(group, wire::type_frame, "", bytes_of(&frame, 1));
}

void RemoteScene::add_tool(Group& group) const {
  const std::vector<Vec3> points = replica_->get_tool();
  wire::Tool tool{points.size(), {}};
  std::copy(points.begin(), points.end(), tool.points);
  add(group, wire::type_tool, "", bytes_of(&tool, 1));
}

// ------------------------------------------------------------------------------------------------------ to the server

// All that may fail, before anything changes: its shapes and curves are sent, and there is room for the rest.
void RemoteScene::prepare(const Group& group) {
  for (const Change& change : group.changes) {
    if (change.parts & FS_PART_SHAPE) upload(change.object->shape.get());
    if (change.parts & FS_PART_PROFILES) {
      upload(change.object->front.curve.get());
      upload(change.object->back.curve.get());
    }
  }
  if (!group.changes.empty()) connection_.wait_for_room();
}

// The replica has changed: now either all of it goes on its way, or the server is lost.
void RemoteScene::transmit(Group& group) noexcept {
  try {
    // Moves alone need no message; unless something they follow is still on its way, or waits for a mesh: they would be
    // felt before what is to be felt with them.
    const uint64_t settled = connection_.outbox()->settled.load(std::memory_order_acquire);
    const auto may_be_written = [&](const Change& change) {
      const auto slot = change.type == wire::type_place ? slots_.find(change.name) : slots_.end();
      return slot != slots_.end() && slot->second.after <= settled;
    };
    if (std::all_of(group.changes.begin(), group.changes.end(), may_be_written)) {
      transmit_moves(group);
    } else {
      for (Change& change : group.changes) send(change, &change != &group.changes.back());
    }
    forget_unused();
  } catch (...) {
    connection_.lose("a change could not be sent as a whole: the server is given up");
  }
}

void RemoteScene::transmit_moves(const Group& group) noexcept {
  if (group.changes.empty()) return;
  connection_.inbox().begin_batch();
  for (const Change& change : group.changes) {
    const auto slot = slots_.find(change.name);
    wire::Place place;
    std::memcpy(&place, change.record.data(), sizeof place);
    connection_.inbox().write(slot->second.index, {slot->second.after, place.movement});
  }
  connection_.inbox().end_batch();
  connection_.wake();
}

void RemoteScene::send(Change& change, bool has_more) {
  const bool is_of_object = change.type == wire::type_set || change.type == wire::type_change ||
                            change.type == wire::type_place || change.type == wire::type_remove;
  Slots::iterator found = slots_.end();
  if (is_of_object) {
    if (change.type == wire::type_set) make_slot(change.name);
    found = slots_.find(change.name);
    if (found == slots_.end()) fail(FS_ERROR_INTERNAL, "object '%s' has no slot", change.name.c_str());
    const uint32_t index = found->second.index;
    std::memcpy(change.record.data(), &index, sizeof index);
  }
  const uint64_t serial = connection_.send(change.type, change.record, has_more);
  if (change.type == wire::type_remove) {
    drop_slot(found);
  } else if (change.type == wire::type_clear) {
    for (auto slot = slots_.begin(); slot != slots_.end();) slot = drop_slot(slot);
  } else if (is_of_object) {
    if (change.type == wire::type_place || (change.parts & FS_PART_POSE)) found->second.after = serial;
    if (change.object) note_object(found->second, change.object.get());
  }
}

// --------------------------------------------------------------------------------------------------------------- slots

void RemoteScene::make_slot(const std::string& name) {
  if (slots_.contains(name)) return;
  const bool is_reused = !free_indexes_.empty();
  Slot slot;
  slot.index = is_reused ? *free_indexes_.begin() : indexes_end_;
  slots_.emplace(name, slot);
  if (is_reused) {
    free_indexes_.erase(slot.index);
  } else {
    ++indexes_end_;
  }
}

RemoteScene::Slots::iterator RemoteScene::drop_slot(Slots::iterator slot) {
  free_indexes_.insert(slot->second.index);
  behind_.erase(slot->first);
  note_object(slot->second, nullptr);
  return slots_.erase(slot);
}

// What is in the slot now; null: nothing any more.
void RemoteScene::note_object(Slot& slot, const Object* object) {
  std::array<uint64_t, 3> used{};
  if (object) {
    slot.has_lifetime = object->lifetime > 0;
    if (object->shape) used[0] = object->shape->serial;
    if (object->front.curve) used[1] = object->front.curve->serial;
    if (object->back.curve) used[2] = object->back.curve->serial;
  }
  for (uint64_t& id : used) {
    const auto found = data_.find(id);
    if (found == data_.end()) {
      id = 0;  // the server's own
    } else {
      ++found->second.uses;
    }
  }
  for (const uint64_t id : slot.data) {
    const auto found = data_.find(id);
    if (found != data_.end() && --found->second.uses == 0) maybe_unused_.push_back(id);
  }
  slot.data = used;
}

// --------------------------------------------------------------------------------------------------- shapes and curves

// Whether the server has it not; or refused it, then it may have become better.
bool RemoteScene::is_missing(uint64_t id) const {
  const auto found = data_.find(id);
  return found == data_.end() || found->second.is_refused;
}

// Sends it unless the server has it. Until an object uses it, it may be forgotten with the next change.
uint64_t RemoteScene::upload(const Shape* shape) {
  if (!shape) return 0;
  if (is_missing(shape->serial)) {
    Descriptor content;
    const wire::Shape record = to_record(*shape, content);
    upload(wire::type_shape, shape->serial, bytes_of(&record, 1), content, {Ref<const Shape>::share(shape), nullptr});
  }
  return shape->serial;
}

uint64_t RemoteScene::upload(const Curve* curve) {
  if (!curve) return 0;
  if (is_missing(curve->serial)) {
    Descriptor content;
    const wire::Curve record = to_record(*curve, content);
    upload(wire::type_curve, curve->serial, bytes_of(&record, 1), content, {nullptr, Ref<const Curve>::share(curve)});
  }
  return curve->serial;
}

void RemoteScene::upload(wire::Type type, uint64_t id, std::span<const std::byte> record, const Descriptor& content,
                         Data data) {
  connection_.wait_for_room();
  maybe_unused_.push_back(id);
  const auto [known, is_new] = data_.try_emplace(id, std::move(data));
  if (!is_new) {  // what it was refused as
    const wire::Forget forget{id};
    connection_.send(wire::type_forget, bytes_of(&forget, 1));
    known->second.is_refused = false;
  }
  connection_.send(type, record, false, content.get());
}

void RemoteScene::forget_unused() {
  for (const uint64_t id : std::exchange(maybe_unused_, {})) {
    const auto found = data_.find(id);
    if (found == data_.end() || found->second.uses > 0) continue;
    data_.erase(found);
    const wire::Forget record{id};
    connection_.send(wire::type_forget, bytes_of(&record, 1));
  }
}

}  // namespace fs
