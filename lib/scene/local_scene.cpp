#include "scene/local_scene.h"

#include <chrono>
#include <cmath>
#include <new>
#include <thread>

#include "base/error.h"
#include "scene/moment.h"

using namespace fs;

LocalScene::LocalScene(std::shared_ptr<ServoOutput> the_output, ClockKind clock)
    : evaluated_(the_output ? std::move(the_output) : std::make_shared<ServoOutput>(), clock) {}

// -------------------------------------------------------------------------------------------------------------- objects

void LocalScene::put(Edits edits, const ParsedObject& object, uint32_t parts, bool is_change) {
  if (readers.builds_shapes() && object.object->shape) object.object->shape->build();  // in most cases parse_object has built it
  edits.put(object, parts, is_change);
}

void LocalScene::set(const fs_object& object) {
  const ParsedObject parsed = parse_object(object, nullptr, readers.builds_shapes());
  mutate([&](Edits edits) { put(edits, parsed, all_parts, false); });
}

void LocalScene::change(const fs_object& change, uint32_t parts) {
  parse_parts(parts);
  const std::string name = parse_name(change.name, "name");
  fs_object current;
  for (bool is_done = false; !is_done;) {
    const Ref<const Object> object = get(name.c_str(), current);
    if (parts == 0) return;
    // Parsing may build a tree, so it happens without the lock, and again if another thread has changed the object.
    const ParsedObject parsed = parse_object(merge_parts(current, change, parts), object.get(), readers.builds_shapes());
    mutate([&](Edits edits) {
      const ObjectState now = edits.require(name.c_str());
      is_done = now.object == object && now.start == current.start;
      if (is_done) put(edits, parsed, parts, true);
    });
  }
}

void LocalScene::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_move(pose, twist, time);
  mutate([&](Edits edits) { edits.move(name, parsed, twist, time); });
}

void LocalScene::remove(const char* name) {
  mutate([&](Edits edits) { edits.remove(name); });
}

void LocalScene::clear() {
  mutate([&](Edits edits) { edits.clear(); });
}

Ref<const Object> LocalScene::get(const char* name, fs_object& out) { return get(name, out, true); }

Ref<const Object> LocalScene::get(const char* name, fs_object& out, bool with_group) {
  const std::lock_guard lock(mutex_);
  const ObjectState known = with_group ? edits().require(name) : evaluated_.objects.require(name);
  out = to_c(known);
  return known.object;
}

// An object as it can be set anew, on whatever clock, to be where it is now. A set gives the motion of a twist the usual
// horizon: one that was worked out has another, so it begins anew from here, or is over.
static fs_object to_saved(const ObjectState& known, double now) {
  fs_object out = to_c(known);
  const Motion& motion = known.motion;
  if (Track::is_zero(motion.twist)) {
    out.time = 0;
  } else if (motion.horizon != extrapolation_limit) {
    out.pose = motion.at(now, 0);
    if (now < motion.time + motion.horizon) out.time = now;
    else out.time = 0, out.twist = {};
  }
  return out;
}

Scene::Contents LocalScene::contents() {
  const std::lock_guard lock(mutex_);
  Contents out;
  const double time = now();
  edits().for_each([&](const std::string&, const ObjectState& known) {
    fs_object object = to_saved(known, time);
    if (!known.start_is_given) object.start = 0;
    out.objects.push_back(object);
    out.owners.push_back(known.object);
  });
  out.frame = edits().frame();
  out.tool = edits().tool();
  out.tool_radius = edits().tool_radius();
  return out;
}

void LocalScene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<Vec3>& tool,
                              double tool_radius) {
  std::vector<ParsedObject> parsed;
  for (const fs_object& object : objects) {
    try {
      parsed.push_back(parse_object(object, nullptr, readers.builds_shapes()));
    } catch (Error& error) {  // an object with a bad name is identified by its index
      if (!error.text.starts_with("object")) error.text = "object " + std::to_string(parsed.size() + 1) + ": " + error.text;
      throw;
    }
  }
  const fs_frame parsed_frame = parse_frame(frame);
  check_tool(tool.data(), tool.size());
  check_tool_radius(tool_radius);
  mutate([&](Edits edits) {
    edits.require_room(parsed);
    edits.refuse_solid_meshes(tool_radius, parsed);
    edits.change_view({.frame = parsed_frame, .points = tool, .point_radius = tool_radius});
    for (const ParsedObject& object : parsed) put(edits, object, all_parts, false);
  });
}

Movement LocalScene::movement(const char* name) {
  const std::lock_guard lock(mutex_);
  const ObjectState known = edits().require(name);
  return {known.motion, known.track};
}

void LocalScene::set_movement(const char* name, const Movement& movement) {
  mutate([&](Edits edits) { edits.set_movement(name, movement.motion, movement.track); }, false);
}

void LocalScene::set_motion(const std::string& name, const Motion& motion) {
  mutate([&](Edits edits) {
    if (!edits.move_to(name, motion, now())) fail_unknown(name);
  });
}

size_t LocalScene::set_motions(const std::vector<Move>& moves) {
  size_t count = 0;
  mutate([&](Edits edits) {
    const double time = now();
    for (const auto& [name, id, motion] : moves) count += evaluated_.objects.move_to(*name, *id, motion, time);
    if (edits.group()) evaluated_.changed();
  });
  return count;
}

void LocalScene::set_capacity(uint32_t capacity) {
  const std::lock_guard lock(mutex_);
  evaluated_.objects.set_capacity(capacity);
}

size_t LocalScene::object_count() {
  const std::lock_guard lock(mutex_);
  return edits().count();
}

bool LocalScene::is_empty() const {
  const std::lock_guard lock(mutex_);
  bool is_any_added = false;
  groups_.for_each([&](const OpenGroup& group) { is_any_added |= group.added > 0; });
  return evaluated_.objects.is_empty() && !is_any_added;
}

// --------------------------------------------------------------------------------------------------- groups

void LocalScene::require_group(const char* function) const {
  if (!groups_.mine()) fail(FS_ERROR_STATE, "%s: no group is open in this thread; fs_scene_begin opens one", function);
}

void LocalScene::begin() {
  const std::lock_guard lock(mutex_);
  if (groups_.mine()) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  evaluated_.settle(true);
  groups_.open(std::make_unique<OpenGroup>());
}

void LocalScene::commit() {
  mutate([&](Edits edits) {
    require_group("fs_scene_commit");
    edits.require_room();
    edits.commit(SIZE_MAX);
    groups_.close();
  });
}

void LocalScene::check_commit() {
  const std::lock_guard lock(mutex_);
  edits().refuse_solid_meshes(edits().tool_radius());
}

void LocalScene::cancel() {
  const std::lock_guard lock(mutex_);
  require_group("fs_scene_cancel");
  groups_.close();
}

// -------------------------------------------------------------------------------------------------- frame, clutch, tool

void LocalScene::set_frame(const fs_frame& frame) {
  const fs_frame parsed = parse_frame(frame);
  mutate([&](Edits edits) { edits.change_view({.frame = parsed}); });
}

fs_frame LocalScene::get_frame(const char* client) {
  require_no_client(client);
  const std::lock_guard lock(mutex_);
  return edits().frame();
}

void LocalScene::set_clutch(bool held) {
  mutate([&](Edits edits) { edits.change_view({.held = held}); });
}

void LocalScene::set_tool(const Vec3* points, size_t count) {
  check_tool(points, count);
  mutate([&](Edits edits) { edits.change_view({.points = std::vector<Vec3>(points, points + count)}); });
}

std::vector<Vec3> LocalScene::get_tool() {
  const std::lock_guard lock(mutex_);
  return edits().tool();
}

void LocalScene::set_tool_radius(double radius) {
  check_tool_radius(radius);
  mutate([&](Edits edits) {
    edits.refuse_solid_meshes(radius);
    edits.change_view({.point_radius = radius});
  });
}

double LocalScene::get_tool_radius() {
  const std::lock_guard lock(mutex_);
  return edits().tool_radius();
}

fs_view LocalScene::view(const char* client) {
  require_no_client(client);
  return view(true);
}

fs_view LocalScene::view(bool with_group) {
  const std::lock_guard lock(mutex_);
  return edits().view(with_group);
}

void LocalScene::set_accuracy(double newtons) {
  check_accuracy(newtons);
  const std::lock_guard lock(mutex_);
  evaluated_.prepare();
  evaluated_.objects.rows.set_accuracy(newtons);
  evaluated_.changed();  // no group holds it back
}

void LocalScene::set_max_stiffness(double stiffness) {
  check_max_stiffness(stiffness);
  const std::lock_guard lock(mutex_);
  max_stiffness_ = stiffness;
  const ServoReader* const servo = evaluated_.servo_reader();
  if (servo && servo->budget) servo->budget->take_max_stiffness();
}

// --------------------------------------------------------------------------------------------------- reports and events

std::vector<fs_report> LocalScene::reports() {
  const Moment moment(Ref<LocalScene>::retain(this), true);  // what an open group has changed is not felt yet
  std::vector<fs_report> out;
  moment.for_each_report([&](const fs_report& report) { out.push_back(report); });
  return out;
}

fs_report LocalScene::report(const char* name) { return report(name, true); }

fs_report LocalScene::report(const char* name, bool with_group) {
  const Moment moment(Ref<LocalScene>::retain(this), with_group, name);
  fs_report out;
  moment.for_each_report([&](const fs_report& report) { out = report; });
  return out;
}

std::vector<fs_motion> LocalScene::motions(const char* client) {
  require_no_client(client);
  const Moment moment(Ref<LocalScene>::retain(this), true);
  std::vector<fs_motion> out;
  moment.for_each_motion("", [&](const fs_motion& motion) { out.push_back(motion); });
  return out;
}

std::vector<fs_motion> LocalScene::motions_since(const char* client, uint64_t since) {
  require_no_client(client);
  const Moment moment(Ref<LocalScene>::retain(this), false);  // a group that is cancelled would leave no trace
  std::vector<fs_motion> out;
  moment.for_each_motion_since("", since, moment.last_revision(), [&](const fs_motion& motion) { out.push_back(motion); });
  sort_by_revision(out);
  return out;
}

bool LocalScene::take_event(fs_event& out) {
  const std::lock_guard lock(mutex_);
  evaluated_.settle(true);
  evaluated_.collect_events();
  return evaluated_.events.take(now(), out);
}

fs_event LocalScene::next_event(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    fs_event event;
    if (take_event(event)) return event;
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    // The servo makes no system call to wake anyone, so this side looks, often enough for a person.
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}

void LocalScene::note(fs_event event) noexcept {
  try {
    const std::lock_guard lock(mutex_);
    event.time = now();
    evaluated_.events.push(event);
  } catch (const std::bad_alloc&) {
  }
}

// -------------------------------------------------------------------------------------------------------------- posting

void LocalScene::hold() {
  const std::lock_guard lock(mutex_);
  evaluated_.hold();
}

void LocalScene::post() {
  const std::lock_guard lock(mutex_);
  evaluated_.post();
}

uint64_t LocalScene::sequence() const {
  const std::lock_guard lock(mutex_);
  return evaluated_.sequence();
}

void LocalScene::sync(double timeout) {
  check_timeout(timeout);
  const uint64_t wanted = sequence();
  const double start = steady_now();
  while (readers.has_servo() && output->used.load(std::memory_order_acquire) < wanted) {
    if (steady_now() - start >= timeout) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

// ----------------------------------------------------------------------------------------------------- servo and clock

fs_status LocalScene::get_time(double& out) const noexcept {
  out = now();
  return FS_OK;
}

fs_status LocalScene::set_time(double time) noexcept {
  if (!(time > 0) || !(time <= 1e15)) {
    return set_last_error_literal(FS_ERROR_INVALID, "time must be > 0 s and at most 1e15 s");
  }
  if (readers.has_servo()) return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene's servo has the clock");
  evaluated_.clock.tell(time);
  return FS_OK;
}

fs_status LocalScene::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  return readers.get_hand(state, response, sent);
}

std::vector<fs_client> LocalScene::clients() {
  fail(FS_ERROR_UNSUPPORTED, "this scene is in this process; only a scene made by fs_scene_connect has clients to list");
}

std::vector<fs_client_view> LocalScene::views() {
  fail(FS_ERROR_UNSUPPORTED, "this scene is in this process; only a scene made by fs_scene_connect lists the views of clients");
}

void LocalScene::get_servo_stats(fs_servo_stats& out) { readers.get_servo_stats(out); }

void LocalScene::get_device_info(fs_device_info& out) { readers.get_device_info(out); }

std::vector<fs_recorded_tick> LocalScene::record(uint64_t after) { return readers.record(after); }

void LocalScene::stop_force() { readers.set_enabled(false); }

void LocalScene::resume_force() { readers.set_enabled(true); }
