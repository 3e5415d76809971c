// Kinematics of the DELTA structure (R. Clavel 1988): three legs at 0, 120 and 240 deg, each an upper arm that turns
// about a horizontal axis on the base and a forearm (a parallelogram, so that the platform only translates).
// Frame: origin in the middle of the base, x over the first leg, z away from the base. An angle is 0 for a horizontal
// upper arm and grows as the arm turns away from the base.
#pragma once

#include <optional>

#include "math/vec3.h"

namespace fs {

struct DeltaGeometry {
  double base_radius;      // m, centre to the axis of an upper arm
  double platform_radius;  // m, centre to the end of a forearm
  double upper_arm;        // m
  double forearm;          // m
};

// The three angles (rad) for a position (m), with the elbows outward; nullopt when the position is out of reach.
std::optional<Vec3> delta_inverse(const DeltaGeometry& geometry, Vec3 position);

// The position (m) for three angles (rad), on the side away from the base; nullopt when the legs cannot meet.
std::optional<Vec3> delta_forward(const DeltaGeometry& geometry, Vec3 angles);

struct DeltaJacobian {
  Mat3 jacobian;    // m/rad: velocity = jacobian * rates, torques = transposed(jacobian) * force
  double coplanar;  // |det| of the unit forearm vectors; the force cannot be controlled near 0
  double straight;  // smallest lever of a forearm relative to its upper arm; 0 when a leg is straight or folded
};

// For a position and its angles; nullopt where the forearms are coplanar (`coplanar` below 1e-6).
std::optional<DeltaJacobian> delta_jacobian(const DeltaGeometry& geometry, Vec3 position, Vec3 angles);

}  // namespace fs
