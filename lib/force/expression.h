// Error sentences for expressions that muParser refuses.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <string>

#include <muParser.h>

namespace fs {

// Throws PARSE. The sentence names the column (from 1), the text there, what is wrong, and what may be meant.
[[noreturn]] void fail_expression(const std::string& text, const mu::ParserError& error);

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
