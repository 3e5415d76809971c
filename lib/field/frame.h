// Between a scene and the device, through the scene's frame.
#pragma once

#include <forceserver/evaluate.h>

#include "math/pose.h"

namespace fs {

// [rt] What is at the device, in the scene's frame.
Vec3 to_scene(const fs_frame& frame, Vec3 at_device) noexcept;
Pose to_scene(const fs_frame& frame, const Pose& hand) noexcept;
fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept;

// [rt] What is in the scene, in the device's frame.
Vec3 to_device(const fs_frame& frame, Vec3 in_scene) noexcept;
Pose to_device(const fs_frame& frame, const Pose& pose) noexcept;
Wrench to_device(const fs_frame& frame, const Wrench& wrench) noexcept;
fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept;

// [rt] Turns the forces, torques and stiffness of a response by r.
void turn(fs_response& response, Quat r) noexcept;
void scale(fs_response& response, double factor) noexcept;
void add(fs_response& sum, const fs_response& other) noexcept;  // to the sum of several scenes or views

}  // namespace fs
