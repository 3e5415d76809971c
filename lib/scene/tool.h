// What touches a scene in a loop of the caller's own. It is the fs_tool of the C contract itself.
#pragma once

#include "scene/local_scene.h"

struct fs_tool : fs::Counted<fs_tool> {
  // points: m, frame of the handle; none: those of the scene, as they are at each evaluation.
  fs_tool(fs::Ref<fs::LocalScene> scene, std::vector<fs::Vec3> points);
  ~fs_tool();

  fs_status evaluate(const fs_state& state, fs_response& out) noexcept;  // [rt]
  void reset() noexcept;                                                  // [rt]

 private:
  const fs::Ref<fs::LocalScene> scene_;
  const fs::Ref<const fs::ToolPoints> points_;  // null: those of the scene
  double radius_ = 0;  // m, of the points at the last evaluation
  uint64_t what_ = 1;  // as Memory::look has it, of its own points
  fs::Reader reader_{fs::make_ref<fs::Memory>()};
};

namespace fs {
using Tool = fs_tool;

// The force on a point at each of the positions (m, scene) at `time` (s; 0: now), on all processors. INVALID, NOT_FOUND.
void evaluate_field(LocalScene& scene, const char* name, double time, const Vec3* positions, size_t count, Vec3* forces);
}  // namespace fs
