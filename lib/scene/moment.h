// The objects of a scene as they are at one moment, whatever is changed later: so that many can be looked at without
// keeping others waiting for the lock, those of several scenes at one time, and in another thread.
#pragma once

#include <mutex>
#include <string>

#include "scene/local_scene.h"

namespace fs {

class LocalScene::Moment {
 public:
  // with_group: as an open group has them; else as they are evaluated.
  Moment(Ref<LocalScene> scene, bool with_group) : scene_(std::move(scene)) {
    const std::lock_guard lock(scene_->mutex_);
    objects_ = with_group ? scene_->working() : scene_->table_;
    basis_ = scene_->report_basis();
    most_ = scene_->slots_.size();
  }
  ~Moment() {
    const std::lock_guard lock(scene_->mutex_);
    objects_ = {};
  }
  Moment(const Moment&) = delete;
  Moment& operator=(const Moment&) = delete;

  size_t most() const noexcept { return most_; }  // objects; those that have been removed and fade out among them
  // Calls f(fs_motion) for each of them; prefix comes before its name.
  template <class F>
  void for_each_motion(const std::string& prefix, F&& f) const {
    objects_.for_each([&](uint32_t, const Entry& entry) {
      if (!entry.is_removed) f(to_motion(entry, prefix));
    });
  }

  // Calls f(fs_report) for each, as they were evaluated.
  template <class F>
  void for_each_report(F&& f) const {
    objects_.for_each([&](uint32_t, const Entry& entry) {
      if (!entry.is_removed) f(make_report(entry, &entry, basis_));
    });
  }
  const fs_frame& frame() const noexcept { return basis_.frame; }

 private:
  static fs_motion to_motion(const Entry& entry, const std::string& prefix) noexcept {
    fs_motion out{};
    const size_t size = prefix.copy(out.name, FS_NAME_SIZE - 1);
    entry.object->name.copy(out.name + size, FS_NAME_SIZE - 1 - size);
    out.primitive = entry.object->primitive;
    out.revision = entry.revision;
    out.motion_revision = entry.motion_revision;
    out.pose = entry.motion.pose;
    out.twist = entry.motion.twist;
    out.time = entry.motion.time;
    out.horizon = entry.motion.horizon;
    return out;
  }

  const Ref<LocalScene> scene_;
  Table<Entry> objects_;
  ReportBasis basis_;
  size_t most_ = 0;
};

}  // namespace fs
