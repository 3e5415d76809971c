// Kinematics of the DELTA, with the geometry of the simulated FIDEL.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "support.h"

#include "device/sim/parameters.h"

using namespace fs;

namespace {

const DeltaGeometry& g = fidel::geometry;

// Calls visit(position) for a grid of 5 mm over the workspace with a margin all round, frame of the DELTA.
template <class Visit>
void visit_volume(double margin, Visit visit) {
  const double radius = fidel::workspace_radius + margin, height = fidel::workspace_height / 2 + margin, step = 0.005;
  for (double x = -radius; x < radius + 1e-9; x += step) {
    for (double y = -radius; y < radius + 1e-9; y += step) {
      if (x * x + y * y > radius * radius + 1e-9) continue;
      for (double z = -height; z < height + 1e-9; z += step) visit(Vec3{x, y, fidel::centre_depth + z});
    }
  }
}

// Largest over smallest singular value, from the eigenvalues of J^T J (closed form for a symmetric 3x3 matrix).
double condition(const Mat3& j) {
  const Mat3 a = transposed(j) * j;
  const double mean = (a.xx + a.yy + a.zz) / 3;
  const double off = a.xy * a.xy + a.xz * a.xz + a.yz * a.yz;
  const double spread = std::sqrt(((a.xx - mean) * (a.xx - mean) + (a.yy - mean) * (a.yy - mean) +
                                   (a.zz - mean) * (a.zz - mean) + 2 * off) / 6);
  if (spread < 1e-15) return 1;
  const Mat3 b = (1 / spread) * (a + (-mean) * identity());
  const double determinant = dot(Vec3{b.xx, b.xy, b.xz}, cross(Vec3{b.yx, b.yy, b.yz}, Vec3{b.zx, b.zy, b.zz}));
  const double angle = std::acos(std::clamp(determinant / 2, -1.0, 1.0)) / 3;
  const double largest = mean + 2 * spread * std::cos(angle);
  const double smallest = mean + 2 * spread * std::cos(angle + 2 * std::numbers::pi / 3);
  return std::sqrt(largest / smallest);
}

START_TEST(round_trip_over_the_volume) {
  double error = 0;
  visit_volume(0.020, [&](Vec3 p) {
    const auto angles = delta_inverse(g, p);
    ck_assert(angles);
    const auto back = delta_forward(g, *angles);
    ck_assert(back);
    error = std::max(error, norm(*back - p));
  });
  ck_assert_double_lt(error, 1e-14);
}
END_TEST

START_TEST(lengths_of_the_legs_hold) {  // an independent check: the forearms keep their length
  const Vec3 p{0.08, -0.05, 0.25};
  const Vec3 angles = *delta_inverse(g, p);
  const double angle[3] = {angles.x, angles.y, angles.z};
  for (int i = 0; i < 3; ++i) {
    const double phi = i * 2 * std::numbers::pi / 3;
    const double reach = g.base_radius + g.upper_arm * std::cos(angle[i]);
    const Vec3 elbow{reach * std::cos(phi), reach * std::sin(phi), g.upper_arm * std::sin(angle[i])};
    const Vec3 end = p + Vec3{g.platform_radius * std::cos(phi), g.platform_radius * std::sin(phi), 0};
    ck_assert_double_eq_tol(norm(end - elbow), g.forearm, 1e-15);
  }
}
END_TEST

START_TEST(platform_is_on_the_side_away_from_the_base) {
  ck_assert_double_gt(delta_forward(g, {0, 0, 0})->z, 0.05);
  const double folded = std::numbers::pi;  // two arms turned inwards: the elbows run the other way round
  ck_assert_double_gt(delta_forward(g, {0, folded, folded})->z, 0.05);
}
END_TEST

START_TEST(jacobian_is_the_derivative) {
  double error = 0;
  for (const Vec3 p : {Vec3{0, 0, 0.28}, Vec3{0.15, 0, 0.18}, Vec3{-0.07, 0.13, 0.38}, Vec3{0.02, -0.15, 0.30}}) {
    const Vec3 angles = *delta_inverse(g, p);
    const Mat3 j = delta_jacobian(g, p, angles)->jacobian;
    const double h = 1e-6;
    for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
      const Vec3 moved = *delta_forward(g, angles + h * axis) - *delta_forward(g, angles - h * axis);
      error = std::max(error, norm((1 / (2 * h)) * moved - j * axis));
    }
  }
  ck_assert_double_lt(error, 1e-9);
}
END_TEST

struct Figures {
  double cond_min = 1e9, cond_mean = 0, cond_max = 0, torque = 0, angle_min = 1e9, angle_max = -1e9, coplanar = 1e9,
         straight = 1e9;
};

Figures figures_of_volume(double margin) {
  Figures f;
  int count = 0;
  visit_volume(margin, [&](Vec3 p) {
    const auto angles = delta_inverse(g, p);
    ck_assert(angles);
    const auto jacobian = delta_jacobian(g, p, *angles);
    ck_assert(jacobian);
    const Mat3& j = jacobian->jacobian;
    const double cond = condition(j);
    f.cond_min = std::min(f.cond_min, cond);
    f.cond_max = std::max(f.cond_max, cond);
    f.cond_mean += cond;
    ++count;
    for (const Vec3 column : {Vec3{j.xx, j.yx, j.zx}, Vec3{j.xy, j.yy, j.zy}, Vec3{j.xz, j.yz, j.zz}}) {
      f.torque = std::max(f.torque, fidel::force_max * norm(column));
    }
    f.angle_min = std::min({f.angle_min, angles->x, angles->y, angles->z});
    f.angle_max = std::max({f.angle_max, angles->x, angles->y, angles->z});
    f.coplanar = std::min(f.coplanar, jacobian->coplanar);
    f.straight = std::min(f.straight, jacobian->straight);
  });
  f.cond_mean /= count;
  return f;
}

// The figures for which the geometry was chosen.
START_TEST(figures_of_the_geometry) {
  const double degree = std::numbers::pi / 180;
  const Figures inside = figures_of_volume(0), margin = figures_of_volume(0.020);
  ck_assert_double_eq_tol(inside.cond_min, 1.007, 0.001);
  ck_assert_double_eq_tol(inside.cond_mean, 1.53, 0.01);  // over the volume; 1.48 when radii count alike
  ck_assert_double_eq_tol(inside.cond_max, 2.11, 0.01);
  ck_assert_double_eq_tol(inside.torque, 5.43, 0.01);
  ck_assert_double_eq_tol(inside.angle_min / degree, -38.7, 0.2);
  ck_assert_double_eq_tol(inside.angle_max / degree, 88.1, 0.2);
  ck_assert_double_eq_tol(inside.coplanar, 0.766, 0.002);
  ck_assert_double_eq_tol(inside.straight, 0.470, 0.002);
  ck_assert_double_eq_tol(margin.cond_max, 2.75, 0.01);
  ck_assert_double_le(margin.torque, fidel::motor_torque_max + 0.005);
}
END_TEST

START_TEST(failures_are_none_and_never_nan) {
  ck_assert(!delta_inverse(g, {0, 0, 0.6}));         // beyond both arms
  ck_assert(!delta_inverse(g, {0.5, 0, 0.28}));
  ck_assert(!delta_inverse(g, {0, 0.34, 0.28}));     // forearm out of the plane
  ck_assert(!delta_inverse(g, {g.base_radius - g.platform_radius, 0, 0}));  // on the axis of an arm
  for (const double bad : {0.0 * INFINITY, 1.0 * INFINITY, -1.0 * INFINITY, 1e300}) {
    ck_assert(!delta_inverse(g, {bad, 0, 0.28}));
    ck_assert(!delta_inverse(g, {0, 0, bad}));
    ck_assert(bad == 1e300 || !delta_forward(g, {bad, 0, 0}));
    ck_assert(!delta_jacobian(g, {bad, 0, 0.28}, {0, 0, bad}) || bad == 1e300);
  }
  DeltaGeometry loose = g;
  loose.forearm = 0.1;  // too short to meet
  ck_assert(!delta_forward(loose, {0, 0, 0}));
  DeltaGeometry folded = g;
  folded.upper_arm = g.base_radius - g.platform_radius;  // all elbows in one point
  ck_assert(!delta_forward(folded, {std::numbers::pi, std::numbers::pi, std::numbers::pi}));
  // Forearms in one plane: none of them can push out of it.
  const double flat = std::asin(0.0);
  DeltaGeometry plane = g;
  plane.forearm = g.base_radius - g.platform_radius + g.upper_arm;
  ck_assert(!delta_jacobian(plane, {0, 0, 0}, {flat, flat, flat}));
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("delta");
  TCase* all = tcase_create("delta");
  tcase_set_timeout(all, 500);
  tcase_add_test(all, round_trip_over_the_volume);
  tcase_add_test(all, lengths_of_the_legs_hold);
  tcase_add_test(all, platform_is_on_the_side_away_from_the_base);
  tcase_add_test(all, jacobian_is_the_derivative);
  tcase_add_test(all, figures_of_the_geometry);
  tcase_add_test(all, failures_are_none_and_never_nan);
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
