#include "law/profile.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/enum.h"
#include "base/error.h"
#include "base/names.h"

namespace fs {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double largest = 1e200;             // N/m: larger slopes could overflow when summed or scaled
constexpr double largest_limit = 1e9;        // N
constexpr double gaussian_support = 39;      // widths: exp(-39^2 / 2) is 0 in double precision

// Enlarges a rounded bound >= 0 slightly, so that it is never below the exact one.
double outward(double bound) { return bound * (1 + 1e-15) + std::numeric_limits<double>::min(); }

void require_finite(double value, const char* field, const char* part) {
  if (!std::isfinite(value)) fail(FS_ERROR_INVALID, "%s.%s is %.9g, must be finite", field, part, value);
}

// Throws INVALID unless the value is good for a profile of this kind; `must` says what is good.
void require_that(bool is_good, const char* must, double value, const char* field, const char* part,
                  fs_profile_kind kind) {
  if (is_good) return;
  fail(FS_ERROR_INVALID, "%s.%s is %.9g, must be %s for %s %s profile", field, part, value, must,
       kind == FS_PROFILE_INVERSE ? "an" : "a", without_prefix(profile_kind_names[kind]));
}

// The formula without limit and reach. The slope is meaningful only where 0 < force < limit.
Intensity formula(const Profile& p, Curve::Parser* parser, double d, double t) noexcept {
  if (p.gain == 0) return {p.offset, 0};  // for every kind, even when d would make it 0 * infinity or 0 / 0
  switch (p.kind) {
    case FS_PROFILE_CONSTANT:
      return {p.gain, 0};
    case FS_PROFILE_LINEAR_INCREASING:
    case FS_PROFILE_LINEAR_DECREASING:
      return {p.gain * d + p.offset, p.gain};
    case FS_PROFILE_GAUSSIAN: {
      const double q = d / p.width;
      const double force = p.gain * std::exp(-0.5 * q * q);
      return {force, -(force * q) / p.width};
    }
    case FS_PROFILE_QUADRATIC:
      return {p.gain * d * d + p.offset, 2 * (p.gain * d)};
    case FS_PROFILE_INVERSE: {
      const double force = p.gain / d;
      return {force + p.offset, -force / d};
    }
    case FS_PROFILE_CUSTOM: {
      const Intensity curve = p.curve->evaluate(parser, d, t);
      return {p.gain * curve.force, p.gain * curve.slope};
    }
    default:
      return {};
  }
}

// The support of the formula clamped at 0, ignoring the reach.
double formula_support(const Profile& p) noexcept {
  if (p.gain == 0) return p.offset > 0 ? infinity : -1;
  switch (p.kind) {
    case FS_PROFILE_CONSTANT:
    case FS_PROFILE_LINEAR_INCREASING:
      return infinity;
    case FS_PROFILE_LINEAR_DECREASING:
      return p.offset > 0 ? outward(p.offset / -p.gain) : -1;
    case FS_PROFILE_GAUSSIAN:
      return gaussian_support * p.width;
    case FS_PROFILE_QUADRATIC:
      if (p.gain > 0) return infinity;
      return p.offset > 0 ? outward(std::sqrt(p.offset / -p.gain)) : -1;
    case FS_PROFILE_INVERSE:
      return p.offset < 0 ? outward(p.gain / -p.offset) : infinity;
    case FS_PROFILE_CUSTOM: {
      const std::vector<double>* table = p.curve->table();
      if (!table) return infinity;
      // Find the entry after the last force; from there on the curve is flat at 0.
      size_t after = table->size();
      while (after > 0 && !((*table)[after - 1] > 0 && std::isfinite((*table)[after - 1]))) --after;
      if (after == 0) return -1;
      if (after == table->size()) return infinity;
      return outward(static_cast<double>(after) * p.curve->step());
    }
    default:
      return -1;
  }
}

// The supremum of |slope| where 0 < formula < limit and d <= end.
double formula_slope(const Profile& p, double end) noexcept {
  switch (p.kind) {
    case FS_PROFILE_LINEAR_INCREASING:
      return p.offset < p.limit && p.gain * end + p.offset > 0 ? p.gain : 0;
    case FS_PROFILE_LINEAR_DECREASING:
      return p.offset > 0 && p.gain * end + p.offset < p.limit ? -p.gain : 0;
    case FS_PROFILE_GAUSSIAN: {
      // gain / width * q * exp(-q^2 / 2) with q = d / width is steepest at q = 1.
      const double start = p.gain > p.limit ? std::sqrt(2 * (std::log(p.gain) - std::log(p.limit))) : 0;
      const double stop = end / p.width;
      if (start >= stop) return 0;
      const double q = std::clamp(1.0, start, stop);
      return p.gain * std::exp(-0.5 * q * q) * q / p.width;
    }
    case FS_PROFILE_QUADRATIC: {
      // The slope grows with d: it is steepest where the force reaches limit (gain > 0) or 0 (gain < 0), or at the end.
      const double room = p.gain > 0 ? p.limit - p.offset : p.offset;
      if (room <= 0) return 0;
      const double last = std::sqrt(room / std::fabs(p.gain)), d = std::fmin(last, end);
      // Distances are compared, not forces: near its zero the formula is rounded to the digits of the offset.
      const bool is_felt = p.gain > 0 ? !(p.offset < 0) || end > std::sqrt(p.offset / -p.gain)
                                      : last <= end || p.gain * d * d + p.offset < p.limit;
      return is_felt ? 2 * std::fabs(p.gain) * d : 0;
    }
    case FS_PROFILE_INVERSE: {
      if (p.offset >= p.limit) return 0;
      const double d = p.gain / (p.limit - p.offset);  // where the force falls below the limit, and is steepest
      return d < end ? (p.limit - p.offset) / p.gain * (p.limit - p.offset) : 0;
    }
    default:
      return 0;
  }
}

// f(d, t) without regard to a cap.
Intensity uncapped(const Profile& p, Curve::Parser* parser, double d, double t) noexcept {
  if (p.reach > 0 && !(d <= p.reach)) return {};
  const Intensity raw = formula(p, parser, d, t);
  if (!(raw.force > 0)) return {};  // NaN too
  if (raw.force >= p.limit) return {p.limit, 0};
  return {raw.force, std::clamp(raw.slope, -largest, largest)};
}

// True where f jumps to 0 at the reach.
bool jumps_at_reach(const Profile& p) {
  if (!(p.reach > 0)) return false;
  if (p.kind == FS_PROFILE_CUSTOM) return p.gain * p.curve->greatest_force(p.reach) > 0;
  return uncapped(p, nullptr, p.reach, 0).force > 0;
}

}  // namespace

Profile parse_profile(const fs_profile& in, const char* field) {
  const int32_t raw_kind = raw_value(in.kind), raw_sense = raw_value(in.sense);
  if (raw_kind < FS_PROFILE_NONE || raw_kind > FS_PROFILE_CUSTOM) {
    fail(FS_ERROR_INVALID, "%s.kind is %d, must be an fs_profile_kind (0..7)", field, raw_kind);
  }
  if (raw_sense != FS_SENSE_ATTRACTIVE && raw_sense != FS_SENSE_REPULSIVE) {
    fail(FS_ERROR_INVALID, "%s.sense is %d, must be an fs_sense (0 or 1)", field, raw_sense);
  }
  require_finite(in.gain, field, "gain");
  require_finite(in.offset, field, "offset");
  require_finite(in.width, field, "width");
  require_finite(in.limit, field, "limit");
  require_finite(in.reach, field, "reach");

  const bool has_gain = in.kind != FS_PROFILE_NONE;
  const bool has_offset = in.kind == FS_PROFILE_LINEAR_INCREASING || in.kind == FS_PROFILE_LINEAR_DECREASING ||
                          in.kind == FS_PROFILE_QUADRATIC || in.kind == FS_PROFILE_INVERSE;
  const auto require = [&](bool is_good, const char* must, double value, const char* part) {
    require_that(is_good, must, value, field, part, in.kind);
  };
  if (!has_gain) {
    require(in.gain == 0, "0", in.gain, "gain");
  } else if (in.kind == FS_PROFILE_LINEAR_DECREASING) {
    require(in.gain <= 0, "<= 0", in.gain, "gain");
  } else if (in.kind != FS_PROFILE_QUADRATIC) {
    require(in.gain >= 0, ">= 0", in.gain, "gain");
  }
  if (!has_offset) require(in.offset == 0, "0", in.offset, "offset");
  if (in.kind == FS_PROFILE_GAUSSIAN) {
    require(in.width > 0, "> 0", in.width, "width");
  } else {
    require(in.width == 0, "0", in.width, "width");
  }
  if (in.kind == FS_PROFILE_NONE) {
    require(in.limit == 0, "0", in.limit, "limit");
    require(in.reach == 0, "0", in.reach, "reach");
  } else {
    require(in.limit > 0, "> 0", in.limit, "limit");
    if (in.limit > largest_limit) {
      fail(FS_ERROR_INVALID, "%s.limit is %.9g, must be at most %.9g N", field, in.limit, largest_limit);
    }
    if (in.reach < 0) fail(FS_ERROR_INVALID, "%s.reach is %.9g, must be >= 0 m", field, in.reach);
  }
  if (in.kind == FS_PROFILE_CUSTOM) {
    if (!in.curve) fail(FS_ERROR_INVALID, "%s.curve is null, must be a curve for a CUSTOM profile", field);
  } else if (in.curve) {
    fail(FS_ERROR_INVALID, "%s.curve is given, must be null for %s %s profile", field,
         in.kind == FS_PROFILE_INVERSE ? "an" : "a", without_prefix(profile_kind_names[in.kind]));
  }
  return {in.kind, in.sense, in.gain, in.offset, in.width, in.limit, in.reach, Ref<const Curve>::share(in.curve), nullptr};
}

fs_profile to_c(const Profile& p) {
  return {p.kind, p.sense, p.gain, p.offset, p.width, p.limit, p.reach, const_cast<fs_curve*>(p.curve.get())};
}

bool operator==(const Profile& a, const Profile& b) {
  return a.kind == b.kind && a.sense == b.sense && a.gain == b.gain && a.offset == b.offset && a.width == b.width &&
         a.limit == b.limit && a.reach == b.reach && a.curve == b.curve;
}

Intensity evaluate(const Profile& p, Curve::Parser* parser, double d, double t) noexcept {
  const Intensity raw = uncapped(p, parser, d, t);
  return p.cap ? p.cap->lower(p, parser, d, t, raw) : raw;
}

double most_between(const Profile& profile, double least, double most) noexcept {
  if (profile.kind == FS_PROFILE_NONE) return 0;
  if (profile.curve) return profile.limit;
  // All formulas are monotone.
  const double end = profile.reach > 0 ? std::min(most, profile.reach) : most;
  if (!(least <= end)) return 0;
  return std::max(uncapped(profile, nullptr, least, 0).force, uncapped(profile, nullptr, end, 0).force);
}

double support(const Profile& p) noexcept {
  const double bound = formula_support(p);
  return p.reach > 0 ? std::fmin(bound, p.reach) : bound;
}

bool has_tail(const Profile& p) noexcept {
  return (p.kind == FS_PROFILE_GAUSSIAN || p.kind == FS_PROFILE_INVERSE) && support(p) > 0;
}

double support_above(const Profile& p, double force) noexcept {
  const double all = support(p);
  if (!has_tail(p)) return all;
  double end = all;
  if (p.kind == FS_PROFILE_GAUSSIAN) {
    end = p.gain > force ? outward(p.width * std::sqrt(2 * std::log(p.gain / force)) * (1 + 1e-12)) : -1;
  } else if (p.offset < force) {
    end = outward(p.gain / (force - p.offset) * (1 + 1e-12));
  }
  return std::fmin(end, all);
}

bool is_ever_felt(const Profile& p) noexcept {
  if (p.kind == FS_PROFILE_CUSTOM) return support(p) > 0;
  // The formulas are monotone, so the two ends decide.
  return uncapped(p, nullptr, 0, 0).force > 0 || uncapped(p, nullptr, p.reach > 0 ? p.reach : infinity, 0).force > 0;
}

double steepest_slope(const Profile& p) {
  if (jumps_at_reach(p)) return infinity;
  if (p.gain == 0) return 0;
  const double end = p.reach > 0 ? p.reach : infinity;
  if (p.kind != FS_PROFILE_CUSTOM) return formula_slope(p, end);
  return std::fmin(p.gain * p.curve->steepest_slope(p.limit / p.gain, end), largest);
}

double first_force(const Profile& p) {
  if (p.kind == FS_PROFILE_CUSTOM) return std::fmin(p.gain * p.curve->greatest_force(0), p.limit);
  return uncapped(p, nullptr, 0, 0).force;
}

}  // namespace fs
