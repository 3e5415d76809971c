// FIDEL, the device of the paper (Flueckiger & Nguyen, "A Generic Force-Server for Haptic Devices"): its sizes and its
// kinematics, for the simulator and for the driver of a real one. "Paper": published there. "Assumed": not published, but
// plausible for a device of this size.
//
// Frames. The device's: origin in the centre of the workspace, x to the right, y away from the user, z up. The base hangs
// above; so the frame of the DELTA (delta.h) is a half turn about x away from it.
// The wrist's three angles are the parts of the rotation vector of the handle, in the device's frame.
#pragma once

#include <numbers>
#include <optional>

#include "device/kinematics/delta.h"
#include "math/pose.h"

namespace fs::fidel {

// Workspace: paper. A cylinder about z, centred on the device's origin.
constexpr double workspace_radius = 0.150;                        // m
constexpr double workspace_height = 0.200;                        // m
constexpr double wrist_angle = 20 * std::numbers::pi / 180;       // rad, in both directions on each of three axes
constexpr double force_max = 25;                                  // N

// Link lengths: assumed, chosen so that the device reaches the workspace and 20 mm beyond it. The condition number of
// the Jacobian is at most 2.11 within the workspace and 2.75 within the margin.
constexpr DeltaGeometry geometry{0.170, 0.050, 0.200, 0.330};     // m
constexpr double centre_depth = 0.280;                            // m, of the workspace's centre below the base
// The largest torque that 25 N in any direction needs within the margin (computed from the geometry).
constexpr double motor_torque_max = 5.52;                         // N m
constexpr double wrist_torque_max = 0.5;                          // N m, of an active wrist: assumed

// Mechanical stops: assumed. They are this far outside the workspace on every side, within the 20 mm margin above.
constexpr double stop_margin = 0.010;                             // m

// The moving mass at the handle, and its viscous damping: assumed.
constexpr double mass = 0.3;                                      // kg
constexpr double damping = 1;                                     // N s/m

// Encoders: assumed. 2000 lines, four edges per line, a reduction of 10: 20 um at the worst place of the workspace.
constexpr double joint_counts = 80000;                            // per revolution
constexpr double wrist_counts = 20000;                            // per revolution
constexpr double resolution = 20e-6;                              // m

constexpr double rate = 1000;                                     // Hz of the controller: paper

// Below these figures of the Jacobian (delta.h) the force is not controlled well. Within the stops they are at least 0.618
// and 0.357, so a device that is below has lost its position.
constexpr double coplanar_min = 0.3, straight_min = 0.15;

// A position from the device's frame to that of the DELTA, or back.
constexpr Vec3 to_delta(Vec3 p, double depth = centre_depth) { return {p.x, -p.y, depth - p.z}; }
constexpr Vec3 from_delta(Vec3 p, double depth = centre_depth) { return to_delta(p, depth); }
constexpr Vec3 turned(Vec3 v) { return {v.x, -v.y, -v.z}; }  // the same for a direction

// One count of an encoder with so many counts a revolution, in rad.
constexpr double count_angle(double counts) { return 2 * std::numbers::pi / counts; }

// The angle (rad) that an encoder gives for `angle`: the nearest whole count; phase: where its counts begin, of a count.
double encoded(double angle, double counts, double phase);

// The torques, all three made smaller by one factor where one of them is above the limit; so the direction is kept.
Vec3 scaled_together(Vec3 torques, double limit);

// The joint torques (N m) that give a force (N, device frame) where the DELTA has this Jacobian.
inline Vec3 joint_torques(const Mat3& jacobian, Vec3 force) { return transposed(jacobian) * turned(force); }

// The force that the motors give for the command `force` (N) at p (m), both in the device's frame. All three torques are
// scaled together, which keeps the direction. Up to force_max no motor reaches its limit anywhere within the stops.
Vec3 motor_force(Vec3 force, Vec3 p);

// Maps the rate of a rotation vector r (rad) to an angular velocity, both along the device's axes: the left Jacobian of SO(3).
// Its transpose maps a torque at the handle to the torques of the three wrist motors.
Mat3 rotation_jacobian(Vec3 r);

}  // namespace fs::fidel
