// Between a scene and the device, through the scene's frame.
#pragma once

#include <forceserver/evaluate.h>

#include "math/pose.h"

namespace fs {

// [rt] The hand in the scene's frame, and the scene's response in the device's.
fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept;
Pose to_scene(const fs_frame& frame, const Pose& hand) noexcept;
fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept;

// [rt] Turns the forces, torques and stiffness of a response by r.
void turn(fs_response& response, Quat r) noexcept;
void scale(fs_response& response, double factor) noexcept;
void add(fs_response& sum, const fs_response& other) noexcept;  // to the sum of several scenes or views

}  // namespace fs
