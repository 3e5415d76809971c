// The gain changes like a slider while the force is felt, down to 0; for a custom profile it is the parameter of the
// curve.
#include <cstring>

#include "api/world.h"

using namespace scenes;

// A plane that the hand is in front of, with a force along z. The offset, if the kind has one, is 0.
static fs_object plane_of(fs_profile_kind kind, double gain, fs_curve* curve) {
  fs_object o = fs_object_init("slider", FS_PRIMITIVE_PLANE);
  o.front = fs_profile_init(kind, FS_SENSE_REPULSIVE, gain, kind == FS_PROFILE_GAUSSIAN ? 0.02 : 0, 100);
  if (kind == FS_PROFILE_LINEAR_DECREASING) o.front.offset = 5;
  if (kind == FS_PROFILE_CUSTOM) o.front.curve = curve;
  return o;
}

// While the gain goes to 0 and back and rests there, the force at every step is that of the formula with this gain.
START_TEST(through_0_and_back) {
  World w(_i);
  const double forces[] = {3, 3};
  const Curve curve = make_table(forces, 2, 1);
  const fs_vec3 hand{0, 0, 0.01};
  w.fake.state.pose = at(hand);
  for (int i = FS_PROFILE_CONSTANT; i <= FS_PROFILE_CUSTOM; ++i) {
    const auto kind = static_cast<fs_profile_kind>(i);
    const double sign = kind == FS_PROFILE_LINEAR_DECREASING ? -1 : 1;
    fs_object o = plane_of(kind, sign, curve.get());
    w.set(o);
    w.settle();
    for (const double slider : {1.0, 0.25, 1e-300, 0.0, 0.0, 1e-3, 2.0, 0.0, 1.0}) {
      o.front.gain = sign * slider;
      OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
      OK(w.sync(w.scene));
      double wanted = 0;
      OK(fs_profile_evaluate(&o.front, 0, 0, &hand.z, 1, &wanted));
      if (slider == 0) EXPECT_NEAR(wanted, o.front.offset, 0);
      EXPECT_VECTOR(w.force_at(hand), (fs_vec3{0, 0, wanted}), 1e-12);
    }
    // An object set with gain 0 exists, and is felt as soon as the gain is above 0.
    o.front.gain = 0;
    OK(fs_object_remove(w.scene, "slider"));
    w.settle();
    w.set(o);
    w.settle();
    EXPECT_VECTOR(w.force_at(hand), (fs_vec3{0, 0, o.front.offset}), 1e-12);
    const fs_report report = report_of(w.scene, "slider");
    ck_assert_int_eq(report.state, FS_OBJECT_FELT);
    o.front.gain = sign;
    OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
    OK(w.sync(w.scene));
    ck_assert_double_gt(std::fabs(w.force_at(hand).z - o.front.offset), 1e-5);
  }
}
END_TEST

// At d = 0 a formula with 0/0 gives the offset: no NaN, and no fault.
START_TEST(inverse_at_0) {
  World w(_i);
  fs_object o = plane_of(FS_PROFILE_INVERSE, 0, nullptr);
  o.front.offset = 2;
  w.set(o);
  w.settle();
  EXPECT_VECTOR(w.force_at({0, 0, 0}), (fs_vec3{0, 0, 2}), 0);
  ck_assert_uint_eq(stats_of(w.scene).faults, 0);
  ck_assert_double_eq(report_of(w.scene, "slider").stiffness_wanted, INFINITY);  // 2 N in front, none behind
  o.front.offset = 0;
  w.set(o);
  w.settle();
  EXPECT_VECTOR(w.force_at({0, 0, 0}), (fs_vec3{0, 0, 0}), 0);
  ck_assert_double_eq(report_of(w.scene, "slider").stiffness_wanted, 0);
}
END_TEST

// A battery: the gain changes, the curve is neither made nor sent again, and t goes on.
START_TEST(parameter_of_a_curve) {
  if (!has_expressions()) return;
  World w(_i);
  const fs_vec3 hand{0, 0, 0.01};
  w.fake.state.pose = at(hand);
  fs_curve* raw = nullptr;
  OK(fs_curve_create_expression("1+t", &raw));
  const Curve curve(raw);  // gives it back
  w.set(plane_of(FS_PROFILE_CUSTOM, 1, raw));
  w.settle();
  const double age = w.force_at(hand).z - 1;  // s
  const double start = now(w.scene) - age;
  ck_assert_double_gt(age, 0.01);
  const Scene viewer = _i == connected ? connect(w.endpoint, "viewer") : Scene();
  const auto clients = [&] {
    std::vector<fs_client> list(9);
    size_t count = 0;
    OK(fs_scene_get_clients(viewer.get(), list.data(), list.size(), &count));
    for (const fs_client& client : list) {
      if (std::string_view(client.name) == "me") return client;
    }
    ck_abort_msg("me is not among the clients");
  };
  const uint64_t bytes = viewer ? clients().shape_bytes : 0;
  std::unique_ptr<Got> seen = viewer ? std::make_unique<Got>(viewer.get(), "me/slider") : nullptr;
  for (const double charge : {0.9, 0.5, 0.0, 0.0, 0.3}) {
    fs_object o = plane_of(FS_PROFILE_CUSTOM, charge, raw);  // its start is 0, so the start is kept
    if (charge == 0.5) {
      const Got got(w.scene, "slider");
      o = got.object;
      o.front.gain = charge;
      OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
    } else {
      OK(fs_object_change(w.scene, &o, FS_PART_PROFILES));
    }
    OK(w.sync(w.scene));
    w.step(20);
    const Got got(w.scene, "slider");
    ck_assert_double_eq(got->front.gain, charge);
    ck_assert_ptr_eq(got->front.curve, raw);
    const double force = w.force_at(hand).z;  // a tick later
    EXPECT_NEAR(force, charge * (1 + now(w.scene) - start), 1e-9);
    if (viewer) {
      ck_assert_ptr_eq(Got(viewer.get(), "me/slider")->front.curve, (*seen)->front.curve);
      ck_assert_uint_eq(clients().shape_bytes, bytes);
    }
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("gain");
  add_on_both(suite, "gain", {through_0_and_back, inverse_at_0, parameter_of_a_curve});
  return run_suite(suite);
}
