// A scene as JSON: its objects, frame and tool. The schema stands in scene.schema.json beside this file. What belongs
// to a moment is not in it: an object's `time` (loading is setting now). `start` is there only when it was given, as an
// age: how long before the present `time` (s) of the scene's clock it was.
#pragma once

#include <string>
#include <vector>

#include <forceserver/scene.h>

#include "force/curve.h"
#include "force/shape.h"

namespace fs {

struct SceneDescription {
  std::vector<fs_object> objects;  // as fs_object_set takes them; their handles are kept alive by the two lists below
  std::vector<Ref<const Shape>> shapes;
  std::vector<Ref<const Curve>> curves;
  fs_frame frame;
  std::vector<Vec3> tool;
};

// Meshes go beside it as PLY, one file for each shape however many objects share it, named after its content
// (NAME-HASH.ply): so the meshes of an old scene file are never replaced, and those no longer used are left. Every
// number comes back bit for bit; a start is worked out from its age, so it is within rounding of the clock. Throws
// IO, or INVALID for a name that is not UTF-8; then the old files are intact.
void write_scene_file(const std::string& path, const SceneDescription& scene, double time);

// Checks the file's form (version, keys, types); the values of objects are for the caller's fs_object_set to check.
// Throws NOT_FOUND, IO, PARSE (line and column, or the object's name and field), VERSION.
SceneDescription read_scene_file(const std::string& path, double time);

}  // namespace fs
