#include "server/client.h"

#include <poll.h>
#include <sys/socket.h>

#include "base/error.h"
#include "base/text.h"

namespace fs {

static bool has_event(const Descriptor& descriptor, short events) noexcept {
  pollfd look{descriptor.get(), events, 0};
  return descriptor && poll(&look, 1, 0) > 0 && (look.revents & events);
}

Client::Client(Host& the_host, uint64_t the_id, Descriptor&& the_socket, const Peer& the_peer)
    : host(the_host), id(the_id), peer(the_peer), socket(std::move(the_socket)), process(open_process(the_peer.process)) {}

bool Client::take_moves() {
  const Moves::Taken taken = moves.take(names, *scene);
  moved += taken.applied;
  refused += taken.refused;
  if (taken.seen > 0) host.note_activity();
  return taken.is_whole;
}

void Client::bind(std::string_view object, uint32_t slot, uint64_t serial) {
  if (names.bind(object, slot, serial)) moves.mark(slot);
}

void Client::push_event(fs_event_kind kind, const std::string& object, const std::string& text) {
  fs_event event{};
  event.kind = kind;
  event.time = scene->now();
  put_text(event.name, object);
  put_text(event.text, text);
  push_event(event);
}

fs_event Client::what_it_did(fs_status status, const char* text) const noexcept {
  fs_event event{};
  event.kind = FS_EVENT_CLIENT;
  event.status = status;
  event.value = static_cast<double>(peer.process);
  put_text(event.name, name);
  put_text(event.text, text);
  return event;
}

void Client::tell_server(fs_status status, const char* text) const noexcept {
  host.servo().scene()->note(what_it_did(status, text));
}

void Client::note_edit_by(const std::string& editor, const std::string& object, bool is_removed) {
  const NameRecord* const record = names.object(object);
  if (!record) return;
  // One event tells of a stream of changes, until the client has looked at the object.
  const bool is_told = record->editor != editor || is_removed;
  if (is_removed) names.forget(object);
  names.set_untold(object, editor);
  note_news();  // before the event, whose reader may look at the object at once
  if (is_told) push_event(FS_EVENT_EDITED, object, editor);
}

void Client::note_untold(const std::string& object) {
  const size_t most = 4 * size_t{host.settings().max_objects};  // twice the objects that it may have, with refused ones
  if (names.untold_count() < most) names.set_untold(object, name);
}

void Client::note_absent(const wire::Set& set, fs_object_state state) {
  const bool is_primitive = set.object.primitive >= FS_PRIMITIVE_POINT && set.object.primitive <= FS_PRIMITIVE_MESH;
  if (!is_primitive || names.absents() >= 2 * size_t{host.settings().max_objects}) return;
  try {
    const std::string object = parse_name(text_of(set.object.name).c_str(), "name");
    if (!names.has(object)) names.set_absent(object, {static_cast<fs_primitive>(set.object.primitive), state});
  } catch (const Error&) {  // it is not a name
  }
}

fs_report Client::report(const std::string& object) const {
  const NameRecord* const record = names.find(object);
  return record && record->absent ? report_of(object, *record->absent) : scene->report(object.c_str());
}

fs_report report_of(const std::string& name, const Absence& absent) {
  fs_report out{};
  put_text(out.name, name);
  out.primitive = absent.primitive;
  out.state = absent.state;
  out.distance = never;
  return out;
}

fs_client Client::describe() const {
  fs_client out{};
  put_text(out.name, name);
  out.process = static_cast<uint32_t>(peer.process);
  out.user = peer.user;
  out.objects = static_cast<uint32_t>(names.objects());
  out.connected = connected;
  out.force_limit = host.settings().limits.force;
  out.wrench = channel->wrench();
  out.moves = moved;
  out.changes = changed;
  out.refused = refused;
  out.limited = channel->limited();
  out.shape_bytes = assets.bytes();
  return out;
}

bool Client::is_alive() const noexcept { return !is_gone && !has_event(process, POLLIN) && !has_event(socket, POLLHUP); }

void Client::drop(double lease) noexcept {
  if (is_gone) return;
  if (!name.empty()) {
    const char* const lost = is_alive() ? "was disconnected by the server" : "was lost: it was killed, or ended without a word";
    tell_server(moves.has_left() ? FS_OK : FS_ERROR_DISCONNECTED, moves.has_left() ? "left" : lost);
  }
  is_gone = true;
  if (channel && scene->is_empty()) {
    channel->leave_at_once();
  } else if (channel) {
    channel->leave(scene->now() + lease);
  }
  if (outbox) outbox->is_closed.store(1);
  host.let_go(*this);
  if (socket) shutdown(socket.get(), SHUT_RDWR);  // a forked process may have it, too
  socket.reset();
  process.reset();
}

}  // namespace fs
