// Fair bounds: nowhere is there more than the limit, and where there is little nothing is taken away.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "budget/fair.h"
#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;

namespace {

bool is_at(const SlopeWant& c, Vec3 x) {
  if (c.region == SlopeWant::Region::everywhere) return true;
  if (c.region == SlopeWant::Region::ball) return norm(x - c.centre) <= c.radius;
  return std::fabs(dot(c.normal, x - c.centre)) <= c.radius;
}

// Some of them belong to one user.
std::vector<SlopeWant> random_wants(scenes::Random& random, size_t count) {
  std::vector<SlopeWant> wants(count);
  uint32_t users = 0;
  for (SlopeWant& c : wants) {
    c.centre = random.in_box(0.2);
    c.radius = random.log_between(1e-3, 0.2);
    c.slope = random.log_between(10, 10'000);
    c.user = c.object = users == 0 || random.coin(0.8) ? users++ : users - 1;
    if (random.coin(0.05)) c.region = SlopeWant::Region::everywhere;
    if (random.coin(0.1)) {
      c.region = SlopeWant::Region::slab;
      c.normal = normalized(random.in_box(1));
    }
  }
  return wants;
}

const Box workspace = [] {
  Box box;
  box.add(Vec3{-0.2, -0.2, -0.2});
  box.add(Vec3{0.2, 0.2, 0.2});
  return box;
}();

START_TEST(nowhere_is_there_more_than_the_limit) {
  scenes::Random random(1);
  double most = 0;
  const int scenes = scenes::is_sanitized ? 20 : scenes::times(60, 600);
  constexpr int places = 2000;
  for (int k = 0; k < scenes; ++k) {
    const std::vector<SlopeWant> wants = random_wants(random, 1 + random.below(200));
    const size_t users = wants.back().user + 1;
    const double limit = random.log_between(100, 20'000);
    const FairBounds found = fair_bounds(wants, users, workspace, limit);
    ck_assert_uint_eq(found.bounds.size(), users);
    std::vector<double> wanted(users);
    for (int i = 0; i < places; ++i) {
      const Vec3 x = i % 2 ? random.in_box(0.2) : wants[random.below(wants.size())].centre + random.in_box(0.01);
      if (!(largest_coordinate(x) <= 0.2)) continue;
      std::fill(wanted.begin(), wanted.end(), 0.0);
      for (const SlopeWant& c : wants) wanted[c.user] += is_at(c, x) ? c.slope : 0;
      double total = 0;
      for (size_t u = 0; u < users; ++u) total += std::min(wanted[u], found.bounds[u]);
      most = std::max(most, total / limit);
      ck_assert_double_le(total, limit * (1 + 1e-12));
      // No bound is higher than that at the place.
      std::vector<double> here = wanted;
      const double bound = fair_bound(here, limit);
      for (size_t u = 0; u < users; ++u) {
        if (wanted[u] > bound) ck_assert_double_le(found.bounds[u], bound * (1 + 1e-12));
      }
    }
  }
  std::printf("  %d sets of wants, %d places: at most %.3f of the limit\n", scenes, scenes * places, most);
}
END_TEST

START_TEST(most_wanted_is_found) {
  scenes::Random random(3);
  double worst = 1;
  for (int k = 0; k < (scenes::is_sanitized ? 20 : 200); ++k) {
    std::vector<SlopeWant> wants = random_wants(random, 1 + random.below(60));
    const double found = most_wanted(wants, workspace);
    double most = 0;
    for (int i = 0; i < 4000; ++i) {
      const SlopeWant& one = wants[random.below(wants.size())];
      const Vec3 x = one.centre + random.in_box(i % 4 ? one.radius : 0);
      if (!(largest_coordinate(x) <= 0.2)) continue;
      double sum = 0;
      for (const SlopeWant& c : wants) sum += is_at(c, x) ? c.slope : 0;
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
START_TEST(bounds_are_fair) {
  const auto bound = [](std::vector<double> wants, double limit) { return fair_bound(wants, limit); };
  ck_assert_double_eq(bound({}, 10), INFINITY);
  ck_assert_double_eq(bound({3, 7}, 10), INFINITY);
  ck_assert_double_eq(bound({100, 1, 2}, 10), 7);
  ck_assert_double_eq(bound({6, 6, 1}, 10), 4.5);
  ck_assert_double_eq(bound({100, 100, 100, 100}, 10), 2.5);
  scenes::Random random(2);
  for (int k = 0; k < 1000; ++k) {
    std::vector<double> wants(1 + random.below(20));
    for (double& want : wants) want = random.log_between(1, 1000);
    const double total = random.log_between(1, 1000), l = bound(wants, total);
    double all = 0, given = 0;
    for (const double want : wants) all += want, given += std::min(want, l);
    ck_assert_double_eq_tol(given, std::min(all, total), 1e-9 * total);
  }
}
END_TEST

START_TEST(what_is_alone_gets_all_of_it) {
  std::vector<SlopeWant> wants(1000);
  for (size_t i = 0; i < wants.size(); ++i) {
    wants[i].centre = {-0.19 + 0.04 * static_cast<double>(i % 10), -0.19 + 0.04 * static_cast<double>(i / 10 % 10),
                        -0.19 + 0.04 * static_cast<double>(i / 100)};
    wants[i].radius = 0.0199;
    wants[i].slope = 3000;
    wants[i].user = wants[i].object = static_cast<uint32_t>(i);
  }
  for (const double bound : fair_bounds(wants, 1000, workspace, 3000).bounds) ck_assert_double_eq(bound, INFINITY);
  // Two that overlap share; a third beside them does not.
  wants.resize(3);
  wants[1].centre = wants[0].centre + Vec3{0.03, 0, 0};
  wants[2].centre = wants[0].centre + Vec3{0, 0, 0.1};
  const FairBounds found = fair_bounds(wants, 3, workspace, 4000);
  ck_assert_double_eq(found.bounds[0], 2000);
  ck_assert_double_eq(found.bounds[1], 2000);
  ck_assert_double_eq(found.bounds[2], INFINITY);
  ck_assert_uint_eq(found.neighbours_of[2], FairBounds::none);
  const Neighbours& neighbours = found.neighbours[found.neighbours_of[0]];
  ck_assert_uint_eq(neighbours.count, 2);
  ck_assert_uint_eq(neighbours.objects[0] + neighbours.objects[1], 1);
  // A chain: the ends do not pay for each other.
  wants[2].centre = wants[1].centre + Vec3{0.03, 0, 0};
  for (const double bound : fair_bounds(wants, 3, workspace, 4000).bounds) ck_assert_double_eq(bound, 2000);
}
END_TEST

START_TEST(n_at_one_place_share_equally) {
  for (const size_t count : {2, 16, 1000, 100'000}) {
    std::vector<SlopeWant> wants(count);
    for (uint32_t i = 0; i < count; ++i) wants[i] = {SlopeWant::Region::ball, {0.01, 0, 0}, {}, 0.05, 2000, i, i};
    const FairBounds found = fair_bounds(wants, count, workspace, 6000);
    for (const double bound : found.bounds) {
      if (count == 2) ck_assert_double_eq(bound, INFINITY);
      if (count > 2) ck_assert_double_eq(bound, 6000.0 / static_cast<double>(count));
    }
    if (count > 2) ck_assert_uint_eq(found.neighbours[found.neighbours_of[0]].count, count);
  }
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("budget");
  TCase* const all = tcase_create("all");
  tcase_set_timeout(all, 500);
  for (const TTest* test : {nowhere_is_there_more_than_the_limit, most_wanted_is_found, bounds_are_fair,
                            what_is_alone_gets_all_of_it, n_at_one_place_share_equally}) {
    tcase_add_test(all, test);
  }
  suite_add_tcase(suite, all);
  SRunner* const runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed > 0;
}
