// What a client changes: its shapes and curves, its objects one by one and in groups, its view.
#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "server/session.h"

namespace fs {
namespace {

// Then its socket is not read, until some have been applied and done.
constexpr size_t most_parked = 4096;  // messages
constexpr unsigned most_jobs = 16;    // each may hold a descriptor

constexpr uint64_t expression_size = 40'000;  // bytes, about what two parsers of a long one take

// Bytes that a shape or curve takes, given back when it goes.
struct Charge {
  Charge(std::shared_ptr<std::atomic<uint64_t>> the_total, uint64_t the_bytes)
      : total(std::move(the_total)), bytes(the_bytes) {
    total->fetch_add(bytes);
  }
  ~Charge() { total->fetch_sub(bytes); }
  const std::shared_ptr<std::atomic<uint64_t>> total;
  const uint64_t bytes;
};

// What a map has of a slot, and the same put back.
template <class Value>
std::optional<Value> look_up(const std::map<uint32_t, Value>& map, uint32_t slot) {
  const auto found = map.find(slot);
  return found == map.end() ? std::nullopt : std::optional(found->second);
}
template <class Value>
void put_back(std::map<uint32_t, Value>& map, uint32_t slot, const std::optional<Value>& value) {
  if (value) map.insert_or_assign(slot, *value);
  else map.erase(slot);
}

}  // namespace

// ------------------------------------------------------------------------------------------------- shapes and curves

void Session::take_upload(Message&& message, Descriptor&& came) {
  const bool is_shape = message.header.type == wire::type_shape;
  const uint64_t id = is_shape ? message.as<wire::Shape>().id : message.as<wire::Curve>().id;
  const size_t most = 4 * size_t{server_.settings().max_objects} + 64;
  const auto forgets = [id](const Unit& unit) { return unit.is_forget && unit.ids.contains(id); };
  if (const auto found = std::find_if(parked_.begin(), parked_.end(), forgets); found != parked_.end()) {
    parked_.erase(found);  // it is wanted again before that could be done, so it stays
    held_ = {};
    for (const Unit& unit : parked_) held_.add(unit, slots_);
    const auto known = uploads_.find(id);
    if (known == uploads_.end() || !known->second.is_ready || known->second.status == FS_OK) return;
    uploads_.erase(known);  // it was refused: once more
  }
  if (id == 0 || (id & wire::of_server) || uploads_.size() >= most || !uploads_.emplace(id, Upload{}).second) {
    return drop(server_.settings().lease);
  }
  Upload refused;
  try {
    const bool is_expression = !is_shape && message.as<wire::Curve>().count == 0;
    const uint64_t bytes = is_expression ? expression_size
                           : is_shape    ? data_size(message.as<wire::Shape>())
                                         : data_size(message.as<wire::Curve>());
    const uint64_t used = shape_bytes_->load(), limit = server_.settings().max_bytes;
    if (bytes > limit || used > limit - bytes) {
      fail(FS_ERROR_FULL, "shapes of %llu bytes would come to %llu: a client may have at most %llu megabytes",
           static_cast<unsigned long long>(bytes), static_cast<unsigned long long>(used + bytes),
           static_cast<unsigned long long>(limit / 1'000'000));
    }
    // Reading, checking and building take as long as they take: not on this thread.
    const auto made = std::make_shared<Upload>();
    auto work = [made, is_shape, message = std::move(message), data = std::make_shared<Descriptor>(std::move(came)),
                 charge = std::make_shared<Charge>(shape_bytes_, bytes)](Wanted& wanted) {
      try {
        if (is_shape) {
          made->shape = from_record(message.as<wire::Shape>(), std::move(*data), wanted);
          made->shape->keep(charge);
          made->shape->build(wanted);
        } else {
          made->curve = from_record(message.as<wire::Curve>(), std::move(*data));
          made->curve->keep(charge);
        }
      } catch (Error& error) {
        *made = {false, nullptr, nullptr, error.status, std::move(error.text)};
      } catch (...) {
        *made = {false, nullptr, nullptr, FS_ERROR_MEMORY, ""};
      }
    };
    server_.worker(bytes).add(id_, {std::move(work), [server = &server_, session = id_, id, made] {
      const std::shared_ptr<Session> found = server->find(session);
      if (!found) return;
      found->finish_upload(id, std::move(*made));
      found->finish_job();
    }});
    ++jobs_;
    return regulate();
  } catch (const Error& error) {
    refused = {false, nullptr, nullptr, error.status, error.text};
  }
  finish_upload(id, std::move(refused));
}

void Session::finish_upload(uint64_t id, Upload&& upload) noexcept {
  try {
    upload.is_ready = true;
    if (upload.status == FS_ERROR_MEMORY && upload.text.empty()) {
      upload.text = "the server has not enough memory for the shape";
    }
    const auto found = uploads_.find(id);
    if (found != uploads_.end()) {  // else it was forgotten meanwhile
      if (upload.status != FS_OK) {
        refused_uploads_.insert(id);
        outbox_->edits.fetch_add(1, std::memory_order_release);
      }
      found->second = std::move(upload);
    }
    if (held_.ids.contains(id)) retry_parked();
    const std::vector<Message> waiting = std::exchange(waiting_edits_, {});
    for (const Message& message : waiting) edit(message);
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::finish_job() noexcept {
  --jobs_;
  regulate();
}

// Who is far ahead of what is done for it is not listened to meanwhile.
void Session::regulate() noexcept {
  if (is_gone_) return;
  const bool is_ahead = held_.messages >= most_parked || jobs_ >= most_jobs;
  const bool is_near = held_.messages < most_parked / 2 && jobs_ < most_jobs;
  if (is_reading_ ? is_ahead : is_near) server_.set_reading(*this, is_reading_ = !is_reading_);
}

// --------------------------------------------------------------------------------------------------------- changes

void Session::Held::add(const Unit& unit, const std::vector<Slot>& present) {
  slots.insert(unit.slots.begin(), unit.slots.end());
  for (const uint32_t slot : unit.slots) names.insert(present[slot].name);
  for (const Message& message : unit.messages) {
    if (message.header.type == wire::type_set) names.insert(text_of(message.as<wire::Set>().object.name));
  }
  ids.insert(unit.ids.begin(), unit.ids.end());
  all += unit.is_about_all;
  view += unit.is_about_view;
  messages += unit.messages.size();
}

bool Session::Held::blocks(const Unit& unit) const {
  if (messages == 0) return false;
  if (all || unit.is_about_all || (view && unit.is_about_view)) return true;
  const auto is_held = [](const auto& counts) { return [&counts](auto key) { return counts.contains(key); }; };
  const auto has_held_name = [this](const Message& message) {
    return message.header.type == wire::type_set && names.contains(text_of(message.as<wire::Set>().object.name));
  };
  return std::any_of(unit.slots.begin(), unit.slots.end(), is_held(slots)) ||
         std::any_of(unit.messages.begin(), unit.messages.end(), has_held_name) ||
         (unit.is_forget && std::any_of(unit.ids.begin(), unit.ids.end(), is_held(ids)));
}

bool Session::is_ready(const Unit& unit) const {
  return unit.is_forget || std::all_of(unit.ids.begin(), unit.ids.end(), [this](uint64_t id) {
    const auto found = uploads_.find(id);
    return found == uploads_.end() || found->second.is_ready;
  });
}

// What needs a shape that is being built waits for it, and what concerns the same objects behind it; all else goes on.
void Session::submit(Unit&& unit) {
  if (is_ready(unit) && !held_.blocks(unit)) return apply(unit);
  for (const Message& message : unit.messages) {
    if (message.header.type == wire::type_set) note_absent(message.as<wire::Set>(), FS_OBJECT_PENDING);
    if (message.header.type == wire::type_remove) absent_.erase(message.as<wire::Remove>().slot);
    if (message.header.type == wire::type_clear) absent_.clear();
  }
  held_.add(unit, slots_);
  parked_.push_back(std::move(unit));
  regulate();
}

void Session::tell_settled() noexcept {
  const bool waits = !parked_.empty() || !unit_.messages.empty();
  if (outbox_ && !waits) outbox_->settled.store(last_serial_, std::memory_order_release);
}

void Session::retry_parked() {
  std::deque<Unit> units = std::exchange(parked_, {});
  held_ = {};
  for (Unit& unit : units) {
    if (is_ready(unit) && !held_.blocks(unit)) {
      apply(unit);
    } else {
      held_.add(unit, slots_);
      parked_.push_back(std::move(unit));
    }
  }
  if (!edited_.empty()) outbox_->edits.fetch_add(1, std::memory_order_release);  // what had to wait can be told now
  tell_settled();
  regulate();
}

Session::Kept Session::keep(uint32_t slot) const {
  return {slots_[slot], look_up(absent_, slot), look_up(edited_, slot), look_up(awaited_, slot)};
}

void Session::apply(const Unit& unit) {
  if (unit.messages.size() == 1) {
    try {
      apply(unit.messages[0]);
    } catch (const Error& error) {
      refuse(unit.messages[0], error.status, error.text);
    }
    return;
  }
  // All or nothing.
  std::map<uint32_t, Kept> before;
  const auto keep_all = [&](const auto& map) {
    for (const auto& [slot, value] : map) before.emplace(slot, keep(slot));
  };
  for (const uint32_t slot : unit.slots) before.emplace(slot, keep(slot));
  if (unit.is_about_all) {
    for (const auto& [name, slot] : slot_of_) before.emplace(slot, keep(slot));
    keep_all(absent_);
    keep_all(edited_);
  }
  const uint64_t changes = changes_, moves = moves_;
  scene_->begin();
  is_applying_ = true;
  struct Applied {
    bool& is_applying;
    ~Applied() { is_applying = false; }
  } const applied{is_applying_};
  const Message* failed = nullptr;
  try {
    for (const Message& message : unit.messages) {
      failed = &message;
      apply(message);
      if ((&message - unit.messages.data()) % 64 == 63) server_.turn_if_due();
    }
    scene_->commit();
  } catch (const Error& error) {
    scene_->cancel();
    changes_ = changes;
    moves_ = moves;
    for (const auto& [slot, was] : before) slot_of_.erase(slots_[slot].name);
    for (const auto& [slot, was] : before) {
      slots_[slot] = was.slot;
      if (!was.slot.name.empty()) slot_of_[was.slot.name] = slot;
      put_back(absent_, slot, was.absent);
      put_back(edited_, slot, was.editor);
      put_back(awaited_, slot, was.awaited);
    }
    for (const Message& message : unit.messages) {
      const bool is_it = &message == failed;
      refuse(message, error.status, is_it ? error.text : "another change of its group was refused: " + error.text);
    }
  }
}

void Session::apply(const Message& message) {
  using namespace wire;
  switch (message.header.type) {
    case type_set: return apply_set(message.as<Set>(), message.header.serial, false);
    case type_change: return apply_set(message.as<Set>(), message.header.serial, true);
    case type_place: {
      const Place& place = message.as<Place>();
      Slot& slot = slots_[place.slot];
      if (slot.name.empty()) return;  // another client has removed it
      scene_->set_motion(slot.name.c_str(), from_record(place.movement));
      slot.after = message.header.serial;
      mark(place.slot);
      ++moves_;
      return;
    }
    case type_remove: {
      const uint32_t slot = message.as<Remove>().slot;
      if (slots_[slot].name.empty()) {  // it was refused, or another client has removed it
        absent_.erase(slot);
        return;
      }
      scene_->remove(slots_[slot].name.c_str());
      free_slot(slot);
      break;
    }
    case type_clear:
      scene_->clear();
      for (const auto& [name, slot] : slot_of_) slots_[slot] = {};
      slot_of_.clear();
      absent_.clear();
      edited_.clear();
      awaited_.clear();
      break;
    case type_frame: scene_->set_frame(message.as<Frame>().frame); break;
    case type_clutch: scene_->set_clutch(message.as<Clutch>().is_held != 0); break;
    case type_tool: {
      const wire::Tool& tool = message.as<wire::Tool>();
      if (tool.count > FS_TOOL_POINTS_MAX) fail(FS_ERROR_INVALID, "count is %llu points, must be 1..%d",
                                                static_cast<unsigned long long>(tool.count), FS_TOOL_POINTS_MAX);
      scene_->set_tool(tool.points, tool.count);
      break;
    }
    case type_forget:
      uploads_.erase(message.as<Forget>().id);
      refused_uploads_.erase(message.as<Forget>().id);
      return;
    default: return;
  }
  ++changes_;
}

void Session::apply_set(const wire::Set& set, uint64_t serial, bool is_change) {
  Slot& slot = slots_[set.slot];
  const std::string name = parse_name(set.object.name, "name");
  const auto known = slot_of_.find(name);
  const bool is_new = known == slot_of_.end();
  if (is_new ? !slot.name.empty() : known->second != set.slot) {
    fail(FS_ERROR_INVALID, "object '%s': its slot %u is not its own", name.c_str(), set.slot);
  }
  if (is_change && is_new) {
    const auto absent = look_up(absent_, set.slot);
    if (!absent || absent->state != FS_OBJECT_REFUSED) return;  // another client has removed it
    fail(FS_ERROR_NOT_FOUND, "object '%s' is not there: it was refused", name.c_str());
  }
  const fs_object object = resolve(set.object, set.parts, nullptr);
  bool brings_shape = false;
  if (!is_new && (set.parts & FS_PART_SHAPE) && object.shape) {
    fs_object present;
    const Ref<const Object> kept = scene_->get(name.c_str(), present);
    brings_shape = present.shape != object.shape;
  }
  if (is_change) {
    scene_->change(object, set.parts);
  } else {
    scene_->set(object);
  }
  if ((is_new || brings_shape) && set.object.is_enabled) awaited_[set.slot] = 0;
  absent_.erase(set.slot);
  slot.name = name;
  slot_of_[name] = set.slot;
  if (set.parts & FS_PART_POSE) {
    slot.after = serial;
    mark(set.slot);  // a move after it may have come by already
  }
  ++changes_;
}

void Session::free_slot(uint32_t slot) {
  slot_of_.erase(slots_[slot].name);
  absent_.erase(slot);
  edited_.erase(slot);
  awaited_.erase(slot);
  slots_[slot] = {};
}

// Others are told of it: what can be no object's is left out.
void Session::note_absent(const wire::Set& set, fs_object_state state) {
  const bool is_primitive = set.object.primitive >= FS_PRIMITIVE_POINT && set.object.primitive <= FS_PRIMITIVE_MESH;
  if (!slots_[set.slot].name.empty() || !is_primitive) return;
  try {
    const std::string name = parse_name(set.object.name, "name");
    if (!slot_of_.contains(name)) absent_[set.slot] = {name, static_cast<fs_primitive>(set.object.primitive), state};
  } catch (const Error&) {
  }
}

// What is there goes on as it was: it is moved on from here, and the client learns what it is.
void Session::refuse(const Message& message, fs_status status, const std::string& text) {
  ++refused_;
  const bool is_place = message.header.type == wire::type_place;
  if (is_place || message.header.type == wire::type_set || message.header.type == wire::type_change) {
    const uint32_t slot = is_place ? message.as<wire::Place>().slot : message.as<wire::Set>().slot;
    Slot& present = slots_[slot];
    if (!present.name.empty() && (is_place || present.name == text_of(message.as<wire::Set>().object.name))) {
      if (is_place || (message.as<wire::Set>().parts & FS_PART_POSE)) {
        present.after = message.header.serial;
        mark(slot);
      }
      edited_[slot] = name_;
      outbox_->edits.fetch_add(1, std::memory_order_release);
    }
  }
  if (!first_refused_) first_refused_ = {status, text};
  fs_event event{};
  event.kind = FS_EVENT_REFUSED;
  event.status = status;
  event.time = scene_->now();
  put_text(event.text, text);
  if (message.header.type == wire::type_set || message.header.type == wire::type_change) {
    const wire::Set& set = message.as<wire::Set>();
    put_text(event.name, text_of(set.object.name));
    note_absent(set, FS_OBJECT_REFUSED);
  }
  push_event(event);
}

// The object of a record, as far as `parts`, with the client's shapes and curves, or those that the target has or that
// were offered. Throws INVALID, STATE (no such shape of the server's), or why the shape could not be had.
fs_object Session::resolve(const wire::Object& record, uint32_t parts, const fs_object* target) const {
  fs_object out = from_record(record);
  const auto find = [&](uint64_t id) -> std::pair<const fs_shape*, const fs_curve*> {
    if (id & wire::of_server) {
      const uint64_t serial = id & ~wire::of_server;
      if (target && target->shape && target->shape->serial == serial) return {target->shape, nullptr};
      for (const fs_profile* p : {target ? &target->front : nullptr, target ? &target->back : nullptr}) {
        if (p && p->curve && p->curve->serial == serial) return {nullptr, p->curve};
      }
      const auto offered = offered_.find(serial);
      if (offered == offered_.end()) fail(FS_ERROR_STATE, "unknown shape");
      return {offered->second.first.get(), offered->second.second.get()};
    }
    const auto upload = uploads_.find(id);
    if (upload == uploads_.end()) fail(FS_ERROR_INVALID, "its shape or curve was not sent");
    if (upload->second.status != FS_OK) fail(upload->second.status, "%s", upload->second.text.c_str());
    return {upload->second.shape.get(), upload->second.curve.get()};
  };
  if ((parts & FS_PART_SHAPE) && record.shape) out.shape = const_cast<fs_shape*>(find(record.shape).first);
  if (parts & FS_PART_PROFILES) {
    if (record.front.curve) out.front.curve = const_cast<fs_curve*>(find(record.front.curve).second);
    if (record.back.curve) out.back.curve = const_cast<fs_curve*>(find(record.back.curve).second);
  }
  return out;
}

}  // namespace fs
