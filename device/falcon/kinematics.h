// Kinematics of the Novint Falcon: a DELTA whose three forearms are parallelograms that are joined with an offset, so that the position
// for three angles has no closed form; Newton's method finds it.
//
// The Falcon's own frame: origin in the middle of its base, z out of the front towards the hand, y up, x to the right for who sits
// before it. Angles are of the arms on the base; the encoders count them.
#pragma once

#include <array>
#include <cstdint>
#include <numbers>
#include <optional>

#include "math/vec3.h"

namespace fs::falcon {

inline constexpr double radians_per_count = 0.036435 * std::numbers::pi / 180;
inline constexpr double angle_at_zero = 35 * std::numbers::pi / 180;  // rad, of an arm whose encoder is at 0
inline constexpr Vec3 centre{0, 0, 0.125};  // m, of the workspace
// m: a cylinder about y, through the centre. All of it can be reached.
inline constexpr double workspace_radius = 0.040, workspace_height = 0.080;

// The angles (rad) for a position (m); nullopt: out of reach.
std::optional<Vec3> angles_at(Vec3 position) noexcept;

struct Pose {
  Vec3 position;  // m
  Mat3 jacobian;  // m/rad: velocity = jacobian * rates of the angles; torques = transposed(jacobian) * force
  double error;  // rad, the largest, of the angles at the position
};

// The pose whose angles are these, by Newton's method, damped, from a position that is near; nullopt: none was found.
std::optional<Pose> pose_from(Vec3 angles, Vec3 start) noexcept;
// The same without a position that is near: tries several starts.
std::optional<Pose> pose_at(Vec3 angles) noexcept;
// At a position; nullopt: out of reach, or singular.
std::optional<Mat3> jacobian_at(Vec3 position) noexcept;

Vec3 angles_of(const std::array<int16_t, 3>& encoders) noexcept;

// ------------------------------------------------------------------------------------------------------------------- motors

// THE MOTOR CONSTANT. How many units of a motor command are 1 N m. It is not known well: open-source programs use 1e4; what was
// recorded of the maker's own suggests that a motor gives 1/2.8 of that torque (a constant of 2.8e4). So forces may be that much
// gentler than was asked for. README.md says how to measure it; the option motor= of an address sets it.
inline constexpr double motor_constant = 1e4;
inline constexpr double motor_uncertainty = 2.8;  // a factor
inline constexpr int largest_command = 4096;

// The commands for torques (N m). If one is beyond largest_command, all three are scaled down, which keeps the direction of the force.
std::array<int16_t, 3> commands_of(Vec3 torques, double constant) noexcept;

// m, the longest lever of the workspace: a force F (N) there, in whatever direction, needs a torque of at most F times that (N m) at any
// motor; and a step of one encoder is at most radians_per_count times that (m).
double longest_lever() noexcept;

}  // namespace fs::falcon
