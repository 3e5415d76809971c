// The stiffness of the local model that a servo sends to a controller behind a link.
#pragma once

#include "math/vec3.h"

namespace fs {

// [rt] The largest eigenvalue of a symmetric matrix, by size.
double spectral_norm(const Mat3& symmetric) noexcept;

// [rt] The symmetric part of a stiffness (only that part takes no energy from nowhere), with a norm of `most` (N/m) at
// the most.
Mat3 local_model(const Mat3& stiffness, double most) noexcept;

}  // namespace fs
