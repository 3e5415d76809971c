// Own objects and groups, view and clock. How changes are sent: sending.cpp; what concerns other clients: others.cpp.
#include "client/remote_scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>

#include "base/error.h"
#include "scene/transfer.h"

namespace fs {
namespace {

constexpr size_t most_syncs = 32;  // that have not been answered

constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;

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
  replica_->leave_unbuilt();
  replica_->hold();
}

// Not after a loss; and in a forked child not even to the lock, which nobody there may ever give back.
RemoteScene::Lock RemoteScene::enter(double* steady) const {
  if (connection_.is_forked()) connection_.check();
  Lock lock(mutex_);
  const double now = steady_now();
  connection_.check(now);
  if (steady) *steady = now;
  return lock;
}

LocalScene& RemoteScene::local() {
  const Lock lock = enter();
  catch_up();
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

void RemoteScene::require_no_group() const {
  if (group_) fail(FS_ERROR_STATE, "a group is open: another client's object cannot be changed in it");
}

// Runs f, which changes the replica and says so in a group: the one that is open, or one of its own.
template <class F>
void RemoteScene::mutate(F&& f) {
  if (group_) {
    try {
      return f(*group_);
    } catch (const std::bad_alloc&) {
      connection_.lose("there was no memory in the middle of a change");
      throw;
    }
  }
  flush_ahead();
  Group group;
  replica_->begin();
  try {
    f(group);
    prepare(group);
    replica_->commit();
  } catch (...) {
    replica_->cancel();
    throw;
  }
  transmit(group);
  publish();
  connection_.check();
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
  const Lock lock = enter();
  pull();
  mutate([&](Group& group) {
    require_room(group, !has(group, name));
    replica_->set(object);
    add_object(group, wire::type_set, name.c_str(), all_parts);
  });
}

void RemoteScene::change(const fs_object& object, uint32_t parts) {
  if (parts & ~all_parts) fail(FS_ERROR_INVALID, "parts is 0x%x, must be of the fs_part bits 0x%x", parts, all_parts);
  check_struct_size(object.struct_size, sizeof object, "fs_object");
  const std::string given = text_of(object.name);
  const char* name = own_name(given.c_str());
  if (name && is_evaluated_here_ && (parts & FS_PART_SHAPE) && object.shape) object.shape->build();  // without the lock
  const Lock lock = enter();
  try {
    if (!name) return change_other(object, parts);
    catch_up(name);
    fs_object own = object;
    if (name != given.c_str()) put_text(own.name, name);
    mutate([&](Group& group) {
      require_room(group, 0);
      replica_->change(own, parts);
      if (parts) add_object(group, wire::type_change, name, parts);
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
  const Lock lock = enter(&steady);
  const double at = time != 0 ? time : connection_.welcome().is_virtual ? now() : steady;
  const char* name = own_name(given);
  if (!name) return move_other(given, parsed, twist, at);
  if (group_) {
    return mutate([&](Group& group) {
      require_room(group, 0);
      replica_->move(name, parsed, twist, at);
      const wire::Place place{0, 0, to_record(replica_->movement(name).motion)};
      add(group, wire::type_place, name, bytes_of(&place, 1));
    });
  }
  pull();
  const auto found = slots_.find(std::string_view(name, strnlen(name, FS_NAME_SIZE)));
  if (found == slots_.end()) {
    replica_->movement(name);  // throws NOT_FOUND
    fail(FS_ERROR_INTERNAL, "object '%.80s' has no slot", name);
  }
  Slot& slot = found->second;
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
  const Lock lock = enter();
  const char* name = own_name(given);
  if (!name) {
    require_no_group();
    const wire::Target target = to_target(given, "name");
    connection_.request(wire::type_remove_other, bytes_of(&target, 1));
    return;
  }
  mutate([&](Group& group) {
    require_room(group, 0);
    replica_->remove(name);
    const wire::Remove removal{};
    add(group, wire::type_remove, name, bytes_of(&removal, 1));
  });
}

void RemoteScene::clear() {
  const Lock lock = enter();
  mutate([&](Group& group) {
    require_room(group, 0);
    replica_->clear();
    add(group, wire::type_clear, "");
  });
}

Ref<const Object> RemoteScene::get(const char* given, fs_object& out) {
  const Lock lock = enter();
  const char* name = own_name(given);
  if (!name) return get_other(given, out);
  catch_up(name);
  flush_ahead();
  return replica_->get(name, out);
}

Scene::Contents RemoteScene::contents() {
  const Lock lock = enter();
  catch_up();
  flush_ahead();
  Contents out = replica_->contents();
  out.frame = own_frame();
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
  const Lock lock = enter();
  mutate([&](Group& group) {
    std::set<std::string_view> fresh;
    for (const std::string& name : names) {
      if (!has(group, name)) fresh.insert(name);
    }
    require_room(group, fresh.size(), names.size() + 2);
    replica_->set_contents(objects, frame, tool);
    for (const std::string& name : names) add_object(group, wire::type_set, name.c_str(), all_parts);
    add_frame(group);
    add_tool(group);
  });
}

// ------------------------------------------------------------------------------------------------------------- groups

void RemoteScene::begin() {
  const Lock lock = enter();
  pull();
  flush_ahead();
  auto group = std::make_unique<Group>();
  replica_->begin();  // STATE
  group_ = std::move(group);
}

// When it fails before anything was sent, the group stays open.
void RemoteScene::commit() {
  const Lock lock = enter();
  if (group_) prepare(*group_);
  replica_->commit();  // STATE
  const std::unique_ptr<Group> group = std::move(group_);
  transmit(*group);
  publish();
  connection_.check();
}

void RemoteScene::cancel() {
  const Lock lock = enter();
  replica_->cancel();  // STATE
  group_ = nullptr;
}

void RemoteScene::sync(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  Lock lock = enter();
  uint64_t own = 0;  // serial; 0: not asked yet
  for (;;) {
    // Those of earlier calls that did not wait for them may be refusals.
    Answer answer;
    while (!syncs_.empty() && connection_.has_answer(syncs_.front())) {
      const uint64_t serial = syncs_.front();
      syncs_.pop_front();
      connection_.take_answer(serial, answer);
    }
    if (!own && syncs_.size() < most_syncs) syncs_.push_back(own = connection_.ask(wire::type_sync));
    if (own && (syncs_.empty() || syncs_.front() > own)) return;
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    lock.unlock();
    connection_.wait(std::fmin(rest, 2e-3));  // not longer: another thread may take the answer in
    lock.lock();
  }
}

// --------------------------------------------------------------------------------------------------------------- view

void RemoteScene::set_frame(const fs_frame& frame) {
  const Lock lock = enter();
  mutate([&](Group& group) {
    require_room(group, 0);
    replica_->set_frame(frame);
    add_frame(group);
  });
}

void RemoteScene::set_tool(const Vec3* points, size_t count) {
  const Lock lock = enter();
  mutate([&](Group& group) {
    require_room(group, 0);
    replica_->set_tool(points, count);
    add_tool(group);
  });
}

void RemoteScene::set_clutch(bool held) {
  const Lock lock = enter();
  mutate([&](Group& group) {
    require_room(group, 0);
    const wire::Clutch clutch{held};
    add(group, wire::type_clutch, "", bytes_of(&clutch, 1));
  });
}

std::vector<Vec3> RemoteScene::get_tool() {
  const Lock lock = enter();
  return replica_->get_tool();
}

// As an open group has it; else the server's, where a clutch may have moved it.
fs_frame RemoteScene::own_frame() {
  const auto is_frame = [](const Change& change) { return change.type == wire::type_frame; };
  if (group_ && std::any_of(group_->changes.begin(), group_->changes.end(), is_frame)) {
    return replica_->get_frame(nullptr);
  }
  const wire::Target target = to_target(client_.c_str(), "client");
  return connection_.request(wire::type_view, bytes_of(&target, 1)).as<wire::Frame>().frame;
}

fs_frame RemoteScene::get_frame(const char* client) {
  const Lock lock = enter();
  if (!client || client_ == client) return own_frame();
  const wire::Target target = to_target(client, "client");
  return connection_.request(wire::type_view, bytes_of(&target, 1)).as<wire::Frame>().frame;
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
  const Lock lock = enter();
  const uint32_t size = out.struct_size;
  out = connection_.request(wire::type_stats).as<fs_servo_stats>();
  out.struct_size = size;
}

void RemoteScene::get_device_info(fs_device_info& out) {
  const Lock lock = enter();
  const uint32_t size = out.struct_size;
  out = connection_.request(wire::type_device).as<fs_device_info>();
  out.struct_size = size;
}

}  // namespace fs
