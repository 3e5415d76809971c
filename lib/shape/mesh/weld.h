// Which points of a mesh are at one place: their coordinates are equal.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/stop_token.h"
#include "math/vec3.h"

namespace fs {

// of_point[i] becomes the lowest of `those` that is where point i is, for each i of them. those: indices of points, each once.
// False: no two of them are at one place, and of_point is as it was. Throws Stopped.
bool join_equal_places(std::span<const Vec3> points, std::span<const uint32_t> those, std::vector<uint32_t>& of_point,
                       StopToken& stop);

}  // namespace fs
