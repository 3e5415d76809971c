// How stiffness is shared out: nowhere is there more than the bound, and where there is little nothing is taken away.
#include <algorithm>
#include <cmath>
#include <cstdio>

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

// Some of them belong to one user.
std::vector<Claim> random_claims(scenes::Random& random, size_t count) {
  std::vector<Claim> claims(count);
  uint32_t users = 0;
  for (Claim& c : claims) {
    c.centre = random.in_box(0.2);
    c.radius = random.log_between(1e-3, 0.2);
    c.slope = random.log_between(10, 10'000);
    c.user = c.object = users == 0 || random.coin(0.8) ? users++ : users - 1;
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
  double most = 0;
  const int scenes = scenes::is_sanitized ? 20 : scenes::times(60, 600);
  constexpr int places = 2000;
  for (int k = 0; k < scenes; ++k) {
    const std::vector<Claim> claims = random_claims(random, 1 + random.below(200));
    const size_t users = claims.back().user + 1;
    const double bound = random.log_between(100, 20'000);
    const Shares shares = fair_shares(claims, users, workspace, bound);
    ck_assert_uint_eq(shares.levels.size(), users);
    std::vector<double> wanted(users);
    for (int i = 0; i < places; ++i) {
      const Vec3 x = i % 2 ? random.in_box(0.2) : claims[random.below(claims.size())].centre + random.in_box(0.01);
      if (!(largest_coordinate(x) <= 0.2)) continue;
      std::fill(wanted.begin(), wanted.end(), 0.0);
      for (const Claim& c : claims) wanted[c.user] += is_at(c, x) ? c.slope : 0;
      double total = 0;
      for (size_t u = 0; u < users; ++u) total += std::min(wanted[u], shares.levels[u]);
      most = std::max(most, total / bound);
      ck_assert_double_le(total, bound * (1 + 1e-12));
      // No level is higher than that of the place.
      std::vector<double> here = wanted;
      const double level = level_of(here, bound);
      for (size_t u = 0; u < users; ++u) {
        if (wanted[u] > level) ck_assert_double_le(shares.levels[u], level * (1 + 1e-12));
      }
    }
  }
  std::printf("  %d sets of claims, %d places: at most %.3f of the bound\n", scenes, scenes * places, most);
}
END_TEST

START_TEST(most_wanted_is_found) {
  scenes::Random random(3);
  double worst = 1;
  for (int k = 0; k < (scenes::is_sanitized ? 20 : 200); ++k) {
    std::vector<Claim> claims = random_claims(random, 1 + random.below(60));
    const double found = most_wanted(claims, workspace);
    double most = 0;
    for (int i = 0; i < 4000; ++i) {
      const Claim& one = claims[random.below(claims.size())];
      const Vec3 x = one.centre + random.in_box(i % 4 ? one.radius : 0);
      if (!(largest_coordinate(x) <= 0.2)) continue;
      double sum = 0;
      for (const Claim& c : claims) sum += is_at(c, x) ? c.slope : 0;
      most = std::max(most, sum);
    }
    ck_assert_double_ge(found, most);
    if (most > 0) worst = std::max(worst, found / most);
  }
  std::printf("  found at most %.2f of what is wanted at 4000 places\n", worst);
  ck_assert_double_le(worst, 2);
  ck_assert_double_eq(most_wanted({}, workspace), 0);
}
END_TEST

// The least wants are met, and the others get the same.
START_TEST(levels_are_fair) {
  const auto level = [](std::vector<double> wants, double total) { return level_of(wants, total); };
  ck_assert_double_eq(level({}, 10), INFINITY);
  ck_assert_double_eq(level({3, 7}, 10), INFINITY);
  ck_assert_double_eq(level({100, 1, 2}, 10), 7);
  ck_assert_double_eq(level({6, 6, 1}, 10), 4.5);
  ck_assert_double_eq(level({100, 100, 100, 100}, 10), 2.5);
  scenes::Random random(2);
  for (int k = 0; k < 1000; ++k) {
    std::vector<double> wants(1 + random.below(20));
    for (double& want : wants) want = random.log_between(1, 1000);
    const double total = random.log_between(1, 1000), l = level(wants, total);
    double all = 0, given = 0;
    for (const double want : wants) all += want, given += std::min(want, l);
    ck_assert_double_eq_tol(given, std::min(all, total), 1e-9 * total);
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
    claims[i].user = claims[i].object = static_cast<uint32_t>(i);
  }
  for (const double level : fair_shares(claims, 1000, workspace, 3000).levels) ck_assert_double_eq(level, INFINITY);
  // Two that overlap share; a third beside them does not.
  claims.resize(3);
  claims[1].centre = claims[0].centre + Vec3{0.03, 0, 0};
  claims[2].centre = claims[0].centre + Vec3{0, 0, 0.1};
  const Shares shares = fair_shares(claims, 3, workspace, 4000);
  ck_assert_double_eq(shares.levels[0], 2000);
  ck_assert_double_eq(shares.levels[1], 2000);
  ck_assert_double_eq(shares.levels[2], INFINITY);
  ck_assert_uint_eq(shares.crowd[2], Shares::none);
  const Crowd& crowd = shares.crowds[shares.crowd[0]];
  ck_assert_uint_eq(crowd.count, 2);
  ck_assert_uint_eq(crowd.objects[0] + crowd.objects[1], 1);
  // A chain: the ends do not pay for each other.
  claims[2].centre = claims[1].centre + Vec3{0.03, 0, 0};
  for (const double level : fair_shares(claims, 3, workspace, 4000).levels) ck_assert_double_eq(level, 2000);
}
END_TEST

START_TEST(n_at_one_place_share_equally) {
  for (const size_t count : {2, 16, 1000, 100'000}) {
    std::vector<Claim> claims(count);
    for (uint32_t i = 0; i < count; ++i) claims[i] = {Claim::Region::ball, {0.01, 0, 0}, {}, 0.05, 2000, i, i};
    const Shares shares = fair_shares(claims, count, workspace, 6000);
    for (const double level : shares.levels) {
      if (count == 2) ck_assert_double_eq(level, INFINITY);
      if (count > 2) ck_assert_double_eq(level, 6000.0 / static_cast<double>(count));
    }
    if (count > 2) ck_assert_uint_eq(shares.crowds[shares.crowd[0]].count, count);
  }
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("budget");
  TCase* const all = tcase_create("all");
  tcase_set_timeout(all, 500);
  for (const TTest* test : {nowhere_is_there_more_than_the_bound, most_wanted_is_found, levels_are_fair,
                            what_is_alone_gets_all_of_it,
                            n_at_one_place_share_equally}) {
    tcase_add_test(all, test);
  }
  suite_add_tcase(suite, all);
  SRunner* const runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed > 0;
}
