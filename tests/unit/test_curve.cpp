// Curves: tables that do not overshoot, expressions that do not allocate, and readers.
#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
#include <thread>

#include "law/curve.h"
#include "unit/count_allocations.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

Ref<const Curve> table(const std::vector<double>& forces, double step) {
  return make_table_curve(forces.data(), forces.size(), step);
}

START_TEST(table_goes_through_its_entries) {
  const std::vector<double> forces = {1, 3, -2, std::nan(""), infinity, 4, 4.5, 0.25};
  const std::vector<double> counted = {1, 3, 0, 0, 0, 4, 4.5, 0.25};
  const Ref<const Curve> curve = table(forces, 0.25);
  for (size_t i = 0; i < forces.size(); ++i) {
    ck_assert_double_eq(curve->evaluate(0, 0.25 * static_cast<double>(i), 0).force, counted[i]);
  }
  ck_assert(curve->expression() == nullptr && curve->step() == 0.25);
  const std::vector<double>& given = *curve->table();
  ck_assert_uint_eq(given.size(), forces.size());
  ck_assert(given[2] == -2 && std::isnan(given[3]) && given[4] == infinity);
  for (const double d : {1.75, 2.0, 1e300, infinity}) {
    ck_assert_double_eq(curve->evaluate(0, d, 0).force, 0.25);
    ck_assert_double_eq(curve->evaluate(0, d, 0).slope, 0);
  }
  // Three entries of a parabola that rises: the ends have the parabola's slope, as in PCHIP.
  const Ref<const Curve> parabola = table({1, 2, 5}, 1);
  ck_assert_double_eq_tol(parabola->evaluate(0, 0, 0).slope, 0, 1e-15);
  ck_assert_double_eq_tol(parabola->evaluate(0, 1, 0).slope, 1.5, 1e-15);  // the harmonic mean of 1 and 3
  ck_assert_double_eq_tol(parabola->evaluate(0, std::nextafter(2, 0), 0).slope, 4, 1e-12);
  const Ref<const Curve> line = table({1, 3}, 0.5);
  ck_assert_double_eq_tol(line->evaluate(0, 0.125, 0).force, 1.5, 1e-15);
  ck_assert_double_eq_tol(line->evaluate(0, 0.125, 0).slope, 4, 1e-14);
}
END_TEST

START_TEST(table_never_overshoots) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    std::vector<double> forces(2 + random.below(20));
    for (double& f : forces) f = random.coin(0.3) ? std::floor(random.between(0, 4)) : random.log_between(1e-6, 1e6);
    if (i % 3 == 0) std::sort(forces.begin(), forces.end());
    const double step = random.log_between(1e-6, 1e3);
    const Ref<const Curve> curve = table(forces, step);
    for (size_t k = 0; k + 1 < forces.size(); ++k) {
      const auto [low, high] = std::minmax(forces[k], forces[k + 1]);
      double before = forces[k];
      for (int j = 1; j < 20; ++j) {
        const Intensity here = curve->evaluate(0, (static_cast<double>(k) + j / 20.0) * step, 0);
        ck_assert(here.force >= low && here.force <= high);
        // Monotone within each interval, in value and slope.
        const double sign = forces[k + 1] >= forces[k] ? 1 : -1;
        ck_assert_double_ge(sign * (here.force - before), -1e-12 * high);
        ck_assert_double_ge(sign * here.slope, -1e-9 * high / step);
        before = here.force;
      }
    }
  }
}
END_TEST

START_TEST(table_slopes_match_differences) {
  Random random(2);
  std::vector<double> forces(30);
  for (double& f : forces) f = random.between(0, 5);
  const Ref<const Curve> curve = table(forces, 0.01);
  for (int i = 0; i < 1000; ++i) {
    const double d = random.between(1e-4, 0.29 - 1e-4), h = 1e-7;
    const double difference = (curve->evaluate(0, d + h, 0).force - curve->evaluate(0, d - h, 0).force) / (2 * h);
    ck_assert_double_eq_tol(curve->evaluate(0, d, 0).slope, difference, 0.05);
  }
  // Ends of the numbers.
  for (const double step : {5e-324, 1e-300, 1e300}) {
    for (const double value : {5e-324, 1e300, std::numeric_limits<double>::max()}) {
      const Ref<const Curve> extreme = table({0, value, value, 0, value}, step);
      for (const double d : {0.0, step / 2, 1.5 * step, 2.5 * step, infinity}) {
        const Intensity here = extreme->evaluate(0, d, 0);
        ck_assert(here.force >= 0 && std::isfinite(here.force) && std::isfinite(here.slope));
      }
    }
  }
}
END_TEST

START_TEST(table_refusals) {
  const double forces[] = {1, 2};
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 1, 1); }), "count is 1, must be at least 2");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 0, 1); }), "count is 0");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 2, 0); }), "step is 0, must be > 0 m");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 2, -1); }), "step is -1");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 2, infinity); }), "step is inf");
  ck_assert_says(refusal(FS_ERROR_INVALID, [&] { make_table_curve(forces, 2, std::nan("")); }), "step is nan");
}
END_TEST

// Compared with many samples the slope is never too low, and near them; even if a limit cuts the curve off.
START_TEST(table_knows_its_steepest_slope) {
  Random random(6);
  for (int i = 0; i < 400; ++i) {
    const bool is_long = i % 20 == 0;
    std::vector<double> forces(is_long ? 1000 : 2 + random.below(20));
    for (double& f : forces) f = random.coin(0.3) ? std::floor(random.between(0, 4)) : random.between(0, 5);
    const double step = random.log_between(1e-6, 1e3);
    const Ref<const Curve> curve = table(forces, step);
    const double limit = random.coin(0.3) ? infinity : random.between(0.1, 6);
    const double reach = random.coin(0.3) ? step * random.between(0.1, static_cast<double>(forces.size())) : infinity;
    double largest = 0;
    const size_t samples = 200 * (forces.size() - 1);
    for (size_t k = 0; k <= samples; ++k) {
      const double d = step * static_cast<double>(k) / 200;
      if (d >= reach) break;
      const Intensity here = curve->evaluate(0, d, 0);
      if (here.force < limit) largest = std::fmax(largest, std::fabs(here.slope));
    }
    const double steepest = curve->steepest_slope(limit, reach);
    ck_assert_double_ge(steepest, largest * (1 - 1e-12));
    const bool is_cut = limit < infinity || reach < infinity;
    if (!is_cut || (!is_long && reach == infinity)) ck_assert_double_le(steepest, largest * 1.03 + 1e-9 / step);
    ck_assert_double_eq(curve->greatest_force(0.3 * step), curve->evaluate(0, 0.3 * step, 0).force);
  }
  ck_assert_double_eq(table({1, 1}, 1e-300)->steepest_slope(infinity, infinity), 0);
  ck_assert(table({0, 1e100}, 1e-300)->steepest_slope(infinity, infinity) > 1e300);
}
END_TEST

bool has_expressions() {
  try {
    make_expression_curve("1");
    return true;
  } catch (const Error& error) {
    ck_assert_int_eq(error.status, FS_ERROR_UNSUPPORTED);
    ck_assert_says(error.text, "built without muParser");
    return false;
  }
}

START_TEST(expression_values) {
  if (!has_expressions()) return;
  const auto value = [&](const char* text, double d, double t) {
    const Ref<const Curve> curve = make_expression_curve(text);
    const auto parser = curve->make_parser();
    return curve->evaluate(parser.get(), d, t);
  };
  ck_assert_double_eq_tol(value("3*(1+sin(12*t))*exp(-d/0.01)", 0.02, 0.1).force,
                          3 * (1 + std::sin(1.2)) * std::exp(-2), 1e-14);
  ck_assert_double_eq(value("d > 0.5 ? 2 : t", 0.4, 7).force, 7);
  ck_assert_double_eq(value("min(d, t)", 0.4, 7).force, 0.4);
  ck_assert_double_eq(value("max(1, (2), t)", 0.4, 7).force, 7);
  ck_assert_double_eq(value("d >= 0.4 && t <= 7 && d != t && d == d", 0.4, 7).force, 1);
  for (const char* number : {"0", "1.", ".5", "0.1", "007", "2.5e3", "1E-3", "1.e+2", "17976931348623157e292", "5e-324", "1e-400",
                             "0.1000000000000000055511151231257827021181583404541015625"}) {
    ck_assert_double_eq(value(number, 0.1, 0).force, std::strtod(number, nullptr));
    ck_assert_double_eq(value((std::string("-(-") + number + ")").c_str(), 0.1, 0).force, std::strtod(number, nullptr));
  }
  for (const char* nothing : {"-1", "1/0", "0/0", "-1/0", "sqrt(-1)", "ln(-1)", "exp(1e9)"}) {
    ck_assert_double_eq(value(nothing, 0.1, 0).force, 0);
    ck_assert_double_eq(value(nothing, 0.1, 0).slope, 0);
  }
  // Slopes: to the square of the step, and one-sided at 0.
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const double d = i == 0 ? 0 : random.between(0, 0.05);
    const Intensity here = value("3*exp(-d/0.01)", d, 0);
    ck_assert_double_eq_tol(here.slope, -300 * std::exp(-d / 0.01), i == 0 ? 0.02 : 1e-5);
  }
  for (const double d : {1e10, 1e300, infinity}) {
    const Intensity here = value("3 + 1/(1+d)", d, 0);
    ck_assert_double_eq_tol(here.force, 3, 1e-9);
    ck_assert(std::isfinite(here.slope));
  }
  const Ref<const Curve> curve = make_expression_curve("d + 2");
  ck_assert_str_eq(curve->expression()->c_str(), "d + 2");
  ck_assert(curve->table() == nullptr);
  ck_assert_double_eq(curve->evaluate(nullptr, 1, 0).force, 0);  // without a parser
  std::vector<std::unique_ptr<Curve::Parser>> parsers;
  for (int i = 0; i < 100; ++i) {  // any number of parsers
    parsers.push_back(curve->make_parser());
    ck_assert_double_eq(curve->evaluate(parsers.back().get(), 1, 0).force, 3);
  }
}
END_TEST

START_TEST(expression_knows_its_steepest_slope) {
  if (!has_expressions()) return;
  const auto of = [](const char* text, double limit = infinity, double reach = infinity) {
    return make_expression_curve(text)->steepest_slope(limit, reach);
  };
  ck_assert_double_eq(of("3"), 0);
  ck_assert_double_eq_tol(of("200*d"), 200, 1e-6);
  ck_assert_double_eq_tol(of("3*exp(-d/0.01)"), 300, 1);
  ck_assert_double_eq_tol(of("2*exp(-0.5*(d/0.02)^2)"), 100 * std::exp(-0.5), 1);
  ck_assert_double_eq_tol(of("3*(1+sin(12*t))*exp(-d/0.01)"), 600, 30);          // in time, too
  ck_assert_double_ge(of("d < 0.0123 ? 3 : 0"), 1e6);                             // a jump
  ck_assert_double_eq(of("10 + 0*d", 3), 0);                                      // above the limit
  ck_assert_double_lt(of("0.001/(d+0.0001)", 3), 1.15 * 9000);                  // steep only above it
  ck_assert_double_lt(of("d > 0.1 ? 1000*d : 0", infinity, 0.05), 1e-9);          // beyond the reach
  ck_assert_double_eq_tol(make_expression_curve("3*exp(-d/0.01)")->greatest_force(0), 3, 1e-12);
  ck_assert_double_eq(make_expression_curve("max(0, 3*(1-d/0.05))")->greatest_force(0.05), 0);
  ck_assert_double_gt(make_expression_curve("2*exp(-d/0.05)")->greatest_force(0.05), 0);
}
END_TEST

START_TEST(expression_refusals) {
  if (!has_expressions()) return;
  const auto refused = [](fs_status status, const std::string& text, const char* says) {
    const std::string sentence = refusal(status, [&] { make_expression_curve(text.c_str()); });
    ck_assert_says(sentence, says);
  };
  refused(FS_ERROR_PARSE, "", "empty");
  refused(FS_ERROR_PARSE, "   ", "empty");
  refused(FS_ERROR_INVALID, std::string(250, '(') + "1" + std::string(250, ')'), "more than 255 bytes");
  refused(FS_ERROR_PARSE, "d=5", "column 2 of the expression is '='");
  refused(FS_ERROR_PARSE, "1+(t=3)", "column 5");
  refused(FS_ERROR_PARSE, "d===3", "column 4");
  refused(FS_ERROR_PARSE, "d<==3", "column 4");
  refused(FS_ERROR_PARSE, "d+=3", "column 3");
  refused(FS_ERROR_PARSE, "3,4", "column 2 of the expression is ',' outside of a call");
  refused(FS_ERROR_PARSE, "1+(3,4)", "column 5");
  refused(FS_ERROR_PARSE, "min(1,(3,4))", "column 9");
  refused(FS_ERROR_PARSE, "\"text\"", "strings");
  refused(FS_ERROR_PARSE, "1 +\t2", "byte 0x09");
  refused(FS_ERROR_PARSE, "1 + \xc3\xa9", "column 5 of the expression is byte 0xc3");
  refused(FS_ERROR_PARSE, "3*foo(d)", "column 3 of the expression, at 'foo'");
  refused(FS_ERROR_PARSE, "3*(d", "column");
  refused(FS_ERROR_PARSE, "3*d)", "column 4");
  refused(FS_ERROR_PARSE, "3*", "column");
  refused(FS_ERROR_PARSE, "sin(1,2)", "column");
  refused(FS_ERROR_PARSE, "d ? 1", "column");
  refused(FS_ERROR_PARSE, "x", "at 'x'");
  refused(FS_ERROR_PARSE, "1e400", "column 1 of the expression, at '1e400'");
  refused(FS_ERROR_PARSE, "1..2", "column 3 of the expression, at '.'");
  for (const char* text : {".", "inf", "nan", "0x10", "2e"}) refused(FS_ERROR_PARSE, text, "column ");
  make_expression_curve((std::string(127, '(') + "d" + std::string(127, ')')).c_str());
  std::string minus = "d";
  while (minus.size() + 3 <= 255) minus = "-(" + minus + ")";
  make_expression_curve(minus.c_str());
}
END_TEST

START_TEST(refusals_say_what_is_meant) {
  if (!has_expressions()) return;
  const struct {
    const char *text, *place, *says;
  } cases[] = {
      {"3*foo(d)", "column 3 of the expression, at 'foo': ", "the distance d (m), the time t (s), _e _pi abs acos"},
      {"3*foo(d)", "", " tan tanh"},
      {"2*pow(d,2)", "column 3 of the expression, at 'pow': ", "(write a^b)"},
      {"if(d>1,2,3)", "column 1 of the expression, at 'if': ", "(write condition ? a : b)"},
      {"2*PI*t", "column 3 of the expression, at 'PI': ", "(write _pi)"},
      {"3*x", "column 3 of the expression, at 'x': ", "(the distance is d)"},
      {"r", "column 1 of the expression, at 'r': ", "(the distance is d)"},
      {"1+time", "column 3 of the expression, at 'time': ", "(the time is t)"},
      {"2*D", "column 3 of the expression, at 'D': ", "(write d)"},
      {"Sin(t)", "column 1 of the expression, at 'Sin': ", "(write sin)"},
      {"1+sin", "column 3 of the expression, at 'sin': ", "it is a function: write sin(...)"},
      {"d**2", "column 3 of the expression, at '*': ", "(write a^b)"},
      {"d and t", "column 3 of the expression, at 'and': ", "(write a && b)"},
      {"d % 2", "column 3 of the expression, at '%': ", "not an operator"},
      {"3*(1+sin(12*t)", "column 3 of the expression, at '(': ", "not closed"},
      {"sqrt(d", "column 5 of the expression, at '(': ", "not closed"},
      {"sin(d))", "column 7 of the expression, at ')': ", "one too many"},
      {"2*(3+)", "column 6 of the expression, at ')': ", "a value is missing"},
      {"3*  ", "column 2 of the expression, at '*': ", "a value is missing after it"},
      {"d && ", "column 4 of the expression, at '&': ", "a value is missing after it"},
      {"^d", "column 1 of the expression, at '^': ", "a value is missing before it"},
      {"1+sin(1,2)*3", "column 3 of the expression, at 'sin': ", "too many arguments"},
      {"1+min()+3", "column 3 of the expression, at 'min': ", "too few arguments"},
      {"2 * d t", "column 7 of the expression, at 't': ", "an operator is missing before it"},
      {"2d", "column 2 of the expression, at 'd': ", "an operator is missing before it"},
      {"d ? 1", "column 3 of the expression, at '?': ", "':' is missing"},
      {"d>1 ? (d>2 ? 1 : 2)", "column 5 of the expression, at '?': ", "':' is missing"},
      {"1 : 2", "column 3 of the expression, at ':': ", "'?' is missing"},
      {"d ? : 2", "column 5 of the expression, at ':': ", "a value is missing before it"},
  };
  for (const auto& c : cases) {
    const std::string sentence = refusal(FS_ERROR_PARSE, [&] { make_expression_curve(c.text); });
    ck_assert_msg(sentence.starts_with(c.place) && sentence.find(c.says) != std::string::npos, "%s: %s", c.text,
                  sentence.c_str());
  }
}
END_TEST

START_TEST(any_text_is_taken_or_refused) {
  if (!has_expressions()) return;
  const char* const parts[] = {"d", "t", "1", "2.5e3", "+", "-", "*", "/", "^", "(", ")", ",", "?", ":", "<", ">=",
                               "==", "!=", "&&", "||", "sin(", "min(", "sum(", "if(", "sqrt(", "_pi", " ", "=", ".",
                               "e", "0x", "#", "!"};
  Random random(4);
  int taken = 0;
  for (int i = 0; i < 6000; ++i) {
    std::string text;
    const size_t length = 1 + random.below(i % 10 == 0 ? 80 : 8);
    for (size_t k = 0; k < length; ++k) {
      const std::string byte(1, static_cast<char>(random.below(256)));
      text += random.coin(0.02) ? byte : parts[random.below(std::size(parts))];
    }
    try {
      const Ref<const Curve> curve = make_expression_curve(text.c_str());
      ++taken;
      const auto parser = curve->make_parser();
      const Intensity here = curve->evaluate(parser.get(), random.between(0, 1), random.between(0, 10));
      ck_assert(here.force >= 0 && std::isfinite(here.force) && std::isfinite(here.slope));
    } catch (const Error& error) {
      ck_assert(error.status == FS_ERROR_PARSE || error.status == FS_ERROR_INVALID);
      unsigned column = 1;
      const bool has_column = std::sscanf(error.text.c_str(), "column %u", &column) == 1;
      ck_assert(has_column || error.text.find("column") == std::string::npos);
      ck_assert_msg(column >= 1 && column <= text.size(), "%s: %s", text.c_str(), error.text.c_str());
    }
  }
  ck_assert_int_gt(taken, 100);
}
END_TEST

START_TEST(an_evaluation_does_not_allocate) {
  if (!has_expressions()) return;
  Random random(5);
  const Ref<const Curve> of_table = table({1, 2, 3}, 1);
  for (const char* text : {"3", "d", "3*(1+sin(12*t))*exp(-d/0.01)", "d > 0.5 ? min(1, 2, d, t) : sum(d, t, 3)^2",
                           "1/0", "(d<0.5 && t>1) ? 1 : d<0.7 ? 2 : sqrt(-d)"}) {
    const Ref<const Curve> curve = make_expression_curve(text);
    const auto parser = curve->make_parser();
    const long before = allocations;
    for (int i = 0; i < 1000; ++i) {
      curve->evaluate(parser.get(), random.between(0, 1), random.between(0, 10));
      of_table->evaluate(nullptr, random.between(0, 4), 0);
    }
    ck_assert_int_eq(allocations, before);
  }
}
END_TEST

START_TEST(many_readers_at_once) {
  if (!has_expressions()) return;
  const Ref<const Curve> curve = make_expression_curve("d + t");
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int i = 0; i < 6; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 20; ++k) {
        for (int n = 0; n < 4; ++n) {  // made while others evaluate
          const auto parser = curve->make_parser();
          for (int j = 0; j < 50; ++j) {
            if (curve->evaluate(parser.get(), 0.25 * j, 0.5 * k).force != 0.25 * j + 0.5 * k) ++wrong;
          }
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ck_assert_int_eq(wrong, 0);
}
END_TEST

}  // namespace

int main() {
  if (seeks_races) return run("curve", {many_readers_at_once});
  return run("curve", {table_goes_through_its_entries, table_never_overshoots, table_slopes_match_differences,
                       table_refusals, table_knows_its_steepest_slope, expression_knows_its_steepest_slope,
                       expression_values, expression_refusals,
                       refusals_say_what_is_meant, any_text_is_taken_or_refused, an_evaluation_does_not_allocate,
                       many_readers_at_once});
}
