// Changes that another client makes to existing objects of a scene, collected until take applies all of them at once. A
// draft is independent of the application's open group. Any thread; errors as of the scene's own calls.
#pragma once

#include "scene/local_scene.h"

namespace fs {

class Draft {
 public:
  explicit Draft(Ref<LocalScene> scene);
  ~Draft();
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;

  void change(const fs_object& object, uint32_t parts);  // its shape is built
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time);
  void remove(const char* name);
  Ref<const Object> get(const char* name, fs_object& out);  // as the draft has it
  void take();  // changes only the parts that the draft has changed

 private:
  const Ref<LocalScene> scene_;
  std::unique_ptr<OpenGroup> group_ = std::make_unique<OpenGroup>();
};

}  // namespace fs
