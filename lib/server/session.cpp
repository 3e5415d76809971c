// A client's life, and what comes in. Its changes: changes.cpp; what it asks: requests.cpp.
#include "server/session.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <new>

#include "base/error.h"
#include "ipc/region.h"
#include "transfer/layout.h"

namespace fs {
namespace {

constexpr int most_awaited = 128;  // objects that are looked at in a turn, whether a tick has used them

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
    case type_bind: return sizeof(Bind);
    case type_clear:
    case type_wake:
    case type_sync:
    case type_reports:
    case type_clients:
    case type_stats:
    case type_device: return 0;
    case type_get:
    case type_pull:
    case type_report:
    case type_view:
    case type_motions:
    case type_remove_other: return sizeof(Target);
    case type_fetch: return sizeof(Fetch);
    case type_edit: return sizeof(Edit);
    case type_move_other: return sizeof(MoveOther);
    default: return -1;
  }
}

bool has_event(const Descriptor& descriptor, short events) noexcept {
  pollfd look{descriptor.get(), events, 0};
  return descriptor && poll(&look, 1, 0) > 0 && (look.revents & events);
}

}  // namespace

Session::Session(fs_server& server, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal)
    : server_(server), id_(id), socket_(std::move(socket)), peer_(peer), refusal_(refusal), since_(steady_now()) {
  process_ = open_process(peer.process);  // none: then the socket tells alone
}

Session::~Session() = default;

bool Session::is_alive() const noexcept {
  return !is_gone_ && !has_event(process_, POLLIN) && !has_event(socket_, POLLHUP);
}

void Session::drop(double lease) noexcept {
  if (is_gone_) return;
  is_gone_ = true;
  if (channel_) {
    channel_->leave(scene_->is_empty() ? -never : scene_->now() + lease);
    server_.note_leaving(channel_);
  }
  if (outbox_) outbox_->is_closed.store(1);
  server_.unwatch(*this);
  server_.forget_jobs(id_);
  if (socket_) shutdown(socket_.get(), SHUT_RDWR);  // a process that was forked from this one may have it, too
  socket_.reset();
  process_.reset();
}

void Session::set_asleep(bool is_asleep) noexcept {
  if (outbox_) outbox_->is_asleep.store(is_asleep);
}

bool Session::is_busy() const noexcept {
  return is_applying_ || !awaited_.empty() || !syncs_.empty() || !parked_.empty() || !waiting_requests_.empty();
}

// ------------------------------------------------------------------------------------------------------- what comes in

bool Session::is_next_apart(const Session* busy, uint64_t round) noexcept {
  if (is_gone_ || name_.empty() || is_applying_ || round_to_wait_ == round) return false;
  struct {
    wire::Header header;
    wire::Target target;
  } next{};
  const ssize_t size = recv(socket_.get(), &next, sizeof next, MSG_PEEK | MSG_DONTWAIT);
  using namespace wire;
  bool is_apart = size >= static_cast<ssize_t>(sizeof next.header);
  switch (next.header.type) {
    case type_group:  // these may be long themselves
    case type_clear:
    case type_reports:  // and these are about all
    case type_motions:
    case type_clients: is_apart = false; break;
    case type_get:
    case type_report:
    case type_view:
    case type_edit:
    case type_move_other:
    case type_remove_other: {
      const std::string target = text_of(next.target.name);
      if (busy && target.substr(0, target.find('/')) == busy->name_) is_apart = false;
      break;
    }
    default: break;
  }
  if (!is_apart) round_to_wait_ = round;
  return is_apart;
}

void Session::receive(int most) noexcept {
  try {
    const std::span<std::byte> buffer = server_.message_buffer();
    const double start = steady_now();
    for (int i = 0; i < most && !is_gone_ && is_reading_; ++i) {
      if (i > 0 && steady_now() - start > fs_server::slice) return;
      Descriptor data;
      size_t size;
      bool is_cut;
      const Transfer transfer = receive_message(socket_, buffer, size, {&data, 1}, is_cut);
      if (transfer == Transfer::again) return;
      if (transfer == Transfer::closed) return drop(server_.settings().lease);
      server_.note_activity();
      if (name_.empty()) {
        greet(buffer.first(size));
        continue;
      }
      Message message{};
      if (size < sizeof message.header) return drop(server_.settings().lease);
      std::memcpy(&message.header, buffer.data(), sizeof message.header);
      size -= sizeof message.header;
      const std::shared_ptr<std::byte[]> memory = std::make_shared_for_overwrite<std::byte[]>(size);
      std::memcpy(memory.get(), buffer.data() + sizeof message.header, size);
      message.body = {memory.get(), size};
      message.memory = memory;
      const uint32_t type = message.header.type;
      const bool is_size_good = type == wire::type_group ? size >= sizeof(wire::Group)
                                                         : body_size(type) == static_cast<ssize_t>(size);
      if (!is_size_good || message.header.serial <= last_serial_) return drop(server_.settings().lease);
      last_serial_ = message.header.serial;
      handle(std::move(message), std::move(data));
      tell_settled();
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
void Session::greet(std::span<const std::byte> message) {
  const ServerSettings& settings = server_.settings();
  wire::Hello hello{};
  std::memcpy(&hello, message.data(), std::min(message.size(), sizeof hello));
  if (hello.magic != wire::magic || message.size() < sizeof hello) return drop(0);
  if (refusal_ == FS_ERROR_DENIED) {
    return answer(refusal_, "this server lets in its own user only; one with all_users lets in others");
  }
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
    // What is left of clients that came and went costs the servo as much as they did.
    const size_t most = settings.max_clients + std::max<size_t>(settings.max_clients, 32);
    if (server_.client_count() + server_.count_leaving() >= most) {
      server_.end_leases();
      fail(FS_ERROR_FULL, "too many clients came and went: there is room again when their objects have faded out");
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
    scene_->set_capacity(2 * settings.max_objects);  // all of them anew, while the old ones fade out
    channel_ = server_.servo().add_channel(scene_, settings.limits);
    connected_ = scene_->now();
    name_ = name;

    wire::Welcome welcome{};
    welcome.inbox_bytes = Inbox::bytes(settings.max_objects);
    welcome.outbox_bytes = sizeof(Outbox);
    welcome.max_objects = settings.max_objects;
    welcome.is_virtual = server_.servo().clock() == ClockKind::virtual_time;
    welcome.is_locked = settings.is_locked;
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
  if (type == type_group) return take_group(message, std::move(data));
  if (type == type_shape || type == type_curve) return take_upload(std::move(message), std::move(data));
  if (type >= type_sync) return request(message);
  Unit unit;
  unit.serial = message.header.serial;
  if (!add(unit, message)) return drop(server_.settings().lease);
  submit(std::move(unit));
}

// The changes of a group, one behind the other. They may be many: others have their turns meanwhile.
void Session::take_group(const Message& message, Descriptor&& data) {
  const double lease = server_.settings().lease;
  const uint64_t bytes = message.as<wire::Group>().bytes;
  const size_t most = wire::most_changes(server_.settings().max_objects);
  Message next{};
  next.body = message.body.subspan(sizeof(wire::Group));
  next.memory = message.memory;
  try {
    if (data) {
      constexpr size_t largest = sizeof(wire::Header) + std::max(sizeof(wire::Edit), sizeof(wire::Tool));
      if (!next.body.empty() || bytes > most * largest) return drop(lease);
      next.memory = map_blob(data, bytes);
      next.body = {static_cast<const std::byte*>(next.memory.get()), static_cast<size_t>(bytes)};
      data.reset();
    }
  } catch (const Error&) {  // it is no sealed memory of that size, or this process has no room for it
    return drop(lease);
  }
  if (next.body.size() != bytes) return drop(lease);
  Unit unit;
  unit.serial = message.header.serial;
  unit.is_mapped = next.memory != message.memory;
  while (!next.body.empty()) {
    if (next.body.size() < sizeof next.header || unit.messages.size() == most) return drop(lease);
    std::memcpy(&next.header, next.body.data(), sizeof next.header);
    next.body = next.body.subspan(sizeof next.header);
    const ssize_t size = body_size(next.header.type);
    if (size < 0 || next.body.size() < static_cast<size_t>(size)) return drop(lease);
    Message change = next;
    change.body = next.body.first(static_cast<size_t>(size));
    next.body = next.body.subspan(static_cast<size_t>(size));
    if (!add(unit, change) || unit.is_forget) return drop(lease);
    let_others();
    if (is_gone_) return;
  }
  submit(std::move(unit));
}

// What the change is about. False: it is none, or has a slot that there is not.
bool Session::add(Unit& unit, const Message& message) const {
  using namespace wire;
  const auto is_slot = [this](uint32_t slot) { return slot < slots_.size() || slot == no_slot; };
  const auto need = [&unit](const wire::Object& object, uint64_t parts) {
    const std::initializer_list<uint64_t> ids = {parts & FS_PART_SHAPE ? object.shape : 0,
                                                 parts & FS_PART_PROFILES ? object.front.curve : 0,
                                                 parts & FS_PART_PROFILES ? object.back.curve : 0};
    for (const uint64_t id : ids) {
      if (id) unit.ids.insert(id);
    }
  };
  switch (message.header.type) {
    case type_set:
    case type_change: {
      const Set& set = message.as<Set>();
      if (!is_slot(set.slot)) return false;
      unit.names.insert(text_of(set.object.name));
      need(set.object, set.parts);
      break;
    }
    case type_place: unit.names.insert(text_of(message.as<Place>().name)); break;
    case type_remove: unit.names.insert(text_of(message.as<Remove>().name)); break;
    case type_bind:
      if (!is_slot(message.as<Bind>().slot)) return false;
      unit.names.insert(text_of(message.as<Bind>().name));
      break;
    case type_clear: unit.is_about_all = true; break;
    case type_forget:
      unit.is_forget = true;
      if (message.as<Forget>().id) unit.ids.insert(message.as<Forget>().id);
      break;
    case type_frame:
    case type_clutch:
    case type_tool: unit.is_about_view = true; break;
    case type_edit:
      unit.names.insert(text_of(message.as<Edit>().target.name));
      need(message.as<Edit>().object, message.as<Edit>().parts);
      break;
    case type_move_other: unit.names.insert(text_of(message.as<MoveOther>().target.name)); break;
    case type_remove_other: unit.names.insert(text_of(message.as<Target>().name)); break;
    default: return false;
  }
  unit.messages.push_back(message);
  return true;
}

// ------------------------------------------------------------------------------------------------- the shared memory

bool Session::take_moves() {
  const uint64_t batch = inbox_.batch();
  if (batch & 1) return false;  // a group is being written: all of it at once, later
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
    return false;
  }
  for (const auto& [slot, move] : moved_) {
    Motion motion;
    if (!from_record(move.movement, motion)) {
      ++refused_;
      continue;
    }
    try {
      scene_->set_motion(slots_[slot].name.c_str(), motion);
      ++moves_;
    } catch (const Error&) {  // the object is not there any more
    }
  }
  moves_allowed_.spend(moved_.size());
  if (!moved_.empty()) server_.note_activity();
  return true;
}

void Session::turn(double now) noexcept {
  if (is_gone_ || name_.empty()) return;
  try {
    outbox_->heartbeat.store(now, std::memory_order_relaxed);
    are_moves_taken_ = false;
    if (is_applying_) return;
    are_moves_taken_ = moves_allowed_.begin_turn() && take_moves();
    scene_->post();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::settle() noexcept {
  if (is_gone_ || name_.empty() || is_applying_) return;
  try {
    const uint64_t used = scene_->output->used.load(std::memory_order_acquire);
    // Some in each turn, in the order of their names and from the first again.
    auto awaited = awaited_.lower_bound(awaited_next_);
    awaited_next_.clear();
    for (int i = 0; awaited != awaited_.end(); ++i) {
      if (i == most_awaited) {
        awaited_next_ = awaited->first;
        break;
      }
      auto& [name, sequence] = *awaited;
      if (sequence == 0) sequence = scene_->sequence();
      if (used < sequence) {
        ++awaited;
        continue;
      }
      fs_event event{};
      event.kind = FS_EVENT_READY;
      event.time = scene_->now();
      put_text(event.name, name);
      push_event(event);
      awaited = awaited_.erase(awaited);
    }
    settle_syncs();
  } catch (...) {
    drop(server_.settings().lease);
  }
}

void Session::keep_house() noexcept {
  if (is_gone_ || is_applying_) return;
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

void Session::push_event(const fs_event& event) noexcept { fs::push_event(*outbox_, event); }

void Session::note_edit(const std::string& object, const std::string& editor, bool is_removed) {
  if (!objects_.contains(object)) return;
  std::string& told = edited_[object];
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
    forget_object(object);
    edited_[object] = editor;
  }
  outbox_->edits.fetch_add(1, std::memory_order_release);
}

}  // namespace fs
