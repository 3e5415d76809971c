// The layout of all records that client and server exchange, as a text. When a client connects, both ends compare the number
// of their layouts; a mismatch is told by the first record and field that differ.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace fs::wire {

// "record field offset size kind", a line each; kind: f(loating) u(nsigned) i(nteger) c(haracters) r(ecord).
const std::string& layout_text();
uint64_t layout_id();

// The first difference, as a sentence; empty: there is none.
std::string layout_difference(std::string_view client, std::string_view server);

}  // namespace fs::wire
