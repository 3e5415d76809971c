#include "law/profile.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/enum.h"
#include "base/error.h"
#include "base/grown.h"
#include "base/names.h"
#include "law/formula.h"
#include "law/kind.h"

namespace fs {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double largest = 1e200;       // N/m: larger slopes could overflow when summed or scaled
constexpr double largest_limit = 1e9;  // N

void require_finite(double value, const char* field, const char* part) {
  if (!std::isfinite(value)) fail(FS_ERROR_INVALID, "%s.%s is %.9g, must be finite", field, part, value);
}

const char* article(fs_profile_kind kind) { return std::strchr("AEIOU", *without_prefix(profile_kind_names[kind])) ? "an" : "a"; }

// Throws INVALID unless the value is good for a profile of this kind; `must` says what is good.
void require_that(bool is_good, const char* must, double value, const char* field, const char* part, fs_profile_kind kind) {
  if (is_good) return;
  fail(FS_ERROR_INVALID, "%s.%s is %.9g, must be %s for %s %s profile", field, part, value, must, article(kind),
       without_prefix(profile_kind_names[kind]));
}

// f(d, t) without regard to a cap.
Intensity uncapped(const Profile& p, Curve::Parser* parser, double d, double t) noexcept {
  Felt<double> f;
  if (p.curve) {
    if (p.gain == 0 || (p.reach > 0 && !(d <= p.reach))) return {};
    const Intensity curve = p.curve->evaluate(parser, d, t);
    f = clamped(p.gain * curve.force, p.gain * curve.slope, p.limit);
  } else {
    const Formula numbers(p);
    if (!(d <= numbers.reach)) return {};
    f = formula_at(numbers, d);
  }
  if (!f.is_felt) return {};
  return {f.force, std::clamp(f.slope, -largest, largest)};
}

// True where f jumps to 0 at the reach.
bool jumps_at_reach(const Profile& p) {
  if (!(p.reach > 0)) return false;
  if (p.curve) return p.gain * p.curve->greatest_force(p.reach) > 0;
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

  check_reserved(in.reserved, field);

  const Kind& kind = kind_of(in.kind);
  const auto require = [&](bool is_good, const char* must, double value, const char* part) {
    require_that(is_good, must, value, field, part, in.kind);
  };
  switch (kind.gain) {
    case Kind::Gain::zero: require(in.gain == 0, "0", in.gain, "gain"); break;
    case Kind::Gain::not_negative: require(in.gain >= 0, ">= 0", in.gain, "gain"); break;
    case Kind::Gain::not_positive: require(in.gain <= 0, "<= 0", in.gain, "gain"); break;
    case Kind::Gain::any: break;
  }
  if (!kind.has_offset) require(in.offset == 0, "0", in.offset, "offset");
  if (kind.has_width) {
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
  if (kind.has_curve) {
    if (!in.curve) fail(FS_ERROR_INVALID, "%s.curve is null, must be a curve for a CUSTOM profile", field);
  } else if (in.curve) {
    fail(FS_ERROR_INVALID, "%s.curve is given, must be null for %s %s profile", field, article(in.kind),
         without_prefix(profile_kind_names[in.kind]));
  }
  return {in.kind, in.sense, in.gain, in.offset, in.width, in.limit, in.reach, Ref<const Curve>::retain(in.curve), nullptr};
}

fs_profile to_c(const Profile& p) {
  return {p.kind, p.sense, p.gain, p.offset, p.width, p.limit, p.reach, const_cast<fs_curve*>(p.curve.get()), {}};
}

bool operator==(const Profile& a, const Profile& b) {
  return a.kind == b.kind && a.sense == b.sense && a.gain == b.gain && a.offset == b.offset && a.width == b.width &&
         a.limit == b.limit && a.reach == b.reach && a.curve == b.curve;
}

Intensity evaluate(const Profile& p, Curve::Parser* parser, double d, double t, double radius) noexcept {
  const double gap = std::fmax(0, d - radius);
  const Intensity raw = uncapped(p, parser, gap, t);
  if (p.cap) return p.cap->lower(p.scaled_curve(), parser, d, t, raw, radius);
  return {raw.force, d < radius ? 0 : raw.slope};
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
  double bound = p.offset > 0 ? infinity : -1;  // with gain 0 the force is the offset
  if (p.gain != 0) bound = kind_of(p.kind).support(p);
  return p.reach > 0 ? std::fmin(bound, p.reach) : bound;
}

bool has_tail(const Profile& p) noexcept { return kind_of(p.kind).tail && support(p) > 0; }

double support_above(const Profile& p, double force) noexcept {
  const double all = support(p);
  return has_tail(p) ? std::fmin(kind_of(p.kind).tail(p, force), all) : all;
}

Ref<Cap> make_cap(const Profile& p, double slope) {
  Ref<Cap> cap = make_ref<Cap>();
  cap->slope = slope;
  if (p.reach > 0) cap->fall = slope * p.reach;
  if (p.gain != 0) kind_of(p.kind).bend(p, *cap);
  return cap;
}

double slope_end(const Profile& p, double k, double part, bool turns) noexcept {
  const double all = support(p);
  if (!(all >= 0) || !(k > 0)) return -1;
  if (p.reach > 0) return all;  // it may jump there
  return kind_of(p.kind).slope_end(p, {.support = all, .k = k, .least = part * k, .farther = p.limit / k, .turns = turns});
}

bool is_ever_felt(const Profile& p) noexcept {
  if (p.curve) return support(p) > 0;
  // The formulas are monotone, so the two ends decide.
  return uncapped(p, nullptr, 0, 0).force > 0 || uncapped(p, nullptr, p.reach > 0 ? p.reach : infinity, 0).force > 0;
}

double steepest_slope(const Profile& p) {
  if (jumps_at_reach(p)) return infinity;
  if (p.gain == 0) return 0;
  return kind_of(p.kind).slope(p, p.reach > 0 ? p.reach : infinity);
}

double first_force(const Profile& p) {
  if (p.curve) return std::fmin(p.gain * p.curve->greatest_force(0), p.limit);
  return uncapped(p, nullptr, 0, 0).force;
}

}  // namespace fs
