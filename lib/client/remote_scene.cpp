#include "client/remote_scene.h"

#include <cstring>
#include <new>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "transfer/records.h"

namespace fs {

RemoteScene::RemoteScene(const Endpoint& endpoint, const std::string& client) : client_(client), line_(endpoint, client) {}

LocalScene& RemoteScene::local() {
  Call call = line_.enter();
  pulls_.catch_up(call);
  replica_.is_evaluated_here = true;
  replica_.catch_up_with_moves();
  return *replica_.scene;
}

const char* RemoteScene::own_name(const char* name) const noexcept {
  const size_t size = strnlen(name, 2 * FS_NAME_SIZE);
  const void* slash = std::memchr(name, '/', size);
  if (!slash) return name;
  const auto prefix = static_cast<size_t>(static_cast<const char*>(slash) - name);
  return std::string_view(name, prefix) == client_ ? name + prefix + 1 : nullptr;
}

// Calls f(group), which changes the replica and adds the change to the group: the thread's, or one for this change alone. Where
// the server has no room, or large assets come first, f is called again later. There is room for one change; f asks for more.
template <class F>
void RemoteScene::mutate(Call& call, F&& f) {
  SendingAhead ahead(line_, sent_);
  Group* const open = groups_.mine();
  for (pulls_.look(); !open; ahead.send_noted_or_wait(call)) {
    replica_.catch_up_with_moves();
    Group group(replica_);
    bool is_sent = false;
    replica_.scene->begin();
    try {
      group.require_room(0);
      f(group);
      is_sent = sender_.deliver(group, ahead);
      if (is_sent) replica_.scene->commit();
      else replica_.scene->cancel();
    } catch (...) {
      replica_.scene->cancel();
      if (is_sent) line_.lose_for_memory();
      throw;
    }
    if (!is_sent) continue;
    replica_.post();
    return connection_.check();
  }
  open->require_room(0);
  try {
    f(*open);
  } catch (const std::bad_alloc&) {
    line_.lose_for_memory();
    throw;
  }
}

// ------------------------------------------------------------------------------------------------------------- objects

void RemoteScene::set(const fs_object& object) {
  if (replica_.is_evaluated_here) parse_object(object);  // builds its tree, without the lock
  require_known(object, connection_.sizes());
  const std::string name = text_of(object.name);
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(!group.is_object(name));
    replica_.scene->set(object);
    group.add_object(wire::type_set, name.c_str(), all_parts);
  });
}

void RemoteScene::change(const fs_object& object, uint32_t parts) {
  parse_parts(parts);
  require_known(merge_parts({}, object, parts), connection_.sizes());
  const std::string given = text_of(object.name);
  const char* name = own_name(given.c_str());
  const bool is_built_here = name && replica_.is_evaluated_here && (parts & FS_PART_SHAPE) && object.shape;
  if (is_built_here) object.shape->build();  // without the lock
  Call call = line_.enter();
  try {
    if (!name) return foreign_.change(call, object, parts, now());
    fs_object own = object;
    if (name != given.c_str()) put_text(own.name, name);
    change_own(call, own, parts);
  } catch (Error& error) {
    // The caller asked for "alice/spring": the sentence must not be about "spring".
    const std::string here = "object '" + given.substr(given.find('/') + 1) + "'";
    if (error.text.starts_with(here)) error.text.replace(0, here.size(), "object '" + given + "'");
    throw;
  }
}

void RemoteScene::change_own(Call& call, const fs_object& object, uint32_t parts) {
  const std::string name = text_of(object.name);
  pulls_.catch_up(call, name.c_str());
  mutate(call, [&](Group& group) {
    replica_.scene->change(object, parts);
    if (parts == 0) return;
    const OwnObject* const own = replica_.objects.find(name);
    const bool is_whole = own && own->is_refused;  // at the server there is nothing to change
    group.add_object(is_whole ? wire::type_set : wire::type_change, name.c_str(), is_whole ? all_parts : parts);
  });
}

// The fast one. It makes no system call and does not allocate, as long as the server is awake and has no news, no group is
// open, the object has no lifetime, and no tool in this process evaluates the scene.
void RemoteScene::move(const char* given, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_move(pose, twist, time);
  double steady;
  Call call = line_.enter(&steady);
  const double at = time != 0 ? time : connection_.welcome().is_virtual ? now() : steady;
  const char* name = own_name(given);
  if (!name) return foreign_.move(call, given, parsed, twist, at);
  pulls_.look();
  OwnObject* const own = replica_.objects.find(std::string_view(name, strnlen(name, FS_NAME_SIZE)));
  const bool is_in_group = groups_.mine();
  if (is_in_group || !own || own->slot == wire::no_slot) {
    call.limit = call.end = 0;  // a move never waits
    const bool is_refused = own && own->is_refused;
    return mutate(call, [&](Group& group) {
      replica_.scene->move(name, parsed, twist, at);
      if (is_in_group || !is_refused) group.add_place(name);
    });
  }
  own->moved_in = questions_.newest();
  if (replica_.is_evaluated_here || own->has_lifetime) {
    replica_.scene->move(name, parsed, twist, at);
    own->movement = replica_.scene->movement(name);
    replica_.post();
  } else {
    replica_.objects.move_ahead(*own, *replica_.scene, parsed, twist, at);
  }
  connection_.inbox().write(own->slot, {own->after, to_record(own->movement.motion)});
  connection_.wake();
}

void RemoteScene::remove(const char* given) {
  Call call = line_.enter();
  const char* name = own_name(given);
  if (!name) return foreign_.remove(call, given);
  pulls_.catch_up(call, "");
  mutate(call, [&](Group& group) {
    replica_.scene->remove(name);
    group.add_remove(name);
  });
}

void RemoteScene::clear() {
  Call call = line_.enter();
  const bool is_in_group = groups_.mine();
  mutate(call, [&](Group& group) {
    if (is_in_group) group.add_removes();  // what other threads set until the commit stays
    else group.add_clear();
    replica_.scene->clear();
  });
}

Ref<const Object> RemoteScene::get(const char* given, fs_object& out) {
  Call call = line_.enter();
  const char* name = own_name(given);
  if (!name) return foreign_.get(call, given, out);
  pulls_.catch_up(call, name);
  replica_.catch_up_with_moves();
  return replica_.scene->get(name, out);
}

Scene::Contents RemoteScene::contents() {
  Call call = line_.enter();
  pulls_.catch_up(call);
  const fs_frame frame = own_view(call).frame;  // may wait, so it comes before the rest
  replica_.catch_up_with_moves();
  Contents out = replica_.scene->contents();
  out.frame = frame;
  return out;
}

void RemoteScene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<Vec3>& tool,
                               double tool_radius) {
  std::vector<std::string> names;
  for (const fs_object& object : objects) {
    require_known(object, connection_.sizes());
    names.push_back(text_of(object.name));
    if (replica_.is_evaluated_here && object.shape) object.shape->build();  // without the lock
  }
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(names, 3);
    replica_.scene->set_contents(objects, frame, tool, tool_radius);
    group.add_frame();
    group.add_tool();
    group.add_tool_radius();  // before the objects: while the present radius is above 0, the server takes no solid mesh
    for (const std::string& name : names) group.add_object(wire::type_set, name.c_str(), all_parts);
  });
}

// ------------------------------------------------------------------------------------------------------------- groups

constexpr double begin_limit = 0.1;  // s that a group waits for news at its begin

void RemoteScene::begin() {
  Call call = line_.enter();
  call.end = steady_now() + begin_limit;
  try {
    pulls_.catch_up(call);
  } catch (const Error& error) {
    if (error.status != FS_ERROR_TIMEOUT) throw;  // the group begins with what is known
  }
  replica_.catch_up_with_moves();
  auto group = std::make_unique<Group>(replica_);
  replica_.scene->begin();  // STATE
  groups_.open(std::move(group));
}

// Where it fails before the group is sent, the group stays open. After that it fails only if the scene is lost.
void RemoteScene::commit() {
  Call call = line_.enter();
  replica_.scene->check_commit();
  {
    SendingAhead ahead(line_, sent_);
    Group* const group = groups_.mine();
    while (group && !sender_.deliver(*group, ahead)) ahead.send_noted_or_wait(call);
  }
  replica_.catch_up_with_moves();  // other threads' moves came before the group
  try {
    replica_.scene->commit();  // STATE
  } catch (const std::bad_alloc&) {
    line_.lose_for_memory();
    throw;
  }
  groups_.close();
  replica_.post();
  connection_.check();
  pulls_.look();
}

void RemoteScene::cancel() {
  const Call call = line_.enter();
  replica_.scene->cancel();  // STATE
  groups_.close();
}

void RemoteScene::sync(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  Call call = line_.enter();
  call.end = start + timeout;
  syncs_.wait(call, timeout);
}

// --------------------------------------------------------------------------------------------------------------- view

void RemoteScene::set_frame(const fs_frame& frame) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    replica_.scene->set_frame(frame);
    group.add_frame();
  });
}

void RemoteScene::set_tool(const Vec3* points, size_t count) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    replica_.scene->set_tool(points, count);
    group.add_tool();
  });
}

void RemoteScene::set_tool_radius(double radius) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    replica_.scene->set_tool_radius(radius);
    group.add_tool_radius();
  });
}

double RemoteScene::get_tool_radius() {
  Call call = line_.enter();
  pulls_.catch_up(call, "");
  return replica_.scene->get_tool_radius();
}

void RemoteScene::set_clutch(bool held) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) { group.add_clutch(held); });
}

std::vector<Vec3> RemoteScene::get_tool() {
  Call call = line_.enter();
  pulls_.catch_up(call, "");
  return replica_.scene->get_tool();
}

// As the server has it, because a clutch may have moved the frame there; with the changes of an open group.
fs_view RemoteScene::own_view(Call& call) {
  auto out = line_.request(call, wire::type_view, to_target(client_.c_str(), "client")).as<fs_view>();
  foresee_group(out);
  return out;
}

// Applies the changes of the thread's group.
void RemoteScene::foresee_group(fs_view& own) const {
  const Group* const group = groups_.mine();
  if (!group) return;
  for (const Change& change : group->batch) foresee(own, change);
}

fs_view RemoteScene::view(const char* client) {
  Call call = line_.enter();
  const bool is_own = !client || client_ == client;
  fs_view out = is_own ? own_view(call) : line_.request(call, wire::type_view, to_target(client, "client")).as<fs_view>();
  out.locked = connection_.welcome().is_locked;
  return out;
}

std::vector<fs_client_view> RemoteScene::views() {
  Call call = line_.enter();
  auto out = line_.request(call, wire::type_views).list<fs_client_view>();
  for (fs_client_view& each : out) {
    if (text_of(each.name) == client_) foresee_group(each.view);
    each.view.locked = connection_.welcome().is_locked;
  }
  return out;
}

void RemoteScene::set_accuracy(double newtons) {
  check_accuracy(newtons);
  Call call = line_.enter();
  send_setting(call, wire::type_accuracy, wire::Accuracy{newtons});
  replica_.scene->set_accuracy(newtons);
}

void RemoteScene::set_max_stiffness(double stiffness) {
  check_max_stiffness(stiffness);
  Call call = line_.enter();
  send_setting(call, wire::type_max_stiffness, wire::MaxStiffness{stiffness});
}

// Past the thread's group.
template <class Record>
void RemoteScene::send_setting(Call& call, wire::Type type, const Record& setting) {
  pulls_.look();
  while (!connection_.send(type, bytes_of(&setting, 1))) line_.pause(call, true);
  connection_.check();
}

// --------------------------------------------------------------------------------------------------- clock and servo

fs_status RemoteScene::get_time(double& out) const noexcept {
  const double steady = steady_now();
  if (const char* why = connection_.loss(steady)) return set_last_error_literal(FS_ERROR_DISCONNECTED, why);
  out = connection_.welcome().is_virtual ? now() : steady;
  return FS_OK;
}

fs_status RemoteScene::set_time(double) noexcept {
  return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene is connected, the server has its clock");
}

fs_status RemoteScene::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  if (const char* why = connection_.loss()) return set_last_error_literal(FS_ERROR_DISCONNECTED, why);
  return read_hand(connection_.outbox()->servo, state, response, sent);
}

// What the server answers becomes out, which keeps its own size.
template <class Info>
void RemoteScene::ask(wire::Type type, Info& out) {
  Call call = line_.enter();
  const uint32_t size = out.struct_size;
  out = line_.request(call, type).as<Info>();
  out.struct_size = size;
}

void RemoteScene::get_servo_stats(fs_servo_stats& out) { ask(wire::type_stats, out); }
void RemoteScene::get_device_info(fs_device_info& out) { ask(wire::type_device, out); }

std::vector<fs_recorded_tick> RemoteScene::record(uint64_t after) {
  Call call = line_.enter();
  std::vector<fs_recorded_tick> out;
  for (;;) {
    const wire::After last{out.empty() ? after : out.back().number};
    const auto piece = line_.request(call, wire::type_record, last).list<fs_recorded_tick>();
    out.insert(out.end(), piece.begin(), piece.end());
    if (piece.size() < wire::most_ticks) return out;
  }
}

void RemoteScene::stop_force() {
  Call call = line_.enter();
  line_.request(call, wire::type_stop_force);
}

void RemoteScene::resume_force() {
  Call call = line_.enter();
  line_.request(call, wire::type_resume_force);
}

// -------------------------------------------------------------------------------------------------- reports and motions

fs_report RemoteScene::report(const char* given) {
  Call call = line_.enter();
  const char* name = own_name(given);
  return name ? reports_.of_own(call, name) : reports_.of_foreign(call, given);
}

std::vector<fs_report> RemoteScene::reports() {
  Call call = line_.enter();
  return reports_.of_all(call);
}

std::vector<fs_motion> RemoteScene::motions(const char* client) {
  Call call = line_.enter();
  if (client && client_ == client) return reports_.own_motions(call);
  return client ? reports_.foreign_motions(call, client) : reports_.all_motions(call);
}

std::vector<fs_motion> RemoteScene::motions_since(const char* client, uint64_t since) {
  Call call = line_.enter();
  if (client && client_ == client) return reports_.own_motions_since(call, since);
  return reports_.foreign_motions_since(call, client, since);
}

std::vector<fs_client> RemoteScene::clients() {
  Call call = line_.enter();
  pulls_.look();
  return line_.request(call, wire::type_clients).list<fs_client>();
}

}  // namespace fs
