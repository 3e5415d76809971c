// The curve of an expression.
#include "base/error.h"
#include "law/curve.h"

#ifdef FORCESERVER_EXPRESSIONS

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <memory>

#include "law/expression.h"
#include "law/expression_parser.h"
#include "law/expression_samples.h"

namespace fs {
namespace {

class ExpressionCurve final : public Curve {
 public:
  // parser: made from the text. Parsing is slow, so the first call of make_parser returns this one.
  ExpressionCurve(std::string text, std::unique_ptr<ExpressionParser> parser)
      : text_(std::move(text)), is_timed_(mentions_time(text_)), samples_(*parser, is_timed_), first_(parser.release()) {}
  ~ExpressionCurve() override { delete first_.load(); }

  std::unique_ptr<Parser> make_parser() const override {
    if (ExpressionParser* const first = first_.exchange(nullptr)) return std::unique_ptr<Parser>(first);
    return std::make_unique<ExpressionParser>(text_);
  }

  Intensity evaluate(Parser* given, double d, double t) const noexcept override {
    auto* const parser = static_cast<ExpressionParser*>(given);
    if (!parser) return {};
    const double force = parser->force(d, t);
    if (force == 0) return {};
    const double low = std::fmax(d - expression_step, 0), high = d + expression_step;
    if (!(high > low)) return {force, 0};  // d is so large that rounding loses the step
    const double slope = (parser->force(high, t) - parser->force(low, t)) / (high - low);
    return {force, std::clamp(slope, -largest_slope, largest_slope)};
  }

  double force(Parser* given, double d, double t) const noexcept override {
    auto* const parser = static_cast<ExpressionParser*>(given);
    return parser ? parser->force(d, t) : 0;
  }

  double steepest_slope(double limit, double reach) const noexcept override { return samples_.steepest_slope(limit, reach); }
  double greatest_force(double d) const noexcept override { return samples_.greatest_force(d); }
  const std::string* expression() const noexcept override { return &text_; }

  bool is_timed() const noexcept override { return is_timed_; }
  std::vector<Knot> knots(double slope, double reach) const override {
    ExpressionParser parser(text_);
    return sampled_knots(parser, is_timed_, slope, reach);
  }

 private:
  const std::string text_;
  const bool is_timed_;
  const ExpressionSamples samples_;
  mutable std::atomic<ExpressionParser*> first_{nullptr};
};

}  // namespace

Ref<const Curve> make_expression_curve(const char* text) {
  const std::string expression(text, strnlen(text, longest_expression + 1));
  check_expression(expression);
  try {
    auto parser = std::make_unique<ExpressionParser>(expression);
    if (parser->result_count() != 1) {
      fail(FS_ERROR_PARSE, "the expression gives %d numbers, must be one", parser->result_count());
    }
    return make_ref<const ExpressionCurve>(expression, std::move(parser));
  } catch (const mu::ParserError& error) {
    fail_expression(expression, error, of_profile);
  }
}

}  // namespace fs

#else

namespace fs {

Ref<const Curve> make_expression_curve(const char*) {
  fail(FS_ERROR_UNSUPPORTED, "a curve cannot be an expression: built without muParser");
}

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
