// What the motors give: the newest command of the host, held and faded as the protocol says.
#pragma once

#include <forceserver/device.h>

#include "device/fidel/udp/protocol.h"
#include "math/filters.h"

namespace fs::udp {

class Renderer {
 public:
  static constexpr double damping = 5;  // N s/m, of models, filtered at 100 Hz

  explicit Renderer(const fs_device_info& device)
      : force_max_(device.force_max), torque_max_(device.torque_max),
        velocity_(device.resolution, VelocityEstimator::local_rest) {}

  // time: s, when it came. It counts for the hold time, then its force fades; after a fade it comes back as slowly.
  void take(const Command& command, double time) noexcept;
  // No force until the next command, at once.
  void drop() noexcept;

  // The wrench for the device's present state; 0 if that is not ready. Called at least once a tick, time: s.
  fs_wrench render(const fs_state& state, double time) noexcept;

 private:
  double force_max_, torque_max_;  // N, N m
  VelocityEstimator velocity_;
  Command command_;
  bool has_command_ = false;
  double came_ = 0, rendered_at_ = 0;  // s
  double weight_ = 0;                  // 0..1
};

}  // namespace fs::udp
