#include "scene/scene_group.h"

namespace fs {

void SceneGroup::set(const fs_object& object) {
  const ParsedObject parsed = parse_object(object, nullptr, scene_->readers.builds_shapes());
  const std::lock_guard lock(scene_->mutex_);
  scene_->put(edits_, parsed, all_parts, false);
}

void SceneGroup::change(const fs_object& change, uint32_t parts) {
  parse_parts(parts);
  const std::string name = parse_name(change.name, "name");
  const std::lock_guard lock(scene_->mutex_);
  const ObjectState known = edits_.require(name.c_str());
  if (parts == 0) return;
  const fs_object whole = merge_parts(to_c(known), change, parts);
  scene_->put(edits_, parse_object(whole, known.object.get(), scene_->readers.builds_shapes()), parts, true);
}

void SceneGroup::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_move(pose, twist, time);
  const std::lock_guard lock(scene_->mutex_);
  edits_.move(name, parsed, twist, time);
}

void SceneGroup::set_motion(const std::string& name, const Motion& motion) {
  const std::lock_guard lock(scene_->mutex_);
  if (!edits_.move_to(name, motion, scene_->now())) fail_unknown(name);
}

void SceneGroup::remove(const char* name) {
  const std::lock_guard lock(scene_->mutex_);
  edits_.remove(name);
}

void SceneGroup::set_frame(const fs_frame& frame) {
  const fs_frame parsed = parse_frame(frame);
  const std::lock_guard lock(scene_->mutex_);
  edits_.change_view({.frame = parsed});
}

void SceneGroup::set_clutch(bool held) {
  const std::lock_guard lock(scene_->mutex_);
  edits_.change_view({.held = held});
}

void SceneGroup::set_tool(const Vec3* points, size_t count) {
  check_tool(points, count);
  const std::lock_guard lock(scene_->mutex_);
  edits_.change_view({.points = std::vector<Vec3>(points, points + count)});
}

void SceneGroup::set_tool_radius(double radius) {
  check_tool_radius(radius);
  const std::lock_guard lock(scene_->mutex_);
  edits_.refuse_solid_meshes(radius);
  edits_.change_view({.point_radius = radius});
}

Ref<const Object> SceneGroup::get(const char* name, fs_object& out) {
  const std::lock_guard lock(scene_->mutex_);
  const ObjectState known = edits_.require(name);
  out = to_c(known);
  return known.object;
}

bool SceneGroup::commit(size_t most) {
  const std::lock_guard lock(scene_->mutex_);
  scene_->evaluated_.prepare();
  try {
    if (!edits_.commit(most)) return false;
  } catch (...) {  // a part may be done
    scene_->evaluated_.changed();
    throw;
  }
  scene_->evaluated_.changed();
  return true;
}

}  // namespace fs
