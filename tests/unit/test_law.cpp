// Laws with a bound on their slope, against a numeric infimal convolution over both sides.
#include <cstring>
#include <limits>
#include <string>

#include "law/law.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

fs_profile profile(fs_profile_kind kind, fs_sense sense, double gain, double offset_or_width, double limit,
                   double reach = 0) {
  fs_profile p = fs_profile_init(kind, sense, gain, offset_or_width, limit);
  p.reach = reach;
  return p;
}

// A law of the given profiles; a null one is of kind NONE.
Law law_of(const fs_profile& front, const fs_profile* back = nullptr) {
  Law law;
  law.front = parse_profile(front, "front");
  if (back) law.back = parse_profile(*back, "back");
  law.support = std::fmax(support(law.front), support(law.back));
  return law;
}

Ref<const Curve> random_table(Random& random) {
  std::vector<double> forces(2 + random.below(12));
  for (double& force : forces) {
    force = random.coin(0.2) ? 0 : random.coin(0.05) ? NAN : random.between(-1, 6);
  }
  return make_table_curve(forces.data(), forces.size(), random.log_between(1e-4, 1e-2));
}

// A profile whose forces and distances are of the size that a hand feels.
fs_profile random_profile(Random& random, std::vector<Ref<const Curve>>& curves) {
  const auto kind = static_cast<fs_profile_kind>(1 + random.below(7));
  const fs_sense sense = random.coin() ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE;
  const double force = random.log_between(0.1, 20), width = random.log_between(1e-3, 0.1);
  const double limit = random.coin(0.3) ? 1e3 : random.log_between(0.1, 20);
  fs_profile p = profile(kind, sense, 0, 0, limit, random.coin() ? 0 : random.log_between(1e-3, 0.2));
  const double offset = random.coin(0.3) ? 0 : random.between(-5, 10);
  switch (kind) {
    case FS_PROFILE_CONSTANT:
      p.gain = force;
      break;
    case FS_PROFILE_LINEAR_INCREASING:
    case FS_PROFILE_LINEAR_DECREASING:
      p.gain = (kind == FS_PROFILE_LINEAR_INCREASING ? 1 : -1) * force / width;
      p.offset = offset;
      break;
    case FS_PROFILE_GAUSSIAN:
      p.gain = force;
      p.width = width;
      break;
    case FS_PROFILE_QUADRATIC:
      p.gain = (random.coin() ? 1 : -1) * force / width / width;
      p.offset = offset;
      break;
    case FS_PROFILE_INVERSE:
      p.gain = force * width;
      p.offset = offset;
      break;
    default:
      p.gain = random.log_between(0.1, 5);
      curves.push_back(random_table(random));
      p.curve = const_cast<fs_curve*>(curves.back().get());
  }
  if (random.coin(0.05)) p.gain = std::copysign(0, p.gain);
  return p;
}

struct RandomLaw {
  std::vector<Ref<const Curve>> curves;
  Law law;
  double slope;  // N/m, its cap

  explicit RandomLaw(Random& random) {
    const fs_profile front = random_profile(random, curves), back = random_profile(random, curves);
    const bool has_back = random.coin(0.7);
    law = law_of(front, has_back ? &back : nullptr);
    if (random.coin(0.1)) std::swap(law.front, law.back);
    slope = random.log_between(20, 5000);
  }
  std::string text() const {
    char out[400];
    const Profile& f = law.front;
    const Profile& b = law.back;
    std::snprintf(out, sizeof out,
                  "front %d %d gain %.17g offset %.17g width %.17g limit %.17g reach %.17g, "
                  "back %d %d gain %.17g offset %.17g width %.17g limit %.17g reach %.17g, slope %.17g",
                  f.kind, f.sense, f.gain, f.offset, f.width, f.limit, f.reach, b.kind, b.sense, b.gain, b.offset, b.width,
                  b.limit, b.reach, slope);
    return out;
  }
};

// min over s of |g(s)| + slope |x - s| on a grid, where g has the sign `sign`; 0 where it has not.
std::vector<double> convolved(const std::vector<double>& places, const std::vector<double>& g, double sign, double slope) {
  std::vector<double> out(g.size());
  for (size_t i = 0; i < g.size(); ++i) out[i] = std::fmax(sign * g[i], 0);
  for (size_t i = 1; i < g.size(); ++i) out[i] = std::fmin(out[i], out[i - 1] + slope * (places[i] - places[i - 1]));
  for (size_t i = g.size(); i-- > 1;) out[i - 1] = std::fmin(out[i - 1], out[i] + slope * (places[i] - places[i - 1]));
  return out;
}

// Compares `with` to the numeric infimal convolution of `law`, on grids of 2 half + 1 places and others. tolerance: of the
// greatest force.
void compare(const Law& law, const Law& with, double slope, double t, const std::string& text, double tolerance,
             int half = 1000, std::initializer_list<double> windows = {2.5, 20.0}) {
  const Law::Parsers parsers = law.make_parsers();
  double most = 0;
  for (int i = -400; i <= 400; ++i) {
    const double s = std::copysign(i == 0 ? 0 : 1e-6 * std::exp(std::abs(i) * 0.04), i);
    most = std::fmax(most, std::fabs(law.at(s, t, &parsers).force));
  }
  if (most == 0) return;
  // Farther away than most/slope nothing can matter.
  for (const double window : windows) {
    const double size = window * most / slope, step = size / half;
    static std::vector<double> places, g, h;  // kept, as making them again takes longer than the rest
    places.assign(1, -1e-12);  // the back's value at s = 0
    g.clear();
    h.clear();
    for (int i = -half; i <= half; ++i) places.push_back(i * step);
    constexpr int parts = 16;  // of an interval of a table, which may be steep and narrow
    for (int i = 0; i < 12 * parts; ++i) {
      if (law.front.curve) places.push_back(law.front.curve->step() / parts * i);
      if (law.back.curve) places.push_back(law.back.curve->step() / parts * -i);
    }
    std::sort(places.begin(), places.end());
    for (const double s : places) {
      g.push_back(law.at(s, t, &parsers).force);
      h.push_back(with.at(s, t, &parsers).force);
    }
    const std::vector<double> above = convolved(places, g, 1, slope), below = convolved(places, g, -1, slope);
    for (size_t i = 0; i < places.size(); ++i) {
      if (std::fabs(places[i]) > size - most / slope) continue;
      const double wanted = above[i] - below[i], got = h[i], sign = std::copysign(1, wanted);
      // The places of the grid are fewer than all, so their least is a little larger.
      ck_assert_msg(sign * got <= sign * wanted + 1e-9 * most + tolerance * most,
                    "at %.9g, t %g: %.12g, should be %.12g: too strong: %s", places[i], t, got, wanted, text.c_str());
      ck_assert_msg(sign * got >= sign * wanted - 2 * slope * step - 1e-9 * most - tolerance * most,
                    "at %.9g, t %g: %.12g, should be %.12g: too weak: %s", places[i], t, got, wanted, text.c_str());
    }
  }
}

// A place where something may go wrong: on either side, near an end of a part, or anywhere.
double random_place(const RandomLaw& it, Random& random) {
  const double sign = random.coin() ? 1 : -1;
  const Profile& side = sign > 0 ? it.law.front : it.law.back;
  double d = random.coin(0.2) ? 0 : random.log_between(1e-6, 0.3);
  if (random.coin(0.2) && side.reach > 0) d = side.reach;
  if (random.coin(0.2) && side.cap && side.cap->bend < 1) d = side.cap->bend;
  if (random.coin(0.2) && side.curve) d = side.curve->step() * random.below(12);
  if (random.coin()) d = std::fabs(d + random.between(-1, 1) * random.log_between(1e-9, 1e-3));
  return sign * d;
}

START_TEST(is_the_infimal_convolution) {
  Random random(1301);
  const int count = sanitized_times(100, 2000);
  int lowered = 0;
  for (int i = 0; i < count; ++i) {
    const RandomLaw it(random);
    const Law with = capped(it.law, it.slope);
    lowered += with.front.cap || with.back.cap;
    compare(it.law, with, it.slope, 0, it.text(), it.curves.empty() ? 0 : 0.005);
  }
  ck_assert_int_gt(lowered, count / 2);
}
END_TEST

START_TEST(never_above_and_never_steeper) {
  Random random(1302);
  const int count = sanitized_times(500, 10000);
  for (int i = 0; i < count; ++i) {
    RandomLaw it(random);
    const Law raw = it.law;
    const Law with = it.law = capped(raw, it.slope);
    for (int k = 0; k < 60; ++k) {
      const double a = random_place(it, random);
      const double b = random.coin(0.3) ? -a : random.coin() ? random_place(it, random) : a + random.between(-1e-5, 1e-5);
      const Intensity at_a = with.at(a, 0, nullptr), at_b = with.at(b, 0, nullptr), full = raw.at(a, 0, nullptr);
      ck_assert_msg(std::fabs(at_a.force) <= std::fabs(full.force) && at_a.force * full.force >= 0,
                    "at %.17g: %.17g of %.17g: %s", a, at_a.force, full.force, it.text().c_str());
      ck_assert_msg(std::fabs(at_a.force - at_b.force) <= it.slope * std::fabs(a - b) * (1 + 1e-6) + 1e-11,
                    "from %.17g to %.17g: %.17g to %.17g: %s", a, b, at_a.force, at_b.force, it.text().c_str());
      ck_assert_double_le(std::fabs(at_a.slope), it.slope);
    }
    ck_assert_double_le(slope_of(with), it.slope);
  }
}
END_TEST

START_TEST(slopes_match_differences) {
  Random random(1303);
  const int count = sanitized_times(500, 5000);
  int compared = 0, different = 0;
  for (int i = 0; i < count; ++i) {
    const RandomLaw it(random);
    const Law with = capped(it.law, it.slope);
    for (int k = 0; k < 10; ++k) {
      const double s = (random.coin() ? 1 : -1) * random.log_between(1e-5, 0.2), h = 1e-6 * std::fabs(s);
      const double difference = (with.at(s + h, 0, nullptr).force - with.at(s - h, 0, nullptr).force) / (2 * h);
      ++compared;
      if (std::fabs(with.at(s, 0, nullptr).slope - difference) > 1e-4 * it.slope) ++different;  // a bend is between them
    }
  }
  ck_assert_int_lt(different, compared / 500);
}
END_TEST

START_TEST(without_effect_the_bits_stay) {
  Random random(1304);
  const int count = sanitized_times(500, 5000);
  int steady = 0;
  for (int i = 0; i < count; ++i) {
    const RandomLaw it(random);
    const double steepest = slope_of(it.law);
    std::vector<double> slopes{infinity};
    if (steepest < infinity && steepest > 0) slopes.push_back(steepest);
    steady += slopes.size() > 1;
    for (const double slope : slopes) {
      const Law with = capped(capped(it.law, it.slope), slope);  // replaces the cap before it
      ck_assert(!with.front.cap && !with.back.cap);
      for (int k = 0; k < 20; ++k) {
        const double s = random_place(it, random);
        const Intensity a = it.law.at(s, 0, nullptr), b = with.at(s, 0, nullptr);
        ck_assert(std::memcmp(&a, &b, sizeof a) == 0);
      }
      ck_assert_double_eq(slope_of(with), steepest);
    }
  }
  ck_assert_int_gt(steady, count / 50);
}
END_TEST

// Numbers that can be checked by hand.
START_TEST(examples) {
  constexpr fs_sense pull = FS_SENSE_ATTRACTIVE, push = FS_SENSE_REPULSIVE;
  const auto at = [](const Law& law, double s) { return law.at(s, 0, nullptr).force; };
  // A constant force to or from a point begins as a spring.
  Law law = capped(law_of(profile(FS_PROFILE_CONSTANT, pull, 3, 0, 10)), 1000);
  ck_assert_double_eq_tol(at(law, 0.001), -1, 1e-12);
  ck_assert_double_eq_tol(at(law, 0.01), -3, 1e-12);
  ck_assert_double_eq(at(law, infinity), -3);
  ck_assert_double_eq(slope_of(law), 1000);
  law = capped(law_of(profile(FS_PROFILE_CONSTANT, push, 3, 0, 10, 0.01)), 1000);
  ck_assert_double_eq_tol(at(law, 0.001), 1, 1e-12);
  ck_assert_double_eq_tol(at(law, 0.0095), 0.5, 1e-12);
  ck_assert_double_eq(at(law, 0.01), 0);
  // gain/d: the tangent below sqrt(gain/k) = 2 mm, where the force is sqrt(gain k) = 10 N.
  law = capped(law_of(profile(FS_PROFILE_INVERSE, push, 0.02, 0, 100)), 5000);
  ck_assert_double_eq_tol(at(law, 0.002), 10, 1e-12);
  ck_assert_double_eq_tol(at(law, 0.001), 5, 1e-12);
  ck_assert_double_eq_tol(at(law, 0.004), 5, 1e-12);
  // A wall whose front pushes the same way goes on from the lesser of the two forces; one that pushes back begins at 0.
  const fs_profile wall = profile(FS_PROFILE_CONSTANT, pull, 20, 0, 100);
  law = capped(law_of(profile(FS_PROFILE_INVERSE, push, 0.02, 0, 100), &wall), 5000);
  ck_assert_double_eq_tol(at(law, 0.001), 15, 1e-12);
  ck_assert_double_eq_tol(at(law, 0), 20, 1e-12);
  ck_assert_double_eq_tol(at(law, -0.001), 20, 1e-12);
  law = capped(law_of(profile(FS_PROFILE_CONSTANT, push, 5, 0, 100), &wall), 5000);
  ck_assert_double_eq_tol(at(law, -0.001), 10, 1e-12);
  ck_assert_double_eq_tol(at(law, 0), 5, 1e-12);
  law = capped(law_of(profile(FS_PROFILE_CONSTANT, pull, 5, 0, 100), &wall), 5000);
  ck_assert_double_eq_tol(at(law, -0.001), 5, 1e-12);
  ck_assert_double_eq_tol(at(law, 0.0005), -2.5, 1e-12);
  // A force that is constant across the plane has nothing to be capped.
  const fs_profile same = profile(FS_PROFILE_CONSTANT, pull, 5, 0, 100);
  Law through = law_of(profile(FS_PROFILE_CONSTANT, push, 5, 0, 100), &same);
  ck_assert(!capped(through, 1).front.cap);
  ck_assert_double_eq(slope_of(through), 0);
  // At a surface with edges it would turn at once, so it begins there.
  through.has_edges = true;
  ck_assert_double_eq(slope_of(through), infinity);
  law = capped(through, 1000);
  ck_assert_double_eq_tol(at(law, 0.001), 1, 1e-12);
  ck_assert_double_eq(at(law, 0), 0);
  ck_assert_double_eq_tol(at(law, -0.001), 1, 1e-12);
  ck_assert_double_eq_tol(at(law, -0.01), 5, 1e-12);
  ck_assert_double_eq(slope_of(law), 1000);
}
END_TEST

START_TEST(extremes_stay_finite) {
  Random random(1305);
  const double extremes[] = {5e-324, 1e-300, 1e-9, 1, 1e9, 1e300, std::numeric_limits<double>::max()};
  for (int i = 0; i < sanitized_times(2000, 20000); ++i) {
    std::vector<Ref<const Curve>> curves;
    fs_profile sides[2] = {random_profile(random, curves), random_profile(random, curves)};
    for (fs_profile& p : sides) {
      if (random.coin()) p.gain = std::copysign(extremes[random.below(7)], p.gain);
      if (random.coin() && p.offset != 0) p.offset = std::copysign(extremes[random.below(7)], p.offset);
      if (random.coin() && p.width != 0) p.width = extremes[random.below(7)];
      if (random.coin() && p.reach != 0) p.reach = extremes[random.below(7)];
    }
    const Law raw = law_of(sides[0], &sides[1]);
    const double slope = extremes[random.below(7)];
    const Law with = capped(raw, slope);
    for (const double d : {0.0, 5e-324, 1e-3, 1e3, 1e300, infinity, random.log_between(1e-300, 1e300)}) {
      for (const double s : {d, -d}) {
        const Intensity g = with.at(s, 0, nullptr);
        ck_assert(std::isfinite(g.force) && std::fabs(g.force) <= std::fabs(raw.at(s, 0, nullptr).force));
        ck_assert(std::isfinite(g.slope) && std::fabs(g.slope) <= std::fmax(slope, slope_of(with)));
      }
    }
  }
}
END_TEST

// Near its zero such a force is a difference of numbers that are far larger than it: it is rounded by up to the limit.
START_TEST(a_large_offset_makes_no_jump) {
  const double slope = 5000;
  for (const double offset : {1e12, 1e15, 1e16, 1e17, 1e18, 1e20, 1e200}) {
    for (const double zero : {1e-5, 0.0031, 0.0100244, 0.3}) {
      const fs_profile sides[] = {
          fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, offset / zero, -offset, 5),
          fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -offset / zero, offset, 5),
          fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, offset / zero / zero, -offset, 5),
          fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, -offset / zero / zero, offset, 5),
          fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_ATTRACTIVE, offset * zero, -offset, 5)};
      for (const fs_profile& side : sides) {
        const Law raw = law_of(side, nullptr), with = capped(raw, slope);
        ck_assert_msg(slope_of(raw) > slope && slope_of(with) <= slope, "kind %d, offset %g: %g N/m, capped %g N/m",
                      side.kind, side.offset, slope_of(raw), slope_of(with));
        for (const double step : {1e-16 * zero, 1e-12 * zero, 1e-7}) {
          double before = std::fmax(zero - 40 * step, 0);
          for (int i = -39; i < 40; ++i) {
            const double d = std::fmax(zero + i * step, 0);
            const double change = with.at(d, 0, nullptr).force - with.at(before, 0, nullptr).force;
            ck_assert_msg(std::fabs(change) <= slope * std::fabs(d - before) + 1e-9,
                          "kind %d, offset %g: %g N within %g m at %g", side.kind, side.offset, change, d - before, d);
            before = d;
          }
        }
      }
    }
  }
}
END_TEST

#ifdef FORCESERVER_EXPRESSIONS
START_TEST(expressions) {
  Random random(1306);
  const char* const texts[] = {"5",
                               "d<0.01 ? 5 : 0",
                               "d<0.01 ? 0 : 5",
                               "d>0.02 && d<0.03 ? 4 : 0.5",
                               "5*exp(-d/0.001)",
                               "3+3*sin(d*2000)",
                               "0.01/d",
                               "1000*d",
                               "6*exp(-((d-0.03)/0.002)^2)",
                               "3*(1+sin(12*t))*exp(-d/0.001)",
                               "d<0.01 ? 2.5+2.5*sin(t) : 0",
                               "6*exp(-((d-0.03-0.01*sin(t))/0.002)^2)",
                               "min(5, 3*t)"};
  for (const char* const front_text : texts) {
    for (const char* const back_text : {"d<0.005 ? 3 : 0", "2+sin(t)", "40*d"}) {
      const Ref<const Curve> front = make_expression_curve(front_text), back = make_expression_curve(back_text);
      for (const fs_sense sense : {FS_SENSE_ATTRACTIVE, FS_SENSE_REPULSIVE}) {
        fs_profile f = profile(FS_PROFILE_CUSTOM, sense, 1, 0, 8), b = profile(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 8);
        f.curve = const_cast<fs_curve*>(front.get());
        b.curve = const_cast<fs_curve*>(back.get());
        const Law raw = law_of(f, &b);
        const Law::Parsers parsers = raw.make_parsers();
        for (const double slope : {200.0, 2000.0}) {
          const Law with = capped(raw, slope);
          const std::string text = std::string(front_text) + ", " + back_text + ", slope " + std::to_string(slope);
          ck_assert_double_le(slope_of(with), slope);
          const bool is_timed = std::strchr(front_text, 't') || std::strchr(back_text, 't');
          for (const double t : {0.0, 0.4, 2.0}) {
            if (!is_timed && t > 0) break;
            if (!is_timed) compare(raw, with, slope, t, text, 0.005, 8000, {2.5});
            for (int i = 0; i < 500; ++i) {
              const double s = random.between(-0.06, 0.06), other = s + random.between(-1, 1) * random.log_between(1e-6, 1e-2);
              const double here = with.at(s, t, &parsers).force, full = raw.at(s, t, &parsers).force;
              const double there = with.at(other, t, &parsers).force;
              ck_assert_msg(std::fabs(here) <= std::fabs(full) && here * full >= 0, "at %g: %g of %g: %s", s, here, full,
                            text.c_str());
              ck_assert_msg(std::fabs(here - there) <= 1.02 * slope * std::fabs(s - other) + 1e-9,
                            "from %.9g to %.9g, t %g: %.9g to %.9g: %s", s, other, t, here, there, text.c_str());
            }
          }
        }
      }
    }
  }
}
END_TEST

// A curve that depends on time loses little more than it must: an eighth of the force at most, a place nearer to a jump.
START_TEST(timed_expressions) {
  for (const char* const text : {"d<0.01 ? 2.5+2.5*sin(t) : 0", "6*exp(-((d-0.03-0.01*sin(t))/0.002)^2)"}) {
    const Ref<const Curve> curve = make_expression_curve(text);
    fs_profile f = profile(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 8);
    f.curve = const_cast<fs_curve*>(curve.get());
    const Law raw = law_of(f), with = capped(raw, 1000);
    for (const double t : {0.0, 0.4, 2.0}) compare(raw, with, 1000, t, text, 0.125, 4000, {2.5});
  }
}
END_TEST
#endif

}  // namespace

int main() {
  Suite* suite = suite_create("law");
  TCase* cases = tcase_create("law");
  tcase_set_timeout(cases, 500);
  tcase_add_test(cases, is_the_infimal_convolution);
  tcase_add_test(cases, never_above_and_never_steeper);
  tcase_add_test(cases, slopes_match_differences);
  tcase_add_test(cases, without_effect_the_bits_stay);
  tcase_add_test(cases, examples);
  tcase_add_test(cases, extremes_stay_finite);
  tcase_add_test(cases, a_large_offset_makes_no_jump);
#ifdef FORCESERVER_EXPRESSIONS
  tcase_add_test(cases, expressions);
  tcase_add_test(cases, timed_expressions);
#endif
  suite_add_tcase(suite, cases);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_ENV);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed ? 1 : 0;
}
