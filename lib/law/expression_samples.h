// What samples tell about the force of an expression, which is known only by evaluating it. All of it is an estimate.
#pragma once

#ifdef FORCESERVER_EXPRESSIONS

#include <utility>
#include <vector>

#include "law/curve_piece.h"
#include "law/expression_parser.h"

namespace fs {

// Taken once, when the curve is made: at distances in a geometric series from 1 um to 100 m, and at times that do not fall into
// step with a usual frequency. A file may have thousands of expressions, so these few hundred evaluations take only some
// tenths of a millisecond.
class ExpressionSamples {
 public:
  ExpressionSamples(ExpressionParser& parser, bool is_timed);

  double steepest_slope(double limit, double reach) const noexcept;  // as that of Curve
  double greatest_force(double d) const noexcept;                    // of the first sample at d or beyond

 private:
  std::vector<CurvePiece> pieces_;
  std::vector<std::pair<double, double>> forces_;  // distance (m), greatest force at any sampled time (N)
};

// Taken when they are asked for: the knots of Curve, of the first sampled time at which the force is steep.
std::vector<Knot> sampled_knots(ExpressionParser& parser, bool is_timed, double slope, double reach);

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
