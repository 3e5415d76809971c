// The arm of a FIDEL as its identity describes it: from encoders to a pose, from a force to torques.
#pragma once

#include <array>
#include <cstdint>

#include "device/fidel/usb/protocol.h"
#include "device/kinematics/fidel.h"

namespace fs::fidel_usb {

// What was found out about one device. The angle of a joint is that of its encoder and its offset. The device's positions
// are `scale` times those of the kinematics, measured from the centre of the workspace.
struct Calibration {
  std::array<double, 3> offsets{};  // rad, within offset_max
  double scale = 1;                 // within scale_min..scale_max
};
constexpr double offset_max = 0.2, scale_min = 0.9, scale_max = 1.1;

class Arm {
 public:
  explicit Arm(const Identity& identity);  // throws a Refusal IO where a figure is out of its range

  enum Place { good, out_of_reach, outside, singular, twisted };
  static const char* words(Place place) noexcept;  // a part of a sentence

  struct Measured {
    Place place = out_of_reach;  // the rest is of use only where it is good
    Pose pose{};                 // device frame
    Vec3 wrist{};                // rad: the rotation vector
    Mat3 jacobian{};             // m/rad, frame of the DELTA
  };
  Measured measured(const std::array<int32_t, 3>& joints, const std::array<int16_t, 3>& wrist,
                    const Calibration& calibration) const noexcept;
  // A number is 0 and the torques are within the limits. wrench: finite, device frame.
  Command command(const Measured& measured, const Wrench& wrench) const noexcept;

  Vec3 angles(const std::array<double, 3>& joints) const noexcept;  // rad, of the encoders alone
  const DeltaGeometry& geometry() const noexcept { return geometry_; }
  double centre_depth() const noexcept { return depth_; }
  double force_max() const noexcept { return force_max_; }    // N, at most 25: what it gives everywhere in its workspace
  double torque_max() const noexcept { return wrist_limit_; }  // N m; 0: the wrist is passive
  double resolution() const noexcept { return lever_ * joint_count_; }  // m, of a step of one encoder

 private:
  double longest_lever() const;

  DeltaGeometry geometry_{};
  double depth_, joint_count_, wrist_count_;  // m; rad a count
  double joint_limit_, wrist_limit_;      // N m
  double lever_, force_max_;              // m: see longest_lever; N
};

}  // namespace fs::fidel_usb
