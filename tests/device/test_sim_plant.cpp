// The simulated FIDEL against closed forms: plant, friction, stops, encoders, motors, wrist.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "support.h"

#include "device/sim/sim.h"

using namespace fs;

namespace {

const std::string plain = "sim:?encoder=ideal&friction=0";

// ---------------------------------------------------------------------------------------------------- plant

START_TEST(free_response_is_the_closed_form) {
  const struct { const char* options; Constants c; } cases[] = {
      {"&hand=nominal", {0.854, 7.45, 135}},
      {"&hand=firm", {1.1, 6.5, 568}},
      {"&hand=light", {0.45, 4, 100}},
      {"&hand=released", {0.3, 1, 0}},
      {"&hand=light&mass=0.05&hand_damping=60&hand_mass=0", {0.05, 61, 100}},  // overdamped
  };
  for (const auto& c : cases) {
    const auto device = open_device(plain + c.options);
    const fs_wrench force{{0.4, -0.2, 0.1}, {}};
    double error = 0;
    for (int k = 1; k <= 500; ++k) {
      const fs_state s = read_at(*device, k * tick);
      const AxisState x = step_response(c.c, 0.4, (k - 1) * tick), y = step_response(c.c, -0.2, (k - 1) * tick);
      const AxisState z = step_response(c.c, 0.1, (k - 1) * tick);
      error = std::max(error, norm(s.pose.position - Vec3{x.x, y.x, z.x}));
      error = std::max(error, norm(s.twist.linear - Vec3{x.v, y.v, z.v}));
      device->write(force);
    }
    ck_assert_msg(error < 1e-12, "%s: %g", c.options, error);
  }
}
END_TEST

// Mass on a spring with Coulomb friction alone: each half swing loses 2 f/k, and it stays where the spring is too weak.
START_TEST(friction_takes_its_share_and_holds) {
  const auto device = open_device("sim:?encoder=ideal&hand_damping=0&hand_mass=0.7&hand_stiffness=500&friction=0.5");
  const fs_wrench push{{0.4, 0, 0}, {}};
  read_at(*device, 0);
  device->write(push);
  // a force below the friction moves nothing, not even in the last bit
  ck_assert_double_eq(read_at(*device, 0.1).pose.position.x, 0);
  const fs_wrench strong{{8, 0, 0}, {}}, none{};
  device->write(strong);
  for (int k = 1; k <= 5000; ++k) read_at(*device, 0.1 + k * tick);
  device->write(none);
  std::vector<double> turns{read_at(*device, 5.101).pose.position.x};
  double before = turns[0], last = 0;
  for (int k = 1; k <= 3000; ++k) {
    const double x = read_at(*device, 5.1 + k * tick).pose.position.x;
    if ((x - before) * last < 0) turns.push_back(before);
    if (x != before) last = x - before;
    before = x;
  }
  // The viscous 1 N s/m takes the factor exp(-b pi/(2 m w)) besides.
  const double w = std::sqrt(500.0), loss = std::exp(-std::numbers::pi / (2 * w)), f = 0.5 / 500;
  for (size_t i = 1; i + 1 < turns.size() && i < 4; ++i) {
    const double expected = loss * (std::fabs(turns[i - 1]) - f) - f;
    ck_assert_double_eq_tol(std::fabs(turns[i]), expected, 0.02e-3);
  }
  ck_assert_double_le(std::fabs(before), f);
  const double held = read_at(*device, 9.0).pose.position.x;
  ck_assert(held != 0);
  ck_assert_double_eq(read_at(*device, 9.1).pose.position.x, held);
}
END_TEST

START_TEST(stops_hold_the_handle_within_the_kinematics) {
  const auto device = open_device("sim:?hand=released&encoder=ideal&friction=0");
  const auto joint = open_device("sim:?hand=released&friction=0");
  double radius = 0, height = 0;
  for (int k = 1; k <= 4000; ++k) {
    const double angle = 0.005 * k;
    const fs_wrench push{{17 * std::cos(angle), 17 * std::sin(angle), k < 2000 ? 17.0 : -17.0}, {}};
    const fs_state s = read_at(*device, k * tick);
    radius = std::max(radius, std::hypot(s.pose.position.x, s.pose.position.y));
    height = std::max(height, std::fabs(s.pose.position.z));
    const fs_state seen = read_at(*joint, k * tick);
    ck_assert_double_lt(norm(seen.pose.position - s.pose.position), 30e-6);
    device->write(push);
    joint->write(push);
  }
  ck_assert_double_eq_tol(radius, fidel::workspace_radius + fidel::stop_margin, 1e-12);
  ck_assert_double_eq_tol(height, fidel::workspace_height / 2 + fidel::stop_margin, 1e-12);
  // No rebound: released at the stop, it stays there.
  const auto thrown = open_device("sim:?hand=released&encoder=ideal&friction=0");
  const fs_wrench out{{25, 0, 0}, {}}, none{};
  for (int k = 1; k <= 1000; ++k) {
    const double x = read_at(*thrown, k * tick).pose.position.x;
    thrown->write(x < 0.15 ? out : none);
  }
  const fs_state at_stop = read_at(*thrown, 1.001);
  ck_assert_double_eq(at_stop.pose.position.x, 0.16);
  ck_assert_double_eq(at_stop.twist.linear.x, 0);
  // A hand whose target is beyond the stop begins at the stop.
  ck_assert_double_eq(read_at(*open_device("sim:?hold=1,0,0&encoder=ideal"), 1).pose.position.x, 0.16);
}
END_TEST

// ---------------------------------------------------------------------------------------------------- encoders, motors

START_TEST(joint_encoders_resolve_20_um) {
  double error = 0, coarse = 0;
  for (int i = 0; i < 400; ++i) {
    const double a = 0.7 * i, r = 0.15 * std::sqrt((i % 40) / 40.0), z = -0.1 + 0.2 * i / 400;
    const Vec3 p{r * std::cos(a), r * std::sin(a), z};
    char uri[128];
    std::snprintf(uri, sizeof uri, "sim:?hold=%.9f,%.9f,%.9f&seed=%d", p.x, p.y, p.z, i);
    const double e = norm(read_at(*open_device(uri), 1).pose.position - p);
    error = std::max(error, e);
    if (e > 1e-6) ++coarse;
  }
  ck_assert_double_lt(error, 20e-6);   // half a count on each of three joints, in the worst direction
  ck_assert_double_gt(error, 10e-6);   // and it is coarse: not the true position
  ck_assert_double_gt(coarse, 380);
}
END_TEST

START_TEST(joint_encoders_give_no_twist_of_their_own) {
  const auto device = open_device("sim:?path=sweep&friction=0");
  const auto ideal = open_device("sim:?path=sweep&friction=0&encoder=ideal");
  double error = 0;
  for (int k = 1; k <= 3000; ++k) {
    const Vec3 worked_out = read_at(*device, k * tick).twist.linear, exact = read_at(*ideal, k * tick).twist.linear;
    if (k > 100) error = std::max(error, norm(worked_out - exact));
  }
  ck_assert_double_gt(error, 1e-4);  // quantised and filtered
  ck_assert_double_lt(error, 0.02);
}
END_TEST

START_TEST(motors_limit_and_keep_the_direction) {
  Simulator sim(parse_sim_options("?encoder=ideal&hand=released&friction=0&hold=0.12,0.05,-0.08"));
  const fs_wrench too_much{{60, -30, 200}, {}};
  sim.advance(0);
  sim.write(too_much);
  sim.advance(tick);
  fs_state s{};
  sim.read(s);
  const Vec3 moved = s.pose.position - Vec3{0.12, 0.05, -0.08};
  ck_assert_double_lt(norm(normalized(moved) - normalized(too_much.force)), 1e-9);
  const double force = norm(moved) / step_response({0.3, 1, 0}, 1, tick).x;
  ck_assert_double_ge(force, 25);  // never below what is promised
  ck_assert_double_lt(force, 80);  // largest joint torque 5.52 N m
  const double depth = fidel::centre_depth + 0.08;
  const Vec3 p{0.12, -0.05, depth};
  const Mat3 j = delta_jacobian(fidel::geometry, p, *delta_inverse(fidel::geometry, p))->jacobian;
  const Vec3 u = normalized(too_much.force), t = force * (transposed(j) * Vec3{u.x, -u.y, -u.z});
  ck_assert_double_eq_tol(std::max({std::fabs(t.x), std::fabs(t.y), std::fabs(t.z)}), 5.52, 0.001);
}
END_TEST

// ---------------------------------------------------------------------------------------------------- wrist

START_TEST(wrist_turns_under_a_torque) {
  const auto active = open_device(plain + "&wrist=active"), passive = open_device(plain);
  const Vec3 torque{0.05, -0.1, 0.2};
  const fs_wrench wrench{{}, torque};
  fs_state s{};
  for (int k = 1; k <= 1000; ++k) {
    s = read_at(*active, k * tick);
    const fs_state still = read_at(*passive, k * tick);
    ck_assert_double_eq(still.pose.orientation.w, 1);
    active->write(wrench);
    passive->write(wrench);
  }
  // At rest the grip balances it: 2 N m/rad, to the first order in the angle.
  ck_assert_double_lt(norm(log_rotation(s.pose.orientation) - 0.5 * torque), 1e-3);
  ck_assert_double_lt(norm(s.twist.angular), 1e-6);
}
END_TEST

START_TEST(wrist_steps_exactly) {
  const auto device = open_device(plain + "&wrist=active");
  const fs_wrench wrench{{}, {0, 0, 0.1}};
  double error = 0;
  for (int k = 1; k <= 200; ++k) {
    const fs_state s = read_at(*device, k * tick);
    const AxisState z = step_response({2e-4, 0.032, 2}, 0.1, (k - 1) * tick);
    error = std::max({error, std::fabs(log_rotation(s.pose.orientation).z - z.x), std::fabs(s.twist.angular.z - z.v)});
    device->write(wrench);
  }
  ck_assert_double_lt(error, 1e-11);
}
END_TEST

START_TEST(wrist_twist_is_that_of_its_pose) {
  const auto device = open_device(plain + "&wrist=active&hand=released");
  const fs_wrench wrench{{}, {0.004, -0.002, 0.003}}, other{{}, {-0.001, 0.006, 0.002}};
  fs_state before = read_at(*device, 0);
  double error = 0, speed = 0;
  for (int k = 1; k <= 80; ++k) {
    device->write(k < 30 ? wrench : other);
    read_at(*device, k * tick - 0.5e-3);
    const fs_state middle = read_at(*device, k * tick - 0.5e-3), s = read_at(*device, k * tick);
    const Vec3 turned = log_rotation(s.pose.orientation * conjugate(before.pose.orientation));
    error = std::max(error, norm((1 / tick) * turned - middle.twist.angular));
    speed = std::max(speed, norm(s.twist.angular));
    before = s;
  }
  ck_assert_double_gt(speed, 0.5);
  ck_assert_double_lt(error, 1e-3 * speed);
}
END_TEST

START_TEST(wrist_limits) {
  // The torque's limit keeps its direction; the stops hold at 20 deg on each axis.
  Simulator sim(parse_sim_options("?encoder=ideal&wrist=active"));
  const fs_wrench large{{}, {0, 30, 40}};
  sim.advance(0);
  sim.write(large);
  sim.advance(tick);
  fs_state s{};
  sim.read(s);
  const Vec3 r = log_rotation(s.pose.orientation);
  ck_assert_double_eq_tol(r.y, step_response({2e-4, 0.032, 2}, 0.3, tick).x, 1e-4);
  ck_assert_double_eq_tol(r.z / r.y, 4.0 / 3, 1e-2);
  Simulator passive(parse_sim_options("?encoder=ideal"));
  passive.advance(0);
  passive.write(large);
  passive.advance(tick);
  passive.read(s);
  ck_assert(log_rotation(s.pose.orientation) == Vec3{});
  const auto device = open_device("sim:?wrist=active&hand=released&encoder=ideal");
  const fs_wrench push{{}, {0.4, 0, 0}};
  for (int k = 1; k <= 500; ++k) {
    s = read_at(*device, k * tick);
    device->write(push);
  }
  ck_assert_double_eq_tol(log_rotation(s.pose.orientation).x, fidel::wrist_angle, 1e-12);
  ck_assert_double_eq(s.twist.angular.x, 0);
}
END_TEST

START_TEST(wrist_encoders_count) {
  const auto device = open_device("sim:?wrist=active"), ideal = open_device("sim:?wrist=active&encoder=ideal");
  const fs_wrench push{{}, {0.07, 0, 0}};
  const double count = 2 * std::numbers::pi / 20000;
  bool between = false;
  ck_assert_double_eq(read_at(*device, 0).pose.orientation.w, 1);
  for (int k = 1; k <= 100; ++k) {
    const double seen = log_rotation(read_at(*device, k * tick).pose.orientation).x;
    const double is = log_rotation(read_at(*ideal, k * tick).pose.orientation).x;
    ck_assert_double_eq_tol(seen / count, std::round(seen / count), 1e-6);
    ck_assert_double_le(std::fabs(seen - is), 0.5 * count + 1e-12);
    between = between || std::fabs(seen - is) > 0.1 * count;
    device->write(push);
    ideal->write(push);
  }
  ck_assert(between);
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("sim_plant");
  TCase* all = tcase_create("sim_plant");
  tcase_set_timeout(all, 500);
  tcase_add_test(all, free_response_is_the_closed_form);
  tcase_add_test(all, friction_takes_its_share_and_holds);
  tcase_add_test(all, stops_hold_the_handle_within_the_kinematics);
  tcase_add_test(all, joint_encoders_resolve_20_um);
  tcase_add_test(all, joint_encoders_give_no_twist_of_their_own);
  tcase_add_test(all, motors_limit_and_keep_the_direction);
  tcase_add_test(all, wrist_turns_under_a_torque);
  tcase_add_test(all, wrist_steps_exactly);
  tcase_add_test(all, wrist_twist_is_that_of_its_pose);
  tcase_add_test(all, wrist_limits);
  tcase_add_test(all, wrist_encoders_count);
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
