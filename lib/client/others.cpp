// What concerns other clients: their objects, their changes of this one's, reports and events.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "base/error.h"
#include "client/remote_scene.h"
#include "scene/transfer.h"

namespace fs {
namespace {

constexpr size_t most_fetched = 8;  // shapes, and curves, that are kept for the next who asks

// What the fetched list has under the server's number; null: nothing.
template <class List>
auto find_fetched(const List& list, uint64_t id) {
  const auto found = std::find_if(list.begin(), list.end(), [id](const auto& entry) { return entry.first == id; });
  return found == list.end() ? nullptr : found->second;
}

template <class List, class Thing>
uint64_t number_of(const List& list, const Thing* thing) {  // the server's; 0: it is not its
  const auto found = std::find_if(list.begin(), list.end(), [&](const auto& e) { return e.second.get() == thing; });
  return found == list.end() ? 0 : found->first;
}

template <class List, class Thing>
void keep_fetched(List& list, uint64_t id, const Thing& thing) {
  list.emplace_back(id, thing);
  if (list.size() > most_fetched) list.pop_front();
}

}  // namespace

wire::Target RemoteScene::to_target(const char* name, const char* field) {
  wire::Target out{};
  const size_t size = strnlen(name, sizeof out.name);
  if (size == sizeof out.name) {
    fail(FS_ERROR_NOT_FOUND, "%s is '%.80s...': there is none of such a long name", field, name);
  }
  std::memcpy(out.name, name, size);
  return out;
}

// -------------------------------------------------------------------------------------------------- their objects

// The handles of a record: this client's own, or the server's, which are fetched. Ask at once, before the next request
// for an object: the server offers those of the last one only.
RemoteScene::Received RemoteScene::receive(const wire::Object& record) {
  Received out{from_record(record), receive_shape(record.shape), receive_curve(record.front.curve),
               receive_curve(record.back.curve)};
  out.object.shape = const_cast<fs_shape*>(out.shape.get());
  out.object.front.curve = const_cast<fs_curve*>(out.front.get());
  out.object.back.curve = const_cast<fs_curve*>(out.back.get());
  return out;
}

Ref<const Shape> RemoteScene::receive_shape(uint64_t id) {
  if (id == 0) return nullptr;
  if (!(id & wire::of_server)) {
    const auto own = data_.find(id);
    if (own == data_.end() || !own->second.shape) fail(FS_ERROR_INTERNAL, "the server tells of a shape that is none");
    return own->second.shape;
  }
  if (Ref<const Shape> known = find_fetched(fetched_shapes_, id)) return known;
  const wire::Fetch fetch{id};
  Answer answer = connection_.request(wire::type_fetch, bytes_of(&fetch, 1));
  answer.require_data();
  const Ref<const Shape> shape = from_record(answer.as<wire::Shape>(), std::move(answer.data));
  keep_fetched(fetched_shapes_, id, shape);
  return shape;
}

Ref<const Curve> RemoteScene::receive_curve(uint64_t id) {
  if (id == 0) return nullptr;
  if (!(id & wire::of_server)) {
    const auto own = data_.find(id);
    if (own == data_.end() || !own->second.curve) fail(FS_ERROR_INTERNAL, "the server tells of a curve that is none");
    return own->second.curve;
  }
  if (Ref<const Curve> known = find_fetched(fetched_curves_, id)) return known;
  const wire::Fetch fetch{id};
  Answer answer = connection_.request(wire::type_fetch, bytes_of(&fetch, 1));
  const auto record = answer.as<wire::Curve>();
  if (record.count) answer.require_data();
  const Ref<const Curve> curve = from_record(record, std::move(answer.data));
  keep_fetched(fetched_curves_, id, curve);
  return curve;
}

// Its name is the one it was asked by, so that it can be changed as it is.
Ref<const Object> RemoteScene::get_other(const char* name, fs_object& out) {
  const wire::Target target = to_target(name, "name");
  const auto record = connection_.request(wire::type_get, bytes_of(&target, 1)).as<wire::Object>();
  const Received received = receive(record);
  Ref<const Object> object = parse_object(received.object, nullptr, false).object;
  out = received.object;
  put_text(out.name, name);
  return object;
}

void RemoteScene::change_other(const fs_object& object, uint32_t parts) {
  require_no_group();
  wire::Edit edit{to_target(text_of(object.name).c_str(), "name"), parts, to_record(object)};
  if (parts == 0) {  // whether it is there
    connection_.request(wire::type_get, bytes_of(&edit.target, 1));
    return;
  }
  if ((parts & FS_PART_POSE) && edit.object.time == 0) edit.object.time = now();
  // What came from the server goes back by its number; unless it has let go of it, then it is sent as a new one.
  for (const bool may_refer : {true, false}) {
    bool refers = false;
    const auto id_of = [&](const auto* thing, const auto& fetched) {
      const uint64_t number = may_refer && thing ? number_of(fetched, thing) : 0;
      refers = refers || number;
      return number ? number : upload(thing);
    };
    if (parts & FS_PART_SHAPE) edit.object.shape = id_of(object.shape, fetched_shapes_);
    if (parts & FS_PART_PROFILES) {
      edit.object.front.curve = id_of(object.front.curve, fetched_curves_);
      edit.object.back.curve = id_of(object.back.curve, fetched_curves_);
    }
    try {
      connection_.request(wire::type_edit, bytes_of(&edit, 1));
      break;
    } catch (const Error& error) {
      if (!refers || error.status != FS_ERROR_STATE || error.text != "unknown shape") throw;
    }
  }
  forget_unused();
}

void RemoteScene::move_other(const char* name, const Pose& pose, const fs_twist* twist, double time) {
  require_no_group();
  const wire::MoveOther move{to_target(name, "name"), twist != nullptr, pose, twist ? *twist : fs_twist{}, time};
  connection_.request(wire::type_move_other, bytes_of(&move, 1));
}

// ---------------------------------------------------------------------------------------------------- their changes

// What others have changed of this one's objects comes into the replica. Not while a group is open: it began without.
void RemoteScene::pull() {
  const std::atomic<uint64_t>& edits = connection_.outbox()->edits;
  const auto is_current = [&] { return edits.load(std::memory_order_acquire) == edits_seen_; };
  if (is_current() || group_) return;
  flush_ahead();
  for (uint32_t i = 0; i <= connection_.welcome().max_objects && !is_current(); ++i) {  // who goes on is not waited for
    if (!pull_) pull_ = connection_.ask(wire::type_pull);
    const auto pulled = connection_.await(*pull_).as<wire::Pulled>();
    pull_.reset();
    edits_seen_ = pulled.edits;
    if (pulled.state == 0) break;
    if (pulled.state == 3) {
      if (const auto data = data_.find(pulled.object.shape); data != data_.end()) data->second.is_refused = true;
      continue;
    }
    const auto slot = std::find_if(slots_.begin(), slots_.end(),
                                   [&](const auto& entry) { return entry.second.index == pulled.slot; });
    if (slot == slots_.end()) continue;
    if (pulled.state == 2) {
      replica_->remove(slot->first.c_str());
      drop_slot(slot);
    } else if (text_of(pulled.object.name) == slot->first) {
      if (is_here(pulled.object)) {
        take_over(*slot, pulled.object);
        behind_.erase(slot->first);
      } else {
        behind_.insert(slot->first);  // whoever needs all of it waits for its mesh
      }
    }
  }
  publish();
  forget_unused();
}

// The same, and all of an object, or of all, is there.
void RemoteScene::catch_up(const char* name) {
  pull();
  if (group_) return;
  bool is_gone = false;
  for (auto next = behind_.begin(); next != behind_.end();) {
    if (name && *next != name) {
      ++next;
      continue;
    }
    const wire::Target target = to_target(next->c_str(), "name");
    wire::Object record;
    try {
      record = connection_.request(wire::type_get, bytes_of(&target, 1)).as<wire::Object>();
    } catch (const Error& error) {
      if (error.status != FS_ERROR_NOT_FOUND) throw;
      is_gone = true;  // removed meanwhile: the next pull tells so
      next = behind_.erase(next);
      continue;
    }
    take_over(*slots_.find(*next), record);
    next = behind_.erase(next);
    publish();
    forget_unused();
  }
  if (is_gone) pull();
}

// Whether nothing has to be fetched for it.
bool RemoteScene::is_here(const wire::Object& record) const {
  const auto is_known = [this](uint64_t id, const auto& fetched) {
    return id == 0 || (id & wire::of_server ? find_fetched(fetched, id) != nullptr : data_.contains(id));
  };
  return is_known(record.shape, fetched_shapes_) && is_known(record.front.curve, fetched_curves_) &&
         is_known(record.back.curve, fetched_curves_);
}

// An own object as the server has it.
void RemoteScene::take_over(Slots::value_type& slot, const wire::Object& record) {
  flush_ahead();
  replica_->set(receive(record).object);
  fs_object object;
  note_object(slot.second, replica_->get(slot.first.c_str(), object).get());
}

// ------------------------------------------------------------------------------------------------- reports and events

// A report of an own object in an open group: what it is, as the group has it; what became of it, as the server tells,
// if it knows it.
fs_report RemoteScene::in_group(const fs_report& ours, const fs_report* theirs) {
  if (!theirs) return ours;
  fs_report out = *theirs;
  out.primitive = ours.primitive;
  out.stiffness_wanted = ours.stiffness_wanted;
  out.stiffness_applied = ours.stiffness_applied;
  fs_object object;
  replica_->get(ours.name, object);
  if (out.state == FS_OBJECT_REFUSED) return out;
  if (out.weight > 0) {
    out.state = out.weight < 1 ? FS_OBJECT_FADING : FS_OBJECT_FELT;
  } else if (!object.enabled) {
    out.state = FS_OBJECT_DISABLED;
  } else if (out.state != FS_OBJECT_PENDING) {
    out.state = FS_OBJECT_FADING;
  }
  return out;
}

fs_report RemoteScene::report(const char* given) {
  const Lock lock = enter();
  const char* name = own_name(given);
  fs_report ours{};
  if (name) {
    pull();
    ours = replica_->report(name);  // NOT_FOUND
  }
  const wire::Target target = to_target(name ? name : given, "name");
  try {
    const auto theirs = connection_.request(wire::type_report, bytes_of(&target, 1)).as<fs_report>();
    return name && group_ ? in_group(ours, &theirs) : theirs;
  } catch (const Error& error) {
    if (!name || !group_ || error.status != FS_ERROR_NOT_FOUND) throw;
    return in_group(ours, nullptr);
  }
}

std::vector<fs_report> RemoteScene::reports() {
  const Lock lock = enter();
  pull();
  std::vector<fs_report> out = connection_.request(wire::type_reports).list<fs_report>();
  if (!group_) return out;
  NameMap<fs_report> theirs;  // of its own objects; those of others have a '/'
  std::erase_if(out, [&](const fs_report& report) {
    const std::string name = text_of(report.name);
    const bool is_own = name.find('/') == std::string::npos;
    if (is_own) theirs[name] = report;
    return is_own;
  });
  std::vector<fs_report> own = replica_->reports();
  for (fs_report& report : own) {
    const auto found = theirs.find(text_of(report.name));
    report = in_group(report, found == theirs.end() ? nullptr : &found->second);
  }
  out.insert(out.begin(), own.begin(), own.end());
  return out;
}

std::vector<fs_client> RemoteScene::clients() {
  const Lock lock = enter();
  return connection_.request(wire::type_clients).list<fs_client>();
}

// The oldest event that is there; false: none. After the last of a server that is gone comes its end.
bool RemoteScene::take_event(fs_event& out) {
  const char* loss = connection_.loss();  // before its last events are looked at
  if (!loss) {
    try {
      pull();
    } catch (const Error&) {  // whatever it is, the next call is told
    }
  }
  const Outbox& outbox = *connection_.outbox();
  const uint64_t written = outbox.events_written.load(std::memory_order_acquire);
  uint64_t lost = 0;
  if (written - events_read_ > event_slots) {
    lost = written - event_slots - events_read_;
    events_read_ = written - event_slots;
  }
  wire::EventSlot slot;
  const auto read_next = [&] {
    return outbox.events[events_read_ % event_slots].read(slot) && slot.number == events_read_;
  };
  while (events_read_ != written && !read_next()) {
    ++lost;  // overwritten meanwhile
    ++events_read_;
  }
  out = {};
  if (lost) {
    out.kind = FS_EVENT_OVERFLOW;
    out.time = now();
    out.value = static_cast<double>(lost);
    return true;
  }
  if (events_read_ != written) {
    ++events_read_;
    out = slot.event;
    out.name[sizeof out.name - 1] = out.text[sizeof out.text - 1] = 0;
    return true;
  }
  if (!loss) return false;
  if (std::exchange(is_end_told_, true)) throw Error{FS_ERROR_DISCONNECTED, loss};
  out.kind = FS_EVENT_DISCONNECTED;
  out.status = FS_ERROR_DISCONNECTED;
  out.time = now();
  put_text(out.text, loss);
  return true;
}

fs_event RemoteScene::next_event(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    if (connection_.is_forked()) connection_.check();
    {
      const Lock lock(mutex_);
      fs_event event;
      if (take_event(event)) return event;
    }
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}

}  // namespace fs
