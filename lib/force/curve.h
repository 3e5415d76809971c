// A custom profile function f(d, t) in newtons, immutable. It is the fs_curve of the C contract itself.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <forceserver/object.h>

#include "base/counted.h"
#include "base/serial.h"

namespace fs {

// The slope of an expression is the difference over d - expression_step .. d + expression_step (m); from d = 0 on one
// side near 0.
inline constexpr double expression_step = 1e-6;

// An intensity (N, >= 0) and its slope in d (N/m).
struct Intensity {
  double force = 0, slope = 0;
};

}  // namespace fs

struct fs_curve : fs::Counted<fs_curve> {
  virtual ~fs_curve() = default;

  const uint64_t serial = fs::next_serial();

  // Whatever shall go when the curve goes. Set before it is shared.
  void keep(std::shared_ptr<const void> what) const { kept_ = std::move(what); }

  // What a thread needs of its own to evaluate this curve: an expression's parser holds state. Null where it needs
  // nothing (a table). Whoever evaluates a curve keeps the parser that was made of it.
  struct Parser {
    virtual ~Parser() = default;
  };
  virtual std::unique_ptr<Parser> make_parser() const { return nullptr; }

  // [rt] d in m, >= 0; t in s. Both results are finite. One thread at a time for each parser; an expression without a
  // parser gives 0.
  virtual fs::Intensity evaluate(Parser* parser, double d, double t) const noexcept = 0;

  // What is known of the curve without evaluating it: worked out once, when it is made, so that whoever sets a profile costs
  // nobody more than a few hundred steps.
  // The steepest |slope|, N/m, over 0 <= d < reach where the force is below limit (N). Never NaN; may be infinite. Of a
  // table never too low: exact, but for one of more than 257 entries cut off by limit or reach. Of an expression an
  // estimate by samples.
  virtual double steepest_slope(double limit, double reach) const noexcept = 0;
  // The greatest force at d (m) at any time, N. Of a table exact, of an expression an estimate by samples.
  virtual double greatest_force(double d) const noexcept = 0;

  virtual const std::string* expression() const noexcept { return nullptr; }          // null: a table
  virtual const std::vector<double>* table() const noexcept { return nullptr; }       // null: an expression
  virtual double step() const noexcept { return 0; }                                  // of the table, m

 private:
  mutable std::shared_ptr<const void> kept_;
};

namespace fs {

using Curve = fs_curve;

// Monotone cubic through forces[i] (N) at i * step (m), after Fritsch & Carlson, "Monotone piecewise cubic
// interpolation" (SIAM J. Numer. Anal. 17, 1980), with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5,
// 1984): it never overshoots its entries. INVALID.
Ref<const Curve> make_table_curve(const double* forces, size_t count, double step);
// INVALID, PARSE; UNSUPPORTED when built without muParser.
Ref<const Curve> make_expression_curve(const char* text);

}  // namespace fs
