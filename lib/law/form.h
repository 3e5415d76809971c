// The forms of formulas that are worked out several at a time (formula.h).
#pragma once

#include <cstdint>

namespace fs {

enum class Form : uint8_t { linear, quadratic, inverse, gaussian };  // a constant is linear with gain 0
inline constexpr uint32_t form_count = 4;

}  // namespace fs
