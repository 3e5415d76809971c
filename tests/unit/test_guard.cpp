// The guard: what it changes, and what it must leave as it is. And what the loop can render, by which it is set up.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <vector>

#include "servo/guard.h"
#include "servo/local_model.h"
#include "budget/loop.h"

#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;

namespace {

constexpr double never = std::numeric_limits<double>::infinity();
constexpr double period = 1e-3;  // s

fs_response response_of(Vec3 force, Vec3 torque = {}) {
  fs_response out{};
  out.wrench = {force, torque};
  return out;
}

fs_state hand_at(Vec3 x, double time) {
  fs_state out{};
  out.pose = {x, identity_quat()};
  out.time = time;
  return out;
}

// Without ramp, and without what a test does not set.
Guard::Limits limits_with(double damping = 0, double slew = never) { return {10, 1, never, 0, period, damping, slew}; }

double distance(const Mat3& a, const Mat3& b) {
  const Mat3 d = a + -1.0 * b;
  return std::max({norm(Vec3{d.xx, d.xy, d.xz}), norm(Vec3{d.yx, d.yy, d.yz}), norm(Vec3{d.zx, d.zy, d.zz})});
}

Mat3 random_matrix(scenes::Random& random, double size) {
  const auto row = [&] { return random.in_box(size); };
  const Vec3 x = row(), y = row(), z = row();
  return {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
}

START_TEST(guard_limits_ramps_and_latches) {
  Guard guard({10, 1, 2, 0.5, 1e-3, 0, never, 3, 0});
  fs_state state{};
  state.pose = identity_pose();
  const fs_response wanted = response_of({30, 0, 40}, {1, 0, 0});
  Wrench sent = guard.apply({state, false, 0}, wanted).wrench;
  ck_assert(sent.force == Vec3{});
  ck_assert_uint_eq(guard.faults(), FS_FAULT_DEVICE);
  guard.set_enabled(true);
  ck_assert_uint_eq(guard.faults(), FS_FAULT_DEVICE);  // it ends when the device is ready
  for (int i = 1; i <= 600; ++i) {
    sent = guard.apply({state, true, 0}, wanted).wrench;
    ck_assert_double_eq_tol(norm(sent.force), 10 * std::fmin(1, i / 500.0), 1e-9);
    ck_assert_double_eq_tol(sent.force.z / sent.force.x, 40.0 / 30, 1e-12);
    ck_assert(guard.has_guarded());
    ck_assert(sent.torque == Vec3{});  // it has none
  }
  guard.apply({state, true, 0.025}, wanted);  // one stall: only the ramp
  ck_assert_uint_eq(guard.faults(), 0);
  for (int i = 0; i < 600; ++i) sent = guard.apply({state, true, 0}, response_of({1, 0, 0})).wrench;
  ck_assert_double_eq(sent.force.x, 1);
  ck_assert(!guard.has_guarded());
  for (int i = 0; i < 19; ++i) guard.apply({state, true, 0.002}, wanted);
  ck_assert_uint_eq(guard.faults(), 0);
  guard.apply({state, true, 0.002}, wanted);
  ck_assert_uint_eq(guard.faults(), FS_FAULT_LATE);
  ck_assert(guard.apply({state, true, 0}, wanted).wrench.force == Vec3{});
  guard.set_enabled(true);
  ck_assert_double_gt(norm(guard.apply({state, true, 0}, wanted).wrench.force), 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ck_assert(guard.apply({state, true, 0}, response_of({nan, 0, 0})).wrench.force == Vec3{});
  ck_assert_uint_eq(guard.faults(), FS_FAULT_NUMBER);
  guard.set_enabled(true);
  state.twist.linear = {0, 2.5, 0};
  guard.apply({state, true, 0}, wanted);
  ck_assert_uint_eq(guard.faults(), FS_FAULT_SPEED);
}
END_TEST


// Whatever is wanted: with every protection off only the limits act, as plain arithmetic.
START_TEST(protections_off_change_no_bit) {
  scenes::Random random(3);
  Guard guard(limits_with());
  for (int i = 0; i < 20000; ++i) {
    const fs_state state = hand_at(random.in_box(0.1), i * period);
    fs_response wanted = response_of(random.in_box(12), random.in_box(1));
    wanted.stiffness = random_matrix(random, 1000);
    Wrench expected = wanted.wrench;
    const double force = norm(expected.force), torque = norm(expected.torque);
    if (force > 10) expected.force = (10 / force) * expected.force;
    if (torque > 1) expected.torque = (1 / torque) * expected.torque;
    const Guard::GuardedForce out = guard.apply({state, true, 0}, wanted);
    ck_assert_int_eq(std::memcmp(&out.wrench, &expected, sizeof expected), 0);
    if (force <= 10) ck_assert_int_eq(std::memcmp(&out.stiffness, &wanted.stiffness, sizeof out.stiffness), 0);
    ck_assert(guard.has_guarded() == (force > 10 || torque > 1));
  }
}
END_TEST

START_TEST(damping_opposes_the_filtered_velocity) {
  const double damping = 5, gain = 1 - std::exp(-2 * std::numbers::pi * 100 * period);
  Guard guard(limits_with(damping));
  double filtered = 0;
  Vec3 force{};
  for (int i = 0; i < 100; ++i) {
    force = guard.apply({hand_at({0.2 * i * period, 0, -0.1 * i * period}, i * period), true, 0}, response_of({1, 0, 0}))
                .wrench.force;
    if (i > 0) filtered += gain * (0.2 - filtered);
    ck_assert_double_eq_tol(force.x, 1 - damping * filtered, 1e-9);
    ck_assert_double_eq_tol(force.z, damping * filtered / 2, 1e-9);
    ck_assert(!guard.has_guarded());
  }
  ck_assert_double_eq_tol(force.x, 0, 1e-9);  // 0.2 m/s times 5 N s/m
  // It is part of what is limited, and of no force at all.
  const Vec3 fast = guard.apply({hand_at({1, 0, 0}, 0.1), true, 0}, response_of({})).wrench.force;
  ck_assert_double_eq_tol(norm(fast), 10, 1e-9);
  guard.set_enabled(false);
  ck_assert(guard.apply({hand_at({2, 0, 0}, 0.101), true, 0}, response_of({})).wrench.force == Vec3{});
  ck_assert(!guard.has_guarded());
  guard.set_enabled(true);
  // A pose that jumps while the device is not ready is no velocity.
  guard.apply({hand_at({0, 0, 0}, 0.102), false, 0}, response_of({}));
  ck_assert(guard.apply({hand_at({0.5, 0, 0}, 0.103), true, 0}, response_of({})).wrench.force == Vec3{});
  // A velocity beyond all numbers is a fault.
  guard.apply({hand_at({1.7e308, 0, 0}, 0.104), true, 0}, response_of({}));
  ck_assert_uint_eq(guard.faults(), FS_FAULT_NUMBER);
}
END_TEST

START_TEST(slew_limits_each_change) {
  Guard guard(limits_with(0, 1000));  // 1 N in a tick
  const fs_state state = hand_at({}, 0);
  Vec3 before{};
  for (int i = 1; i <= 5; ++i) {
    const Vec3 sent = guard.apply({state, true, 0}, response_of({3, 0, 4})).wrench.force;
    ck_assert_double_eq_tol(norm(sent - before), 1, 1e-12);
    ck_assert_double_eq_tol(sent.x / sent.z, 0.75, 1e-12);
    before = sent;
    ck_assert(guard.has_guarded() == (i < 5));
  }
  const Vec3 late = guard.apply({state, true, 0.002}, response_of({-3, 0, -4})).wrench.force;
  ck_assert_double_eq_tol(norm(late - before), 3, 1e-12);  // a tick that is 2 ms late may change more
  ck_assert(guard.apply({state, false, 0}, response_of({3, 0, 4})).wrench.force == Vec3{});  // a fault ends the force at once
  const Vec3 again = guard.apply({state, true, 0}, response_of({3, 0, 4})).wrench.force;
  ck_assert_double_eq_tol(norm(again), 1, 1e-12);
}
END_TEST

// The stiffness that is passed on is the derivative of the force that is sent, by finite differences.
// Another damping comes in even steps, a higher slew limit at once, and a lower one within a second.
START_TEST(the_loop_may_change) {
  Guard::Limits limits = limits_with(8, 1000);
  limits.blend = 0.02;
  Guard guard(limits);
  double x = 0, time = 0;
  const auto next = [&](double wanted, double speed) {  // N, sent
    x += speed * period;
    time += period;
    const fs_state state = hand_at({x, 0, 0}, time);
    return guard.apply({state, true, 0}, response_of({wanted, 0, 0})).wrench.force.x;
  };
  double sent = 0;
  for (int i = 0; i < 500; ++i) sent = next(0, 0.1);
  ck_assert_double_eq_tol(sent, -0.8, 1e-6);
  guard.follow(4, 1000);
  for (int i = 1; i <= 40; ++i) ck_assert_double_eq_tol(next(0, 0.1), -0.1 * (8 - 4 * std::min(1.0, i / 20.0)), 1e-6);
  guard.follow(0, 1000);
  for (int i = 0; i < 500; ++i) sent = next(0, 0);
  ck_assert_double_eq(sent, 0);
  const auto most_change = [&] { return next(9, 0) - next(-9, 0); };  // N, of the second tick
  ck_assert_double_eq_tol(most_change(), 1, 1e-9);
  guard.follow(0, 3000);
  ck_assert_double_eq_tol(most_change(), 3, 1e-9);
  guard.follow(0, 1000);
  double last = most_change();
  ck_assert_double_gt(last, 2.9);
  for (int i = 0; i < 450; ++i) last = most_change();
  ck_assert_double_gt(last, 1.1);
  for (int i = 0; i < 60; ++i) last = most_change();
  ck_assert_double_eq_tol(last, 1, 1e-9);
  guard.follow(0, never);
  ck_assert_double_gt(most_change(), 8);
}
END_TEST

START_TEST(stiffness_is_that_of_the_force_sent) {
  scenes::Random random(7);
  for (int i = 0; i < 2000; ++i) {
    const Guard::Limits limits{10, 1, never, 0.01, period, 0, i % 3 == 0 ? 4000.0 : never};
    const Vec3 force = random.in_box(20), earlier = random.in_box(5);
    const Mat3 stiffness = random_matrix(random, 1000);
    const fs_state state = hand_at({}, 0);
    const auto sent = [&](Vec3 dx) {
      Guard guard(limits);
      for (int k = 0; k < 4 + i % 10; ++k) guard.apply({state, true, 0}, response_of(earlier));
      fs_response wanted = response_of(force + stiffness * dx);
      wanted.stiffness = stiffness;
      return guard.apply({state, true, 0}, wanted);
    };
    const double h = 1e-7;  // m
    const auto slope = [&](Vec3 dx) {
      return (1 / (2 * h)) * (sent(h * dx).wrench.force - sent(-h * dx).wrench.force);
    };
    const Vec3 x = slope({1, 0, 0}), y = slope({0, 1, 0}), z = slope({0, 0, 1});
    ck_assert_double_le(distance(sent({}).stiffness, {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}), 1e-2);
  }
  // On a fault, and along axes that the device lacks, there is none.
  Guard::Limits flat = limits_with();
  flat.force_axes = 2;
  Guard guard(flat);
  fs_response wanted = response_of({1, 1, 1});
  wanted.stiffness = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  const Guard::GuardedForce out = guard.apply({hand_at({}, 0), true, 0}, wanted);
  ck_assert(out.stiffness == Mat3({1, 2, 0, 4, 5, 0, 0, 0, 0}));
  ck_assert(out.wrench.force == Vec3({1, 1, 0}));
  ck_assert(guard.apply({hand_at({}, 0), false, 0}, wanted).stiffness == Mat3{});
}
END_TEST

START_TEST(energy_is_force_times_way) {
  Guard guard(limits_with());
  fs_state state = hand_at({}, 0);
  const auto tick = [&](Vec3 x, double angle, bool is_ready = true) {
    state.pose = {x, exp_rotation({0, 0, angle})};
    guard.apply({state, is_ready, 0}, response_of({2, 0, 0}, {0, 0, 0.5}));
  };
  tick({0, 0, 0}, 0);
  ck_assert_double_eq(guard.energy(), 0);
  tick({0.01, 0.02, 0}, 0);  // moved with the force
  ck_assert_double_eq_tol(guard.energy(), 0.02, 1e-15);
  tick({-0.02, 0, 0}, 0.1);  // against it, and turned with the torque
  ck_assert_double_eq_tol(guard.energy(), 0.02 - 0.06 + 0.05, 1e-12);
  tick({5, 0, 0}, 0, false);  // lost: a jump is no way
  tick({9, 0, 0}, 0);
  ck_assert_double_eq_tol(guard.energy(), 0.01, 1e-12);
}
END_TEST

// --------------------------------------------------------------------------------------------- what a loop can render

// The loop in time: whether it swings up. `substeps` of a period make any delay exact that is a multiple of them.
bool grows(const Loop& loop, double damping, double stiffness, int substeps) {
  const double h = loop.period / substeps, gain = 1 - std::exp(-2 * std::numbers::pi * 100 * loop.period);
  const int delay = static_cast<int>(std::lround(loop.delay / h));
  const double a = loop.damping / loop.mass, decay = std::exp(-a * h);
  std::vector<double> line(static_cast<size_t>(delay) + 1);
  double x = 1, v = 0, before = 1, speed = 0, early = 0, late = 0, force = 0;
  const int ticks = static_cast<int>(std::lround(300 * std::max(1.0, loop.delay / loop.period)) + 40000);
  for (int k = 0; k < ticks; ++k) {
    speed += gain * ((x - before) / loop.period - speed);
    before = x;
    force = -stiffness * x - damping * speed;
    (k < ticks / 2 ? early : late) = std::max(k < ticks / 4 ? 0.0 : k < ticks / 2 ? early : late, std::fabs(x));
    if (std::fabs(x) > 1e100) return true;
    for (int i = 0; i < substeps; ++i) {
      const size_t now = static_cast<size_t>(k * substeps + i) % line.size();
      line[now] = force;
      const double u = line[(now + 1) % line.size()] / loop.mass;
      const double drift = (1 - decay) / a;
      x += v * drift + u * (h - drift) / a;
      v = v * decay + u * drift;
    }
  }
  return late > early;
}

START_TEST(critical_stiffness_of_the_table) {  // released, 0.3 kg, 1 N s/m, 1 kHz
  const struct { double delay, stiffness; } cases[]{{0, 2001}, {0.002, 401}, {0.005, 182}, {0.010, 96}, {0.020, 49},
                                                    {0.050, 20}};
  for (const auto& c : cases) {
    ck_assert_double_eq_tol(critical_stiffness({0.3, 1, 1e-3, c.delay}, 0), c.stiffness, 0.5);
  }
  ck_assert_double_eq_tol(critical_stiffness({0.3, 1, 1e-3, 0}, 5), 10814, 1);
  ck_assert_double_eq_tol(critical_stiffness({0.854, 7.45, 1e-3, 0}, 0), 14922, 1);  // without the hand's spring
  ck_assert_double_eq(critical_stiffness({0.3, 1, 1e-3, 0}, 0, 2000), never);        // none below 2000
  ck_assert_double_eq(critical_stiffness({0.3, 0, 1e-3, 0}, 0, 1e6), never);
}
END_TEST

// Also where the delay is no whole number of periods, and where the damping itself is near its limit.
START_TEST(critical_stiffness_in_time) {
  scenes::Random random(11);
  for (int i = 0; i < 60; ++i) {
    const int substeps = 8;
    const double T = 1 / random.log_between(500, 20000);
    const Loop loop{random.log_between(0.05, 1), random.between(0.3, 3), T,
                    T / substeps * static_cast<double>(random.below(60))};
    const double damping = random.between(0, 0.7) * loop.mass / (T / 2 + loop.delay);
    const double critical = critical_stiffness(loop, damping);
    ck_assert_msg(!grows(loop, damping, 0.98 * critical, substeps), "%g kg, %g s, %g s: %g N/m is too much", loop.mass,
                  loop.period, loop.delay, critical);
    ck_assert_msg(grows(loop, damping, 1.02 * critical, substeps), "%g kg, %g s, %g s: %g N/m is too little", loop.mass,
                  loop.period, loop.delay, critical);
  }
}
END_TEST

START_TEST(limits_of_loops) {
  // The formula: 6000 at 1 kHz, 3000 at 500 Hz, 1200/545/286 for 2/5/10 ms; half the critical stiffness is a little less.
  const struct { double period, delay, formula; } cases[]{{1e-3, 0, 6000}, {2e-3, 0, 3000}, {1e-3, 0.002, 1200},
                                                          {1e-3, 0.005, 545.5}, {1e-3, 0.010, 285.7}};
  for (const auto& c : cases) {
    const Loop loop{0.3, 1, c.period, c.delay};
    const LoopLimit limits = limit_of(loop, 5);
    ck_assert_double_eq(limits.damping, 5);
    ck_assert_double_le(limits.max_stiffness, c.formula);
    ck_assert_double_ge(limits.max_stiffness, 0.9 * c.formula);
    ck_assert_double_eq_tol(limits.max_stiffness, critical_stiffness(loop, 5) / 2, 1e-6);
    const LoopLimit heavy = limit_of({100, 1, c.period, c.delay}, 5);  // only the formula is left
    ck_assert_double_eq_tol(heavy.max_stiffness, c.formula, 1e-3 * c.formula);
  }
  // All that is allowed is stable: the most stiffness with the most damping, local and of objects together.
  for (const double mass : {0.05, 0.1, 0.3, 1.0}) {
    for (const double rate : {500.0, 1000.0, 4000.0, 20000.0}) {
      for (const double delay : {0.0, 0.001, 0.005, 0.02, 10.0}) {
        for (const double wanted : {0.0, 5.0, 50.0, 1e9}) {
          const Loop loop{mass, 1, 1 / rate, delay};
          const LoopLimit limits = limit_of(loop, wanted);
          const double all = limits.damping + limits.object_damping;
          ck_assert_double_eq_tol(all, 0.7 * mass / (0.5 / rate + delay), 1e-9 * all);
          ck_assert_double_le(limits.damping, wanted);
          ck_assert_double_ge(limits.object_damping, 0);
          ck_assert_double_gt(limits.max_stiffness, 0);
          for (const double damping : {limits.damping, (limits.damping + all) / 2, all}) {
            ck_assert_double_ge(critical_stiffness(loop, damping, 4 * limits.max_stiffness), 1.999 * limits.max_stiffness);
          }
        }
      }
    }
  }
}
END_TEST

START_TEST(a_local_model_is_symmetric_and_bounded) {
  scenes::Random random(5);
  for (int i = 0; i < 5000; ++i) {
    const Mat3 raw = random_matrix(random, 1000);
    const Mat3 symmetric = 0.5 * (raw + transposed(raw));
    Vec3 v = random.in_box(1);
    Mat3 power = (1 / spectral_norm(symmetric)) * symmetric;
    for (int k = 0; k < 8; ++k) power = power * power;  // an eigenvalue above 1 would grow, all below 1 would vanish
    const double trace = power.xx + power.yy + power.zz;
    ck_assert_double_ge(trace, 0.99);
    ck_assert_double_le(trace, 3.01);
    const Mat3 model = local_model(raw, 300);
    ck_assert(model == transposed(model));
    ck_assert_double_le(norm(model * v), 300 * norm(v) * (1 + 1e-9));
    ck_assert(local_model(raw, 1e9) == symmetric);
  }
  ck_assert_double_eq(spectral_norm(-500.0 * identity()), 500);
  ck_assert_double_eq_tol(spectral_norm({-500, 0, 0, 0, 0, 0, 0, 0, 0}), 500, 1e-9);
  ck_assert_double_eq_tol(spectral_norm({1, 0, 0, 0, -3, 0, 0, 0, 2}), 3, 1e-12);
  ck_assert(local_model({0, 1, 0, -1, 0, 0, 0, 0, 0}, 300) == Mat3{});
  ck_assert(local_model({never, 0, 0, 0, 0, 0, 0, 0, 0}, 300) == Mat3{});
  ck_assert(local_model({std::numeric_limits<double>::quiet_NaN(), 0, 0, 0, 0, 0, 0, 0, 0}, 300) == Mat3{});
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("guard");
  TCase* all = tcase_create("guard");
  tcase_set_timeout(all, 500);
  for (const TTest* test : {guard_limits_ramps_and_latches, protections_off_change_no_bit,
                            damping_opposes_the_filtered_velocity, slew_limits_each_change, the_loop_may_change,
                            stiffness_is_that_of_the_force_sent, energy_is_force_times_way,
                            critical_stiffness_of_the_table, critical_stiffness_in_time, limits_of_loops,
                            a_local_model_is_symmetric_and_bounded}) {
    tcase_add_test(all, test);
  }
  suite_add_tcase(suite, all);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
