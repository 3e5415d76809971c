// Checks that wait for a protection that the library does not have yet. When it comes, the suite fails and asks for the
// line to be deleted.
#pragma once

namespace stability {

struct Pending {
  const char* check;      // the id that the suite prints
  const char* waits_for;  // the protection
};

inline constexpr Pending pending_checks[] = {
    {"relay/0_ms/default", "slope cap"},
    {"relay/2_ms/default", "slope cap"},
    {"relay/10_ms/default", "slope cap"},
    {"limits/0.3_kg_1000_Hz_0_ms", "budget computed at the start"},
    {"limits/0.3_kg_500_Hz_0_ms", "budget computed at the start"},
    {"limits/0.3_kg_1000_Hz_2_ms", "budget computed at the start"},
    {"limits/0.3_kg_1000_Hz_5_ms", "budget computed at the start"},
    {"limits/0.3_kg_1000_Hz_10_ms", "budget computed at the start"},
    {"limits/0.05_kg_1000_Hz_0_ms", "budget computed at the start"},
    {"limits/0.05_kg_4000_Hz_5_ms", "budget computed at the start"},
    {"limits/1_kg_20000_Hz_0_ms", "budget computed at the start"},
    {"limits/0_kg_1000_Hz_1_ms", "budget computed at the start"},
    {"1/cured/5_ms", "slope cap, or local damping"},
    {"1/cured/10_ms", "slope cap"},
    {"2/cured/0_ms", "slope cap"},
    {"2/cured/2_ms", "slope cap"},
    {"2/cured/10_ms", "slope cap"},
    {"3/cured", "slope cap"},
    {"4/cured/0_ms", "blended direction at repulsive corners"},
    {"4/cured/2_ms", "blended direction at repulsive corners"},
    {"4/cured/5_ms", "blended direction at repulsive corners"},
    {"4/cured/10_ms", "blended direction at repulsive corners"},
    {"6/cured", "blend of moves"},
    {"8/cured/local", "local damping"},
    {"10/cured/1", "local damping, or the slope cap"},
    {"10/cured/2", "slope cap, shared by what overlaps"},
    {"10/cured/4", "slope cap, shared by what overlaps"},
    {"10/cured/8", "slope cap, shared by what overlaps"},
    {"10/cured/16", "slope cap, shared by what overlaps"},
    {"random/default/nominal", "slope cap, shared; local damping; blended direction at corners"},
    {"random/default/firm", "slope cap, shared; local damping; blended direction at corners"},
    {"random/default/light", "slope cap, shared; local damping; blended direction at corners"},
    {"sweep", "slope cap, shared; local damping; blended direction at corners"},
};

}  // namespace stability
