// Own objects and groups, view and clock. How changes are sent: sending.cpp; what concerns other clients: others.cpp.
#include "client/remote_scene.h"

#include <algorithm>
#include <cstring>
#include <new>

#include "base/error.h"

namespace fs {
namespace {

constexpr size_t most_syncs = 32;  // that have not been answered

ClockKind clock_of(const wire::Welcome& welcome) {
  return welcome.is_virtual ? ClockKind::virtual_time : ClockKind::steady;
}

}  // namespace

RemoteScene::RemoteScene(const Endpoint& endpoint, const std::string& client)
    : client_(client),
      connection_(endpoint, client),
      replica_(make_ref<LocalScene>(
          std::shared_ptr<ServoOutput>(connection_.outbox(), &connection_.outbox()->servo),
          clock_of(connection_.welcome()))) {
  taken_.resize(connection_.welcome().max_objects);
  replica_->leave_unbuilt();
  replica_->hold();
}

LocalScene& RemoteScene::local() {
  Call call = enter();
  catch_up(call);
  is_evaluated_here_ = true;
  flush_ahead();
  return *replica_;
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
  for (look(); !group_; pause(call, true)) {
    flush_ahead();
    Group group;
    bool is_sent = false;
    replica_->begin();
    try {
      f(group);
      is_sent = deliver(group);
      if (is_sent) {
        replica_->commit();
      } else {
        replica_->cancel();
      }
    } catch (...) {
      replica_->cancel();
      if (is_sent) connection_.lose(no_memory_text);
      throw;
    }
    if (!is_sent) continue;
    publish();
    return connection_.check();
  }
  try {
    f(*group_);
  } catch (const std::bad_alloc&) {
    connection_.lose(no_memory_text);
    throw;
  }
}

// Tools look at what has been posted.
void RemoteScene::publish() {
  if (is_evaluated_here_) replica_->post();
}

void RemoteScene::flush_ahead() {
  for (; ahead_; ahead_ = ahead_->second.next_ahead) {
    replica_->set_movement(ahead_->first.c_str(), ahead_->second.movement);
    ahead_->second.is_ahead = false;
  }
}

// ------------------------------------------------------------------------------------------------------------- objects

void RemoteScene::set(const fs_object& object) {
  if (is_evaluated_here_) parse_object(object);  // builds its tree, without the lock
  check_struct_size(object.struct_size, sizeof object, "fs_object");
  const std::string name = text_of(object.name);
  Call call = enter();
  mutate(call, [&](Group& group) {
    require_room(group, !is_object(group, name));
    replica_->set(object);
    add_object(group, wire::type_set, name.c_str(), all_parts);
  });
}

void RemoteScene::change(const fs_object& object, uint32_t parts) {
  parse_parts(parts);
  check_struct_size(object.struct_size, sizeof object, "fs_object");
  const std::string given = text_of(object.name);
  const char* name = own_name(given.c_str());
  if (name && is_evaluated_here_ && (parts & FS_PART_SHAPE) && object.shape) object.shape->build();  // without the lock
  Call call = enter();
  try {
    if (!name) return change_other(call, object, parts);
    catch_up(call, name);
    fs_object own = object;
    if (name != given.c_str()) put_text(own.name, name);
    mutate(call, [&](Group& group) {
      require_room(group, 0);
      replica_->change(own, parts);
      if (parts == 0) return;
      const auto slot = slots_.find(std::string_view(name));
      const bool is_whole = slot != slots_.end() && slot->second.is_refused;  // the server has nothing to change
      add_object(group, is_whole ? wire::type_set : wire::type_change, name, is_whole ? all_parts : parts);
    });
  } catch (Error& error) {
    // A sentence about "spring" is one about "alice/spring" for whoever asked for that.
    const std::string here = "object '" + given.substr(given.find('/') + 1) + "'";
    if (error.text.starts_with(here)) error.text.replace(0, here.size(), "object '" + given + "'");
    throw;
  }
}

// The fast one: no system call and no allocation, while the server is awake.
void RemoteScene::move(const char* given, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  double steady;
  Call call = enter(&steady);
  const double at = time != 0 ? time : connection_.welcome().is_virtual ? now() : steady;
  const char* name = own_name(given);
  if (!name) return move_other(call, given, parsed, twist, at);
  look();
  const auto found = slots_.find(std::string_view(name, strnlen(name, FS_NAME_SIZE)));
  if (group_ || found == slots_.end() || found->second.index == wire::no_slot) {
    call.limit = call.end = 0;  // it never waits
    const bool is_refused = found != slots_.end() && found->second.is_refused;
    return mutate(call, [&](Group& group) {
      require_room(group, 0);
      replica_->move(name, parsed, twist, at);
      wire::Place place{{}, to_record(replica_->movement(name).motion)};
      put_text(place.name, name);
      if (group_ || !is_refused) add(group, wire::type_place, name, bytes_of(&place, 1));
    });
  }
  Slot& slot = found->second;
  slot.moved_in = question_;
  if (is_evaluated_here_ || slot.has_lifetime) {
    replica_->move(name, parsed, twist, at);
    slot.movement = replica_->movement(name);
    publish();
  } else {
    if (!slot.is_ahead) {
      slot.movement = replica_->movement(name);
      slot.is_ahead = true;
      slot.next_ahead = ahead_;
      ahead_ = &*found;
    }
    slot.movement.motion = slot.movement.track.take(parsed, twist, at);
  }
  connection_.inbox().write(slot.index, {slot.after, to_record(slot.movement.motion)});
  connection_.wake();
}

void RemoteScene::remove(const char* given) {
  Call call = enter();
  const char* name = own_name(given);
  if (!name) return remove_other(call, given);
  catch_up(call, "");
  mutate(call, [&](Group& group) {
    require_room(group, 0);
    replica_->remove(name);
    wire::Remove removal{};
    put_text(removal.name, name);
    add(group, wire::type_remove, name, bytes_of(&removal, 1));
  });
}

void RemoteScene::clear() {
  Call call = enter();
  mutate(call, [&](Group& group) {
    require_room(group, 0);
    replica_->clear();
    add(group, wire::type_clear, "");
  });
}

Ref<const Object> RemoteScene::get(const char* given, fs_object& out) {
  Call call = enter();
  const char* name = own_name(given);
  if (!name) return get_other(call, given, out);
  catch_up(call, name);
  flush_ahead();
  return replica_->get(name, out);
}

Scene::Contents RemoteScene::contents() {
  Call call = enter();
  catch_up(call);
  const fs_frame frame = own_view(call).frame;  // may wait: before the rest is looked at
  flush_ahead();
  Contents out = replica_->contents();
  out.frame = frame;
  return out;
}

void RemoteScene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                               const std::vector<Vec3>& tool) {
  if (is_evaluated_here_) {
    for (const fs_object& object : objects) {
      if (object.shape) object.shape->build();  // without the lock
    }
  }
  std::vector<std::string> names;
  for (const fs_object& object : objects) names.push_back(text_of(object.name));
  Call call = enter();
  mutate(call, [&](Group& group) {
    const std::set<std::string_view> distinct(names.begin(), names.end());
    const auto fresh = static_cast<size_t>(
        std::count_if(distinct.begin(), distinct.end(), [&](std::string_view name) { return !is_object(group, name); }));
    require_room(group, fresh, names.size() + 2);
    replica_->set_contents(objects, frame, tool);
    for (const std::string& name : names) add_object(group, wire::type_set, name.c_str(), all_parts);
    add_frame(group);
    add_tool(group);
  });
}

// ------------------------------------------------------------------------------------------------------------- groups

void RemoteScene::begin() {
  const Call call = enter();
  look();
  flush_ahead();
  auto group = std::make_unique<Group>();
  replica_->begin();  // STATE
  group_ = std::move(group);
}

// Where it fails, the group stays open, and nothing of it was sent.
void RemoteScene::commit() {
  Call call = enter();
  while (group_ && !deliver(*group_)) pause(call, true);
  try {
    replica_->commit();  // STATE
  } catch (const std::bad_alloc&) {
    connection_.lose(no_memory_text);
    throw;
  }
  group_ = nullptr;
  publish();
  connection_.check();
  look();
}

void RemoteScene::cancel() {
  const Call call = enter();
  replica_->cancel();  // STATE
  group_ = nullptr;
}

// At its end the client knows what became of its changes, if the time suffices.
void RemoteScene::sync(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  Call call = enter();
  call.end = start + timeout;
  const auto catch_up_in_time = [&] {
    while (look(), !group_ && !is_current() && try_pause(call, !pull_)) {
    }
  };
  uint64_t own = 0;  // serial; 0: not asked yet
  for (;;) {
    // Those of earlier calls that did not wait for them may be refusals.
    Answer answer;
    while (!syncs_.empty() && connection_.has_answer(syncs_.front())) {
      const uint64_t serial = syncs_.front();
      syncs_.pop_front();
      try {
        connection_.take_answer(serial, answer);
      } catch (const Error&) {
        catch_up_in_time();
        throw;
      }
    }
    if (!own && syncs_.size() < most_syncs) {
      syncs_.push_back(0);  // before it is asked: so that its answer cannot be lost
      try {
        syncs_.back() = own = connection_.ask(wire::type_sync);
      } catch (...) {
        syncs_.pop_back();
        throw;
      }
      if (!own) syncs_.pop_back();
    }
    if (own && (syncs_.empty() || syncs_.front() > own)) return catch_up_in_time();
    if (!try_pause(call, !own)) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
  }
}

// --------------------------------------------------------------------------------------------------------------- view

void RemoteScene::set_frame(const fs_frame& frame) {
  Call call = enter();
  mutate(call, [&](Group& group) {
    require_room(group, 0);
    replica_->set_frame(frame);
    add_frame(group);
  });
}

void RemoteScene::set_tool(const Vec3* points, size_t count) {
  Call call = enter();
  mutate(call, [&](Group& group) {
    require_room(group, 0);
    replica_->set_tool(points, count);
    add_tool(group);
  });
}

void RemoteScene::set_clutch(bool held) {
  Call call = enter();
  mutate(call, [&](Group& group) {
    require_room(group, 0);
    const wire::Clutch clutch{held};
    add(group, wire::type_clutch, "", bytes_of(&clutch, 1));
  });
}

std::vector<Vec3> RemoteScene::get_tool() {
  Call call = enter();
  catch_up(call, "");
  return replica_->get_tool();
}

fs_frame RemoteScene::get_frame(const char* client) { return view(client).frame; }

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
  Call call = enter();
  const uint32_t size = out.struct_size;
  out = request(call, wire::type_stats).as<fs_servo_stats>();
  out.struct_size = size;
}

void RemoteScene::get_device_info(fs_device_info& out) {
  Call call = enter();
  const uint32_t size = out.struct_size;
  out = request(call, wire::type_device).as<fs_device_info>();
  out.struct_size = size;
}

}  // namespace fs
