// Checks that wait for a protection that the library does not have yet, or for a cure that is not found yet. When it comes,
// the suite fails and asks for the line to be deleted.
#pragma once

#include <array>

namespace stability {

struct Pending {
  const char* check;      // the id that the suite prints
  const char* waits_for;  // the protection
};

inline constexpr std::array<Pending, 0> pending_checks{};

}  // namespace stability
