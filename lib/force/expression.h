// Sentences about what muParser does not take in an expression.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <string>

#include <muParser.h>

namespace fs {

// Throws PARSE: the column (from 1, within the text), what stands there, what is wrong, and what may be meant.
[[noreturn]] void fail_expression(const std::string& text, const mu::ParserError& error);

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
