// Changes of a scene that belong together, kept apart from it until they are committed: what threads of the application have
// open are other groups. Calls and errors are those of the scene; a group that is destroyed changes nothing. Any thread, one
// at a time.
#pragma once

#include "scene/local_scene.h"

namespace fs {

class SceneGroup {
 public:
  explicit SceneGroup(Ref<LocalScene> scene) : scene_(std::move(scene)), edits_(scene_->evaluated_, &group_) {}
  SceneGroup(const SceneGroup&) = delete;
  SceneGroup& operator=(const SceneGroup&) = delete;

  void set(const fs_object& object);
  void change(const fs_object& object, uint32_t parts);
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time);
  void set_motion(const std::string& name, const Motion& motion);
  void remove(const char* name);
  void set_frame(const fs_frame& frame);
  void set_clutch(bool held);
  void set_tool(const Vec3* points, size_t count);
  void set_tool_radius(double radius);
  Ref<const Object> get(const char* name, fs_object& out);  // as the group has it

  // Changes the scene, by at most so many objects; true: by all of them. Between the steps nobody may set, move, remove or post;
  // bounds may change.
  // Where somebody else has changed an object meanwhile, only the parts that the group has changed are changed.
  bool commit(size_t most);

 private:
  const Ref<LocalScene> scene_;
  OpenGroup group_;
  Edits edits_;
};

}  // namespace fs
