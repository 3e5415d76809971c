// Profiles: formulas, clamping, slopes, support and every refusal.
#include <cstring>
#include <limits>

#include "field/object.h"
#include "law/profile.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

fs_profile profile(fs_profile_kind kind, double gain, double offset_or_width, double limit, double reach = 0) {
  fs_profile p = fs_profile_init(kind, FS_SENSE_REPULSIVE, gain, offset_or_width, limit);
  p.reach = reach;
  return p;
}

double force(const fs_profile& p, double d) { return evaluate(parse_profile(p, "front"), 0, d, 0).force; }

// A sound profile of any formula kind, with its components over many orders of magnitude.
fs_profile random_profile(Random& random) {
  const auto kind = static_cast<fs_profile_kind>(1 + random.below(6));
  const double sign = random.coin() ? 1 : -1;
  const double gain = random.log_between(1e-2, 1e3);
  const double other = random.coin(0.2) ? 0 : sign * random.log_between(1e-3, 1e2);
  const double limit = random.log_between(1e-2, 1e2), reach = random.coin() ? random.log_between(1e-3, 10) : 0;
  fs_profile p = profile(kind, gain, other, limit, reach);
  if (kind == FS_PROFILE_LINEAR_DECREASING) p.gain = -gain;
  if (kind == FS_PROFILE_QUADRATIC) p.gain = sign * gain;
  if (random.coin(0.1)) p.gain = std::copysign(0, p.gain);
  if (kind == FS_PROFILE_CONSTANT) p.offset = 0;
  if (kind == FS_PROFILE_GAUSSIAN) p.width = random.log_between(1e-3, 1);
  return p;
}

START_TEST(formulas) {
  ck_assert_double_eq(force(profile(FS_PROFILE_CONSTANT, 3, 0, 10), 7), 3);
  ck_assert_double_eq(force(profile(FS_PROFILE_CONSTANT, 30, 0, 10), 7), 10);
  ck_assert_double_eq(force(profile(FS_PROFILE_LINEAR_INCREASING, 100, 1, 10), 0.02), 3);
  ck_assert_double_eq(force(profile(FS_PROFILE_LINEAR_INCREASING, 100, -1, 10), 0.005), 0);
  ck_assert_double_eq(force(profile(FS_PROFILE_LINEAR_DECREASING, -100, 5, 10), 0.02), 3);
  ck_assert_double_eq(force(profile(FS_PROFILE_LINEAR_DECREASING, -100, 5, 10), 0.06), 0);
  ck_assert_double_eq_tol(force(profile(FS_PROFILE_GAUSSIAN, 4, 0.01, 10), 0.02), 4 * std::exp(-2), 1e-15);
  ck_assert_double_eq_tol(force(profile(FS_PROFILE_QUADRATIC, 1000, 1, 10), 0.05), 3.5, 1e-15);
  ck_assert_double_eq_tol(force(profile(FS_PROFILE_QUADRATIC, -1000, 5, 10), 0.05), 2.5, 1e-15);
  ck_assert_double_eq(force(profile(FS_PROFILE_QUADRATIC, 0, 5, 10), infinity), 5);
  ck_assert_double_eq_tol(force(profile(FS_PROFILE_INVERSE, 0.01, 1, 10), 0.01), 2, 1e-15);
  ck_assert_double_eq(force(profile(FS_PROFILE_INVERSE, 0.01, 1, 10), 0), 10);
  ck_assert_double_eq(force(profile(FS_PROFILE_INVERSE, 0.01, -1, 10), infinity), 0);
  ck_assert_double_eq(force(fs_profile{}, 0), 0);
  ck_assert_double_eq(force(profile(FS_PROFILE_CONSTANT, 3, 0, 10, 0.5), 0.5), 3);
  ck_assert_double_eq(force(profile(FS_PROFILE_CONSTANT, 3, 0, 10, 0.5), std::nextafter(0.5, 1)), 0);

  const double forces[] = {0, 2, 8};
  const Ref<const Curve> curve = make_table_curve(forces, 3, 0.01);
  fs_profile custom = profile(FS_PROFILE_CUSTOM, 0.5, 0, 3);
  custom.curve = const_cast<fs_curve*>(curve.get());
  ck_assert_double_eq(force(custom, 0.01), 1);
  ck_assert_double_eq(force(custom, 1), 3);
}
END_TEST

// Gain 0 leaves the offset at every distance, 0 and infinity too; nothing where there is none. Minus 0 is 0.
START_TEST(gain_zero) {
  const fs_profile_kind kinds[] = {FS_PROFILE_CONSTANT, FS_PROFILE_LINEAR_INCREASING, FS_PROFILE_LINEAR_DECREASING,
                                   FS_PROFILE_GAUSSIAN, FS_PROFILE_QUADRATIC,         FS_PROFILE_INVERSE};
  for (const fs_profile_kind kind : kinds) {
    const bool has_offset = kind != FS_PROFILE_CONSTANT && kind != FS_PROFILE_GAUSSIAN;
    for (const double gain : {0.0, -0.0}) {
      for (const double offset : {-2.0, 0.0, 3.0, 30.0}) {
        if (offset != 0 && !has_offset) continue;
        const Profile p = parse_profile(profile(kind, gain, kind == FS_PROFILE_GAUSSIAN ? 0.01 : offset, 10), "front");
        const double wanted = std::fmin(std::fmax(offset, 0), 10);
        for (const double d : {0.0, 5e-324, 0.01, 1e300, infinity}) {
          const Intensity f = evaluate(p, 0, d, 0);
          ck_assert_double_eq(f.force, wanted);
          ck_assert_double_eq(f.slope, 0);
        }
        ck_assert_double_eq(support(p), wanted > 0 ? infinity : -1);
        ck_assert(is_ever_felt(p) == (wanted > 0));
        ck_assert_double_eq(steepest_slope(p), 0);
      }
    }
  }
  const double forces[] = {3, 2, std::nan("")};
  const Ref<const Curve> curve = make_table_curve(forces, 3, 0.01);
  fs_profile custom = profile(FS_PROFILE_CUSTOM, 0, 0, 3, 0.5);
  custom.curve = const_cast<fs_curve*>(curve.get());
  const Profile p = parse_profile(custom, "front");
  for (const double d : {0.0, 0.005, 0.5, 1e300, infinity}) ck_assert_double_eq(evaluate(p, 0, d, 0).force, 0);
  ck_assert_double_eq(support(p), -1);
  ck_assert(!is_ever_felt(p));
  ck_assert_double_eq(steepest_slope(p), 0);
}
END_TEST

START_TEST(always_within_limits) {
  Random random(1);
  for (int i = 0; i < sanitized_times(2000, 20000); ++i) {
    const Profile p = parse_profile(random_profile(random), "front");
    for (const double d : {0.0, 5e-324, random.log_between(1e-300, 1e300), random.log_between(1e-4, 10),
                           std::numeric_limits<double>::max(), infinity}) {
      const Intensity f = evaluate(p, 0, d, 0);
      ck_assert(f.force >= 0 && f.force <= p.limit && std::isfinite(f.slope));
      ck_assert((f.force > 0 && f.force < p.limit) || f.slope == 0);
    }
  }
  // Components at the ends of the numbers.
  const double extremes[] = {5e-324, 1e-300, 1, 1e300, std::numeric_limits<double>::max()};
  for (int i = 0; i < sanitized_times(2000, 20000); ++i) {
    fs_profile in = random_profile(random);
    in.gain = std::copysign(extremes[random.below(5)], in.gain);
    if (in.offset != 0) in.offset = std::copysign(extremes[random.below(5)], in.offset);
    if (in.width != 0) in.width = extremes[random.below(5)];
    const Profile p = parse_profile(in, "front");
    for (const double d : {0.0, extremes[random.below(5)], infinity}) {
      const Intensity f = evaluate(p, 0, d, 0);
      ck_assert(f.force >= 0 && f.force <= p.limit && std::isfinite(f.slope));
    }
    ck_assert(!std::isnan(steepest_slope(p)) && steepest_slope(p) >= 0);
    ck_assert(!std::isnan(support(p)));
  }
}
END_TEST

START_TEST(slopes_match_differences) {
  Random random(2);
  const int count = sanitized_times(2000, 20000);
  int compared = 0;
  for (int i = 0; i < count; ++i) {
    const Profile p = parse_profile(random_profile(random), "front");
    const double d = random.log_between(1e-3, 3);
    const double h = 1e-5 * d;
    const double low = evaluate(p, 0, d - h, 0).force, high = evaluate(p, 0, d + h, 0).force;
    const Intensity here = evaluate(p, 0, d, 0);
    const auto is_inside = [&](double f) { return f > 0 && f < p.limit; };
    if (!is_inside(low) || !is_inside(here.force) || !is_inside(high)) continue;
    ++compared;
    const double difference = (high - low) / (2 * h);
    ck_assert_double_eq_tol(here.slope, difference, 1e-5 * std::fabs(here.slope) + 1e-10 * p.limit / h);
  }
  ck_assert_int_gt(compared, count / 7);
}
END_TEST

START_TEST(nothing_beyond_the_support) {
  Random random(3);
  const int count = sanitized_times(2000, 20000);
  int finite = 0;
  for (int i = 0; i < count; ++i) {
    const Profile p = parse_profile(random_profile(random), "front");
    const double s = support(p);
    if (s == infinity) continue;
    ++finite;
    const double further = std::fmax(0, s) + random.log_between(1e-12, 10);
    for (const double d : {std::fmax(0, std::nextafter(s, infinity)), further}) {
      ck_assert_double_eq(evaluate(p, 0, d, 0).force, 0);
    }
    // The bound is not larger than necessary, either.
    const bool ends_there = p.kind == FS_PROFILE_CONSTANT || p.kind == FS_PROFILE_LINEAR_DECREASING ||
                            (p.kind == FS_PROFILE_INVERSE && !(p.offset < 0 && p.reach > 0));
    if (s > 0 && ends_there) {
      ck_assert_double_gt(evaluate(p, 0, s * (1 - 1e-9), 0).force, 0);
    }
  }
  ck_assert_int_gt(finite, count / 4);
  ck_assert_double_eq(support(Profile{}), -1);
  const auto of = [](const fs_profile& p) { return support(parse_profile(p, "front")); };
  ck_assert_double_eq_tol(of(profile(FS_PROFILE_LINEAR_DECREASING, -100, 5, 10)), 0.05, 1e-15);
  ck_assert_double_eq(of(profile(FS_PROFILE_LINEAR_DECREASING, -100, 5, 10, 0.01)), 0.01);
  ck_assert_double_eq(of(profile(FS_PROFILE_LINEAR_DECREASING, -100, -5, 10)), -1);
  ck_assert_double_eq_tol(of(profile(FS_PROFILE_INVERSE, 1, -5, 10)), 0.2, 1e-15);
  ck_assert_double_eq(of(profile(FS_PROFILE_INVERSE, 1, 0, 10)), infinity);

  const auto of_table = [](std::initializer_list<double> forces) {
    const Ref<const Curve> curve = make_table_curve(forces.begin(), forces.size(), 0.5);
    fs_profile p = profile(FS_PROFILE_CUSTOM, 1, 0, 3);
    p.curve = const_cast<fs_curve*>(curve.get());
    const Profile parsed = parse_profile(p, "front");
    const double s = support(parsed);
    if (s < infinity) ck_assert_double_eq(evaluate(parsed, 0, std::fmax(0, std::nextafter(s, 1e9)), 0).force, 0);
    return s;
  };
  ck_assert_double_eq_tol(of_table({1, 2, 0, -1, std::nan("")}), 1, 1e-14);
  ck_assert_double_eq(of_table({0, 0, 0}), -1);
  ck_assert_double_eq(of_table({1, 0, 1}), infinity);
}
END_TEST

START_TEST(steepest_slope_is_the_steepest) {
  Random random(4);
  const int count = sanitized_times(300, 3000);
  int compared = 0;
  for (int i = 0; i < count; ++i) {
    const Profile p = parse_profile(random_profile(random), "front");
    const double steepest = steepest_slope(p);
    const bool jumps = p.reach > 0 && evaluate(p, 0, p.reach, 0).force > 0;
    ck_assert((steepest == infinity) == jumps);
    if (jumps) continue;
    // The largest slope over many distances is never above the bound and comes near it.
    double largest = 0;
    for (int k = 0; k < 4000; ++k) {
      largest = std::fmax(largest, std::fabs(evaluate(p, 0, 1e-6 * std::exp(k * 6e-3), 0).slope));
    }
    ck_assert_double_le(largest, steepest * (1 + 1e-12));
    if (steepest > 0 && largest == 0) continue;  // a stretch between two of the distances
    ++compared;
    ck_assert_double_ge(largest, (p.kind == FS_PROFILE_GAUSSIAN ? 0.85 : 0.98) * steepest);  // its flank falls fast
  }
  ck_assert_int_gt(compared, count / 3);
  const auto of = [](const fs_profile& p) { return steepest_slope(parse_profile(p, "front")); };
  ck_assert_double_eq(of(profile(FS_PROFILE_CONSTANT, 3, 0, 10)), 0);
  ck_assert_double_eq(of(profile(FS_PROFILE_CONSTANT, 3, 0, 10, 1)), infinity);
  ck_assert_double_eq(of(profile(FS_PROFILE_LINEAR_INCREASING, 100, 20, 10)), 0);
  ck_assert_double_eq_tol(of(profile(FS_PROFILE_INVERSE, 0.01, 0, 10)), 1e4, 1e-9);
  ck_assert_double_eq_tol(of(profile(FS_PROFILE_QUADRATIC, 1000, 0, 10)), 200, 1e-12);
  ck_assert_double_eq_tol(of(profile(FS_PROFILE_GAUSSIAN, 4, 0.01, 10)), 400 * std::exp(-0.5), 1e-12);

  // A table's ramp of 10 N within 1 mm.
  const double ramp[] = {0, 0, 10, 10};
  const Ref<const Curve> table = make_table_curve(ramp, 4, 0.001);
  fs_profile custom = profile(FS_PROFILE_CUSTOM, 1, 0, 100);
  custom.curve = const_cast<fs_curve*>(table.get());
  ck_assert_double_eq_tol(of(custom), 15e3, 100);  // a cubic between two level ends: 1.5 times the secant
  custom.limit = 1e-6;
  ck_assert_double_lt(of(custom), 1000);
  custom.reach = 0.005;
  ck_assert_double_eq(of(custom), infinity);
}
END_TEST

// Setting a profile again and again, with another gain each time, delays no other thread: the curve is not evaluated.
class CountingCurve final : public Curve {
 public:
  std::unique_ptr<Parser> make_parser() const override {
    ++evaluations;
    return nullptr;
  }
  Intensity evaluate(Parser*, double d, double) const noexcept override {
    ++evaluations;
    return {d < 1 ? 1 - d : 0, d < 1 ? -1.0 : 0.0};
  }
  double steepest_slope(double, double) const noexcept override { return 1; }
  double greatest_force(double d) const noexcept override { return std::fmax(1 - d, 0); }
  std::vector<Knot> knots(double, double) const override {
    ++evaluations;
    return {};
  }
  const std::vector<double>* table() const noexcept override { return &entries_; }
  double step() const noexcept override { return 1; }
  mutable int evaluations = 0;

 private:
  const std::vector<double> entries_ = {1, 0};
};

START_TEST(an_object_with_a_curve_does_not_evaluate_it) {
  const Ref<const CountingCurve> curve = make_ref<const CountingCurve>();
  fs_object object = fs_object_init("o", FS_PRIMITIVE_POINT);
  object.front = profile(FS_PROFILE_CUSTOM, 1, 0, 3, 2);
  object.front.curve = const_cast<CountingCurve*>(curve.get());
  Ref<const Object> before;
  for (int i = 0; i < 10; ++i) {
    object.front.gain += 0.1;
    before = parse_object(object, before.get()).object;
    ck_assert_double_eq(before->steepest_slope, infinity);  // the force reverses across a point
    ck_assert_double_eq(steepest_slope(before->law.front), object.front.gain);
  }
  ck_assert_int_eq(curve->evaluations, 0);
}
END_TEST

START_TEST(refusals) {
  const auto refused = [](const fs_profile& p, const char* sentence) {
    const std::string text = refusal(FS_ERROR_INVALID, [&] { parse_profile(p, "front"); });
    ck_assert_says(text, sentence);
  };
  const fs_profile good = profile(FS_PROFILE_CONSTANT, 1, 0, 10);
  fs_profile p = good;
  p.kind = static_cast<fs_profile_kind>(8);
  refused(p, "front.kind is 8, must be an fs_profile_kind (0..7)");
  p.kind = FS_PROFILE_FORCE_32;
  refused(p, "front.kind is 2147483647");
  std::memset(&p.kind, 0xff, sizeof p.kind);  // as a C program can
  refused(p, "front.kind is -1");
  p = good;
  p.sense = static_cast<fs_sense>(2);
  refused(p, "front.sense is 2, must be an fs_sense (0 or 1)");
  double fs_profile::*const numbers[] = {&fs_profile::gain, &fs_profile::offset, &fs_profile::width, &fs_profile::limit,
                                         &fs_profile::reach};
  const char* const names[] = {"gain", "offset", "width", "limit", "reach"};
  for (int kind = 0; kind <= 7; ++kind) {
    for (int i = 0; i < 5; ++i) {
      for (const double bad : {std::nan(""), infinity, -infinity}) {
        p = good;
        p.kind = static_cast<fs_profile_kind>(kind);
        p.*numbers[i] = bad;
        const std::string text = refusal(FS_ERROR_INVALID, [&] { parse_profile(p, "back"); });
        ck_assert_says(text, std::string("back.") + names[i]);
        ck_assert_says(text, "must be finite");
      }
    }
  }
  refused(profile(FS_PROFILE_GAUSSIAN, -3, 0.01, 10), "front.gain is -3, must be >= 0 for a GAUSSIAN profile");
  refused(profile(FS_PROFILE_CONSTANT, -1, 0, 10), "front.gain is -1, must be >= 0 for a CONSTANT profile");
  refused(profile(FS_PROFILE_LINEAR_INCREASING, -1, 0, 10), "must be >= 0 for a LINEAR_INCREASING profile");
  refused(profile(FS_PROFILE_LINEAR_DECREASING, 1, 0, 10),
          "front.gain is 1, must be <= 0 for a LINEAR_DECREASING profile");
  refused(profile(FS_PROFILE_INVERSE, -1, 0, 10), "front.gain is -1, must be >= 0 for an INVERSE profile");
  refused(profile(FS_PROFILE_GAUSSIAN, 1, 0, 10), "front.width is 0, must be > 0 for a GAUSSIAN profile");
  refused(profile(FS_PROFILE_CONSTANT, 1, 2, 10), "front.offset is 2, must be 0 for a CONSTANT profile");
  p = profile(FS_PROFILE_INVERSE, 1, 0, 10);
  p.width = 0.5;
  refused(p, "front.width is 0.5, must be 0 for an INVERSE profile");
  refused(profile(FS_PROFILE_CONSTANT, 1, 0, 0), "front.limit is 0, must be > 0 for a CONSTANT profile");
  refused(profile(FS_PROFILE_CONSTANT, 1, 0, 2e9), "front.limit is 2e+09, must be at most 1e+09 N");
  refused(profile(FS_PROFILE_CONSTANT, 1, 0, 10, -1), "front.reach is -1, must be >= 0 m");
  refused(profile(FS_PROFILE_CUSTOM, 1, 0, 10), "front.curve is null, must be a curve for a CUSTOM profile");
  for (int i = 0; i < 5; ++i) {
    p = {};
    p.*numbers[i] = 1;
    refused(p, (std::string("front.") + names[i] + " is 1, must be 0 for a NONE profile").c_str());
  }
  const double forces[] = {1, 1};
  const Ref<const Curve> curve = make_table_curve(forces, 2, 1);
  p = good;
  p.curve = const_cast<fs_curve*>(curve.get());
  refused(p, "front.curve is given, must be null for a CONSTANT profile");
  p = {};
  p.sense = FS_SENSE_REPULSIVE;
  parse_profile(p, "front");

  // A valid profile comes back unchanged, and keeps its curve.
  p = profile(FS_PROFILE_CUSTOM, 2, 0, 10, 0.5);
  p.curve = const_cast<fs_curve*>(curve.get());
  const Profile parsed = parse_profile(p, "front");
  const fs_profile back = to_c(parsed);
  ck_assert(back.kind == p.kind && back.sense == p.sense && back.gain == p.gain && back.offset == p.offset &&
            back.width == p.width && back.limit == p.limit && back.reach == p.reach && back.curve == p.curve);
  ck_assert(parsed == parse_profile(back, "back"));
  Profile other = parsed;
  other.reach = 0.25;
  ck_assert(!(parsed == other));
}
END_TEST

}  // namespace

int main() {
  return run("profile", {formulas, gain_zero, always_within_limits, slopes_match_differences, nothing_beyond_the_support,
                         steepest_slope_is_the_steepest, an_object_with_a_curve_does_not_evaluate_it, refusals});
}
