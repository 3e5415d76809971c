#include "force/curve.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>

#ifdef FORCESERVER_EXPRESSIONS
#include <muParser.h>
#endif

#include "base/error.h"
#include "force/expression.h"

namespace fs {
namespace {

constexpr double largest = std::numeric_limits<double>::max();

// A part of a curve, from `begin` (m) to the beginning of the next piece.
struct Piece {
  double begin = 0;
  double low = 0, high = 0;  // N, bounds of the force
  double steepest = 0;       // N/m, the largest |slope|
};
constexpr size_t most_pieces = 256;

// A cubic Hermite segment between two entries as a polynomial of u in [0, 1], from the slopes there (N per step).
struct Cubic {
  double c0, c1, c2, c3;

  Cubic(double from, double to, double slope_from, double slope_to)
      : c0(from),
        c1(slope_from),
        c2(3 * (to - from) - 2 * slope_from - slope_to),
        c3(slope_from + slope_to - 2 * (to - from)) {}

  double force(double u) const { return c0 + u * (c1 + u * (c2 + u * c3)); }
  double slope(double u) const { return c1 + u * (2 * c2 + u * (3 * c3)); }
  // The largest |slope| from u = a to b: at an end, or at the vertex of the slope's parabola.
  double steepest(double a, double b) const {
    const double turn = std::clamp(c3 != 0 ? -c2 / (3 * c3) : a, a, b);
    return std::fmax(std::fmax(std::fabs(slope(a)), std::fabs(slope(b))), std::fabs(slope(turn)));
  }
  // Where the slope has the given value, in order; NaN or infinite where it has it nowhere else.
  std::array<double, 2> places_with_slope(double wanted) const {
    const double a = 3 * c3, b = 2 * c2, c = c1 - wanted;
    const double q = -(b + std::copysign(std::sqrt(b * b - 4 * a * c), b)) / 2;
    const double one = q / a, other = c / q;
    return {std::fmin(one, other), std::fmax(one, other)};
  }
};

class TableCurve final : public Curve {
 public:
  TableCurve(std::vector<double> table, double step) : table_(std::move(table)), step_(step) {
    values_.reserve(table_.size());
    for (const double force : table_) {
      // The upper bound keeps differences finite; no profile lets more than 1e9 N through.
      values_.push_back(force > 0 && std::isfinite(force) ? std::fmin(force, 1e100) : 0);
    }
    set_slopes();
    set_pieces();
  }

  Intensity evaluate(Parser*, double d, double) const noexcept override {
    const size_t last = values_.size() - 1;
    const double position = d / step_;
    if (!(position < static_cast<double>(last))) return {values_[last], 0};
    if (!(position > 0)) return {values_[0], clamped(slopes_[0] / step_)};
    const size_t i = static_cast<size_t>(position);
    const double u = position - static_cast<double>(i);
    const Cubic cubic = interval(i);
    const auto [low, high] = std::minmax(values_[i], values_[i + 1]);
    return {std::clamp(cubic.force(u), low, high), clamped(cubic.slope(u) / step_)};
  }

  double steepest_slope(double limit, double reach) const noexcept override {
    double steepest = 0;
    for (size_t k = 0; k < pieces_.size() && pieces_[k].begin < reach; ++k) {
      const Piece& piece = pieces_[k];
      if (piece.low >= limit || piece.steepest <= steepest) continue;
      const bool is_cut = piece.high > limit && intervals_in_piece_ == 1;
      steepest = std::fmax(steepest, is_cut ? slope_below(k, limit) : piece.steepest);
    }
    return steepest;
  }
  double greatest_force(double d) const noexcept override { return evaluate(0, d, 0).force; }

  // Where f is no steeper than slope on both sides of s, and where it bends the wrong way, f(s) + slope*|d - s| is not the
  // least. The ends of the steep intervals and their tangents remain.
  std::vector<Knot> knots(double slope, double reach) const override {
    std::vector<Knot> out;
    const auto add = [&](double position) {
      const double d = position * step_;
      if (out.empty() || d > out.back().distance) out.push_back({d, evaluate(nullptr, d, 0).force});
    };
    for (size_t k = 0; k < pieces_.size() && pieces_[k].begin < reach; ++k) {
      if (!(pieces_[k].steepest > slope)) continue;
      const size_t begin = k * intervals_in_piece_, end = std::min(begin + intervals_in_piece_, values_.size() - 1);
      for (size_t i = begin; i < end; ++i) {
        const Cubic cubic = interval(i);
        if (!(cubic.steepest(0, 1) / step_ > slope)) continue;
        const double start = static_cast<double>(i);
        add(start);
        const double rise = values_[i + 1] > values_[i] ? slope * step_ : -slope * step_;
        for (const double u : cubic.places_with_slope(rise)) {
          if (u > 0 && u < 1) add(start + u);
        }
        add(start + 1);
      }
    }
    return out;
  }

  const std::vector<double>* table() const noexcept override { return &table_; }
  double step() const noexcept override { return step_; }

 private:
  static double clamped(double slope) { return std::clamp(slope, -largest, largest); }
  Cubic interval(size_t i) const { return {values_[i], values_[i + 1], slopes_[i], slopes_[i + 1]}; }

  void set_pieces() {
    const size_t intervals = values_.size() - 1;
    intervals_in_piece_ = (intervals + most_pieces - 1) / most_pieces;
    for (size_t i = 0; i < intervals; ++i) {
      const auto [low, high] = std::minmax(values_[i], values_[i + 1]);
      const double steepest = std::fmin(interval(i).steepest(0, 1) / step_, largest);
      if (i % intervals_in_piece_ == 0) pieces_.push_back({static_cast<double>(i) * step_, low, high, 0});
      Piece& piece = pieces_.back();
      piece = {piece.begin, std::fmin(piece.low, low), std::fmax(piece.high, high), std::fmax(piece.steepest, steepest)};
    }
  }

  // The steepest |slope| (N/m) of interval i where the force is below `limit`, which it crosses there once.
  double slope_below(size_t i, double limit) const {
    const Cubic cubic = interval(i);
    const bool is_rising = values_[i + 1] > values_[i];
    double below = is_rising ? 0 : 1, above = 1 - below;
    for (int k = 0; k < 30; ++k) {
      const double middle = (below + above) / 2;
      (cubic.force(middle) < limit ? below : above) = middle;
    }
    return std::fmin((is_rising ? cubic.steepest(0, above) : cubic.steepest(above, 1)) / step_, largest);
  }

  // The slope at an end of the table, from the rises of the two intervals next to it: that of the parabola through
  // three entries, limited so that the curve stays monotone.
  static double end_slope(double first, double second) {
    const double slope = (3 * first - second) / 2;
    if (slope * first <= 0) return 0;
    if (first * second < 0 && std::fabs(slope) > 3 * std::fabs(first)) return 3 * first;
    return slope;
  }

  void set_slopes() {
    const size_t n = values_.size();
    const auto rise = [&](size_t i) { return values_[i + 1] - values_[i]; };
    slopes_.assign(n, 0);
    if (n == 2) {
      slopes_[0] = slopes_[1] = rise(0);
      return;
    }
    slopes_[0] = end_slope(rise(0), rise(1));
    slopes_[n - 1] = end_slope(rise(n - 2), rise(n - 3));
    for (size_t i = 1; i + 1 < n; ++i) {
      const double before = rise(i - 1), after = rise(i);
      if ((before > 0) == (after > 0) && before != 0 && after != 0) {
        slopes_[i] = 2 * before * (after / (before + after));  // the harmonic mean
      }
    }
  }

  const std::vector<double> table_;  // as given
  std::vector<double> values_;       // N, finite, >= 0
  std::vector<double> slopes_;       // N per step
  const double step_;                // m
  std::vector<Piece> pieces_;
  size_t intervals_in_piece_ = 1;
};

#ifdef FORCESERVER_EXPRESSIONS

constexpr size_t longest_expression = 255;  // bytes

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
      return f > 0 && f <= largest ? f : 0;
    } catch (...) {
      return 0;
    }
  }

  int result_count() const { return parser_.GetNumResults(); }

 private:
  double d_ = 0, t_ = 0;
  mu::Parser parser_;
};

// True when `t` occurs as a word of its own, so the expression may depend on time.
bool mentions_time(const std::string& text) {
  const auto is_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == 't' && !(i > 0 && is_word(text[i - 1])) && !is_word(text[i + 1])) return true;
  }
  return false;
}

class ExpressionCurve final : public Curve {
 public:
  // parser: made from the text. Parsing is slow, so the first call of make_parser returns this one.
  ExpressionCurve(std::string text, std::unique_ptr<ExpressionParser> parser) : text_(std::move(text)) {
    sample(*parser);
    first_.store(parser.release());
  }
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
    return {force, std::clamp(slope, -largest, largest)};
  }

  double force(Parser* given, double d, double t) const noexcept override {
    auto* const parser = static_cast<ExpressionParser*>(given);
    return parser ? parser->force(d, t) : 0;
  }

  double steepest_slope(double limit, double reach) const noexcept override {
    double steepest = 0;
    for (const Piece& piece : pieces_) {
      if (piece.begin < reach && piece.low < limit) steepest = std::fmax(steepest, piece.steepest);
    }
    return steepest;
  }
  double greatest_force(double d) const noexcept override {  // of the first sample at d or beyond
    const auto next = std::lower_bound(forces_.begin(), forces_.end() - 1, d,
                                       [](const auto& sample, double wanted) { return sample.first < wanted; });
    return next->second;
  }

  const std::string* expression() const noexcept override { return &text_; }

  bool is_timed() const noexcept override { return mentions_time(text_); }
  std::vector<Knot> knots(double slope, double reach) const override {
    ExpressionParser parser(text_);
    const int times = is_timed() ? 6 : 1;
    for (int j = 0; j < times; ++j) {
      const std::vector<Knot> found = steep_parts(parser, sampled_time(j), slope, reach, is_timed() ? 1024 : 4096);
      if (!found.empty()) return found;
    }
    return {};
  }

 private:
  static double sampled_time(size_t j) { return 1.6180339 * static_cast<double>(j); }

  // Of the intervals between `count` samples those that are steeper than slope, and those next to them. They are halved
  // where steep and flat or rising and falling meet, the nearest ones first, until they are as short as the step of
  // the slope or too many.
  static std::vector<Knot> steep_parts(ExpressionParser& parser, double t, double slope, double reach, int count) {
    constexpr double dense = 1e-3, last = 100;  // m: below `dense` the samples are equally far apart, beyond it geometric
    const double densest = std::asinh(last / dense) / (count - 1);
    const auto at = [&](double d) { return Knot{d, parser.force(d, t), false}; };
    const auto mark = [&](Knot& from, const Knot& to) {
      from.is_steep = std::fabs(to.force - from.force) > slope * (to.distance - from.distance);
    };
    std::vector<Knot> samples{at(0)};
    for (int i = 1; i < count && samples.back().distance < reach; ++i) {
      samples.push_back(at(std::fmin(dense * std::sinh(densest * i), reach)));
      mark(samples[samples.size() - 2], samples.back());
    }
    // The direction of interval i of a list: 0 where it is flat.
    const auto way = [](const std::vector<Knot>& list, size_t i) {
      if (i + 1 >= list.size() || !list[i].is_steep) return 0;
      return list[i + 1].force > list[i].force ? 1 : -1;
    };
    std::vector<Knot> out;
    for (size_t i = 0; i < samples.size(); ++i) {
      const size_t first = i < 2 ? 0 : i - 2;
      if (way(samples, first) || way(samples, i < 1 ? 0 : i - 1) || way(samples, i) || way(samples, i + 1)) {
        out.push_back(samples[i]);
      }
    }

    constexpr size_t most_knots = 16384;
    for (bool is_halved = true; is_halved && out.size() < most_knots;) {
      is_halved = false;
      std::vector<Knot> finer;
      for (size_t i = 0; i < out.size(); ++i) {
        finer.push_back(out[i]);
        if (i + 1 == out.size() || out[i + 1].distance - out[i].distance <= expression_step) continue;
        const int here = way(out, i), before = i > 0 ? way(out, i - 1) : 0, after = way(out, i + 1);
        if ((here == before && here == after) || finer.size() + (out.size() - i) >= most_knots) continue;
        Knot middle = at((out[i].distance + out[i + 1].distance) / 2);
        mark(finer.back(), middle);
        mark(middle, out[i + 1]);
        finer.push_back(middle);
        is_halved = true;
      }
      out = std::move(finer);
    }
    return out;
  }

  // Samples at distances in a geometric series from 1 um to 100 m, and at times that do not fall into step with a usual
  // frequency. A file may have thousands of expressions, so these few hundred evaluations take only some
  // tenths of a millisecond.
  void sample(ExpressionParser& parser) {
    const bool is_timed = mentions_time(text_);
    const size_t times = is_timed ? 6 : 1, distances = is_timed ? 64 : most_pieces;
    constexpr double first = 1e-6, last = 100;
    forces_.resize(distances, {0, 0});
    for (size_t i = 1; i < distances; ++i) {
      forces_[i].first = first * std::pow(last / first, static_cast<double>(i - 1) / static_cast<double>(distances - 2));
    }
    pieces_.resize(distances - 1);
    Secant steepest;
    for (size_t j = 0; j < times; ++j) {
      const double t = sampled_time(j);
      double before = 0;
      for (size_t i = 0; i < distances; ++i) {
        auto& [d, greatest] = forces_[i];
        const double force = parser.force(d, t);
        greatest = std::fmax(greatest, force);
        if (i > 0) {
          const Secant secant{i - 1, t, forces_[i - 1].first, d, before, force};
          Piece& piece = pieces_[i - 1];
          const auto [low, high] = std::minmax(before, force);
          piece = {secant.begin, j == 0 ? low : std::fmin(piece.low, low), std::fmax(piece.high, high),
                   std::fmax(piece.steepest, secant.slope())};
          if (secant.slope() > steepest.slope()) steepest = secant;
        }
        before = force;
      }
    }
    // Halve the steepest interval repeatedly, so that a jump shows its true steepness.
    for (int k = 0; k < 32 && steepest.end - steepest.begin > 2 * expression_step; ++k) {
      Secant left = steepest, right = steepest;
      left.end = right.begin = (steepest.begin + steepest.end) / 2;
      left.to = right.from = parser.force(left.end, steepest.time);
      steepest = left.slope() > right.slope() ? left : right;
      Piece& piece = pieces_[steepest.piece];
      piece.steepest = std::fmax(piece.steepest, steepest.slope());
    }
  }

  struct Secant {
    size_t piece = 0;
    double time = 0;            // s
    double begin = 0, end = 0;  // m
    double from = 0, to = 0;    // N
    double slope() const { return end > begin ? std::fmin(std::fabs(to - from) / (end - begin), largest) : 0; }
  };

  const std::string text_;
  std::vector<Piece> pieces_;
  std::vector<std::pair<double, double>> forces_;  // samples: distance (m), greatest force at any sampled time (N)
  mutable std::atomic<ExpressionParser*> first_{nullptr};
};

// Refuses what muParser accepts but a profile must not contain: bytes that are not printable ASCII, strings,
// assignment, several results.
void check_expression(const std::string& text) {
  if (text.find_first_not_of(' ') == std::string::npos) fail(FS_ERROR_PARSE, "the expression is empty");
  if (text.size() > longest_expression) {
    fail(FS_ERROR_INVALID, "the expression has more than %zu bytes", longest_expression);
  }
  std::string open;  // one for each open '(': 'f' when it begins the arguments of a function, otherwise '('
  for (size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c < 0x20 || c > 0x7e) {
      fail(FS_ERROR_PARSE, "column %zu of the expression is byte 0x%02x, must be printable ASCII", i + 1, c);
    }
    if (c == '"') fail(FS_ERROR_PARSE, "column %zu of the expression is '\"': strings are not numbers", i + 1);
    if (std::strchr("<>!=", c) && text[i + 1] == '=') {
      ++i;
    } else if (c == '=') {
      fail(FS_ERROR_PARSE, "column %zu of the expression is '=': assignment is not allowed", i + 1);
    } else if (c == '(') {
      const size_t before = i == 0 ? std::string::npos : text.find_last_not_of(' ', i - 1);
      const bool is_call = before != std::string::npos && (std::isalnum(text[before]) || text[before] == '_');
      open.push_back(is_call ? 'f' : '(');
    } else if (c == ')' && !open.empty()) {
      open.pop_back();
    } else if (c == ',' && (open.empty() || open.back() != 'f')) {
      fail(FS_ERROR_PARSE, "column %zu of the expression is ',' outside of a call: it must give one number", i + 1);
    }
  }
}

#endif  // FORCESERVER_EXPRESSIONS

}  // namespace

Ref<const Curve> make_table_curve(const double* forces, size_t count, double step) {
  if (count < 2) fail(FS_ERROR_INVALID, "count is %zu, must be at least 2 entries of a table", count);
  if (!(step > 0) || !std::isfinite(step)) fail(FS_ERROR_INVALID, "step is %.9g, must be > 0 m and finite", step);
  return make_ref<const TableCurve>(std::vector<double>(forces, forces + count), step);
}

#ifdef FORCESERVER_EXPRESSIONS

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
    fail_expression(expression, error);
  }
}

#else

Ref<const Curve> make_expression_curve(const char*) {
  fail(FS_ERROR_UNSUPPORTED, "a curve cannot be an expression: built without muParser");
}

#endif

}  // namespace fs
