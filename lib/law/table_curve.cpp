// The curve through a table.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/error.h"
#include "law/curve.h"
#include "law/curve_piece.h"

namespace fs {
namespace {

// A cubic Hermite segment between two entries as a polynomial of u in [0, 1], from the slopes there (N per step).
struct Cubic {
  double c0, c1, c2, c3;

  Cubic(double from, double to, double slope_from, double slope_to)
      : c0(from), c1(slope_from), c2(3 * (to - from) - 2 * slope_from - slope_to), c3(slope_from + slope_to - 2 * (to - from)) {}

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
      const CurvePiece& piece = pieces_[k];
      if (piece.low >= limit || piece.steepest <= steepest) continue;
      const bool is_cut = piece.high > limit && intervals_in_piece_ == 1;
      steepest = std::fmax(steepest, is_cut ? slope_below(k, limit) : piece.steepest);
    }
    return steepest;
  }
  double greatest_force(double d) const noexcept override { return evaluate(nullptr, d, 0).force; }

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
  static double clamped(double slope) { return std::clamp(slope, -largest_slope, largest_slope); }
  Cubic interval(size_t i) const { return {values_[i], values_[i + 1], slopes_[i], slopes_[i + 1]}; }

  void set_pieces() {
    const size_t intervals = values_.size() - 1;
    intervals_in_piece_ = (intervals + most_curve_pieces - 1) / most_curve_pieces;
    for (size_t i = 0; i < intervals; ++i) {
      const auto [low, high] = std::minmax(values_[i], values_[i + 1]);
      const double steepest = std::fmin(interval(i).steepest(0, 1) / step_, largest_slope);
      if (i % intervals_in_piece_ == 0) pieces_.push_back({static_cast<double>(i) * step_, low, high, 0});
      CurvePiece& piece = pieces_.back();
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
    return std::fmin((is_rising ? cubic.steepest(0, above) : cubic.steepest(above, 1)) / step_, largest_slope);
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
  std::vector<CurvePiece> pieces_;
  size_t intervals_in_piece_ = 1;
};

}  // namespace

Ref<const Curve> make_table_curve(const double* forces, size_t count, double step) {
  if (count < 2) fail(FS_ERROR_INVALID, "count is %zu, must be at least 2 entries of a table", count);
  if (!(step > 0) || !std::isfinite(step)) fail(FS_ERROR_INVALID, "step is %.9g, must be > 0 m and finite", step);
  std::vector<double> entries;
  entries.reserve(count);  // throws where there cannot be so many
  entries.assign(forces, forces + count);
  return make_ref<const TableCurve>(std::move(entries), step);
}

}  // namespace fs
