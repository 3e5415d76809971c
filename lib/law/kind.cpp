#include "law/kind.h"

#include <algorithm>
#include <cmath>

#include "law/formula.h"

namespace fs {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double largest = 1e200;        // N/m: larger slopes could overflow when summed or scaled
constexpr double gaussian_support = 39;  // widths: exp(-39^2 / 2) is 0 in double precision

// Enlarges a rounded bound >= 0 slightly, so that it is never below the exact one.
double outward(double bound) { return bound * (1 + 1e-15) + std::numeric_limits<double>::min(); }

// The formula, clamped at 0 only.
double force_at(const Profile& p, double d) {
  Formula numbers(p);
  numbers.limit = std::numeric_limits<double>::max();
  const Felt<double> f = formula_at(numbers, d);
  return f.is_felt ? f.force : 0;
}

void set_bend(const Profile& p, Cap& cap, double at, double slope) {
  cap.bend = at;
  cap.bend_force = force_at(p, at) - slope * at;
  cap.bend_slope = slope;
}

void lower_fall(Cap& cap, double end) { cap.fall = std::fmin(cap.fall, cap.slope * end); }

// What a kind is where it does not say otherwise.
struct Plain {
  static constexpr auto gain = Kind::Gain::not_negative;
  static constexpr bool has_offset = false, has_width = false, has_curve = false, is_constant = false;
  static constexpr auto form = Form::linear;
  static double support(const Profile&) noexcept { return infinity; }
  static double slope(const Profile&, double) noexcept { return 0; }
  static void bend(const Profile&, Cap&) {}
  static constexpr double (*tail)(const Profile&, double) noexcept = nullptr;
  static double slope_end(const Profile&, const SlopeEnd& end) noexcept { return end.support; }
};

struct None : Plain {
  static constexpr auto gain = Kind::Gain::zero;
};

struct Constant : Plain {
  static constexpr bool is_constant = true;
  static double slope_end(const Profile& p, const SlopeEnd& end) noexcept {
    return std::fmin(end.support, std::fmax(p.gain / end.k, end.turn(p.gain)));
  }
};

struct LinearIncreasing : Plain {
  static constexpr bool has_offset = true;
  static double slope(const Profile& p, double end) noexcept {
    return p.offset < p.limit && p.gain * end + p.offset > 0 ? p.gain : 0;
  }
  static void bend(const Profile& p, Cap& cap) {
    if (p.gain > cap.slope) cap.rise = p.offset < 0 ? -cap.slope * (-p.offset / p.gain) : p.offset;
  }
  static double slope_end(const Profile& p, const SlopeEnd& end) noexcept {
    const double first = std::fmin(p.offset, p.limit);
    if (!(p.gain > 0)) return std::fmax(first / end.k, end.turn(first));
    return std::fmax((p.limit + std::fabs(p.offset)) / std::fmin(p.gain, end.k), end.turn(p.limit));
  }
};

struct LinearDecreasing : Plain {
  static constexpr auto gain = Kind::Gain::not_positive;
  static constexpr bool has_offset = true;
  static double support(const Profile& p) noexcept { return p.offset > 0 ? outward(p.offset / -p.gain) : -1; }
  static double slope(const Profile& p, double end) noexcept {
    return p.offset > 0 && p.gain * end + p.offset < p.limit ? -p.gain : 0;
  }
  static void bend(const Profile& p, Cap& cap) {
    if (-p.gain > cap.slope) lower_fall(cap, p.offset / -p.gain);
  }
};

struct Gaussian : Plain {
  static constexpr bool has_width = true;
  static constexpr auto form = Form::gaussian;
  static double support(const Profile& p) noexcept { return gaussian_support * p.width; }
  static double slope(const Profile& p, double end) noexcept {
    // gain / width * q * exp(-q^2 / 2) with q = d / width is steepest at q = 1.
    const double start = p.gain > p.limit ? std::sqrt(2 * (std::log(p.gain) - std::log(p.limit))) : 0;
    const double stop = end / p.width;
    if (start >= stop) return 0;
    const double q = std::clamp(1.0, start, stop);
    return p.gain * std::exp(-0.5 * q * q) * q / p.width;
  }
  // The distance beyond d = width where it has become as flat as `slope`, m.
  static double flat_from(const Profile& p, double slope) {
    // With y = (d / width)^2 the slope is -gain / width sqrt(y) exp(-y / 2), so y - ln(y) = flatness. Newton's method goes
    // down to the larger root.
    const double flatness = 2 * (std::log(p.gain) - std::log(slope) - std::log(p.width));
    if (!(flatness > 1)) return p.width;
    double y = 2 * flatness;
    for (int k = 0; k < 100; ++k) {
      const double next = y - (y - std::log(y) - flatness) / (1 - 1 / y);
      if (!(next < y && next > 1)) break;
      y = next;
    }
    return std::sqrt(y) * p.width;
  }
  static void bend(const Profile& p, Cap& cap) {
    const double steepest = p.gain / p.width * std::exp(-0.5);
    if (steepest > cap.slope) set_bend(p, cap, flat_from(p, cap.slope), -cap.slope);
  }
  static double tail(const Profile& p, double force) noexcept {
    return p.gain > force ? outward(p.width * std::sqrt(2 * std::log(p.gain / force)) * (1 + 1e-12)) : -1;
  }
  static double slope_end(const Profile& p, const SlopeEnd& end) noexcept {
    // From one width on its slope falls, and is more than that of the turn.
    double widths = 1;
    while (widths < 5 && p.gain / p.width * widths * std::exp(-0.5 * widths * widths) > end.least) widths += 0.25;
    // Beyond its steep part a falling force is not changed by a cap.
    return std::fmin(end.support, std::fmax(widths * p.width, end.farther));
  }
};

struct Quadratic : Plain {
  static constexpr auto gain = Kind::Gain::any;
  static constexpr bool has_offset = true;
  static constexpr auto form = Form::quadratic;
  static double support(const Profile& p) noexcept {
    if (p.gain > 0) return infinity;
    return p.offset > 0 ? outward(std::sqrt(p.offset / -p.gain)) : -1;
  }
  static double slope(const Profile& p, double end) noexcept {
    // The slope grows with d: it is steepest where the force reaches limit (gain > 0) or 0 (gain < 0), or at the end.
    const double room = p.gain > 0 ? p.limit - p.offset : p.offset;
    if (room <= 0) return 0;
    const double last = std::sqrt(room / std::fabs(p.gain)), d = std::fmin(last, end);
    // Distances are compared, not forces: near its zero the formula is rounded to the digits of the offset.
    const bool is_felt =
        p.gain > 0 ? !(p.offset < 0) || end > std::sqrt(p.offset / -p.gain) : last <= end || p.gain * d * d + p.offset < p.limit;
    return is_felt ? 2 * std::fabs(p.gain) * d : 0;
  }
  static void bend(const Profile& p, Cap& cap) {
    const double k = cap.slope, zero = p.offset / p.gain < 0 ? std::sqrt(p.offset / -p.gain) : 0;
    if (p.gain > 0) {
      // It is steep from its zero on. The line begins there with 0, as the formula is rounded to the digits of the offset.
      if (2 * p.gain * zero > k) {
        cap.rise = -k * zero;
      } else {
        set_bend(p, cap, k / (2 * p.gain), k);
      }
      return;
    }
    // Its arch is concave, so what is steep of it ends at 0.
    if (2 * -p.gain * zero > k) lower_fall(cap, zero);
  }
  static double slope_end(const Profile& p, const SlopeEnd& end) noexcept {
    if (!(p.gain > 0)) return end.support;
    return std::fmax(std::sqrt((p.limit + std::fabs(p.offset)) / p.gain) + end.farther, end.turn(p.limit));
  }
};

struct Inverse : Plain {
  static constexpr bool has_offset = true;
  static constexpr auto form = Form::inverse;
  static double support(const Profile& p) noexcept { return p.offset < 0 ? outward(p.gain / -p.offset) : infinity; }
  static double slope(const Profile& p, double end) noexcept {
    if (p.offset >= p.limit) return 0;
    const double d = p.gain / (p.limit - p.offset);  // where the force falls below the limit, and is steepest
    return d < end ? (p.limit - p.offset) / p.gain * (p.limit - p.offset) : 0;
  }
  static void bend(const Profile& p, Cap& cap) {
    const double zero = p.offset < 0 ? p.gain / -p.offset : infinity, bend = std::sqrt(p.gain / cap.slope);
    if (bend < zero) {
      set_bend(p, cap, bend, -cap.slope);
    } else {
      lower_fall(cap, zero);
    }
  }
  static double tail(const Profile& p, double force) noexcept {
    return p.offset < force ? outward(p.gain / (force - p.offset) * (1 + 1e-12)) : infinity;
  }
  static double slope_end(const Profile& p, const SlopeEnd& end) noexcept {
    return std::fmin(end.support, std::fmax(std::sqrt(p.gain / end.least), end.turn(std::fmax(p.offset, 0))) + end.farther);
  }
};

struct Custom : Plain {
  static constexpr bool has_curve = true;
  static double support(const Profile& p) noexcept {
    const std::vector<double>* table = p.curve->table();
    if (!table) return infinity;
    // Find the entry after the last force; from there on the curve is flat at 0.
    size_t after = table->size();
    while (after > 0 && !((*table)[after - 1] > 0 && std::isfinite((*table)[after - 1]))) --after;
    if (after == 0) return -1;
    if (after == table->size()) return infinity;
    return outward(static_cast<double>(after) * p.curve->step());
  }
  static double slope(const Profile& p, double end) noexcept {
    return std::fmin(p.gain * p.curve->steepest_slope(p.limit / p.gain, end), largest);
  }
  static void bend(const Profile& p, Cap& cap) { cap.follow(p.scaled_curve(), p.reach > 0 ? p.reach : infinity); }
};

template <class K>
constexpr Kind row{K::gain,    K::has_offset, K::has_width, K::has_curve, K::is_constant, K::form,
                   K::support, K::slope,      K::bend,      K::tail,      K::slope_end};

}  // namespace

const Kind kinds[] = {row<None>,     row<Constant>,  row<LinearIncreasing>, row<LinearDecreasing>,
                      row<Gaussian>, row<Quadratic>, row<Inverse>,          row<Custom>};

static_assert(FS_PROFILE_NONE == 0 && FS_PROFILE_CONSTANT == 1 && FS_PROFILE_LINEAR_INCREASING == 2 &&
              FS_PROFILE_LINEAR_DECREASING == 3 && FS_PROFILE_GAUSSIAN == 4 && FS_PROFILE_QUADRATIC == 5 &&
              FS_PROFILE_INVERSE == 6 && FS_PROFILE_CUSTOM == 7);

}  // namespace fs
