// A client's life and its changes. What it asks: requests.cpp.
#include "server/session.h"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/syscall.h>

#include <algorithm>
#include <cstring>
#include <new>

#include "base/error.h"

namespace fs {
namespace {

constexpr int messages_at_once = 64;
constexpr unsigned most_parked = 1024;  // units; then its socket is not read until some have been applied

// Of the record that comes with a type; -1: no such type.
ssize_t body_size(uint32_t type) {
  using namespace wire;
  switch (type) {
    case type_shape: return sizeof(wire::Shape);
    case type_curve: return sizeof(wire::Curve);
    case type_forget: return sizeof(Forget);
    case type_set:
    case type_change: return sizeof(Set);
    case type_place: return sizeof(Place);
    case type_remove: return sizeof(Remove);
    case type_frame: return sizeof(Frame);
    case type_clutch: return sizeof(Clutch);
    case type_tool: return sizeof(wire::Tool);
    case type_clear:
    case type_wake:
    case type_sync:
    case type_pull:
    case type_reports:
    case type_clients:
    case type_stats:
    case type_device: return 0;
    case type_get:
    case type_report:
    case type_view:
    case type_remove_other: return sizeof(Target);
    case type_fetch: return sizeof(Fetch);
    case type_edit: return sizeof(Edit);
    case type_move_other: return sizeof(MoveOther);
    default: return -1;
  }
}

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

bool has_event(const Descriptor& descriptor, short events) noexcept {
  pollfd look{descriptor.get(), events, 0};
  return descriptor && poll(&look, 1, 0) > 0 && (look.revents & events);
}

}  // namespace

Session::Session(fs_server& server, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal)
    : server_(server), id_(id), socket_(std::move(socket)), peer_(peer), refusal_(refusal), since_(steady_now()) {
  // Of another name space of processes, or gone already: then the socket tells alone.
  if (peer.process > 0) process_ = Descriptor(static_cast<int>(syscall(SYS_pidfd_open, peer.process, 0)));
}

Session::~Session() = default;

bool Session::is_alive() const noexcept {
  return !is_gone_ && !has_event(process_, POLLIN) && !has_event(socket_, POLLHUP);
}

void Session::drop(double lease) noexcept {
  if (is_gone_) return;
  is_gone_ = true;
  if (channel_) channel_->leave(scene_->now() + lease);
  if (outbox_) outbox_->is_closed.store(1);
  server_.unwatch(*this);
  socket_.reset();
  process_.reset();
}

void Session::set_asleep(bool is_asleep) noexcept {
  if (outbox_) outbox_->is_asleep.store(is_asleep);
}

bool Session::is_busy() const noexcept {
  return !awaited_.empty() || !syncs_.empty() || !parked_.empty() || !waiting_edits_.empty();
}

// ------------------------------------------------------------------------------------------------------- what comes in

void Session::receive() noexcept {
  try {
    alignas(16) static thread_local std::byte buffer[most_message];
    for (int i = 0; i < messages_at_once && !is_gone_ && is_reading_; ++i) {
      Descriptor data;
      size_t size;
      bool is_cut;
      const Transfer transfer = receive_message(socket_, buffer, size, {&data, 1}, is_cut);
      if (transfer == Transfer::again) return;
      if (transfer == Transfer::closed) return drop(server_.settings().lease);
      server_.note_activity();
      Message message{};
      if (name_.empty()) {
        message.body.assign(buffer, buffer + size);
        greet(message);
        continue;
      }
      if (size < sizeof message.header) return drop(server_.settings().lease);
      std::memcpy(&message.header, buffer, sizeof message.header);
      message.body.assign(buffer + sizeof message.header, buffer + size);
      const ssize_t wanted = body_size(message.header.type);
      if (wanted < 0 || static_cast<size_t>(wanted) != message.body.size() || message.header.serial <= last_serial_) {
        return drop(server_.settings().lease);
      }
      last_serial_ = message.header.serial;
      handle(std::move(message), std::move(data));
    }
  } catch (...) {  // no memory, or no descriptors, for this client
    drop(server_.settings().lease);
  }
}

void Session::answer(fs_status status, const std::string& text, std::span<const std::byte> rest,
                     std::span<const int> descriptors) {
  wire::Answer out{};
  out.magic = wire::magic;
  out.layout = wire::layout_id();
  out.status = status;
  put_text(out.text, text);
  const std::span<const std::byte> parts[] = {bytes_of(&out, 1), rest};
  if (send_message(socket_, parts, descriptors) != Transfer::done || status != FS_OK) drop(0);
}

// The first message: who it is, and whether both ends mean the same.
void Session::greet(const Message& message) {
  const ServerSettings& settings = server_.settings();
  wire::Hello hello{};
  std::memcpy(&hello, message.body.data(), std::min(message.body.size(), sizeof hello));
  if (hello.magic != wire::magic || message.body.size() < sizeof hello) return drop(0);
  if (refusal_ == FS_ERROR_DENIED) return answer(refusal_, "this server lets in its own user only");
  if (hello.layout != wire::layout_id()) {
    const std::string& layout = wire::layout_text();
    const std::string text = "the client is version " + text_of(hello.version) + " of the library, the server " +
                             fs_version() + ", and they do not go together: ";
    return answer(FS_ERROR_VERSION, text, bytes_of(layout.data(), std::min<size_t>(layout.size(), 60000)));
  }
  try {
    const std::string name = parse_name(hello.client, "client_name");
    if (name == "server") fail(FS_ERROR_INVALID, "client_name is 'server', which is the name of the server's own scene");
    Session* const other = server_.find(name);
    if (other && !other->is_alive()) {
      other->drop(settings.lease);
    } else if (other) {
      fail(FS_ERROR_EXISTS, "client_name is '%s': a client of that name is connected (process %d)", name.c_str(),
           static_cast<int>(other->peer_.process));
    }
    if (server_.client_count() >= settings.max_clients) {
      fail(FS_ERROR_FULL, "the server has %u clients, its maximum", settings.max_clients);
    }

    const Descriptor inbox = make_region("forceserver-inbox", Inbox::bytes(settings.max_objects));
    seal_region(inbox, false);
    const Descriptor outbox = make_region("forceserver-outbox", sizeof(Outbox));
    inbox_memory_ = map_region(inbox, Inbox::bytes(settings.max_objects), true);
    const std::shared_ptr<void> memory = map_region(outbox, sizeof(Outbox), true);
    seal_region(outbox, true);
    inbox_ = Inbox(inbox_memory_.get(), settings.max_objects);
    // All bytes are 0, as an Outbox begins: not a page is touched that need not be.
    outbox_ = std::shared_ptr<Outbox>(memory, static_cast<Outbox*>(memory.get()));
    outbox_->heartbeat.store(steady_now());
    slots_.resize(settings.max_objects);
    dirty_.resize((settings.max_objects + 63) / 64);
    scene_ = make_ref<LocalScene>(std::shared_ptr<ServoOutput>(outbox_, &outbox_->servo));
    scene_->hold();
    channel_ = server_.servo().add_channel(scene_, settings.limits);
    connected_ = scene_->now();
    name_ = name;

    wire::Welcome welcome{};
    welcome.inbox_bytes = Inbox::bytes(settings.max_objects);
    welcome.outbox_bytes = sizeof(Outbox);
    welcome.max_objects = settings.max_objects;
    welcome.is_virtual = server_.servo().clock() == ClockKind::virtual_time;
    welcome.rate = server_.servo().settings().rate;
    const int descriptors[] = {inbox.get(), outbox.get()};
    answer(FS_OK, "", bytes_of(&welcome, 1), descriptors);
  } catch (const Error& error) {
    answer(error.status, error.text);
  }
}

void Session::handle(Message&& message, Descriptor&& data) {
  using namespace wire;
  const uint32_t type = message.header.type;
  if (type == type_wake) return;
  if (type >= type_sync) {
    if (!unit_.messages.empty()) return drop(server_.settings().lease);  // in the middle of a group
    return request(message);
  }
  if (type == type_shape || type == type_curve) {
    if (!unit_.messages.empty()) return drop(server_.settings().lease);
    return take_upload(std::move(message), std::move(data));
  }

  const auto need = [this](uint64_t id) {
    if (id) unit_.ids.insert(id);
  };
  uint32_t slot = 0;
  switch (type) {
    case type_set:
    case type_change: {
      const Set& set = message.as<Set>();
      slot = set.slot;
      unit_.slots.insert(slot);
      if (set.parts & FS_PART_SHAPE) need(set.object.shape);
      if (set.parts & FS_PART_PROFILES) {
        need(set.object.front.curve);
        need(set.object.back.curve);
      }
      break;
    }
    case type_place: unit_.slots.insert(slot = message.as<Place>().slot); break;
    case type_remove: unit_.slots.insert(slot = message.as<Remove>().slot); break;
    case type_clear: unit_.is_about_all = true; break;
    case type_forget:
      unit_.is_forget = true;
      need(message.as<Forget>().id);
      break;
    default: break;  // of the view
  }
  const bool goes_on = message.header.more != 0;
  unit_.messages.push_back(std::move(message));
  const size_t most = 4 * size_t{server_.settings().max_objects} + 64;
  if (slot >= slots_.size() || unit_.messages.size() > most || (unit_.is_forget && unit_.messages.size() > 1)) {
    return drop(server_.settings().lease);
  }
  if (!goes_on) submit(std::exchange(unit_, {}));
}

// ------------------------------------------------------------------------------------------------- shapes and curves

void Session::take_upload(Message&& message, Descriptor&& came) {
  const bool is_shape = message.header.type == wire::type_shape;
  const uint64_t id = is_shape ? message.as<wire::Shape>().id : message.as<wire::Curve>().id;
  const size_t most = 4 * size_t{server_.settings().max_objects} + 64;
  if (id == 0 || (id & wire::of_server) || uploads_.size() >= most || !uploads_.emplace(id, Upload{}).second) {
    return drop(server_.settings().lease);
  }
  Upload refused;
  try {
    const uint64_t bytes = is_shape ? data_size(message.as<wire::Shape>()) : data_size(message.as<wire::Curve>());
    const uint64_t used = shape_bytes_->load(), limit = server_.settings().max_bytes;
    if (bytes > limit || used > limit - bytes) {
      fail(FS_ERROR_FULL, "shapes of %llu bytes would come to %llu: a client may have at most %llu megabytes",
           static_cast<unsigned long long>(used), static_cast<unsigned long long>(bytes),
           static_cast<unsigned long long>(limit / 1'000'000));
    }
    // Reading, checking and building take as long as they take: not on this thread.
    server_.worker().add(id_, [server = &server_, session = id_, is_shape, id, message = std::move(message),
                               data = std::make_shared<Descriptor>(std::move(came)),
                               charge = std::make_shared<Charge>(shape_bytes_, bytes)]() -> Worker::Done {
      const auto made = std::make_shared<Upload>();
      try {
        if (is_shape) {
          made->shape = from_record(message.as<wire::Shape>(), std::move(*data));
          made->shape->keep(charge);
          made->shape->build();
        } else {
          made->curve = from_record(message.as<wire::Curve>(), std::move(*data));
          made->curve->keep(charge);
        }
      } catch (const Error& error) {
        *made = {false, nullptr, nullptr, error.status, error.text};
      } catch (...) {
        *made = {false, nullptr, nullptr, FS_ERROR_MEMORY, ""};
      }
      return [server, session, id, made] {
        if (const std::shared_ptr<Session> found = server->find(session)) found->finish_upload(id, std::move(*made));
      };
    });
    return;
  } catch (const Error& error) {
    refused = {false, nullptr, nullptr, error.status, error.text};
  }
  finish_upload(id, std::move(refused));
}

void Session::finish_upload(uint64_t id, Upload&& upload) {
  const auto found = uploads_.find(id);
  if (found == uploads_.end() || is_gone_) return;
  upload.is_ready = true;
  if (upload.status == FS_ERROR_MEMORY && upload.text.empty()) upload.text = "the server has not enough memory for the shape";
  found->second = std::move(upload);
  retry_parked();
  const std::vector<Message> waiting = std::exchange(waiting_edits_, {});
  for (const Message& message : waiting) edit(message);
}

// --------------------------------------------------------------------------------------------------------- changes

void Session::Held::add(const Unit& unit, int sign) {
  const auto count = [sign](auto& counts, auto key) {
    const auto found = counts.try_emplace(key, 0).first;
    if (sign > 0) ++found->second;
    else if (--found->second == 0) counts.erase(found);
  };
  for (const uint32_t slot : unit.slots) count(slots, slot);
  for (const uint64_t id : unit.ids) count(ids, id);
  all += static_cast<unsigned>(sign) * unit.is_about_all;
  units += static_cast<unsigned>(sign);
}

bool Session::Held::blocks(const Unit& unit) const {
  if (units == 0) return false;
  if (all || unit.is_about_all) return true;
  const auto is_held = [](const auto& counts) { return [&counts](auto key) { return counts.contains(key); }; };
  return std::any_of(unit.slots.begin(), unit.slots.end(), is_held(slots)) ||
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
    if (message.header.type != wire::type_set) continue;
    const fs_object object = from_record(message.as<wire::Set>().object);
    const std::string name = text_of(object.name);
    if (!slot_of_.contains(name)) absent_[name] = {object.primitive, FS_OBJECT_PENDING};
  }
  held_.add(unit, 1);
  parked_.push_back(std::move(unit));
  if (held_.units >= most_parked) server_.set_reading(*this, is_reading_ = false);
}

void Session::retry_parked() {
  std::deque<Unit> units = std::exchange(parked_, {});
  held_ = {};
  is_late_ = true;
  for (Unit& unit : units) {
    if (is_ready(unit) && !held_.blocks(unit)) {
      apply(unit);
    } else {
      held_.add(unit, 1);
      parked_.push_back(std::move(unit));
    }
  }
  is_late_ = false;
  if (!is_reading_ && !is_gone_ && held_.units < most_parked / 2) server_.set_reading(*this, is_reading_ = true);
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
  std::map<uint32_t, Slot> before;
  for (uint32_t i = 0; i < slots_.size(); ++i) {
    if (unit.slots.contains(i) || (unit.is_about_all && !slots_[i].name.empty())) before[i] = slots_[i];
  }
  const size_t awaited = awaited_.size();
  const uint64_t changes = changes_;
  scene_->begin();
  const Message* failed = nullptr;
  try {
    for (const Message& message : unit.messages) {
      failed = &message;
      apply(message);
    }
    scene_->commit();
  } catch (const Error& error) {
    scene_->cancel();
    awaited_.resize(awaited);
    changes_ = changes;
    for (const uint32_t slot : unit.slots) slot_of_.erase(slots_[slot].name);
    for (const auto& [slot, was] : before) {
      slots_[slot] = was;
      if (!was.name.empty()) slot_of_[was.name] = slot;
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
      ::fs::Movement movement = scene_->movement(slot.name.c_str());
      movement.motion = from_record(place.movement);
      movement.track.take(movement.motion.pose, &movement.motion.twist, movement.motion.time);
      scene_->set_movement(slot.name.c_str(), movement);
      slot.after = message.header.serial;
      mark(place.slot);
      ++moves_;
      return;
    }
    case type_remove: {
      const uint32_t slot = message.as<Remove>().slot;
      if (slots_[slot].name.empty()) return;
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
    case type_forget: uploads_.erase(message.as<Forget>().id); return;
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
  if (is_change && is_new) return;  // another client has removed it
  const fs_object object = resolve(set.object, set.parts, nullptr);
  if (is_change) {
    scene_->change(object, set.parts);
  } else {
    scene_->set(object);
  }
  if (is_new || is_late_) awaited_.push_back({name, 0});
  absent_.erase(name);
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
  absent_.erase(slots_[slot].name);
  edited_.erase(slot);
  slots_[slot] = {};
}

void Session::refuse(const Message& message, fs_status status, const std::string& text) {
  ++refused_;
  if (!first_refused_) first_refused_ = {status, text};
  fs_event event{};
  event.kind = FS_EVENT_REFUSED;
  event.status = status;
  event.time = scene_->now();
  put_text(event.text, text);
  if (message.header.type == wire::type_set || message.header.type == wire::type_change) {
    const fs_object object = from_record(message.as<wire::Set>().object);
    const std::string name = text_of(object.name);
    put_text(event.name, name);
    if (!slot_of_.contains(name) && absent_.size() < slots_.size()) absent_[name] = {object.primitive, FS_OBJECT_REFUSED};
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

// ------------------------------------------------------------------------------------------------- the shared memory

void Session::take_moves() {
  const uint64_t batch = inbox_.batch();
  if (batch & 1) return;  // a group is being written: all of it at once, later
  inbox_.take_dirty([this](uint32_t slot) { mark(slot); });
  moved_.clear();
  for (size_t word = 0; word < dirty_.size(); ++word) {
    for (uint64_t bits = std::exchange(dirty_[word], 0); bits != 0; bits &= bits - 1) {
      const auto slot = static_cast<uint32_t>(64 * word) + static_cast<uint32_t>(__builtin_ctzll(bits));
      wire::Move move;
      // Not whole: it is being written, and will be marked again. After a change that has not come yet: that marks it.
      if (!slots_[slot].name.empty() && inbox_.read(slot, move) && move.after == slots_[slot].after) {
        moved_.emplace_back(slot, move);
      }
    }
  }
  if (inbox_.batch() != batch) {  // a group came between: it belongs together, so once more
    for (const auto& [slot, move] : moved_) mark(slot);
    return;
  }
  for (const auto& [slot, move] : moved_) {
    ::fs::Movement movement;
    if (!from_record(move.movement, movement.motion)) {
      ++refused_;
      continue;
    }
    try {
      const char* name = slots_[slot].name.c_str();
      const Motion motion = movement.motion;
      movement = scene_->movement(name);
      movement.track.take(motion.pose, &motion.twist, motion.time);
      movement.motion = motion;
      scene_->set_movement(name, movement);
      ++moves_;
    } catch (const Error&) {  // the object is not there any more
    }
  }
  if (!moved_.empty()) server_.note_activity();
}

void Session::turn(double now) noexcept {
  if (is_gone_ || name_.empty()) return;
  try {
    outbox_->heartbeat.store(now, std::memory_order_relaxed);
    take_moves();
    scene_->post();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::settle() noexcept {
  if (is_gone_ || name_.empty()) return;
  try {
    const uint64_t used = scene_->output->used.load(std::memory_order_acquire);
    std::erase_if(awaited_, [&](Awaited& awaited) {
      if (awaited.sequence == 0) awaited.sequence = scene_->sequence();
      if (used < awaited.sequence) return false;
      fs_event event{};
      event.kind = FS_EVENT_READY;
      event.time = scene_->now();
      put_text(event.name, awaited.name);
      if (slot_of_.contains(awaited.name)) push_event(event);
      return true;
    });
    settle_syncs();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::keep_house() noexcept {
  if (is_gone_) return;
  if (name_.empty()) {
    constexpr double patience = 2;  // s
    if (steady_now() - since_ > patience) drop(0);
    return;
  }
  try {
    for (fs_event event; scene_->take_event(event);) push_event(event);
    if (channel_->is_bad()) drop(0);
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::push_event(const fs_event& event) noexcept {
  const uint64_t number = outbox_->events_written.load(std::memory_order_relaxed);
  outbox_->events[number % event_slots].write({number, event});
  outbox_->events_written.store(number + 1, std::memory_order_release);
}

void Session::note_edit(const std::string& object, const std::string& editor, bool is_removed) {
  const auto found = slot_of_.find(object);
  if (found == slot_of_.end()) return;
  const uint32_t slot = found->second;
  std::string& told = edited_[slot];
  if (told != editor || is_removed) {  // of a stream of changes one is told, until the client has seen them
    fs_event event{};
    event.kind = FS_EVENT_EDITED;
    event.time = scene_->now();
    put_text(event.name, object);
    put_text(event.text, editor);
    push_event(event);
  }
  told = editor;
  if (is_removed) {
    slots_[slot] = {};
    slot_of_.erase(found);
  }
  outbox_->edits.fetch_add(1, std::memory_order_release);
}

}  // namespace fs
