#include "device/fidel/usb/arm.h"

#include <algorithm>
#include <cmath>

#include "device/support/refusal.h"

namespace fs::fidel_usb {
namespace {

constexpr double outside_margin = 0.03;  // m beyond the workspace: the stops, and an error before calibration
constexpr double wrist_margin = 0.1;     // rad

double within(uint32_t value, double unit, double low, double high, const char* what, const char* unit_name) {
  const double size = value * unit;
  if (!(size >= low && size <= high)) {
    refuse(FS_ERROR_IO, "the device says that its %s is %.9g %s, must be within %.9g..%.9g: its firmware is wrong", what, size,
           unit_name, low, high);
  }
  return size;
}

int32_t micro(double torque) { return static_cast<int32_t>(std::lround(torque * 1e6)); }

std::array<int32_t, 3> micro(Vec3 torques) { return {micro(torques.x), micro(torques.y), micro(torques.z)}; }

}  // namespace

Arm::Arm(const Identity& identity) {
  const auto length = [](uint32_t um, const char* what) { return within(um, 1e-6, 0.01, 1, what, "m"); };
  geometry_ = {length(identity.base_radius, "radius of the base"), length(identity.platform_radius, "radius of the platform"),
               length(identity.upper_arm, "upper arm"), length(identity.forearm, "forearm")};
  depth_ = length(identity.centre_depth, "depth of the workspace");
  joint_count_ = fidel::count_angle(within(identity.joint_counts, 1, 1000, 16e6, "number of counts of a joint", "a revolution"));
  wrist_count_ = 0;
  if (identity.wrist_counts != 0) {
    wrist_count_ =
        fidel::count_angle(within(identity.wrist_counts, 1, 1000, 16e6, "number of counts of the wrist", "a revolution"));
  }
  joint_limit_ = within(identity.joint_torque, 1e-6, 0.01, 100, "largest torque of a joint", "N m");
  wrist_limit_ = within(identity.wrist_torque, 1e-6, 0, 10, "largest torque of the wrist", "N m");
  within(identity.joint_speed, 1e-3, 0.1, 100, "largest speed of a joint", "rad/s");
  lever_ = longest_lever();
  force_max_ = std::min(fidel::force_max, joint_limit_ / lever_);
}

const char* Arm::words(Place place) noexcept {
  switch (place) {
    case good: return "the handle is where it can be";
    case out_of_reach: return "the encoders tell angles at which the arms cannot meet";
    case outside: return "the encoders tell a place far outside of the workspace";
    case singular: return "the encoders tell a place where the arms cannot control the force";
    case twisted: return "the encoders of the wrist tell an angle beyond its stops";
  }
  return "";
}

// m: in all of the workspace a force F (N), in whatever direction, needs a torque of at most F times that (N m) at any joint; and a
// step of a joint moves the handle by at most that much times the step (rad).
double Arm::longest_lever() const {
  double largest = 0;
  constexpr int steps = 6;
  for (int ix = -steps; ix <= steps; ++ix) {
    for (int iy = -steps; iy <= steps; ++iy) {
      for (int iz = -steps; iz <= steps; ++iz) {
        const Vec3 p{ix * fidel::workspace_radius / steps, iy * fidel::workspace_radius / steps,
                     iz * fidel::workspace_height / (2 * steps)};
        if (std::hypot(p.x, p.y) > fidel::workspace_radius) continue;
        const Vec3 position = fidel::to_delta(p, depth_);
        const auto angles = delta_inverse(geometry_, position);
        const auto jacobian = angles ? delta_jacobian(geometry_, position, *angles) : std::nullopt;
        if (!jacobian || jacobian->coplanar < fidel::coplanar_min || jacobian->straight < fidel::straight_min) {
          refuse(FS_ERROR_IO,
                 "the device says that its links are %.0f, %.0f, %.0f and %.0f mm: they do not reach (%.0f, %.0f, %.0f) mm",
                 1e3 * geometry_.base_radius, 1e3 * geometry_.platform_radius, 1e3 * geometry_.upper_arm, 1e3 * geometry_.forearm,
                 1e3 * p.x, 1e3 * p.y, 1e3 * p.z);
        }
        const Mat3& j = jacobian->jacobian;
        for (const Vec3 column : {Vec3{j.xx, j.yx, j.zx}, Vec3{j.xy, j.yy, j.zy}, Vec3{j.xz, j.yz, j.zz}}) {
          largest = std::max(largest, norm(column));
        }
      }
    }
  }
  return largest;
}

Vec3 Arm::angles(const std::array<double, 3>& joints) const noexcept {
  return {joints[0] * joint_count_, joints[1] * joint_count_, joints[2] * joint_count_};
}

Arm::Measured Arm::measured(const std::array<int32_t, 3>& joints, const std::array<int16_t, 3>& wrist,
                            const Calibration& calibration) const noexcept {
  Measured out;
  const Vec3 offsets{calibration.offsets[0], calibration.offsets[1], calibration.offsets[2]};
  const Vec3 angle =
      angles({static_cast<double>(joints[0]), static_cast<double>(joints[1]), static_cast<double>(joints[2])}) + offsets;
  const auto position = delta_forward(geometry_, angle);
  if (!position) return out;
  const Vec3 p = calibration.scale * fidel::from_delta(*position, depth_);
  out.wrist = {wrist[0] * wrist_count_, wrist[1] * wrist_count_, wrist[2] * wrist_count_};
  out.pose = {p, exp_rotation(out.wrist)};
  const bool is_inside = std::hypot(p.x, p.y) <= fidel::workspace_radius + outside_margin &&
                         std::fabs(p.z) <= fidel::workspace_height / 2 + outside_margin;
  const auto jacobian = delta_jacobian(geometry_, *position, angle);
  const bool is_regular = jacobian && jacobian->coplanar >= fidel::coplanar_min && jacobian->straight >= fidel::straight_min;
  out.place = !is_inside ? outside : !is_regular ? singular : good;
  if (largest_coordinate(out.wrist) > fidel::wrist_angle + wrist_margin) out.place = twisted;
  if (jacobian) out.jacobian = calibration.scale * jacobian->jacobian;
  return out;
}

Command Arm::command(const Measured& measured, const Wrench& wrench) const noexcept {
  Command out{};
  if (measured.place != good) return out;
  out.joints = micro(fidel::scaled_together(fidel::joint_torques(measured.jacobian, wrench.force), joint_limit_));
  const Vec3 wrist = transposed(fidel::rotation_jacobian(measured.wrist)) * wrench.torque;
  out.wrist = micro(fidel::scaled_together(wrist, wrist_limit_));
  return out;
}

}  // namespace fs::fidel_usb
