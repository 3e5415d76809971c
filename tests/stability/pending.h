// Checks that wait for a protection that the library does not have yet. When it comes, delete the line.
#pragma once

namespace stability {

struct Pending {
  const char* check;      // the id that the suite prints
  const char* waits_for;  // the protection
};

inline constexpr Pending pending_checks[] = {
    {"", ""},
};

}  // namespace stability
