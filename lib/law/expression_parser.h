// An expression in d and t as muParser has parsed it.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <cmath>
#include <string>

#include <muParser.h>

#include "law/curve.h"
#include "law/expression.h"

namespace fs {

// muParser with its variables. Only one thread at a time may use it.
class ExpressionParser final : public Curve::Parser {
 public:
  explicit ExpressionParser(const std::string& text) {
    parser_.DefineVar("d", &d_);
    parser_.DefineVar("t", &t_);
    parser_.SetExpr(text);
    // The first evaluation parses and allocates; those in the servo must not. A few more make sure that they do not.
    for (const double d : {0.0, 0.001, 1.0}) value(d, 0);
  }

  // The value as muParser gives it; may throw mu::ParserError.
  double value(double d, double t) {
    d_ = d;
    t_ = t;
    return parser_.Eval();
  }

  // The value as a force: 0 when below 0 or not finite.
  double force(double d, double t) noexcept {
    try {
      const double f = value(d, t);
      return f > 0 && std::isfinite(f) ? f : 0;
    } catch (...) {
      return 0;
    }
  }

  int result_count() const { return parser_.GetNumResults(); }

 private:
  double d_ = 0, t_ = 0;
  mu::Parser parser_ = make_expression_parser();
};

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
