// The text of an expression: what that of a profile, or of a texture, may contain, and the sentences that say why one is refused.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <string>

#include <muParser.h>

namespace fs {

inline constexpr size_t longest_expression = 255;  // bytes

struct Variables {
  const char* letters;
  const char* meaning;
};
inline constexpr Variables of_profile{"dt", "the distance d (m), the time t (s)"};
inline constexpr Variables of_texture{"xyz", "the place x, y, z (m)"};

// Refuses what muParser accepts but an expression must not contain: bytes that are not printable ASCII, strings,
// assignment, several results. Throws PARSE; INVALID: it is too long.
void check_expression(const std::string& text);

// A parser that reads numbers without a stream, as muParser's own reader has: where a stream has no memory, it says that there is
// no number.
mu::Parser make_expression_parser();

// What muParser refuses. Throws PARSE. The sentence names the column (from 1), the text there, what is wrong, and what may be meant.
[[noreturn]] void fail_expression(const std::string& text, const mu::ParserError& error, const Variables& variables);

// True when `t` occurs as a word of its own, so the expression may depend on time.
bool mentions_time(const std::string& text);

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
