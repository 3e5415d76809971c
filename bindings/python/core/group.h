// Groups of changes of a scene: each belongs to a thread.
#pragma once

#include "handle.h"

namespace forceserver_python {

inline py::object begin_group(Handle<fs_scene>& scene) {
  const Use<fs_scene> use(scene);
  const uint64_t before = scene.group();
  const uint64_t group = before != 0 ? before : scene.begin_group();
  const fs_status status = without_gil([&] { return fs_scene_begin(use); });
  if (status < 0 && before == 0) scene.end_group(group);
  check(status);
  return py::none();
}

// `end` is fs_scene_commit or fs_scene_cancel. A commit that times out leaves the group open.
inline void end_group(Handle<fs_scene>& scene, const Use<fs_scene>& use, uint64_t group, fs_status (*end)(fs_scene*)) {
  const fs_status status = without_gil([&] { return end(use); });
  if (group != 0 && (status >= 0 || status == FS_ERROR_STATE || end == fs_scene_cancel)) scene.end_group(group);
  check(status);
}

// commit() and cancel(): the group of this thread; where it has none it waits for that of another one, and fails.
inline py::object end_group(Handle<fs_scene>& scene, fs_status (*end)(fs_scene*)) {
  const Use<fs_scene> use(scene);
  const Edit edit(scene);
  end_group(scene, use, scene.group(), end);
  return py::none();
}

// What `with scene.change()` is made of. It ends its own group and no other, in whichever thread it is closed.
inline void add_groups(py::class_<Handle<fs_scene>>& made) {
  const auto as_self = [](const py::object& self) -> Handle<fs_scene>& { return as_handle<fs_scene>(self, "self"); };
  made.def("_group", [as_self](const py::object& self) { return as_self(self).group(); });
  made.def("_end_group", [as_self](const py::object& self, uint64_t group, bool commit) {
    Handle<fs_scene>& scene = as_self(self);
    if (!scene.is_open(group)) return;
    const Use<fs_scene> use(scene);
    end_group(scene, use, group, commit ? fs_scene_commit : fs_scene_cancel);
  });
}

}  // namespace forceserver_python
