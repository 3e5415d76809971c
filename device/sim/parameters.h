// The numbers of the simulated FIDEL and the hand on it, each with its source, beside those of the device itself
// (device/kinematics/fidel.h, which explains "paper" and "assumed").
#pragma once

#include "device/kinematics/fidel.h"

namespace fs::fidel {

// The Coulomb friction on each axis of the device: assumed.
constexpr double friction = 0.3;                                  // N
constexpr double stick_speed = 0.2e-3;                            // m/s, below which friction can stop it: assumed

// Wrist: the range and "three small motors, or passive" are from the paper; the rest is assumed.
constexpr double wrist_inertia = 2e-4;                            // kg m^2
constexpr double wrist_damping = 2e-3;                            // N m s/rad

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
