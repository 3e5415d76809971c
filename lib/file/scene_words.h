// The words of a scene file for the enum values of the contract: words[value].
#pragma once

namespace fs {

constexpr const char* primitive_words[] = {"point", "polyline", "plane", "mesh"};
constexpr const char* kind_words[] = {"none",     "constant",  "linear_increasing", "linear_decreasing",
                                      "gaussian", "quadratic", "inverse",           "custom"};
constexpr const char* sense_words[] = {"attractive", "repulsive"};
constexpr const char* keep_words[] = {"none", "front", "back", "either"};

constexpr int scene_version = 1;

}  // namespace fs
