#include "law/expression_samples.h"

#ifdef FORCESERVER_EXPRESSIONS

#include <algorithm>
#include <cmath>

namespace fs {
namespace {

double sampled_time(size_t j) { return 1.6180339 * static_cast<double>(j); }
size_t sampled_times(bool is_timed) { return is_timed ? 6 : 1; }

struct Secant {
  size_t piece = 0;
  double time = 0;            // s
  double begin = 0, end = 0;  // m
  double from = 0, to = 0;    // N
  double slope() const { return end > begin ? std::fmin(std::fabs(to - from) / (end - begin), largest_slope) : 0; }
};

// Of the intervals between `count` samples those that are steeper than slope, and those next to them. They are halved
// where steep and flat or rising and falling meet, the nearest ones first, until they are as short as the step of
// the slope or too many.
std::vector<Knot> steep_parts(ExpressionParser& parser, double t, double slope, double reach, int count) {
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

}  // namespace

ExpressionSamples::ExpressionSamples(ExpressionParser& parser, bool is_timed) {
  const size_t times = sampled_times(is_timed), distances = is_timed ? 64 : most_curve_pieces;
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
        CurvePiece& piece = pieces_[i - 1];
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
    CurvePiece& piece = pieces_[steepest.piece];
    piece.steepest = std::fmax(piece.steepest, steepest.slope());
  }
}

double ExpressionSamples::steepest_slope(double limit, double reach) const noexcept {
  double steepest = 0;
  for (const CurvePiece& piece : pieces_) {
    if (piece.begin < reach && piece.low < limit) steepest = std::fmax(steepest, piece.steepest);
  }
  return steepest;
}

double ExpressionSamples::greatest_force(double d) const noexcept {
  const auto next = std::lower_bound(forces_.begin(), forces_.end() - 1, d,
                                     [](const auto& sample, double wanted) { return sample.first < wanted; });
  return next->second;
}

std::vector<Knot> sampled_knots(ExpressionParser& parser, bool is_timed, double slope, double reach) {
  for (size_t j = 0; j < sampled_times(is_timed); ++j) {
    const std::vector<Knot> found = steep_parts(parser, sampled_time(j), slope, reach, is_timed ? 1024 : 4096);
    if (!found.empty()) return found;
  }
  return {};
}

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS
