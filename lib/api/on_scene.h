// For the C functions of a scene: checks `scene`, calls f, and turns an exception into a status. The scene lives until the call
// ends, even if another thread destroys its handle meanwhile.
#pragma once

#include "api/guarded.h"
#include "scene/scene.h"

namespace fs {

template <class F>
fs_status on_scene(fs_scene* scene, F&& f) {
  return guarded([&] {
    require_pointer(scene, "scene");
    const Ref<fs_scene> kept = Ref<fs_scene>::retain(scene);
    f();
  });
}

}  // namespace fs
