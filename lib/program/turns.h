// Where a polyline turns, and by how much the force jumps there.
#pragma once

#include <functional>

#include <forceserver/forceserver.h>

// How much the force of a polyline changes, at most, where two of its parts are equally near and the hand passes from
// the one to the other, N. strongest_beyond: the largest force at this distance (m) or farther, N; it falls with it.
double jump_between_parts(const fs_shape* line, const std::function<double(double)>& strongest_beyond);
