#include "client/remote_scene.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <new>
#include <thread>

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

// Runs f, which changes the replica and says so in a group: the one that is open, or one of its own. Where the server has
// no room, f runs again when there is.
template <class F>
void RemoteScene::mutate(Call& call, F&& f) {
  for (pulls_.look(); !group_; line_.pause(call, true)) {
    replica_.catch_up_with_moves();
    Group group(replica_, max_objects());
    bool is_sent = false;
    replica_.scene->begin();
    try {
      f(group);
      is_sent = sender_.deliver(group);
      if (is_sent) {
        replica_.scene->commit();
      } else {
        replica_.scene->cancel();
      }
    } catch (...) {
      replica_.scene->cancel();
      if (is_sent) line_.lose_for_memory();
      throw;
    }
    if (!is_sent) continue;
    replica_.post();
    return connection_.check();
  }
  try {
    f(*group_);
  } catch (const std::bad_alloc&) {
    line_.lose_for_memory();
    throw;
  }
}

// ------------------------------------------------------------------------------------------------------------- objects

void RemoteScene::set(const fs_object& object) {
  if (replica_.is_evaluated_here) parse_object(object);  // builds its tree, without the lock
  check_struct_size(object.struct_size, sizeof object, "fs_object");
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
  check_struct_size(object.struct_size, sizeof object, "fs_object");
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
    // A sentence about "spring" is one about "alice/spring" for a caller who asked for that.
    const std::string here = "object '" + given.substr(given.find('/') + 1) + "'";
    if (error.text.starts_with(here)) error.text.replace(0, here.size(), "object '" + given + "'");
    throw;
  }
}

void RemoteScene::change_own(Call& call, const fs_object& object, uint32_t parts) {
  const std::string name = text_of(object.name);
  pulls_.catch_up(call, name.c_str());
  mutate(call, [&](Group& group) {
    group.require_room(0);
    replica_.scene->change(object, parts);
    if (parts == 0) return;
    const OwnObject* const own = replica_.objects.find(name);
    const bool is_whole = own && own->is_refused;  // the server has nothing to change
    group.add_object(is_whole ? wire::type_set : wire::type_change, name.c_str(), is_whole ? all_parts : parts);
  });
}

// The fast one: no system call and no allocation, while the server is awake.
void RemoteScene::move(const char* given, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  double steady;
  Call call = line_.enter(&steady);
  const double at = time != 0 ? time : connection_.welcome().is_virtual ? now() : steady;
  const char* name = own_name(given);
  if (!name) return foreign_.move(call, given, parsed, twist, at);
  pulls_.look();
  OwnObject* const own = replica_.objects.find(std::string_view(name, strnlen(name, FS_NAME_SIZE)));
  if (group_ || !own || own->slot == wire::no_slot) {
    call.limit = call.end = 0;  // it never waits
    const bool is_refused = own && own->is_refused;
    return mutate(call, [&](Group& group) {
      group.require_room(0);
      replica_.scene->move(name, parsed, twist, at);
      if (group_ || !is_refused) group.add_place(name);
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
    group.require_room(0);
    replica_.scene->remove(name);
    group.add_remove(name);
  });
}

void RemoteScene::clear() {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(0);
    replica_.scene->clear();
    group.add_clear();
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
  const fs_frame frame = own_view(call).frame;  // may wait: before the rest is looked at
  replica_.catch_up_with_moves();
  Contents out = replica_.scene->contents();
  out.frame = frame;
  return out;
}

void RemoteScene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                               const std::vector<Vec3>& tool) {
  std::vector<std::string> names;
  for (const fs_object& object : objects) {
    names.push_back(text_of(object.name));
    if (replica_.is_evaluated_here && object.shape) object.shape->build();  // without the lock
  }
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    const std::set<std::string_view> distinct(names.begin(), names.end());
    const auto fresh = static_cast<size_t>(
        std::count_if(distinct.begin(), distinct.end(), [&](std::string_view name) { return !group.is_object(name); }));
    group.require_room(fresh, names.size() + 2);
    replica_.scene->set_contents(objects, frame, tool);
    for (const std::string& name : names) group.add_object(wire::type_set, name.c_str(), all_parts);
    group.add_frame();
    group.add_tool();
  });
}

// ------------------------------------------------------------------------------------------------------------- groups

void RemoteScene::begin() {
  const Call call = line_.enter();
  pulls_.look();
  replica_.catch_up_with_moves();
  auto group = std::make_unique<Group>(replica_, max_objects());
  replica_.scene->begin();  // STATE
  group_ = std::move(group);
}

// Where it fails, the group stays open, and nothing of it was sent.
void RemoteScene::commit() {
  Call call = line_.enter();
  while (group_ && !sender_.deliver(*group_)) line_.pause(call, true);
  try {
    replica_.scene->commit();  // STATE
  } catch (const std::bad_alloc&) {
    line_.lose_for_memory();
    throw;
  }
  group_ = nullptr;
  replica_.post();
  connection_.check();
  pulls_.look();
}

void RemoteScene::cancel() {
  const Call call = line_.enter();
  replica_.scene->cancel();  // STATE
  group_ = nullptr;
}

// At its end the client knows what became of its changes, if the time suffices.
void RemoteScene::sync(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  Call call = line_.enter();
  call.end = start + timeout;
  uint64_t own = 0;  // serial; 0: it is not asked for yet
  for (;;) {
    try {
      syncs_.take_answers();
    } catch (const Error&) {
      pulls_.catch_up_in_time(call);
      throw;
    }
    if (!own) own = syncs_.ask();
    if (own && syncs_.is_answered(own)) return pulls_.catch_up_in_time(call);
    if (!line_.try_pause(call, !own)) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
  }
}

// --------------------------------------------------------------------------------------------------------------- view

void RemoteScene::set_frame(const fs_frame& frame) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(0);
    replica_.scene->set_frame(frame);
    group.add_frame();
  });
}

void RemoteScene::set_tool(const Vec3* points, size_t count) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(0);
    replica_.scene->set_tool(points, count);
    group.add_tool();
  });
}

void RemoteScene::set_clutch(bool held) {
  Call call = line_.enter();
  mutate(call, [&](Group& group) {
    group.require_room(0);
    group.add_clutch(held);
  });
}

std::vector<Vec3> RemoteScene::get_tool() {
  Call call = line_.enter();
  pulls_.catch_up(call, "");
  return replica_.scene->get_tool();
}

// The server's word, for a clutch may have moved the frame there; with what an open group has.
fs_view RemoteScene::own_view(Call& call) {
  auto out = line_.request(call, wire::type_view, to_target(client_.c_str(), "client")).as<fs_view>();
  if (!group_) return out;
  for (const Change& change : group_->batch) foresee(out, change);
  return out;
}

fs_view RemoteScene::view(const char* client) {
  Call call = line_.enter();
  if (!client || client_ == client) return own_view(call);
  return line_.request(call, wire::type_view, to_target(client, "client")).as<fs_view>();
}

void RemoteScene::set_accuracy(double newtons) {
  connection_.check();
  check_accuracy(newtons);
}

void RemoteScene::set_max_stiffness(double stiffness) {
  connection_.check();
  check_max_stiffness(stiffness);
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

void RemoteScene::get_servo_stats(fs_servo_stats& out) {
  Call call = line_.enter();
  const uint32_t size = out.struct_size;
  out = line_.request(call, wire::type_stats).as<fs_servo_stats>();
  out.struct_size = size;
}

void RemoteScene::get_device_info(fs_device_info& out) {
  Call call = line_.enter();
  const uint32_t size = out.struct_size;
  out = line_.request(call, wire::type_device).as<fs_device_info>();
  out.struct_size = size;
}

// -------------------------------------------------------------------------------------------------- reports and events

// A report of an own object in an open group: what the object is, as the group has it; what became of it, as the server
// tells, if it knows it.
fs_report RemoteScene::in_group(const fs_report& ours, const fs_report* theirs) const {
  if (!theirs) return ours;
  fs_report out = *theirs;
  out.primitive = ours.primitive;
  out.stiffness_wanted = ours.stiffness_wanted;
  out.stiffness_applied = ours.stiffness_applied;
  fs_object object;
  replica_.scene->get(ours.name, object);
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
  Call call = line_.enter();
  const char* name = own_name(given);
  fs_report ours{};
  if (name) {
    pulls_.catch_up(call, name);
    ours = replica_.scene->report(name);  // NOT_FOUND
  }
  try {
    const auto theirs = line_.request(call, wire::type_report, to_target(name ? name : given, "name")).as<fs_report>();
    return name && group_ ? in_group(ours, &theirs) : theirs;
  } catch (const Error& error) {
    if (!name || !group_ || error.status != FS_ERROR_NOT_FOUND) throw;
    return in_group(ours, nullptr);
  }
}

std::vector<fs_report> RemoteScene::reports() {
  Call call = line_.enter();
  pulls_.catch_up(call, "");
  std::vector<fs_report> out = line_.request(call, wire::type_reports).list<fs_report>();
  if (!group_) return out;
  NameMap<fs_report> theirs;  // of its own objects; those of others have a '/'
  std::erase_if(out, [&](const fs_report& report) {
    const std::string name = text_of(report.name);
    const bool is_own = name.find('/') == std::string::npos;
    if (is_own) theirs[name] = report;
    return is_own;
  });
  std::vector<fs_report> own = replica_.scene->reports();
  for (fs_report& report : own) {
    const auto found = theirs.find(text_of(report.name));
    report = in_group(report, found == theirs.end() ? nullptr : &found->second);
  }
  out.insert(out.begin(), own.begin(), own.end());
  return out;
}

// What may wait comes first: the scene's own objects are looked at with the lock.
std::vector<fs_motion> RemoteScene::motions(const char* client) {
  Call call = line_.enter();
  const bool is_own = client && client_ == client;
  if (client && !*client) fail(FS_ERROR_NOT_FOUND, "client is '': no client of that name is connected");
  std::vector<fs_motion> others;
  if (!is_own) {
    const wire::Target target = to_target(client ? client : "", "client");
    others = line_.request(call, wire::type_motions, target).list<fs_motion>();
    if (client) return others;
  }
  pulls_.catch_up(call);
  replica_.catch_up_with_moves();
  std::vector<fs_motion> out = replica_.scene->motions(nullptr);
  if (out.empty()) return others;
  out.insert(out.end(), others.begin(), others.end());
  return out;
}

std::vector<fs_client> RemoteScene::clients() {
  Call call = line_.enter();
  pulls_.look();
  return line_.request(call, wire::type_clients).list<fs_client>();
}

// The oldest event that is there; false: none. After the last of a server that is gone comes its end.
bool RemoteScene::take_event(fs_event& out) {
  const char* loss = connection_.loss();  // before its last events are looked at
  if (!loss) {
    try {
      pulls_.look();
    } catch (const Error&) {  // whatever it is, the next call is told
    }
  }
  if (events_.read(*connection_.outbox(), out)) {
    if (out.kind == FS_EVENT_OVERFLOW) out.time = now();
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
      const std::unique_lock lock = line_.enter_unchecked();
      fs_event event;
      if (take_event(event)) return event;
    }
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}

}  // namespace fs
