// The text of a scene file to a scene; path is its name, beside which its meshes lie.
#pragma once

#include <string>
#include <string_view>

#include "file/scene_file.h"

namespace fs {

SceneDescription parse_scene(std::string_view text, const std::string& path, double time);  // as read_scene_file

}  // namespace fs
