// The error that fs_scene_set_accuracy allows: what is made of it, and what is told of it.
#include <cmath>

#include "api/support.h"

using namespace scenes;

namespace {

fs_profile fading(Random& random) {
  const fs_sense sense = random.coin() ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE;
  const double limit = random.between(1, 5);
  if (random.coin()) return fs_profile_init(FS_PROFILE_GAUSSIAN, sense, random.between(0.5, 5), random.log_between(1e-3, 0.02), limit);
  return fs_profile_init(FS_PROFILE_INVERSE, sense, random.log_between(1e-4, 1e-2), random.coin(0.3) ? -0.01 : 0, limit);
}

// Objects of all kinds, most of which have a force that fades out without end.
Content fading_content(Random& random, size_t count) {
  RandomOptions options;
  options.count = count;
  Content content = random_content(random, options);
  for (fs_object& o : content.objects) {
    if (random.coin(0.8)) o.front = fading(random);
  }
  return content;
}

fs_vec3 force_of(const Scene& scene, fs_vec3 x, double& bound) {
  const Tool tool = make_tool(scene.get());
  const fs_response response = evaluate(tool.get(), hand_at(x, 100));
  bound = response.error_bound;
  return response.wrench.force;
}

START_TEST(the_error_is_within_its_bound) {
  Random random(1);
  double greatest = 0;
  for (int k = 0; k < times(60, 600); ++k) {
    const Content content = fading_content(random, 1 + random.below(60));
    const Scene exact = make_scene(), scene = make_scene();
    fill(exact.get(), content);
    const double allowed = random.log_between(1e-6, 1);
    const bool is_first = random.coin();
    if (is_first) OK(fs_scene_set_accuracy(scene.get(), allowed));
    fill(scene.get(), content);
    if (!is_first) OK(fs_scene_set_accuracy(scene.get(), allowed));
    for (int i = 0; i < 30; ++i) {
      const fs_vec3 x = random.in_box(random.coin() ? 0.1 : 1);
      double bound, none;
      const fs_vec3 force = force_of(scene, x, bound), truth = force_of(exact, x, none);
      const double error = norm(force - truth), rounding = 1e-12 * (1 + norm(truth));
      ck_assert_double_eq(none, 0);
      ck_assert_double_le(bound, allowed);
      ck_assert_double_le(error, bound + rounding);
      greatest = std::max(greatest, error / allowed);
    }
    OK(fs_scene_set_accuracy(scene.get(), 0));  // exact again
    for (int i = 0; i < 10; ++i) {
      const fs_vec3 x = random.in_box(0.2);
      double bound, none;
      const fs_vec3 force = force_of(scene, x, bound), truth = force_of(exact, x, none);
      ck_assert_double_eq(bound, 0);
      EXPECT_VECTOR(force, truth, 0);
    }
  }
  ck_assert_double_gt(greatest, 0.01);  // it is made use of
}
END_TEST

// The share of each grows smaller with their number, and objects that come and go do not use it up.
START_TEST(many_objects_share_it) {
  Random random(2);
  const Scene scene = make_scene(), exact = make_scene();
  OK(fs_scene_set_accuracy(scene.get(), 0.05));
  const auto add = [&](int i) {
    fs_object o = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    o.pose = at(random.in_box(0.1));
    o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 2, 0.01, 2);
    for (const Scene* s : {&scene, &exact}) OK(fs_object_set(s->get(), &o));
  };
  double bound, none;
  for (int i = 0; i < 2000; ++i) {
    add(i % 700);
    if (random.coin(0.3)) {
      const std::string name = "o" + std::to_string(random.below(static_cast<uint64_t>(i % 700) + 1));
      const fs_status status = fs_object_remove(scene.get(), name.c_str());
      ck_assert_int_eq(fs_object_remove(exact.get(), name.c_str()), status);
    }
    if (i % 20) continue;
    const fs_vec3 x = random.in_box(0.15), force = force_of(scene, x, bound);
    ck_assert_double_le(bound, 0.05);
    ck_assert_double_le(norm(force - force_of(exact, x, none)), bound + 1e-12);
  }
  ck_assert_double_gt(bound, 0);
  OK(fs_scene_clear(scene.get()));
  force_of(scene, {}, bound);
  ck_assert_double_eq(bound, 0);
}
END_TEST

// Under a servo, where it may be changed while objects are felt, and where objects fade.
START_TEST(a_servo_tells_its_bound) {
  Rig rig("accuracy");
  Random random(3);
  const Content content = fading_content(random, 40);
  fill(rig.scene.get(), content);
  fs_servo_options options = virtual_options();
  options.ramp = options.speed_limit = -1;
  options.fade = 0.01;
  rig.start(options);
  for (int i = 0; i < 300; ++i) {
    const double allowed = i / 30 % 2 ? 0.02 : 0;
    if (i % 30 == 0) OK(fs_scene_set_accuracy(rig.scene.get(), allowed));
    rig.fake.state.pose = at(random.in_box(0.2));
    rig.step(1);
    fs_response response;
    fs_state state;
    OK(fs_scene_get_hand(rig.scene.get(), &state, &response, nullptr));
    if (i < 30) continue;
    const Scene exact = make_scene();
    fill(exact.get(), content);
    double none;
    ck_assert_double_le(response.error_bound, allowed);
    ck_assert_double_le(norm(response.wrench.force - force_of(exact, state.pose.position, none)), response.error_bound + 1e-9);
  }
  ck_assert_uint_eq(stats_of(rig.scene.get()).approximated, 150);
}
END_TEST

// Damping may be large where the force is small; the field of one object is exact.
START_TEST(what_stays_exact) {
  const Scene scene = make_scene();
  OK(fs_scene_set_accuracy(scene.get(), 0.1));
  fs_object o = fs_object_init("o", FS_PRIMITIVE_POINT);
  o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 1, 0.01, 2);
  o.damping = 20;
  OK(fs_object_set(scene.get(), &o));
  const Tool tool = make_tool(scene.get());
  fs_state state = hand_at({0.05, 0, 0}, 100);
  state.twist.linear = {0, 0.05, 0};
  const fs_response response = evaluate(tool.get(), state);
  EXPECT_NEAR(response.wrench.force.y, -1, 1e-9);
  ck_assert_double_eq(response.error_bound, 0);
  o.damping = 0;
  OK(fs_object_set(scene.get(), &o));
  const fs_vec3 x{0.03, 0, 0};
  fs_vec3 field;
  OK(fs_evaluate_field(scene.get(), "o", 100, &x, 1, &field));
  EXPECT_NEAR(field.x, std::exp(-4.5), 1e-15);
  EXPECT_VECTOR(force_at(make_tool(scene.get()).get(), x, 100), (fs_vec3{}), 0);  // 0.011 N is left out
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("accuracy");
  add_case(suite, "all", {the_error_is_within_its_bound, many_objects_share_it, a_servo_tells_its_bound, what_stays_exact});
  return run_suite(suite);
}
