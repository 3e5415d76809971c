// "sim:", a simulated FIDEL and the hand on it.
//
// Modelled: a hand fixed to the handle; on each axis of the device frame, a mass with viscous and Coulomb friction, and
// the hand's spring and damper towards its (moving) target; forces constant between writes, and delayed; motor torques
// limited with the direction kept; mechanical stops without rebound; the position as the joint encoders measure it
// through the kinematics; a wrist with a grip, its rotation vector moved on each of the axes x, y, z.
// Not modelled: gravity, the change of inertia with the pose, elasticity, backlash, amplifiers (include their lag in
// delay_ms), the error of quantised angles in the conversion of force to torque (1e-4), coupling of wrist and arm.
//
// Time runs on a grid of 25 us that begins at the first reading, so the same writes give the same bits, however often
// the device is read. A write counts from the newest grid time that was read, and takes effect delay_ms (rounded to the
// grid) later. The only randomness is the offset of each encoder within one count, chosen by `seed`.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "device/sim/link.h"
#include "device/sim/options.h"
#include "device/sim/plant.h"
#include "math/pose.h"

#include <forceserver/driver.h>

namespace fs {

class Simulator {
 public:
  explicit Simulator(const SimOptions& options);

  void get_info(fs_device_info& out) const noexcept;
  // [rt] Simulates up to `time` (s, any clock). A step forward of more than 0.1 s counts as 0.1 s, a step back as none.
  void advance(double time) noexcept;
  // [rt] Gives the pose, the time of the last advance (on its clock) and READY. The twist is exact with ideal encoders,
  // and 0 otherwise. Behind a link all is that of the newest pose that has come, and not READY before the first.
  void read(fs_state& out) noexcept;
  // [rt] Any finite wrench.
  void write(const Wrench& wrench) noexcept { write_model({identity_pose(), wrench}); }
  // [rt] A local model (fs_model), for the controller behind a link.
  void write_model(const Link::Command& command) noexcept;

 private:
  void step() noexcept;
  fs_state measured() const noexcept;
  Wrench control() noexcept;
  void step_handle(Vec3 force) noexcept;
  void step_wrist(Vec3 torque) noexcept;
  Vec3 encoded_position() const noexcept;
  Vec3 encoded_rotation() const noexcept;

  SimOptions options_;
  HandPath path_;
  Axis handle_, wrist_;
  double joint_phase_[3], wrist_phase_[3];  // counts
  AxisState position_[3];                   // m, device frame
  AxisState rotation_[3];                   // rad: the rotation vector of the handle
  std::optional<Link> link_;
  VelocityEstimator velocity_;              // of the controller behind the link
  Wrench command_{};                        // what the motors are to give, without the delay
  std::vector<Wrench> line_;                // delay line: the commands of the last steps, at the step modulo its size
  int64_t steps_ = 0;                       // number of steps done
  bool started_ = false;
  double origin_ = 0;                       // s, the time at which step 0 began
};

const fs_driver& sim_driver();

}  // namespace fs
