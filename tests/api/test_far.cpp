// Distant objects are skipped, and that changes nothing: a tool that has come a long way, through changes of all kinds,
// gives the same bits as one that has just been made; and the plot of the field the same force.
#include <cstring>
#include <vector>

#include "api/support.h"

using namespace scenes;

static double range(Random& random) { return std::pow(10.0, random.between(-5, 0)); }  // m

// Moves a hand through a scene and changes the scene meanwhile.
static void walk(uint64_t seed, double scale, fs_vec3 origin) {
  Random random(seed);
  RandomOptions options;
  options.count = 250;
  options.half = 0.3;
  options.moves = options.damps = options.masks = options.disables = true;
  const Content content = random_content(random, options);
  Scene scene = make_scene();
  const auto put = [&](fs_object o) {
    o.pose.position = origin + scale * o.pose.position;
    if (random.coin(0.7) && o.front.kind != FS_PROFILE_NONE) o.front.reach = scale * random.between(0.001, 0.05);
    if (random.coin(0.7) && o.back.kind != FS_PROFILE_NONE) o.back.reach = scale * random.between(0.001, 0.05);
    OK(fs_object_set(scene.get(), &o));
  };
  double time = options.time;
  OK(fs_scene_set_time(scene.get(), time));
  for (const fs_object& o : content.objects) put(o);
  const std::vector<fs_vec3> points{{0, 0, 0}, scale * fs_vec3{0.01, 0, 0}, scale * fs_vec3{0, 0.02, 0.01}};
  const size_t count = random.coin(0.5) ? 1 : points.size();
  const auto tool_of = [&] {
    fs_tool* tool = nullptr;
    OK(fs_tool_create(scene.get(), points.data(), count, &tool));
    return Tool(tool);
  };
  const Tool walker = tool_of();

  fs_vec3 hand = random.in_box(0.3), goal = hand;  // mostly it goes straight to a place where something may be felt
  size_t felt = 0;
  for (int step = 0; step < 400; ++step) {
    if (random.coin(0.05)) goal = content.objects[random.below(250)].pose.position;
    if (random.coin(0.02)) hand = random.in_box(0.4);
    hand = random.coin(0.2) ? hand + range(random) * random.in_box(0.2) : hand + random.between(0, 0.1) * (goal - hand);
    if (random.coin(0.3)) time += random.between(-0.05, 0.2);
    if (random.coin(0.2)) {
      const fs_object& o = content.objects[random.below(static_cast<uint32_t>(content.objects.size()))];
      const fs_pose pose = at(origin + scale * random.in_box(0.3));
      const fs_twist twist{scale * random.in_box(2), random.in_box(5)};
      switch (random.below(4)) {
        case 0: fs_object_remove(scene.get(), o.name); break;
        case 1: put(o); break;
        default: fs_object_move(scene.get(), o.name, &pose, random.coin(0.5) ? &twist : nullptr, time); break;
      }
    }
    fs_state state = hand_at(origin + scale * hand, time);
    state.pose.orientation = random.orientation();
    state.twist = {scale * random.in_box(1), random.in_box(1)};
    const Tool fresh = tool_of();
    const fs_response here = evaluate(walker.get(), state), there = evaluate(fresh.get(), state);
    felt += here.felt_count;
    ck_assert_msg(std::memcmp(&here, &there, sizeof here) == 0,
                  "seed %llu, step %d: the one that came far feels %u objects and (%g, %g, %g) N, the other %u and (%g, %g, %g)",
                  static_cast<unsigned long long>(seed), step, here.felt_count, here.wrench.force.x, here.wrench.force.y,
                  here.wrench.force.z, there.felt_count, there.wrench.force.x, there.wrench.force.y, there.wrench.force.z);
  }
  ck_assert_uint_gt(felt, 0);
}

START_TEST(it_makes_no_difference_where_one_comes_from) {
  walk(static_cast<uint64_t>(_i), _i % 4 == 1 ? 1e4 : _i % 4 == 2 ? 1e-4 : 1, _i % 3 == 1 ? fs_vec3{4e5, 5e6, 300} : fs_vec3{});
}
END_TEST

START_TEST(the_field_is_what_a_tool_feels) {
  Random random(77);
  RandomOptions options;
  options.count = 200;
  const Content content = random_content(random, options);
  Scene scene = make_scene();
  fill(scene.get(), content);
  const Tool tool = make_tool(scene.get());
  std::vector<fs_vec3> places, forces(3000);
  for (size_t i = 0; i < forces.size(); ++i) places.push_back(random.in_box(0.3));
  OK(fs_evaluate_field(scene.get(), nullptr, options.time, places.data(), places.size(), forces.data()));
  for (size_t i = 0; i < forces.size(); ++i) {
    const fs_vec3 felt = evaluate(tool.get(), hand_at(places[i], options.time)).wrench.force;
    ck_assert_int_eq(std::memcmp(&felt, &forces[i], sizeof felt), 0);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("far");
  TCase* walks = tcase_create("walks");
  tcase_set_timeout(walks, 500);
  tcase_add_loop_test(walks, it_makes_no_difference_where_one_comes_from, 0, 12);
  tcase_add_test(walks, the_field_is_what_a_tool_feels);
  suite_add_tcase(suite, walks);
  return run_suite(suite);
}
