// How stiffness is shared out: nowhere is there more than the bound, and where there is little nothing is taken away.
#include <cmath>

#include "field/budget.h"
#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;

namespace {

bool is_at(const Claim& c, Vec3 x) {
  if (c.region == Claim::Region::everywhere) return true;
  if (c.region == Claim::Region::ball) return norm(x - c.centre) <= c.radius;
  return std::fabs(dot(c.normal, x - c.centre)) <= c.radius;
}

double given(const Claim& claim, double sum, double bound) { return claim.slope * std::min(1.0, bound / sum); }

std::vector<Claim> random_claims(scenes::Random& random, size_t count) {
  std::vector<Claim> claims(count);
  for (Claim& c : claims) {
    c.centre = random.in_box(0.2);
    c.radius = random.log_between(1e-3, 0.2);
    c.slope = random.log_between(10, 10'000);
    if (random.coin(0.05)) c.region = Claim::Region::everywhere;
    if (random.coin(0.1)) {
      c.region = Claim::Region::slab;
      c.normal = normalized(random.in_box(1));
    }
  }
  return claims;
}

const Box workspace = [] {
  Box box;
  box.add(Vec3{-0.2, -0.2, -0.2});
  box.add(Vec3{0.2, 0.2, 0.2});
  return box;
}();

START_TEST(nowhere_is_there_more_than_the_bound) {
  scenes::Random random(1);
  for (int k = 0; k < 60; ++k) {
    const std::vector<Claim> claims = random_claims(random, 1 + random.below(200));
    const double bound = random.log_between(100, 20'000);
    const std::vector<double> sums = greatest_sums(claims, workspace, bound);
    ck_assert_uint_eq(sums.size(), claims.size());
    for (int i = 0; i < 2000; ++i) {
      const Vec3 x = i % 2 ? random.in_box(0.2) : claims[random.below(claims.size())].centre + random.in_box(0.01);
      if (!(largest_coordinate(x) <= 0.2)) continue;
      double wanted = 0, total = 0;
      for (size_t c = 0; c < claims.size(); ++c) {
        if (!is_at(claims[c], x)) continue;
        wanted += claims[c].slope;
        total += given(claims[c], sums[c], bound);
      }
      ck_assert_double_le(total, bound * (1 + 1e-12));
      for (size_t c = 0; c < claims.size(); ++c) {
        if (is_at(claims[c], x) && wanted > bound) ck_assert_double_ge(sums[c], wanted * (1 - 1e-12));
      }
    }
  }
}
END_TEST

START_TEST(what_is_alone_gets_all_of_it) {
  std::vector<Claim> claims(1000);
  for (size_t i = 0; i < claims.size(); ++i) {
    claims[i].centre = {-0.19 + 0.04 * static_cast<double>(i % 10), -0.19 + 0.04 * static_cast<double>(i / 10 % 10),
                        -0.19 + 0.04 * static_cast<double>(i / 100)};
    claims[i].radius = 0.0199;
    claims[i].slope = 3000;
  }
  for (const double sum : greatest_sums(claims, workspace, 3000)) ck_assert_double_eq(sum, 3000);
  // Two that overlap share; a third beside them does not.
  claims.resize(3);
  claims[1].centre = claims[0].centre + Vec3{0.03, 0, 0};
  claims[2].centre = claims[0].centre + Vec3{0, 0, 0.1};
  const std::vector<double> sums = greatest_sums(claims, workspace, 4000);
  ck_assert_double_eq(sums[0], 6000);
  ck_assert_double_eq(sums[1], 6000);
  ck_assert_double_eq(sums[2], 3000);
  // A chain: the ends do not pay for each other.
  claims[2].centre = claims[1].centre + Vec3{0.03, 0, 0};
  for (const double sum : greatest_sums(claims, workspace, 4000)) ck_assert_double_eq(sum, 6000);
}
END_TEST

START_TEST(n_at_one_place_share_equally) {
  for (const size_t count : {2, 16, 1000, 100'000}) {
    std::vector<Claim> claims(count);
    for (Claim& c : claims) c = {Claim::Region::ball, {0.01, 0, 0}, {}, 0.05, 2000};
    for (const double sum : greatest_sums(claims, workspace, 6000)) {
      ck_assert_double_eq(sum, count * 2000 > 6000 ? static_cast<double>(count) * 2000 : 2000);
    }
  }
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("budget");
  TCase* const all = tcase_create("all");
  tcase_set_timeout(all, 500);
  for (const TTest* test : {nowhere_is_there_more_than_the_bound, what_is_alone_gets_all_of_it, n_at_one_place_share_equally}) {
    tcase_add_test(all, test);
  }
  suite_add_tcase(suite, all);
  SRunner* const runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed > 0;
}
