// What a client changes: its shapes and curves, its objects one by one and in groups, its view.
#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "server/session.h"

namespace fs {
namespace {

// Then its socket is not read, until some have been applied and done.
constexpr size_t most_parked = 4096;  // messages
constexpr size_t few_parked = 32;     // groups and changes, that cost little to look through
constexpr size_t few_steps = 4;       // of what takes about a microsecond each
constexpr size_t most_kept = 256;     // changes that are let go of at once
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

// What a map has of a name, and the same put back.
template <class Map>
std::optional<typename Map::mapped_type> look_up(const Map& map, const std::string& name) {
  const auto found = map.find(name);
  return found == map.end() ? std::nullopt : std::optional(found->second);
}
template <class Map>
void put_into(Map& map, const std::string& name, const std::optional<typename Map::mapped_type>& value) {
  if (value) map.insert_or_assign(name, *value);
  else map.erase(name);
}

}  // namespace

// While many objects change, which all are felt in the same tick: others have their turns meanwhile and are answered, this
// session is not.
struct Session::Applying {
  explicit Applying(Session& the_session) : session(the_session), was(std::exchange(session.is_applying_, true)) {}
  ~Applying() {
    session.is_applying_ = was;
    session.is_amid_drafts_ = was_amid_drafts;
  }
  Session& session;
  const bool was, was_amid_drafts = session.is_amid_drafts_;
};

void Session::let_others() {
  if (++steps_ % few_steps == 0) server_.let_others(this, is_amid_drafts_);
}

template <class Map>
void Session::empty(Map& map) {
  for (; !map.empty(); map.erase(map.begin())) let_others();
}

// Letting go of many changes takes a while, so the worker does.
void Session::let_go(Unit&& unit) {
  if (unit.messages.size() <= most_kept) return;
  const auto dead = std::make_shared<Unit>(std::move(unit));
  server_.worker(0).add(0, {[dead](Wanted&) { *dead = {}; }, [] {}});
}

// ------------------------------------------------------------------------------------------------- shapes and curves

void Session::take_upload(Message&& message, Descriptor&& came) {
  const bool is_shape = message.header.type == wire::type_shape;
  const uint64_t id = is_shape ? message.as<wire::Shape>().id : message.as<wire::Curve>().id;
  const size_t most = wire::most_data(server_.settings().max_objects);
  const auto forgets = [id](const Unit& unit) { return unit.is_forget && unit.ids.contains(id); };
  const auto found = held_.ids.contains(id) ? std::find_if(parked_.begin(), parked_.end(), forgets) : parked_.end();
  if (found != parked_.end()) {
    const Applying applying(*this);
    parked_.erase(found);  // it is wanted again before that could be done, so it stays
    held_ = {};
    for (const Unit& unit : parked_) {
      held_.add(unit);
      let_others();
    }
    const auto known = uploads_.find(id);
    if (known == uploads_.end() || !known->second.is_ready || known->second.status == FS_OK) return;
    uploads_.erase(known);  // it was refused: once more
  }
  // Parked changes hold some that the client has told to forget: then it is not read from until these are done.
  const bool is_too_much = uploads_.size() >= most && parked_.empty();
  if (id == 0 || (id & wire::of_server) || is_too_much || !uploads_.emplace(id, Upload{}).second) {
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
      fail(FS_ERROR_FULL, "this shape or curve of %llu bytes would make %llu, the server allows a client %llu megabytes",
           static_cast<unsigned long long>(bytes), static_cast<unsigned long long>(used + bytes),
           static_cast<unsigned long long>(limit / 1'000'000));
    }
    // Reading, checking and building take as long as they take: not on this thread.
    const auto made = std::make_shared<Upload>();
    auto work = [made, is_shape, message = std::move(message), data = std::make_shared<Descriptor>(std::move(came)),
                 charge = std::make_shared<Charge>(shape_bytes_, bytes), reader = channel_->reader.id](Wanted& wanted) {
      try {
        if (is_shape) {
          made->shape = from_record(message.as<wire::Shape>(), std::move(*data), wanted);
          made->shape->keep(charge);
          made->shape->build(wanted);
        } else {
          made->curve = from_record(message.as<wire::Curve>(), std::move(*data));
          made->curve->keep(charge);
          made->curve->prepare(reader);
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
    if (found != uploads_.end() && !found->second.is_ready) {  // else it was forgotten meanwhile
      if (upload.status != FS_OK) {
        refused_uploads_.insert(id);
        outbox_->edits.fetch_add(1, std::memory_order_release);
      }
      if (const void* const made = upload.shape ? static_cast<const void*>(upload.shape.get()) : upload.curve.get()) {
        upload_of_[made] = id;
      }
      found->second = std::move(upload);
    }
    if (held_.ids.contains(id)) {
      is_retry_due_ = true;
      if (parked_.size() <= few_parked) retry_parked();
    }
    retry_requests();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::finish_job() noexcept {
  --jobs_;
  regulate();
}

// Stop reading from a client with too much queued work.
void Session::regulate() noexcept {
  if (is_gone_) return;
  const bool has_too_much = !parked_.empty() && uploads_.size() >= wire::most_data(server_.settings().max_objects);
  const bool is_ahead = held_.cost >= most_parked || jobs_ >= most_jobs || has_too_much;
  const bool is_near = held_.cost < most_parked / 2 && jobs_ < most_jobs && !has_too_much;
  if (is_reading_ ? is_ahead : is_near) server_.set_reading(*this, is_reading_ = !is_reading_);
}

// --------------------------------------------------------------------------------------------------------- changes

void Session::Held::add(const Unit& unit) {
  constexpr size_t map_cost = 256;
  names.insert(unit.names.begin(), unit.names.end());
  ids.insert(unit.ids.begin(), unit.ids.end());
  all += unit.is_about_all;
  view += unit.is_about_view;
  cost += std::max(unit.messages.size(), unit.is_mapped ? map_cost : 1);
}

bool Session::Held::blocks(const Unit& unit) const {
  if (cost == 0) return false;
  if (all || unit.is_about_all || (view && unit.is_about_view)) return true;
  const auto is_in = [](const auto& held) { return [&held](const auto& key) { return held.contains(key); }; };
  return std::any_of(unit.names.begin(), unit.names.end(), is_in(names)) ||
         (unit.is_forget && std::any_of(unit.ids.begin(), unit.ids.end(), is_in(ids)));
}

bool Session::is_ready(const Unit& unit) const {
  return unit.is_forget || std::all_of(unit.ids.begin(), unit.ids.end(), [this](uint64_t id) {
    const auto found = uploads_.find(id);
    return found == uploads_.end() || found->second.is_ready;
  });
}

// A change that needs a shape which is being built waits for it, and later changes of the same objects wait behind it; all
// else goes on.
void Session::submit(Unit&& unit) {
  if (is_ready(unit) && !held_.blocks(unit)) {
    apply(unit);
    return let_go(std::move(unit));
  }
  for (const Message& message : unit.messages) {
    if (message.header.type == wire::type_set) note_absent(message.as<wire::Set>(), FS_OBJECT_PENDING);
    if (message.header.type == wire::type_remove) absent_.erase(text_of(message.as<wire::Remove>().name));
    if (message.header.type == wire::type_clear) absent_.clear();
  }
  held_.add(unit);
  parked_.push_back(std::move(unit));
  regulate();
}

void Session::tell_settled() noexcept {
  if (outbox_ && parked_.empty() && waiting_requests_.empty()) outbox_->applied.store(last_serial_, std::memory_order_release);
}

void Session::catch_up() noexcept {
  if (is_gone_ || !is_retry_due_ || (turns_until_retry_ > 0 && --turns_until_retry_ > 0)) return;
  try {
    retry_parked();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::retry_parked() {
  const Applying applying(*this);
  is_retry_due_ = false;
  turns_until_retry_ = parked_.size() / few_parked;
  std::deque<Unit> units = std::exchange(parked_, {});
  held_ = {};
  for (Unit& unit : units) {
    if (is_ready(unit) && !held_.blocks(unit)) {
      apply(unit);
      let_go(std::move(unit));
    } else {
      held_.add(unit);
      parked_.push_back(std::move(unit));
    }
    let_others();
  }
  retry_requests();
  // What had to wait can be told now.
  if (!edited_.empty() || is_view_edited_) outbox_->edits.fetch_add(1, std::memory_order_release);
  tell_settled();
  regulate();
}

// --------------------------------------------------------------------------------------------- what is known of a name

void Session::bind(const std::string& name, uint32_t slot, uint64_t after) {
  uint32_t& present = objects_[name];
  if (present != wire::no_slot && present != slot && slots_[present].name == name) slots_[present] = {};
  present = wire::no_slot;
  if (slot == wire::no_slot) return;
  // The client may have given the slot to another object, before this change or while it waited: the last word counts.
  if (Slot& other = slots_[slot]; !other.name.empty() && other.name != name) {
    if (other.after > after) return;
    objects_[other.name] = wire::no_slot;
  }
  present = slot;
  slots_[slot] = {name, after};
  mark(slot);  // a move after it may have come by already
}

void Session::forget_object(const std::string& name) {
  if (const auto found = objects_.find(name); found != objects_.end()) {
    if (found->second != wire::no_slot) slots_[found->second] = {};
    objects_.erase(found);
  }
  absent_.erase(name);
  edited_.erase(name);
  awaited_.erase(name);
}

Session::Kept Session::keep(const std::string& name) const {
  const std::optional<uint32_t> slot = look_up(objects_, name);
  const bool has_slot = slot && *slot != wire::no_slot;
  return {slot, has_slot ? slots_[*slot].after : 0, look_up(absent_, name), look_up(edited_, name), look_up(awaited_, name)};
}

void Session::put_back(const std::string& name, const Kept& kept) {
  if (kept.slot) {
    objects_.try_emplace(name, wire::no_slot);
    bind(name, *kept.slot, kept.after);
  }
  put_into(absent_, name, kept.absent);
  put_into(edited_, name, kept.editor);
  put_into(awaited_, name, kept.awaited);
}

// --------------------------------------------------------------------------------------------------------- changes

void Session::apply(const Unit& unit) {
  if (unit.messages.size() > 1) return apply_group(unit);
  for (const Message& message : unit.messages) {
    try {
      if (message.header.type < wire::type_sync) {
        apply(message, unit.serial);
      } else {
        apply_group(unit);
      }
    } catch (const Error& error) {
      refuse(unit, message, error);
    }
  }
}

// All or nothing.
void Session::apply_group(const Unit& unit) {
  std::map<std::string, Kept> before;
  const Applying applying(*this);
  const auto is_of_others = [](const Message& message) { return message.header.type >= wire::type_sync; };
  is_amid_drafts_ = std::any_of(unit.messages.begin(), unit.messages.end(), is_of_others);
  const auto keep_all = [&](const auto& map) {
    for (const auto& [name, value] : map) {
      before.emplace(name, keep(name));
      let_others();
    }
  };
  for (const std::string& name : unit.names) {
    before.emplace(name, keep(name));
    let_others();
  }
  if (unit.is_about_all) {
    keep_all(objects_);
    keep_all(absent_);
    keep_all(edited_);
  }
  const uint64_t changes = changes_, moves = moves_;
  std::map<const LocalScene*, Foreign> foreign;
  scene_->begin();
  const Message* failed = nullptr;
  try {
    for (const Message& message : unit.messages) {
      failed = &message;
      if (message.header.type < wire::type_sync) {
        apply(message, unit.serial);
      } else {
        apply_foreign(message, foreign);
      }
      let_others();
    }
    while (!scene_->commit(few_steps)) server_.let_others(this, is_amid_drafts_);
    for (auto& [scene, other] : foreign) other.scene->take(other.draft);
  } catch (const Error& error) {
    scene_->cancel();
    changes_ = changes;
    moves_ = moves;
    // Names that came with the group are gone before those that were there get their slots again.
    for (const auto& [name, was] : before) {
      forget_object(name);
      let_others();
    }
    for (const auto& [name, was] : before) {
      put_back(name, was);
      let_others();
    }
    return refuse(unit, *failed, error);
  }
  for (auto& [scene, other] : foreign) {
    for (const auto& [name, is_removed] : other.names) tell_edit(*other.scene, other.owner.get(), name, is_removed);
  }
  foreign.clear();
  empty(before);
}

void Session::apply(const Message& message, uint64_t serial) {
  using namespace wire;
  switch (message.header.type) {
    case type_set: return apply_set(message.as<Set>(), serial, false);
    case type_change: return apply_set(message.as<Set>(), serial, true);
    case type_place: {
      const std::string name = text_of(message.as<Place>().name);
      const auto found = objects_.find(name);
      if (found == objects_.end()) return;  // another client has removed it
      scene_->set_motion(name.c_str(), from_record(message.as<Place>().movement));
      bind(name, found->second, serial);
      ++moves_;
      return;
    }
    case type_bind: {
      const std::string name = text_of(message.as<Bind>().name);
      if (objects_.contains(name)) bind(name, message.as<Bind>().slot, serial);
      return;
    }
    case type_remove: {
      const std::string name = text_of(message.as<Remove>().name);
      if (!objects_.contains(name)) {  // it was refused, or another client has removed it
        absent_.erase(name);
        return;
      }
      scene_->remove(name.c_str());
      forget_object(name);
      break;
    }
    case type_clear: {
      const Applying applying(*this);
      for (auto next = objects_.begin(); next != objects_.end(); next = objects_.erase(next)) {
        scene_->remove(next->first.c_str());
        if (next->second != no_slot) slots_[next->second] = {};
        let_others();
      }
      empty(absent_);
      empty(edited_);
      empty(awaited_);
      break;
    }
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
      if (const auto found = uploads_.find(message.as<Forget>().id); found != uploads_.end()) {
        upload_of_.erase(found->second.shape ? static_cast<const void*>(found->second.shape.get())
                                             : found->second.curve.get());
        uploads_.erase(found);
      }
      refused_uploads_.erase(message.as<Forget>().id);
      return;
    default: return;
  }
  ++changes_;
}

void Session::apply_set(const wire::Set& set, uint64_t serial, bool is_change) {
  const std::string name = parse_name(text_of(set.object.name).c_str(), "name");
  const bool is_new = !objects_.contains(name);
  if (is_change && is_new) {
    const auto absent = look_up(absent_, name);
    if (!absent || absent->state != FS_OBJECT_REFUSED) return;  // another client has removed it
    fail(FS_ERROR_NOT_FOUND, "object '%s' is not there: it was refused", name.c_str());
  }
  if (is_new && objects_.size() >= server_.settings().max_objects) {
    fail(FS_ERROR_FULL, "object '%s' would be one more than the %u that the server allows a client", name.c_str(),
         server_.settings().max_objects);
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
  if ((is_new || brings_shape) && set.object.is_enabled) awaited_[name] = 0;
  absent_.erase(name);
  if (is_new) objects_[name] = wire::no_slot;
  if (is_new || (set.parts & FS_PART_POSE)) bind(name, set.slot, serial);
  ++changes_;
}

void Session::change_foreign(Foreign& other, const Message& message, const std::string& name) const {
  if (message.header.type == wire::type_edit) {
    const wire::Edit& edit = message.as<wire::Edit>();
    const uint32_t parts = parse_parts(edit.parts);
    fs_object present;
    const Ref<const Object> kept = other.scene->get(other.draft, name.c_str(), present);
    fs_object object = resolve(edit.object, parts, &present);
    put_text(object.name, name);
    other.scene->change(other.draft, object, parts);
  } else if (message.header.type == wire::type_move_other) {
    const wire::MoveOther& move = message.as<wire::MoveOther>();
    other.scene->move(other.draft, name.c_str(), move.pose, move.has_twist ? &move.twist : nullptr, move.time);
  } else {
    other.scene->remove(other.draft, name.c_str());
  }
}

// A change of another client's object, as part of a group.
void Session::apply_foreign(const Message& message, std::map<const LocalScene*, Foreign>& foreign) const {
  using namespace wire;
  const wire::Target& whose = message.as<Target>();  // each of them begins with it
  Session* owner;
  std::string name;
  LocalScene& scene = target(whose, true, owner, name);
  const auto found = foreign.find(&scene);
  if (found == foreign.end() && owner) owner->take_moves();  // what it has moved before
  Foreign& other = found != foreign.end()
                       ? found->second
                       : foreign.try_emplace(&scene, owner ? owner->shared_from_this() : nullptr, Ref<LocalScene>::share(&scene))
                             .first->second;
  try {
    change_foreign(other, message, name);
  } catch (const Error& error) {
    throw Error{error.status, "'" + text_of(whose.name) + "': " + error.text};
  }
  other.names[name] = message.header.type == type_remove_other;
}

// Others are told of an object that waits for its shape, or was refused.
void Session::note_absent(const wire::Set& set, fs_object_state state) {
  const bool is_primitive = set.object.primitive >= FS_PRIMITIVE_POINT && set.object.primitive <= FS_PRIMITIVE_MESH;
  if (!is_primitive || absent_.size() >= 2 * slots_.size()) return;
  try {
    const std::string name = parse_name(text_of(set.object.name).c_str(), "name");
    if (!objects_.contains(name)) absent_[name] = {static_cast<fs_primitive>(set.object.primitive), state};
  } catch (const Error&) {
  }
}

// The client has to be told of the name. It has not more names than it may have objects, twice that with those refused.
void Session::note_untold(const std::string& name) {
  if (edited_.size() < 4 * slots_.size()) edited_[name] = name_;
}

// What is there goes on as it was. The client believes otherwise until it has been told, so each name that it spoke of is
// told; and moves it writes meanwhile are taken.
void Session::refuse(const Unit& unit, const Message& failed, const Error& error) {
  const double now = scene_->now();
  const Applying applying(*this);
  for (const std::string& name : unit.names) {
    if (name.find('/') == std::string::npos) note_untold(name);
    let_others();
  }
  if (unit.is_about_all) {
    for (const auto& [name, slot] : objects_) edited_[name] = name_;
    for (const auto& [name, absent] : absent_) edited_[name] = name_;
  }
  is_view_edited_ = is_view_edited_ || unit.is_about_view;
  for (const Message& message : unit.messages) {
    ++refused_;
    fs_event event{};
    event.kind = FS_EVENT_REFUSED;
    event.status = error.status;
    event.time = now;
    put_text(event.text, &message == &failed ? error.text : "another change of its group was refused: " + error.text);
    const uint32_t type = message.header.type;
    std::string name;
    if (type == wire::type_set || type == wire::type_change) {
      const wire::Set& set = message.as<wire::Set>();
      name = text_of(set.object.name);
      if (type == wire::type_set) note_absent(set, FS_OBJECT_REFUSED);
      if ((set.parts & FS_PART_POSE) && objects_.contains(name)) bind(name, set.slot, unit.serial);
    } else if (type == wire::type_place || type == wire::type_bind) {
      name = type == wire::type_place ? text_of(message.as<wire::Place>().name) : text_of(message.as<wire::Bind>().name);
      if (const auto found = objects_.find(name); found != objects_.end()) {
        bind(name, type == wire::type_bind ? message.as<wire::Bind>().slot : found->second, unit.serial);
      }
    } else if (type == wire::type_remove) {
      name = text_of(message.as<wire::Remove>().name);
      absent_.erase(name);  // nor does the client want it
    } else if (type == wire::type_clear) {
      absent_.clear();
    } else if (type >= wire::type_sync) {  // of another client's object
      name = text_of(message.as<wire::Target>().name);
    }
    put_text(event.name, name);
    push_event(event);
    let_others();
  }
  outbox_->edits.fetch_add(1, std::memory_order_release);
  if (!first_refused_) first_refused_ = {error.status, error.text};
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
      const Offer* const offer = find_offer(serial);
      if (!offer) fail(FS_ERROR_STATE, "%s", wire::not_offered);
      return {offer->shape.get(), offer->curve.get()};
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
