// All numbers of the simulated FIDEL and the hand on it, each with its source. "Paper": Flueckiger & Nguyen, "A Generic
// Force-Server for Haptic Devices". "Assumed": not published, but plausible for a device of this size.
#pragma once

#include <numbers>

#include "device/kinematics/delta.h"

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

// Mechanical stops: assumed. They are this far outside the workspace on every side, within the 20 mm margin above.
constexpr double stop_margin = 0.010;                             // m

// The moving mass at the handle, its viscous damping and its Coulomb friction on each axis of the device: assumed.
constexpr double mass = 0.3;                                      // kg
constexpr double damping = 1;                                     // N s/m
constexpr double friction = 0.3;                                  // N
constexpr double stick_speed = 0.2e-3;                            // m/s, below which friction can stop it: assumed

// Encoders: assumed. 2000 lines, four edges per line, a reduction of 10: 20 um at the worst place of the workspace.
constexpr double joint_counts = 80000;                            // per revolution
constexpr double resolution = 20e-6;                              // m

constexpr double rate = 1000;                                     // Hz of the controller: paper

// Wrist: the range and "three small motors, or passive" are from the paper; the rest is assumed.
constexpr double wrist_torque_max = 0.5;                          // N m
constexpr double wrist_inertia = 2e-4;                            // kg m^2
constexpr double wrist_damping = 2e-3;                            // N m s/rad
constexpr double wrist_counts = 20000;                            // per revolution

// A hand holds the handle rigidly: its mass moves with the handle, and its spring and damper pull towards its target.
// The grip does the same for the orientation (assumed: 2 N m/rad, 0.03 N m s/rad).
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

constexpr double worst_delay_ms = 1;                              // of hand=worst: assumed

// A controller at the device, behind a link: assumed. It runs at the rate above, damps by itself, and lets its force go
// when no command comes: after fade_after, within fade_length.
constexpr int controller_steps = 40;                              // of the simulation, 1 ms
constexpr double controller_damping = 5;                          // N s/m, filtered at 100 Hz
constexpr double fade_after = 0.1, fade_length = 0.1;             // s

// The simulation: its step (1/8 of the period of a controller at 5 kHz, 1/40 of that at 1 kHz), and the most time that
// it catches up at once after a stall.
constexpr double substep = 25e-6;                                 // s
constexpr double catch_up_max = 0.1;                              // s

// Motions of the hand's target (device frame, within the workspace; chosen for this simulator).
// t = 0 is the time of the first reading.
constexpr double figure8_width = 0.06, figure8_height = 0.03;     // m: x = width sin(wt), y = height sin(2wt), z = 0
constexpr double figure8_period = 4;                              // s
constexpr double sweep_width = 0.10, sweep_period = 5;            // m, s: x = -width cos(wt), y = z = 0
constexpr double touch_middle = 0.02, touch_stroke = 0.04;        // m: z = middle + stroke cos(wt), x = y = 0: from
constexpr double touch_period = 2;                                // s    60 mm above the origin to 20 mm below it

}  // namespace fs::fidel
