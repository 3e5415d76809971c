#include "client/sender.h"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

namespace fs {

bool Sender::deliver(Group& group, SendingAhead& ahead) {
  if (group.batch.empty()) return true;
  if (may_be_written(group.batch)) {
    write_moves(group.batch);
    return true;
  }
  bool is_any_noted = false;
  for (size_t i = 0; i < group.batch.size(); ++i) is_any_noted |= ahead.note(group.assets(i));
  if (is_any_noted) return false;
  for (size_t i = 0; i < group.batch.size(); ++i) {
    if (!sent_.send(group.assets(i))) return false;
  }
  const uint64_t serial = send(group.batch);
  if (serial) note_sent(group, serial);
  return serial != 0;
}

// Moves alone need no message. If an earlier change of the object is still on its way, the moves would overtake it.
bool Sender::may_be_written(const Batch& batch) const {
  const uint64_t applied = connection_.outbox()->applied.load(std::memory_order_acquire);
  return std::all_of(batch.begin(), batch.end(), [&](const Change& change) {
    const OwnObject* const own = change.type == wire::type_place ? replica_.objects.find(change.name()) : nullptr;
    return own && own->slot != wire::no_slot && own->after <= applied;
  });
}

void Sender::write_moves(const Batch& batch) noexcept {
  connection_.inbox().begin_batch();
  for (const Change& change : batch) {
    OwnObject& own = *replica_.objects.find(change.name());
    connection_.inbox().write(own.slot, {own.after, change.as<wire::Place>().motion});
    own.moved_in = questions_.newest();
  }
  connection_.inbox().end_batch();
  connection_.wake();
}

// Takes and gives back slots for the changes of a batch, one after the other; all of that is undone unless it is kept.
class Sender::SlotPlan {
 public:
  explicit SlotPlan(OwnObjects& objects) : objects_(objects) {}
  ~SlotPlan() {
    for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) objects_.numbers.set(step->first, !step->second);
  }
  SlotPlan(const SlotPlan&) = delete;
  SlotPlan& operator=(const SlotPlan&) = delete;
  void keep() noexcept { steps_.clear(); }

  uint32_t of(std::string_view name) const {
    if (const auto found = slots_.find(name); found != slots_.end()) return found->second;
    const OwnObject* const own = objects_.find(name);
    return own ? own->slot : wire::no_slot;
  }
  uint32_t take(std::string_view name) {
    uint32_t slot = of(name);
    if (slot == wire::no_slot) {
      slot = objects_.numbers.take();
      if (slot != wire::no_slot) steps_.emplace_back(slot, true);
    }
    slots_.insert_or_assign(std::string(name), slot);
    return slot;
  }
  void give(std::string_view name) {
    const uint32_t slot = of(name);
    slots_.insert_or_assign(std::string(name), wire::no_slot);
    if (slot == wire::no_slot) return;
    steps_.emplace_back(slot, false);
    objects_.numbers.give(slot);
  }
  void give_all() {
    std::vector<std::string> names;
    for (const auto& [name, own] : objects_.all()) names.push_back(name);
    for (const auto& [name, slot] : slots_) names.push_back(name);
    for (const std::string& name : names) give(name);
  }

 private:
  OwnObjects& objects_;
  std::vector<std::pair<uint32_t, bool>> steps_;  // slot; true: it was taken, false: given back
  NameMap<uint32_t> slots_;                       // of the names that the batch changes, as they are so far
};

// Returns the serial; 0: there is no room.
uint64_t Sender::send(Batch& batch) {
  SlotPlan plan(replica_.objects);
  for (size_t i = 0; i < batch.size(); ++i) {
    const Change change = batch[i];
    switch (change.type) {
      case wire::type_remove: plan.give(change.name()); break;
      case wire::type_clear: plan.give_all(); break;
      case wire::type_set: batch.put_slot(i, plan.take(change.name())); break;
      case wire::type_change: batch.put_slot(i, plan.of(change.name())); break;
      default: break;
    }
  }
  const Batch::Message message = batch.message();
  const uint64_t serial = connection_.send(message.type, message.body, message.content.get());
  if (serial) plan.keep();
  return serial;
}

void Sender::note_sent(const Group& group, uint64_t serial) noexcept {
  try {
    for (size_t i = 0; i < group.batch.size(); ++i) {
      note_sent(group, i, serial);
      questions_.note(group.batch[i]);
    }
  } catch (...) {
    line_.lose_for_memory();
  }
}

// The SlotPlan has given back the slots of removed objects already.
void Sender::note_sent(const Group& group, size_t i, uint64_t serial) {
  const Change change = group.batch[i];
  OwnObjects& objects = replica_.objects;
  OwnObject* const present = objects.find(change.name());
  switch (change.type) {
    case wire::type_set: {
      OwnObject& own = present ? *present : objects.add(change.name());
      own.slot = change.as<wire::Set>().slot;
      own.after = serial;
      objects.note_refused(own, false);
      objects.note_object(own, group.object(i));
      break;
    }
    case wire::type_change:
      if (change.is_foreign()) {  // the other client's object uses them now
        for (const uint64_t id : ids_of(group.assets(i))) sent_.note_maybe_unused(id, serial);
      }
      if (!present) break;
      if (change.as<wire::Set>().parts & FS_PART_POSE) present->after = serial;
      objects.note_object(*present, group.object(i));
      break;
    case wire::type_place:
      if (present) present->after = serial;
      break;
    case wire::type_remove: objects.drop(change.name()); break;
    case wire::type_clear: objects.drop_all(); break;
    default: break;
  }
}

}  // namespace fs
