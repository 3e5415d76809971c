#include <forceserver/evaluate.h>

#include "api/guarded.h"
#include "base/names.h"
#include "scene/tool.h"

using namespace fs;

const char* fs_state_reason(uint32_t flags) { return state_reason(flags); }

fs_status fs_tool_create(fs_scene* scene, const fs_vec3* points, size_t count, fs_tool** out) {
  return guarded([&] {
    require_pointer(scene, "scene");
    require_pointer(out, "out");
    if (!points && count) fail(FS_ERROR_INVALID, "points is null, must be %zu points", count);
    std::vector<Vec3> own;
    if (points) {
      check_tool(points, count);
      own.assign(points, points + count);
    }
    *out = make_ref<Tool>(Ref<LocalScene>::retain(&scene->local()), std::move(own)).detach();
  });
}

fs_status fs_evaluate(fs_tool* tool, const fs_state* state, fs_response* out) {
  if (!out) return null_argument("out is null");
  if (!tool || !state) {
    *out = {};
    return null_argument(tool ? "state is null" : "tool is null");
  }
  return tool->evaluate(*state, *out);
}

fs_status fs_tool_reset(fs_tool* tool) {
  if (!tool) return null_argument("tool is null");
  tool->reset();
  return FS_OK;
}

void fs_tool_destroy(fs_tool* tool) {
  if (tool) tool->release();
}

fs_status fs_evaluate_field(fs_scene* scene, const char* name, double time, const fs_vec3* positions, size_t count,
                            fs_vec3* forces) {
  return guarded([&] {
    require_pointer(scene, "scene");
    if (count) {
      require_pointer(positions, "positions");
      require_pointer(forces, "forces");
    }
    evaluate_field(scene->local(), name, time, positions, count, forces);
  });
}
