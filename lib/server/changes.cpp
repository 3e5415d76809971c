#include "server/changes.h"

#include "base/text.h"
#include "transfer/records.h"

namespace fs {

void Changes::apply(const ReceivedBatch& received) {
  const Change change = received.changes[0];
  try {
    apply(*client_.scene, change, received.serial);
  } catch (const Error& error) {
    for (const std::string& name : received.about.names) client_.note_untold(name);
    if (received.about.is_about_view) client_.is_view_untold = true;
    tell_refused(change, received.serial, error, true);
    syncs_.note_refusal(error.status, error.text);
  }
}

// Applies all changes or none.
Task Changes::apply_step_by_step(const ReceivedBatch& received) {
  const Batch& changes = received.changes;
  if (changes.size() == 1 && !changes[0].is_foreign()) {
    co_await clear();
    ++client_.changed;
    co_return;
  }
  Records before;
  co_await take_records(received.about, before);
  const uint64_t changed = client_.changed, moved = client_.moved;
  std::unique_ptr<SceneGroup> group = std::make_unique<SceneGroup>(client_.scene);
  ForeignGroups foreign;
  Change last{};
  std::unique_ptr<Error> refusal;
  try {
    for (size_t i = 0; i < changes.size(); ++i) {
      last = changes[i];
      if (last.is_foreign()) {
        apply_foreign(last, foreign);
      } else {
        apply(*group, last, received.serial);
      }
      co_await client_.work.look();
    }
    while (!group->commit(1)) co_await client_.work.look();
    for (auto& [scene, of_scene] : foreign) of_scene.commit();
  } catch (const Error& error) {
    refusal = std::make_unique<Error>(error);
  }
  if (refusal) {
    group = nullptr;
    client_.changed = changed;
    client_.moved = moved;
    co_await put_back(before);
    co_await refuse(received, last, *refusal);
    co_return;
  }
  for (const auto& [scene, of_scene] : foreign) of_scene.tell(client_);
  foreign.clear();
  for (; !before.empty(); before.erase(before.begin())) co_await client_.work.step();
}

template <class Scene>
void Changes::apply(Scene& scene, const Change& change, uint64_t serial) {
  using namespace wire;
  const std::string name(change.name());
  const NameRecord* const record = client_.names.object(name);
  switch (change.type) {
    case type_set: return apply_set(scene, change.as<Set>(), serial, false);
    case type_change: return apply_set(scene, change.as<Set>(), serial, true);
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
    case type_frame: scene.set_frame(change.as<Frame>().frame); break;
    case type_max_stiffness: client_.scene->set_max_stiffness(change.as<MaxStiffness>().stiffness); break;
    case type_accuracy: client_.scene->set_accuracy(change.as<Accuracy>().newtons); break;
    case type_clutch: scene.set_clutch(change.as<Clutch>().is_held != 0); break;
    case type_tool: {
      const wire::Tool& tool = change.as<wire::Tool>();
      if (tool.count > FS_TOOL_POINTS_MAX)
        fail(FS_ERROR_INVALID, "count is %llu points, must be 1..%d", static_cast<unsigned long long>(tool.count),
             FS_TOOL_POINTS_MAX);
      scene.set_tool(tool.points, tool.count);
      break;
    }
    case type_tool_radius: scene.set_tool_radius(change.as<ToolRadius>().radius); break;
    case type_forget: return client_.assets.forget(change.as<Forget>().id);
    default: return;
  }
  ++client_.changed;
}

Task Changes::clear() {
  while (const std::string* const first = client_.names.first()) {
    const std::string name = *first;
    if (client_.names.has(name)) client_.scene->remove(name.c_str());
    client_.names.forget(name);
    co_await client_.work.step();
  }
}

template <class Scene>
void Changes::apply_set(Scene& scene, const wire::Set& set, uint64_t serial, bool is_change) {
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
    const Ref<const Object> kept = scene.get(name.c_str(), present);
    brings_shape = present.shape != linked.object.shape;
  }
  if (is_change) {
    scene.change(linked.object, set.parts);
  } else {
    scene.set(linked.object);
  }
  names.add(name);
  if ((is_new || brings_shape) && set.object.enabled) names.await(name);
  if (is_new || (set.parts & FS_PART_POSE)) client_.bind(name, set.slot, serial);
  ++client_.changed;
}

// A change of another client's object, as part of a group.
void Changes::apply_foreign(const Change& change, ForeignGroups& groups) {
  const TargetObject target = find_foreign(client_, change.name());
  auto group = groups.find(target.scene.get());
  if (group == groups.end()) group = groups.try_emplace(target.scene.get(), target).first;
  try {
    group->second.add(client_, change, target.name);
  } catch (const Error& error) {
    throw Error{error.status, "'" + std::string(change.name()) + "': " + error.text};
  }
}

// ------------------------------------------------------------------------------------------------ when one is refused

Task Changes::take_records(const Subjects& about, Records& out) {
  for (const std::string& name : about.names) {
    out.emplace(name, client_.names.record_of(name));
    co_await client_.work.step();
  }
}

// First forgets the names that came with the group, so that names that were there before can get their slots again.
Task Changes::put_back(const Records& records) {
  for (const auto& [name, was] : records) {
    client_.names.forget(name);
    co_await client_.work.step();
  }
  for (const auto& [name, was] : records) {
    if (client_.names.put_back(name, was)) client_.moves.mark(was.slot);
    co_await client_.work.step();
  }
}

// The objects stay as they were. The client believes otherwise until it has been told, so every name in the batch is noted to
// be told.
Task Changes::refuse(const ReceivedBatch& received, const Change& failed, const Error& error) {
  for (const std::string& name : received.about.names) {
    if (name.find('/') == std::string::npos) client_.note_untold(name);
    co_await client_.work.step();
  }
  if (received.about.is_about_view) client_.is_view_untold = true;
  for (size_t i = 0; i < received.changes.size(); ++i) {
    const Change change = received.changes[i];
    tell_refused(change, received.serial, error, change.record.data() == failed.record.data());
    co_await client_.work.step();
  }
  syncs_.note_refusal(error.status, error.text);
}

void Changes::tell_refused(const Change& change, uint64_t serial, const Error& error, bool is_cause) {
  ++client_.refused;
  fs_event event{};
  event.kind = FS_EVENT_REFUSED;
  event.status = error.status;
  event.time = client_.scene->now();
  put_text(event.text, is_cause ? error.text : "another change of its group was refused: " + error.text);
  put_text(event.name, change.name());
  refuse(change, serial);
  client_.note_news();  // before the event, whose reader may look at the object at once
  client_.push_event(event);
}

// Slots are bound as the batch says: moves that the client has written meanwhile count.
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
    default: break;
  }
}

}  // namespace fs
