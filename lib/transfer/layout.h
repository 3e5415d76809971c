// The layout of all that client and server exchange, as a text. Both ends must have the same: its number is compared when a
// client connects, and a mismatch is told by record and field.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace fs::wire {

// "record field offset size kind", a line each; kind: f(loating) u(nsigned) i(nteger) c(haracters) r(ecord).
const std::string& layout_text();
uint64_t layout_id();

// What differs first, as a sentence; empty: nothing.
std::string layout_difference(std::string_view client, std::string_view server);

}  // namespace fs::wire
