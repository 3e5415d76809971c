#include "server/client.h"

#include "base/error.h"
#include "base/text.h"
#include "server/clients.h"

namespace fs {

Client::Client(Host& the_host, uint64_t the_id, Descriptor&& the_socket, const Peer& the_peer)
    : host(the_host), id(the_id), peer(the_peer), socket(std::move(the_socket)), process(open_process(the_peer.process)) {}

void Client::let_others() {
  if (++steps_ % few_steps == 0) host.let_others(this, is_amid_drafts);
}

bool Client::take_moves() {
  const Moves::Taken taken = moves.take(*scene);
  moved += taken.applied;
  refused += taken.refused;
  if (taken.seen > 0) host.note_activity();
  return taken.is_whole;
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

void Client::tell_all(const char* text) const noexcept {
  const fs_event event = what_it_did(FS_OK, text);
  host.servo().scene()->note(event);
  host.clients().for_each([&](const std::shared_ptr<Client>& client) { client->push_event(event); });
}

void Client::forget_object(const std::string& object) {
  moves.forget(object);
  absent.erase(object);
  told.names().erase(object);
  awaited.names().erase(object);
}

void Client::note_edit_by(const std::string& editor, const std::string& object, bool is_removed) {
  if (!moves.has(object)) return;
  std::string& told_editor = told.names()[object];
  // One event tells of a stream of changes, until the client has looked at the object.
  const bool is_told = told_editor != editor || is_removed;
  told_editor = editor;
  if (is_removed) {
    forget_object(object);
    told.names()[object] = editor;
  }
  note_news();  // before the event, whose reader may look at the object at once
  if (is_told) push_event(FS_EVENT_EDITED, object, editor);
}

void Client::note_untold(const std::string& object) {
  const size_t most = 4 * size_t{host.settings().max_objects};  // twice the objects that it may have, with refused ones
  if (told.names().size() < most) told.names()[object] = name;
}

void Client::note_absent(const wire::Set& set, fs_object_state state) {
  const bool is_primitive = set.object.primitive >= FS_PRIMITIVE_POINT && set.object.primitive <= FS_PRIMITIVE_MESH;
  if (!is_primitive || absent.size() >= 2 * size_t{host.settings().max_objects}) return;
  try {
    const std::string object = parse_name(text_of(set.object.name).c_str(), "name");
    if (!moves.has(object)) absent[object] = {static_cast<fs_primitive>(set.object.primitive), state};
  } catch (const Error&) {  // it is not a name
  }
}

fs_report Client::report(const std::string& object) const {
  const auto found = absent.find(object);
  return found == absent.end() ? scene->report(object.c_str()) : report_of(object, found->second);
}

fs_report report_of(const std::string& name, const Client::Absent& absent) {
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
  out.objects = static_cast<uint32_t>(moves.objects().size());
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

}  // namespace fs
