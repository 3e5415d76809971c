// A haptic device and the hand that holds it, simulated: the plant of the control loop. It is independent of the simulator
// in device/sim, so that an error of one cannot hide behind the other.
//
// The hand is rigid to the handle: their masses and dampers add, and the hand's spring pulls towards its target. Each axis
// is m x'' + b x' + k (x - target) = force + friction, stepped exactly (matrix exponential) eight times in a period.
// Coulomb friction opposes the motion; below 0.2 mm/s it holds what it can hold. Rotation is the same for a small rotation
// vector, without friction.
#pragma once

#include <cstdint>
#include <vector>

#include "scenes/vector.h"

namespace stability {

// What the device is assumed to be. The defaults are like the FIDEL's.
struct DeviceModel {
  double mass = 0.3;       // kg
  double damping = 1;      // N s/m
  double friction = 0.3;   // N
  double encoder = 20e-6;  // m, the step of the positions; 0: exact
  double force_max = 25;   // N
  double rate = 1000;      // Hz, of the servo
  double delay = 0;        // s, from a pose to its force, beside the period; a multiple of 1/8 period is kept exactly
  double torque_max = 0;   // N m; 0: a passive wrist
  double wrist_inertia = 2e-4, wrist_damping = 2e-3, wrist_encoder = 3e-4;  // kg m^2, N m s/rad, rad
  bool gives_raw_twist = false;  // the driver gives the plain difference of two positions as its velocity
};

struct HandModel {
  const char* name;
  double mass, damping, stiffness;                    // kg, N s/m, N/m
  double grip_damping = 0.03, grip_stiffness = 2;     // N m s/rad, N m/rad
};
inline constexpr HandModel nominal{"nominal", 0.554, 6.45, 135};  // Scientific Reports, srep18004, figure 3
inline constexpr HandModel firm{"firm", 0.8, 5.5, 568};           // N. Hogan
inline constexpr HandModel light{"light", 0.15, 3, 100};          // assumed
inline constexpr HandModel released{"released", 0, 0, 0, 0, 0};
inline constexpr HandModel hands[] = {nominal, firm, light};

// e^(A t) of (x, v, u)' = A (x, v, u) with u constant: x = xx x + xv v + xu u, v = vx x + vv v + vu u.
struct Transition {
  double xx, xv, xu, vx, vv, vu;
};
Transition transition(double m, double b, double k, double t);

class Plant {
 public:
  Plant(const DeviceModel& device, const HandModel& hand, double rate);

  fs_vec3 target{};  // m, where the hand wants to be
  fs_vec3 push{};    // N, another force on the handle
  bool is_held_by_stage = false;  // the handle is exactly at `target`, whatever the force

  void put(fs_vec3 position, fs_vec3 velocity = {}) { x_ = position, v_ = velocity; }
  void advance(double time);                          // s, to a time not before the last
  void command(fs_vec3 force, fs_vec3 torque = {});   // N, N m; acts after the delay, at most the device's maxima

  fs_vec3 position() const { return x_; }
  fs_vec3 velocity() const { return v_; }
  fs_vec3 rotation() const { return r_; }             // rad
  fs_vec3 measured() const;                           // m, as the encoders have it
  fs_vec3 measured_rotation() const;
  fs_vec3 commanded() const { return commanded_; }    // N, the last command
  fs_vec3 applied() const { return force_; }          // N, what acts now
  double work() const { return work_; }               // J, done by the device on the hand so far
  const DeviceModel& device() const { return device_; }

 private:
  struct Command {
    int64_t step;  // from which it acts
    fs_vec3 force, torque;
  };
  void step();
  void move();

  DeviceModel device_;
  Transition move_, turn_;
  double step_length_, stiffness_, grip_stiffness_;
  int64_t step_ = 0, delay_steps_;
  std::vector<Command> waiting_;  // a ring
  size_t first_ = 0, count_ = 0;
  fs_vec3 x_{}, v_{}, r_{}, w_{}, force_{}, torque_{}, commanded_{};
  double work_ = 0;
};

}  // namespace stability
