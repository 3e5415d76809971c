// Parses the text of a scene file. path is the file's name; its meshes are in the same folder.
#pragma once

#include <string>
#include <string_view>

#include "file/scene_file.h"

namespace fs {

SceneDescription parse_scene(std::string_view text, const std::string& path, double time);  // as read_scene_file

}  // namespace fs
