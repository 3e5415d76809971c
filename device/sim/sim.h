// "sim:", a simulated FIDEL and the hand on it.
//
// Modelled: the hand rigid on the handle, each axis of the device frame a mass with viscous and Coulomb friction, the
// hand's spring and damper towards its (moving) target; forces held between writes and delayed; motor torques limited
// with the direction kept; mechanical stops without rebound; the position as joint encoders see it through the
// kinematics; a wrist with a grip, its rotation vector along x, y, z.
// Not modelled: gravity, the change of inertia with the pose, elasticity, backlash, amplifiers (count their lag into
// delay_ms), the quantised angles' error in the conversion of force to torque (1e-4), coupling between wrist and arm.
//
// Time runs on a grid of 25 us that begins at the first reading, so the same writes give the same bits, however often
// it is read. What is written takes effect at the newest grid time that was read, delay_ms (rounded to the grid) later.
// The only randomness is where, within its first count, each encoder begins: `seed`.
#pragma once

#include <cstdint>
#include <vector>

#include "device/sim/options.h"
#include "device/sim/plant.h"
#include "math/pose.h"

#include <forceserver/driver.h>

namespace fs {

class Simulator {
 public:
  explicit Simulator(const SimOptions& options);

  void get_info(fs_device_info& out) const noexcept;
  // [rt] Up to `time` (s, any clock). A step forward of more than 0.1 s counts as 0.1 s; one backward as none.
  void advance(double time) noexcept;
  // [rt] Pose, time of the last advance (on its clock), READY. The twist is left 0, with ideal encoders it is exact.
  void read(fs_state& out) const noexcept;
  // [rt] Any finite wrench.
  void write(const Wrench& wrench) noexcept { command_ = wrench; }

 private:
  void step() noexcept;
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
  Wrench command_{};
  std::vector<Wrench> line_;                // the commands of the last steps, by step modulo its size: the delay
  int64_t steps_ = 0;                       // done
  bool started_ = false;
  double origin_ = 0;                       // s, when step 0 began
};

const fs_driver& sim_driver();

}  // namespace fs
