#include "scene/draft.h"

namespace fs {

Draft::Draft(Ref<LocalScene> scene) : scene_(std::move(scene)) {}

Draft::~Draft() {
  const std::lock_guard lock(scene_->mutex_);
  group_ = nullptr;
}

void Draft::change(const fs_object& change, uint32_t parts) {
  const std::string name = parse_name(change.name, "name");
  const std::lock_guard lock(scene_->mutex_);
  const Edits::In inside(scene_->edits_, group_);
  fs_object present;
  const Ref<const Object> object = scene_->get_one(name.c_str(), present);
  scene_->put(parse_object(merge_parts(present, change, parts), object.get(), scene_->readers.builds_shapes()), parts);
}

void Draft::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_move(pose, twist, time);
  const std::lock_guard lock(scene_->mutex_);
  const Edits::In inside(scene_->edits_, group_);
  scene_->edits_.move(name, parsed, twist, time);
}

void Draft::remove(const char* name) {
  const std::lock_guard lock(scene_->mutex_);
  const Edits::In inside(scene_->edits_, group_);
  scene_->edits_.remove(name);
}

Ref<const Object> Draft::get(const char* name, fs_object& out) {
  const std::lock_guard lock(scene_->mutex_);
  const Edits::In inside(scene_->edits_, group_);
  return scene_->get_one(name, out);
}

void Draft::take() {
  scene_->mutate([&] {
    scene_->edits_.take(*group_);
    if (scene_->edits_.group()) scene_->evaluated_.changed();  // what is evaluated has changed, beside the open group
  });
}

}  // namespace fs
