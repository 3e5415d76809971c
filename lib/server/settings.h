// What the options of a server come to.
#pragma once

#include <cstdint>

#include "servo/servo.h"

namespace fs {

// fs_server_options, checked, with the defaults for what was left 0.
struct ServerSettings {
  uint32_t max_clients, max_objects;
  uint64_t max_bytes;  // of shapes, curves and surfaces, for each client
  double lease;        // s
  Channel::Limits limits;
  bool is_locked, is_for_all_users;
  bool is_force_kept;  // a client cannot end the force
};
ServerSettings parse_options(const fs_server_options& options, const ServoSettings& servo);  // INVALID

}  // namespace fs
