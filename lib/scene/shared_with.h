// With whom an object shares what the servo can render (fs_report.shares_with).
#pragma once

#include <string>
#include <vector>

#include "base/name_map.h"

namespace fs {

// The others that are felt where an object gets less than it wants.
struct SharedWith {
  std::vector<std::string> names;  // some of them, first those that want most
  size_t count = 0;                // of all
  bool has_clients = false;        // other clients have a part of what the loop can render
  std::string text(size_t room) const;  // of `room` bytes at most: the names that fit, such as "a, b and 17 more"
};

using Sharing = NameMap<SharedWith>;  // by the name of the object

}  // namespace fs
