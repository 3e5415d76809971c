// The simulated FIDEL and the hand on it: all numbers, each with its source. "Paper": Flueckiger & Nguyen, "A Generic
// Force-Server for Haptic Devices". "Assumed": nothing was published; chosen to be plausible for a device of this size.
#pragma once

#include <numbers>

#include "device/kinematics/delta.h"

namespace fs::fidel {

// Workspace: paper. A cylinder about z, centred on the device's origin.
constexpr double workspace_radius = 0.150;                        // m
constexpr double workspace_height = 0.200;                        // m
constexpr double wrist_angle = 20 * std::numbers::pi / 180;       // rad, each way on each of three axes
constexpr double force_max = 25;                                  // N

// Link lengths: assumed, chosen so that the volume is reached with a margin of 20 mm, condition number of the Jacobian
// 2.11 at most within the volume and 2.75 within the margin.
constexpr DeltaGeometry geometry{0.170, 0.050, 0.200, 0.330};     // m
constexpr double centre_depth = 0.280;                            // m, of the volume's centre below the base
// The largest torque that 25 N in any direction needs within the margin (computed from the geometry).
constexpr double motor_torque_max = 5.52;                         // N m

// Mechanical stops: assumed. The cylinder and so much more all round; within the 20 mm of the geometry's margin.
constexpr double stop_margin = 0.010;                             // m

// The moving mass at the handle and what brakes it: assumed. Viscous, and Coulomb on each axis of the device frame.
constexpr double mass = 0.3;                                      // kg
constexpr double damping = 1;                                     // N s/m
constexpr double friction = 0.3;                                  // N
constexpr double stick_speed = 0.2e-3;                            // m/s, below which friction can hold: assumed

// Encoders: assumed. 2000 lines, four edges a line, a reduction of 10; the volume's worst place then resolves 20 um.
constexpr double joint_counts = 80000;                            // a revolution
constexpr double resolution = 20e-6;                              // m

constexpr double rate = 1000;                                     // Hz of the controller: paper

// Wrist: range and "three small motors, or passive" from the paper; the rest assumed.
constexpr double wrist_torque_max = 0.5;                          // N m
constexpr double wrist_inertia = 2e-4;                            // kg m^2
constexpr double wrist_damping = 2e-3;                            // N m s/rad
constexpr double wrist_counts = 20000;                            // a revolution

// A hand holds the handle rigidly: its mass moves along, its spring and damper pull towards where it wants to be. The
// grip does the same for the orientation (assumed: 2 N m/rad, 0.03 N m s/rad).
struct Hand {
  double mass;            // kg
  double damping;         // N s/m
  double stiffness;       // N/m
  double grip_damping;    // N m s/rad
  double grip_stiffness;  // N m/rad
};
constexpr Hand nominal_hand{0.554, 6.45, 135, 0.03, 2};           // Scientific Reports, srep18004, figure 3
constexpr Hand firm_hand{0.8, 5.5, 568, 0.03, 2};                 // N. Hogan
constexpr Hand light_hand{0.15, 3, 100, 0.03, 2};                 // assumed
constexpr Hand released_hand{0, 0, 0, 0, 0};                      // nobody holds the handle

// The simulation: an exact step, 1/8 of the period of a controller at 5 kHz (of one at 1 kHz 1/40), and no more than so
// much at once after a stall.
constexpr double substep = 25e-6;                                 // s
constexpr double catch_up_max = 0.1;                              // s

// Motions of the hand's wish (device frame, all within the workspace; chosen for this simulator). They begin at t = 0
// with the first reading.
constexpr double figure8_width = 0.06, figure8_height = 0.03;     // m: x = width sin(wt), y = height sin(2wt), z = 0
constexpr double figure8_period = 4;                              // s
constexpr double sweep_width = 0.10, sweep_period = 5;            // m, s: x = -width cos(wt), y = z = 0
constexpr double touch_middle = 0.02, touch_stroke = 0.04;        // m: z = middle + stroke cos(wt), x = y = 0: from
constexpr double touch_period = 2;                                // s    60 mm above the origin to 20 mm below it

}  // namespace fs::fidel
