// A scene as JSON: its objects, frame and tool. The schema is scene.schema.json beside this file. An object's `time` and
// `start` are saved only if they are not 0, as ages: the time from them to the present `time` (s) of the scene's clock.
#pragma once

#include <string>
#include <vector>

#include <forceserver/scene.h>

#include "law/curve.h"
#include "law/surface.h"
#include "shape/shape.h"

namespace fs {

struct SceneDescription {
  std::vector<fs_object> objects;  // as fs_object_set takes them; their handles are kept alive by the three lists below
  std::vector<Ref<const Shape>> shapes;
  std::vector<Ref<const Curve>> curves;
  std::vector<Ref<const Surface>> surfaces;
  fs_frame frame;
  std::vector<Vec3> tool;
  double tool_radius = 0;
};

// Meshes are written beside the scene file as PLY, one file for each shape however many objects use it, named after its
// content (NAME-HASH.ply). So the meshes of an old scene file are never replaced; those no longer used stay. Every
// number is read back bit for bit, except that times are computed from their ages and are exact to the rounding of the
// clock. Throws IO, or INVALID for a name that is not UTF-8; then the old files are intact.
void write_scene_file(const std::string& path, const SceneDescription& scene, double time);

// Checks the file's form (version, keys, types); the caller's fs_object_set checks the values of objects.
// Throws NOT_FOUND, IO, PARSE (line and column, or the object's name and field), VERSION.
SceneDescription read_scene_file(const std::string& path, double time);

}  // namespace fs
