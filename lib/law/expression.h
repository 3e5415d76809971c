// The text of an expression: what a profile's may contain, and the sentences that say why one is refused.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <string>

#include <muParser.h>

namespace fs {

inline constexpr size_t longest_expression = 255;  // bytes

// Refuses what muParser accepts but a profile must not contain: bytes that are not printable ASCII, strings,
// assignment, several results. Throws PARSE; INVALID: it is too long.
void check_expression(const std::string& text);

// What muParser refuses. Throws PARSE. The sentence names the column (from 1), the text there, what is wrong, and what may be meant.
[[noreturn]] void fail_expression(const std::string& text, const mu::ParserError& error);

// True when `t` occurs as a word of its own, so the expression may depend on time.
bool mentions_time(const std::string& text);

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
