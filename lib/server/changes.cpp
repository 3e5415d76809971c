#include "server/changes.h"

#include <algorithm>

#include "base/text.h"
#include "transfer/records.h"

namespace fs {

void Changes::apply(const ReceivedBatch& received) {
  if (received.changes.empty()) return;
  const Change first = received.changes[0];
  if (received.changes.size() > 1 || first.is_foreign()) return apply_group(received);
  try {
    apply(first, received.serial);
  } catch (const Error& error) {
    refuse(received, first, error);
  }
}

// Applies all changes or none.
void Changes::apply_group(const ReceivedBatch& received) {
  const Client::Applying applying(client_);
  client_.is_amid_drafts = std::any_of(received.changes.begin(), received.changes.end(),
                                       [](const Change& change) { return change.is_foreign(); });
  Records before = records_of(received.about);
  const uint64_t changed = client_.changed, moved = client_.moved;
  ForeignEdits edits;
  client_.scene->begin();
  std::optional<Change> failed;
  try {
    for (const Change& change : received.changes) {
      failed = change;
      if (change.is_foreign()) {
        apply_foreign(change, edits);
      } else {
        apply(change, received.serial);
      }
      client_.let_others();
    }
    while (!client_.scene->commit(Client::few_steps)) client_.host.let_others(&client_, client_.is_amid_drafts);
    for (auto& [scene, edit] : edits) edit.take();
  } catch (const Error& error) {
    client_.scene->cancel();
    client_.changed = changed;
    client_.moved = moved;
    put_back(before);
    return refuse(received, *failed, error);
  }
  for (const auto& [scene, edit] : edits) edit.tell(client_);
  edits.clear();
  for (; !before.empty(); before.erase(before.begin())) client_.let_others();
}

void Changes::apply(const Change& change, uint64_t serial) {
  using namespace wire;
  LocalScene& scene = *client_.scene;
  const std::string name(change.name());
  const NameRecord* const record = client_.names.object(name);
  switch (change.type) {
    case type_set: return apply_set(change.as<Set>(), serial, false);
    case type_change: return apply_set(change.as<Set>(), serial, true);
    case type_place:
      if (!record) return;  // another client has removed it
      scene.set_motion(name, from_record(change.as<Place>().motion));
      client_.bind(name, record->slot, serial);
      ++client_.moved;
      return;
    case type_bind:
      if (record) client_.bind(name, change.as<Bind>().slot, serial);
      return;
    case type_remove:
      if (!record) return client_.names.drop_absent(name);  // it was refused, or another client has removed it
      scene.remove(name.c_str());
      client_.names.forget(name);
      break;
    case type_clear: apply_clear(); break;
    case type_frame: scene.set_frame(change.as<Frame>().frame); break;
    case type_max_stiffness: scene.set_max_stiffness(change.as<MaxStiffness>().stiffness); break;
    case type_accuracy: scene.set_accuracy(change.as<Accuracy>().newtons); break;
    case type_clutch: scene.set_clutch(change.as<Clutch>().is_held != 0); break;
    case type_tool: {
      const wire::Tool& tool = change.as<wire::Tool>();
      if (tool.count > FS_TOOL_POINTS_MAX) fail(FS_ERROR_INVALID, "count is %llu points, must be 1..%d",
                                                static_cast<unsigned long long>(tool.count), FS_TOOL_POINTS_MAX);
      scene.set_tool(tool.points, tool.count);
      break;
    }
    case type_forget: return client_.assets.forget(change.as<Forget>().id);
    default: return;
  }
  ++client_.changed;
}

void Changes::apply_clear() {
  const Client::Applying applying(client_);
  while (const std::string* const first = client_.names.first()) {
    const std::string name = *first;
    if (client_.names.has(name)) client_.scene->remove(name.c_str());
    client_.names.forget(name);
    client_.let_others();
  }
}

void Changes::apply_set(const wire::Set& set, uint64_t serial, bool is_change) {
  const std::string name = parse_name(text_of(set.object.name).c_str(), "name");
  const uint32_t most = client_.host.settings().max_objects;
  Names& names = client_.names;
  const NameRecord* const record = names.find(name);
  const bool is_new = !record || !record->is_there;
  if (is_change && is_new) {
    const bool is_refused = record && record->absent && record->absent->state == FS_OBJECT_REFUSED;
    if (!is_refused) return;  // another client has removed it
    fail(FS_ERROR_NOT_FOUND, "object '%s' does not exist: it was refused", name.c_str());
  }
  if (is_new && names.objects() >= most) {
    fail(FS_ERROR_FULL, "object '%s' would be one more than the %u that the server allows a client", name.c_str(), most);
  }
  const LinkedObject linked = client_.assets.resolve(set.object, set.parts, nullptr);
  bool brings_shape = false;
  if (!is_new && linked.object.shape) {
    fs_object present;
    const Ref<const Object> kept = client_.scene->get(name.c_str(), present);
    brings_shape = present.shape != linked.object.shape;
  }
  if (is_change) {
    client_.scene->change(linked.object, set.parts);
  } else {
    client_.scene->set(linked.object);
  }
  names.add(name);
  if ((is_new || brings_shape) && set.object.enabled) names.await(name);
  if (is_new || (set.parts & FS_PART_POSE)) client_.bind(name, set.slot, serial);
  ++client_.changed;
}

// A change of another client's object, as part of a group.
void Changes::apply_foreign(const Change& change, ForeignEdits& edits) {
  const auto& whose = change.as<wire::Target>();  // each foreign change begins with its target
  const TargetObject target = find_foreign(client_, whose);
  auto edit = edits.find(target.scene.get());
  if (edit == edits.end()) {
    if (target.owner) target.owner->take_moves();  // moves that the owner made before this change
    edit = edits.try_emplace(target.scene.get(), target).first;
  }
  try {
    edit->second.add(client_, change, target.name);
  } catch (const Error& error) {
    throw Error{error.status, "'" + text_of(whose.name) + "': " + error.text};
  }
}

// ------------------------------------------------------------------------------------------------ when one is refused

Changes::Records Changes::records_of(const Subjects& about) {
  Records out;
  const auto add = [&](const std::string& name) {
    out.emplace(name, client_.names.record_of(name));
    client_.let_others();
  };
  for (const std::string& name : about.names) add(name);
  if (about.is_about_all) client_.names.for_each([&](const std::string& name, const NameRecord&) { add(name); });
  return out;
}

// First forgets the names that came with the group, so that names that were there before can get their slots again.
void Changes::put_back(const Records& records) {
  for (const auto& [name, was] : records) {
    client_.names.forget(name);
    client_.let_others();
  }
  for (const auto& [name, was] : records) {
    if (client_.names.put_back(name, was)) client_.moves.mark(was.slot);
    client_.let_others();
  }
}

// The objects stay as they were. The client believes otherwise until it has been told, so every name in the batch is noted to
// be told, and slots are bound as the batch says: moves that the client has written meanwhile count.
void Changes::refuse(const ReceivedBatch& received, const Change& failed, const Error& error) {
  const double now = client_.scene->now();
  const Client::Applying applying(client_);
  for (const std::string& name : received.about.names) {
    if (name.find('/') == std::string::npos) client_.note_untold(name);
    client_.let_others();
  }
  if (received.about.is_about_all) {
    client_.names.for_each([&](const std::string& name, const NameRecord& record) {
      if (record.is_there || record.absent) client_.names.tell(name, client_.name);
    });
  }
  if (received.about.is_about_view) client_.is_view_untold = true;
  for (const Change& change : received.changes) {
    ++client_.refused;
    fs_event event{};
    event.kind = FS_EVENT_REFUSED;
    event.status = error.status;
    event.time = now;
    const bool is_cause = change.record.data() == failed.record.data();
    put_text(event.text, is_cause ? error.text : "another change of its group was refused: " + error.text);
    put_text(event.name, change.name());
    refuse(change, received.serial);
    client_.note_news();  // before the event, whose reader may look at the object at once
    client_.push_event(event);
    client_.let_others();
  }
  client_.note_news();
  syncs_.note_refusal(error.status, error.text);
}

void Changes::refuse(const Change& change, uint64_t serial) {
  const std::string_view name = change.name();
  const NameRecord* const record = client_.names.object(name);
  switch (change.type) {
    case wire::type_set: client_.note_absent(change.as<wire::Set>(), FS_OBJECT_REFUSED); [[fallthrough]];
    case wire::type_change:
      if (record && (change.as<wire::Set>().parts & FS_PART_POSE)) {
        client_.bind(name, change.as<wire::Set>().slot, serial);
      }
      break;
    case wire::type_place:
      if (record) client_.bind(name, record->slot, serial);
      break;
    case wire::type_bind:
      if (record) client_.bind(name, change.as<wire::Bind>().slot, serial);
      break;
    case wire::type_remove: client_.names.drop_absent(name); break;  // the client does not want the refused object either
    case wire::type_clear: client_.names.drop_absents(); break;
    default: break;
  }
}

}  // namespace fs
