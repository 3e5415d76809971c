// Changes on their way to the server: collected in a group, then sent as one message.
#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "base/error.h"
#include "client/remote_scene.h"

namespace fs {

// ------------------------------------------------------------------------------------------------------- into a group

// Whether there is such a name, as the group has it; and whether the server has an object of it then.
bool RemoteScene::has(const Group& group, std::string_view name) const {
  const auto known = group.names.find(name);
  return known != group.names.end() ? known->second : slots_.contains(name);
}

bool RemoteScene::is_object(const Group& group, std::string_view name) const {
  const auto slot = slots_.find(name);
  const bool was_refused = slot != slots_.end() && slot->second.is_refused;
  return has(group, name) && (group.names.contains(name) || !was_refused);
}

void RemoteScene::note_name(Group& group, const std::string& name, bool is_there) const {
  group.more_names += is_there - has(group, name);
  group.more_objects += is_there - is_object(group, name);
  group.names[name] = is_there;
}

// For so many more objects, and changes. What was refused is at no server: it has room of its own.
void RemoteScene::require_room(const Group& group, size_t objects, size_t changes) const {
  const size_t most = connection_.welcome().max_objects, most_changes = wire::most_changes(connection_.welcome().max_objects);
  const size_t names = slots_.size() + static_cast<size_t>(group.more_names) + objects;
  const size_t present = slots_.size() - refused_count_ + static_cast<size_t>(group.more_objects) + objects;
  if (objects && present > most) {
    fail(FS_ERROR_FULL, "the scene would hold %zu objects, the server allows a client %zu", present, most);
  }
  if (objects && names > 2 * most) {
    fail(FS_ERROR_FULL, "the scene would hold %zu objects, %zu of them refused: remove these", names, refused_count_);
  }
  if (group.changes.size() + changes > most_changes) {
    fail(FS_ERROR_FULL, "the group would be of %zu changes, must be at most %zu", group.changes.size() + changes,
         most_changes);
  }
}

void RemoteScene::add(Group& group, wire::Type type, const char* name, std::span<const std::byte> record) const {
  if (type == wire::type_set || type == wire::type_remove) note_name(group, name, type == wire::type_set);
  if (type == wire::type_clear) {
    for (auto& [known, is_there] : group.names) is_there = false;
    for (const auto& [known, slot] : slots_) group.names[known] = false;
    group.more_names = -static_cast<ptrdiff_t>(slots_.size());
    group.more_objects = -static_cast<ptrdiff_t>(slots_.size() - refused_count_);
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

// Sends the group with all that it needs, as a whole. False: there is no room at the server now, and nothing has changed
// but that some of its shapes and curves are there already.
bool RemoteScene::deliver(Group& group) {
  if (group.changes.empty()) return true;
  if (may_be_written(group)) {
    write_moves(group);
    return true;
  }
  for (const Change& change : group.changes) {
    if (change.object && !upload_parts(*change.object, change.parts)) return false;
  }
  const uint64_t serial = send(group);
  if (serial) note_sent(group, serial);
  return serial != 0;
}

// Moves alone need no message; unless a change before them has not been applied yet: they would be felt before it.
bool RemoteScene::may_be_written(const Group& group) const {
  const uint64_t settled = connection_.outbox()->applied.load(std::memory_order_acquire);
  return std::all_of(group.changes.begin(), group.changes.end(), [&](const Change& change) {
    const auto slot = change.type == wire::type_place ? slots_.find(change.name) : slots_.end();
    return slot != slots_.end() && slot->second.index != wire::no_slot && slot->second.after <= settled;
  });
}

void RemoteScene::write_moves(const Group& group) noexcept {
  connection_.inbox().begin_batch();
  for (const Change& change : group.changes) {
    Slot& slot = slots_.find(change.name)->second;
    wire::Place place;
    std::memcpy(&place, change.record.data(), sizeof place);
    connection_.inbox().write(slot.index, {slot.after, place.movement});
    slot.moved_in = question_;
  }
  connection_.inbox().end_batch();
  connection_.wake();
}

// The slots that a group of changes takes and gives, in turn; given back unless it is kept.
class RemoteScene::SlotNumbers {
 public:
  explicit SlotNumbers(RemoteScene& scene) : scene_(scene) {}
  ~SlotNumbers() {
    for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) scene_.set_taken(step->first, !step->second);
  }
  void keep() noexcept { steps_.clear(); }

  uint32_t of(const std::string& name) const {
    if (const auto found = numbers_.find(name); found != numbers_.end()) return found->second;
    const auto slot = scene_.slots_.find(name);
    return slot == scene_.slots_.end() ? wire::no_slot : slot->second.index;
  }
  uint32_t take(const std::string& name) {
    uint32_t number = of(name);
    if (number == wire::no_slot) {
      number = scene_.take_index();
      if (number != wire::no_slot) steps_.emplace_back(number, true);
    }
    return numbers_[name] = number;
  }
  void give(const std::string& name) {
    const uint32_t number = of(name);
    numbers_[name] = wire::no_slot;
    if (number == wire::no_slot) return;
    steps_.emplace_back(number, false);
    scene_.set_taken(number, false);
  }
  void give_all() {
    std::vector<std::string> names;
    for (const auto& [name, slot] : scene_.slots_) names.push_back(name);
    for (const auto& [name, number] : numbers_) names.push_back(name);
    for (const std::string& name : names) give(name);
  }

 private:
  RemoteScene& scene_;
  std::vector<std::pair<uint32_t, bool>> steps_;  // a number; true: it was taken
  std::map<std::string, uint32_t> numbers_;       // as they are now, of the names that the group changes
};

// One message: the change, or a group's changes one behind the other. 0: no room.
uint64_t RemoteScene::send(Group& group) {
  SlotNumbers numbers(*this);
  const bool is_alone = group.changes.size() == 1 && group.changes[0].type < wire::type_sync;
  std::vector<std::byte> bytes;
  for (Change& change : group.changes) {
    if (change.type == wire::type_remove) {
      numbers.give(change.name);
    } else if (change.type == wire::type_clear) {
      numbers.give_all();
    } else if (change.type == wire::type_set || change.type == wire::type_change) {
      const uint32_t index = change.type == wire::type_set ? numbers.take(change.name) : numbers.of(change.name);
      std::memcpy(change.record.data(), &index, sizeof index);
    }
    if (is_alone) break;
    const wire::Header header{change.type, 0, 0};
    const auto head = bytes_of(&header, 1);
    bytes.insert(bytes.end(), head.begin(), head.end());
    bytes.insert(bytes.end(), change.record.begin(), change.record.end());
  }
  uint64_t serial;
  const wire::Group head{bytes.size()};
  if (is_alone) {
    serial = connection_.send(group.changes[0].type, group.changes[0].record);
  } else if (bytes.size() <= most_message / 2) {
    serial = connection_.send(wire::type_group, bytes_of(&head, 1), -1, bytes);
  } else {
    serial = connection_.send(wire::type_group, bytes_of(&head, 1), make_blob({bytes}).get());
  }
  if (serial) numbers.keep();
  return serial;
}

// It is on its way: so the slots are as send has numbered them.
void RemoteScene::note_sent(const Group& group, uint64_t serial) noexcept {
  try {
    for (const Change& change : group.changes) {
      const auto found = slots_.find(change.name);
      switch (change.type) {
        case wire::type_set: {
          const auto slot = found != slots_.end() ? found : slots_.emplace(change.name, Slot{}).first;
          std::memcpy(&slot->second.index, change.record.data(), sizeof slot->second.index);
          slot->second.after = serial;
          note_refused(slot->second, false);
          note_object(slot->second, change.object.get());
          break;
        }
        case wire::type_change:
          if (found == slots_.end()) break;
          if (change.parts & FS_PART_POSE) found->second.after = serial;
          note_object(found->second, change.object.get());
          break;
        case wire::type_place:
          if (found != slots_.end()) found->second.after = serial;
          break;
        case wire::type_remove:
          if (found != slots_.end()) drop_slot(found);
          break;
        case wire::type_clear:
          for (auto slot = slots_.begin(); slot != slots_.end();) slot = drop_slot(slot);
          break;
        case wire::type_edit:  // what it brings is the server's to keep
          for (const uint64_t id : {change.object->shape ? change.object->shape->serial : 0,
                                    change.object->front.curve ? change.object->front.curve->serial : 0,
                                    change.object->back.curve ? change.object->back.curve->serial : 0}) {
            if (data_.contains(id)) maybe_unused_[id] = serial;
          }
          break;
        default: break;
      }
      touch(change);
    }
  } catch (...) {
    connection_.lose(no_memory_text);
  }
}

// --------------------------------------------------------------------------------------------------------------- slots

// The lowest number that is free; no_slot: none is.
uint32_t RemoteScene::take_index() noexcept {
  while (first_free_ < taken_.size() && taken_[first_free_]) ++first_free_;
  if (first_free_ == taken_.size()) return wire::no_slot;
  taken_[first_free_] = true;
  return static_cast<uint32_t>(first_free_);
}

void RemoteScene::set_taken(uint32_t index, bool is_taken) noexcept {
  taken_[index] = is_taken;
  if (!is_taken) first_free_ = std::min<size_t>(first_free_, index);
}

void RemoteScene::release_index(Slot& slot) noexcept {
  if (slot.index != wire::no_slot) set_taken(slot.index, false);
  slot.index = wire::no_slot;
}

// The object is no more; the number of its slot has been given back.
RemoteScene::Slots::iterator RemoteScene::drop_slot(Slots::iterator slot) {
  note_object(slot->second, nullptr);
  note_refused(slot->second, false);
  return slots_.erase(slot);
}

void RemoteScene::note_refused(Slot& slot, bool is_refused) noexcept {
  refused_count_ += is_refused;
  refused_count_ -= slot.is_refused;
  slot.is_refused = is_refused;
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
    if (found != data_.end() && --found->second.uses == 0) maybe_unused_[id] = connection_.last_serial();
  }
  slot.data = used;
}

// --------------------------------------------------------------------------------------------------- shapes and curves

// The server lacks it, or refused it and a retry may succeed.
bool RemoteScene::is_missing(uint64_t id) const {
  const auto found = data_.find(id);
  return found == data_.end() || found->second.is_refused;
}

// Sends it unless the server has it. False: there is no room now. It counts as unused until an object uses it.
bool RemoteScene::upload(const Shape* shape) {
  if (!shape || !is_missing(shape->serial)) return true;
  if (!has_room_for_data()) return false;
  const PackedAsset packed = pack(Asset::of(shape));
  return upload(wire::type_shape, shape->serial, packed.record(), packed.content, {Ref<const Shape>::share(shape), nullptr});
}

bool RemoteScene::upload(const Curve* curve) {
  if (!curve || !is_missing(curve->serial)) return true;
  if (!has_room_for_data()) return false;
  const PackedAsset packed = pack(Asset::of(curve));
  return upload(wire::type_curve, curve->serial, packed.record(), packed.content, {nullptr, Ref<const Curve>::share(curve)});
}

bool RemoteScene::upload(wire::Type type, uint64_t id, std::span<const std::byte> record, const Descriptor& content,
                         Data data) {
  if (const auto refused = data_.find(id); refused != data_.end()) {
    const wire::Forget forget{id};
    if (!connection_.send(wire::type_forget, bytes_of(&forget, 1))) return false;
    data.uses = refused->second.uses;
    data_.erase(refused);
  }
  const auto known = data_.emplace(id, std::move(data)).first;
  uint64_t serial = 0;
  try {
    maybe_unused_[id] = connection_.last_serial();
    serial = connection_.send(type, record, content.get());
  } catch (...) {
    data_.erase(known);
    throw;
  }
  if (!serial) data_.erase(known);
  return serial != 0;
}

// Before it is copied.
bool RemoteScene::has_room_for_data() const {
  return data_.size() < wire::most_data(connection_.welcome().max_objects) && connection_.has_room();
}

bool RemoteScene::upload_parts(const Object& object, uint32_t parts) {
  if ((parts & FS_PART_SHAPE) && !upload(object.shape.get())) return false;
  return !(parts & FS_PART_PROFILES) || (upload(object.front.curve.get()) && upload(object.back.curve.get()));
}

// Not before the server has applied the change that uses it no more: if that is refused, it is used again.
void RemoteScene::forget_unused() {
  const bool are_many = data_.size() > wire::most_data(connection_.welcome().max_objects) / 2;
  if (maybe_unused_.empty() || !(is_current() || are_many)) return;
  const uint64_t settled = connection_.outbox()->applied.load(std::memory_order_acquire);
  for (auto next = maybe_unused_.begin(); next != maybe_unused_.end();) {
    const auto [id, after] = *next;
    const auto found = data_.find(id);
    if (found != data_.end() && found->second.uses == 0) {
      const wire::Forget record{id};
      if (after > settled || !connection_.send(wire::type_forget, bytes_of(&record, 1))) {
        ++next;
        continue;
      }
      data_.erase(found);
    }
    next = maybe_unused_.erase(next);
  }
}

}  // namespace fs
