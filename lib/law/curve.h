// A custom profile function f(d, t) in newtons, immutable. It is the fs_curve of the C contract itself.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <forceserver/object.h>

#include "base/counted.h"
#include "base/serial.h"

namespace fs {

// The slope of an expression is its difference quotient over d - expression_step .. d + expression_step (m); the
// interval begins at 0 when d is smaller than the step.
inline constexpr double expression_step = 1e-6;

// An intensity (N, >= 0) and its slope in d (N/m).
struct Intensity {
  double force = 0, slope = 0;
};

// A place of a curve or of its envelope (cap.h): distance (m) and force (N). is_steep: between this place and the next one the
// curve is steeper than its cap, and not known any better than by the two.
struct Knot {
  double distance = 0, force = 0;
  bool is_steep = false;
};

}  // namespace fs

struct fs_curve : fs::Counted<fs_curve> {
  virtual ~fs_curve() = default;

  const uint64_t serial = fs::next_serial();

  // Keeps `what` alive as long as the curve. Called before any other thread has the curve.
  void keep(std::shared_ptr<const void> what) const { kept_ = std::move(what); }

  // The state that a thread needs to evaluate an expression; a table needs none, and its parser is null. Each thread
  // that evaluates a curve keeps a parser that this curve made.
  struct Parser {
    virtual ~Parser() = default;
  };
  virtual std::unique_ptr<Parser> make_parser() const { return nullptr; }

  // [rt] d in m, >= 0; t in s. Both results are finite. Only one thread at a time may use a parser; an expression
  // without a parser gives 0.
  virtual fs::Intensity evaluate(Parser* parser, double d, double t) const noexcept = 0;

  // [rt] As evaluate, but only the force, which takes an expression a third of the time.
  virtual double force(Parser* parser, double d, double t) const noexcept { return evaluate(parser, d, t).force; }

  // The next two use figures that are computed once, when the curve is made, so setting a profile takes at most a few
  // hundred steps.
  // The steepest |slope|, N/m, over 0 <= d < reach where the force is below limit (N). Never NaN; may be infinite. For
  // a table it is never too low, and exact unless limit or reach cuts off a table of more than 257 entries. For an
  // expression it is an estimate from samples.
  virtual double steepest_slope(double limit, double reach) const noexcept = 0;
  // The greatest force at d (m) at any time, N: exact for a table, an estimate from samples for an expression.
  virtual double greatest_force(double d) const noexcept = 0;

  // Whether f depends on t, as far as the text of an expression tells.
  virtual bool is_timed() const noexcept { return false; }
  // The places from 0 to reach (m, may be infinite) where f(s) + slope*|d - s| can be least for some d, apart from d itself
  // (slope: N/m, > 0), in order of distance; none when f is nowhere steeper than slope. Exact for a table; an expression
  // is sampled, which takes up to a millisecond; if it depends on time, at several times, and the result is of the first
  // of these at which it is steep.
  virtual std::vector<fs::Knot> knots(double slope, double reach) const = 0;

  virtual const std::string* expression() const noexcept { return nullptr; }          // null for a table
  virtual const std::vector<double>* table() const noexcept { return nullptr; }       // null for an expression
  virtual double step() const noexcept { return 0; }                                  // of the table, m

 private:
  mutable std::shared_ptr<const void> kept_;
};

namespace fs {

using Curve = fs_curve;

// A monotone cubic through forces[i] (N) at i * step (m), after Fritsch & Carlson, "Monotone piecewise cubic
// interpolation" (SIAM J. Numer. Anal. 17, 1980), with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5,
// 1984). It never overshoots its entries. Throws INVALID.
Ref<const Curve> make_table_curve(const double* forces, size_t count, double step);
// Throws INVALID, PARSE; UNSUPPORTED when built without muParser.
Ref<const Curve> make_expression_curve(const char* text);

}  // namespace fs
