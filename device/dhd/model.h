// What is known of the models of Force Dimension, and what their status means.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "device/dhd/api.h"

namespace fs::dhd {

// The limits of a model, as the open source of CHAI3D states them (CDeltaDevices.cpp).
struct Limits {
  double force, torque;  // N, N m; torque 0: not known
  double radius;         // m, of the workspace
};
Limits limits_of(int type);  // of dhdGetSystemType. Of a model that is not known: careful ones

using StatusArray = std::array<int, status_count>;

// Why the device gives no force, as a bit of fs_state.flags; 0: it does.
uint32_t reason_of(const StatusArray& status, bool is_initialized);

// The same for people; "" where nothing stands in the way.
std::string words_of(const StatusArray& status, bool is_initialized);

}  // namespace fs::dhd
