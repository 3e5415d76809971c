// Clients' changes that are under way, wait for a mesh or are refused; what other clients do meanwhile; and clients
// whose evaluation takes too long.
#include <atomic>
#include <cmath>
#include <memory>
#include <thread>

#include "api/world.h"

using namespace scenes;

static Shape big_mesh(size_t triangles = is_sanitized ? 20000 : 80000) { return make_mesh(sphere_mesh(0.05, triangles)); }
static void move(const Scene& scene, const char* name, double x) {
  const fs_pose pose = at(x, 0, 0);
  const fs_twist rest{};
  OK(fs_object_move(scene.get(), name, &pose, &rest, FS_NOW));
}
static double place_of(fs_scene* scene, const char* name) { return Got(scene, name)->pose.position.x; }

// ------------------------------------------------------------------------------------------------------------- refused

START_TEST(moves_after_a_refusal) {
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 1;
  ServerRig rig(options);
  const Scene me = rig.join("me"), bob = rig.join("bob");
  const Shape large = make_mesh(sphere_mesh(0.1, 50000));  // 1.2 MB
  set(me, spring("alone"));
  set(me, spring("of a group"));
  rig.settle(me.get());
  set(me, solid("alone", large));
  EXPECT(FS_ERROR_FULL, rig.sync(me.get()));
  OK(fs_scene_begin(me.get()));
  move(me, "of a group", 0.01);
  set(me, solid("new", large));
  OK(fs_scene_commit(me.get()));
  EXPECT(FS_ERROR_FULL, rig.sync(me.get()));
  // After a refused change the object is felt as before; the client has that state again and can move the object.
  ck_assert_int_eq(Got(me.get(), "alone")->primitive, FS_PRIMITIVE_POINT);
  ck_assert_double_eq(place_of(me.get(), "of a group"), 0);
  move(me, "alone", 0.02);
  move(me, "of a group", 0.03);
  OK(rig.sync(me.get()));
  ck_assert_double_eq(place_of(bob.get(), "me/alone"), 0.02);
  ck_assert_double_eq(place_of(bob.get(), "me/of a group"), 0.03);
  rig.step();
  EXPECT_NEAR(rig.fake.written.force.x, 100 * 0.05, 1e-9);
  // A new object that was refused is sent as a whole with the next change of it, and is refused again or taken.
  fs_object late = fs_object_init("new", FS_PRIMITIVE_POINT);
  late.front = attract(1, 1);
  OK(fs_object_change(me.get(), &late, FS_PART_PROFILES));
  EXPECT_SENTENCE(FS_ERROR_FULL, rig.sync(me.get()), "max_megabytes");
  OK(fs_object_change(me.get(), &late, FS_PART_SHAPE));
  OK(rig.sync(me.get()));
  ck_assert_int_eq(Got(bob.get(), "me/new")->primitive, FS_PRIMITIVE_POINT);
}
END_TEST

START_TEST(abandoned_syncs) {  // a later sync returns their refusals, once
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 1;
  ServerRig rig(options);
  const Scene me = rig.join("me");
  const Shape large = make_mesh(sphere_mesh(0.1, 50000));
  set(me, push("a"));
  for (int i = 0; i < 200; ++i) EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(me.get(), 0));  // nobody steps
  OK(rig.sync(me.get()));
  set(me, solid("b", large));
  fs_status status = fs_scene_sync(me.get(), 0);
  if (status == FS_ERROR_TIMEOUT) {
    next_event(me.get(), FS_EVENT_REFUSED);
    status = rig.sync(me.get());
  }
  ck_assert_int_eq(status, FS_ERROR_FULL);
  OK(rig.sync(me.get()));  // returned once
}
END_TEST

START_TEST(nobody_gave_a_start) {  // then a file has none either, after another client has changed the object
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  const scenes::Folder folder;
  const auto count_ages = [&] {
    const std::string path = folder / "scene.json";
    OK(fs_scene_save(me.get(), path.c_str()));
    std::ifstream file(path);
    int count = 0;
    for (std::string line; std::getline(file, line);) count += line.find("\"age\"") != std::string::npos;
    return count;
  };
  for (int round = 0; round < 2; ++round) {  // at the first instant of the clock, and later
    set(me, spring("changed"));
    fs_object given = spring("given");
    given.start = 0.5;
    set(me, given);
    rig.settle(me.get());
    const Got got(bob.get(), "me/changed");
    fs_object o = got.object;
    o.front.gain = 30;
    OK(fs_object_change(bob.get(), &o, FS_PART_PROFILES));
    ck_assert_double_eq(Got(me.get(), "changed")->front.gain, 30);
    ck_assert_int_eq(count_ages(), 1);
    OK(fs_scene_clear(me.get()));
    rig.settle(me.get());
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------------- while it waits

START_TEST(groups_of_moves_wait_together) {
  ServerRig rig(fs_server_options_init());
  const Scene me = rig.join("me");
  set(me, spring("mesh"));
  set(me, spring("point"));
  rig.settle(me.get());
  const Shape big = big_mesh();
  fs_object o = solid("mesh", big, 0);
  o.front = constant(FS_SENSE_ATTRACTIVE, 1);
  set(me, o);  // it is being built
  OK(fs_scene_begin(me.get()));
  move(me, "mesh", 0.3);
  move(me, "point", 0.02);
  OK(fs_scene_commit(me.get()));
  // Each of the two is kept as long as the other.
  const bool is_done = eventually([&] {
    rig.step();
    const fs_report mesh = [&] {
      fs_report out;
      OK(fs_scene_get_report(me.get(), "mesh", &out));
      return out;
    }();
    const bool point_has_moved = rig.fake.written.force.x > 0.5;
    if (point_has_moved) ck_assert_int_eq(mesh.primitive, FS_PRIMITIVE_MESH);
    return point_has_moved;
  });
  ck_assert(is_done);
}
END_TEST

START_TEST(ready_when_it_was_not) {  // no FS_EVENT_READY for an object that was felt before or cannot be felt
  ServerRig rig;
  const Scene me = rig.join("me");
  rig.fake.state.pose = at(0, 0, 0.02);  // not at the centre, where all triangles are equally near
  const Shape first = big_mesh(1000), second = big_mesh(20000);
  fs_object disabled = push("disabled");
  disabled.enabled = false;
  set(me, disabled);
  set(me, push("felt"));
  set(me, solid("mesh", first));
  rig.settle(me.get());
  const auto ready = [&] {
    std::string names;
    for (;;) {
      fs_event event;
      OK(fs_scene_next_event(me.get(), 0.02, &event));
      if (event.kind == FS_EVENT_NONE) return names;
      if (event.kind == FS_EVENT_READY) names += std::string(event.name) + " ";
    }
  };
  ck_assert(ready() == "felt mesh ");
  OK(fs_scene_begin(me.get()));
  set(me, push("felt", 3));
  set(me, solid("mesh", second));
  OK(fs_scene_commit(me.get()));
  rig.settle(me.get());
  ck_assert(ready() == "mesh ");
  set(me, solid("mesh", second, 7));
  rig.settle(me.get());
  ck_assert(ready() == "");
}
END_TEST

START_TEST(removed_while_it_is_built) {
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  const Shape big = big_mesh();
  set(me, solid("a", big));
  OK(fs_object_remove(me.get(), "a"));
  ck_assert_uint_eq(own_reports_of(me.get()).size(), 0);
  ck_assert_uint_eq(reports_of(bob.get()).size(), 0);
}
END_TEST

START_TEST(small_beside_large) {  // neither waits for a mesh of another client
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob"), eve = rig.join("eve");
  const Shape small = big_mesh(50), large = big_mesh(is_sanitized ? 50000 : 1000000);
  set(me, solid("small", small));
  set(me, push("mine"));
  rig.settle(me.get());
  set(eve, solid("large", large));
  fs_report report;
  OK(fs_scene_get_report(eve.get(), "large", &report));
  const bool was_building = report.state == FS_OBJECT_PENDING;
  size_t count = 0;
  {
    const Got got(bob.get(), "me/small");
    OK(fs_shape_get_triangles(got->shape, &count) ? FS_OK : FS_ERROR_INTERNAL);
  }
  ck_assert_uint_gt(count, 0);
  // Another client changes the mesh of another object of mine; a move does not wait for that.
  const Shape other = big_mesh(80);
  const fs_object o = solid("me/small", other);
  OK(fs_object_change(bob.get(), &o, FS_PART_SHAPE));
  move(me, "mine", 0.01);
  OK(fs_scene_get_report(eve.get(), "large", &report));
  ck_assert(!was_building || report.state == FS_OBJECT_PENDING);  // both are seen while it is built
  ck_assert(has(me.get(), "small"));
}
END_TEST

START_TEST(the_later_move_counts) {
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  set(me, spring("a"));
  rig.settle(me.get());
  for (int i = 0; i < 50; ++i) {
    move(me, "a", 0.01);
    move(bob, "me/a", 0.02 + 1e-4 * i);
    ck_assert_double_eq(place_of(bob.get(), "me/a"), 0.02 + 1e-4 * i);
    ck_assert_double_eq(place_of(me.get(), "a"), 0.02 + 1e-4 * i);
  }
}
END_TEST

// --------------------------------------------------------------------------------------------- when, how often, how dear

START_TEST(who_comes_later) {  // a client of a virtual servo has its time from the first call on
  ServerRig rig;
  rig.step_until(10);
  const Scene me = rig.join("me");
  ck_assert_double_eq(now(me.get()), 10);
  fs_object o = push("a");
  o.lifetime = 2;
  set(me, o);
  OK(rig.sync(me.get()));
  rig.step(100);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  fs_client clients[4];
  size_t count = 0;
  OK(fs_scene_get_clients(me.get(), clients, 4, &count));
  ck_assert_uint_eq(count, 2);
  ck_assert_double_eq(clients[1].connected, 10);
}
END_TEST

START_TEST(looking_in_again_and_again) {  // by clients without objects leaves nothing to fade out
  ServerRig rig;
  for (int i = 0; i < 200; ++i) rig.join("me");
}
END_TEST

static fs_servo_options thread_options(double rate) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  options.rate = rate;
  return options;
}

START_TEST(a_stream_of_changes) {  // the stream is felt while it goes on
  ServerRig rig(fs_server_options_init(), thread_options(100));
  const Scene me = rig.join("me"), bob = rig.join("bob");
  set(me, push("a", 1));
  set(bob, push("b", 1));
  OK(fs_scene_sync(me.get(), long_enough));
  double force = 1;
  int steps = 0;
  const bool is_felt = eventually([&] {
    set(me, push("a", force += 1e-3));
    steps = 0;
    double last = 0;
    for (const fs_tick& tick : record_of(rig.servo.get())) {
      steps += tick.response.wrench.force.z != last;
      last = tick.response.wrench.force.z;
    }
    return steps > 30;
  });
  ck_assert_msg(is_felt, "the force has changed %d times", steps);
  OK(fs_scene_sync(bob.get(), long_enough));
}
END_TEST

START_TEST(a_client_that_costs_too_much) {  // it is disconnected, and the others do not notice
  ServerRig rig(fs_server_options_init(), thread_options(2000));
  const Scene honest = rig.join("honest"), dear = rig.join("dear");
  set(honest, push("a", 1));
  OK(fs_scene_sync(honest.get(), long_enough));
  std::vector<fs_vec3> ring;  // all of it equally near
  constexpr int points = is_sanitized ? 30000 : 300000;
  for (int i = 0; i < points; ++i) {
    ring.push_back({0.05 * std::cos(2 * M_PI * i / points), 0.05 * std::sin(2 * M_PI * i / points), 0});
  }
  const Shape line = make_polyline(ring.data(), ring.size(), true);
  fs_object o = fs_object_init("ring", FS_PRIMITIVE_POLYLINE);
  o.shape = line.get();
  o.front = attract(10, 1);
  set(dear, o);
  ck_assert(eventually([&] { return fs_scene_sync(dear.get(), long_enough) == FS_ERROR_DISCONNECTED; }));
  wait_a_little(0.1);
  fs_servo_stats stats = fs_servo_stats_init();
  OK(fs_scene_get_servo_stats(honest.get(), &stats));
  ck_assert_uint_eq(stats.faults, 0);
  fs_wrench sent;
  OK(fs_scene_get_hand(honest.get(), nullptr, nullptr, &sent));
  EXPECT_VECTOR(sent.force, (fs_vec3{0, 0, 1}), 1e-9);
}
END_TEST

// While a long group is applied the server answers other clients, but not requests about its objects.
START_TEST(half_of_a_group_is_seen_by_nobody) {
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  constexpr int count = 1000;
  const int rounds = times(5, 20);
  const auto set_all = [&](double gain) {
    OK(fs_scene_begin(me.get()));
    for (int i = 0; i < count; ++i) {
      fs_object o = spring(("o" + std::to_string(i)).c_str());
      o.front.gain = gain;
      set(me, o);
    }
    OK(fs_scene_commit(me.get()));
    OK(rig.sync(me.get()));
  };
  set_all(1);
  std::atomic<bool> is_done{false};
  std::thread changes([&] {
    for (int k = 2; k <= rounds; ++k) set_all(k);
    is_done = true;
  });
  // They are changed in the order of their numbers: where only the last are as they were, it is half of a group.
  while (!is_done) {
    const double first = Got(bob.get(), "me/o0")->front.gain, last = Got(bob.get(), "me/o999")->front.gain;
    ck_assert_double_le(first, last);
    ck_assert_double_le(last, Got(bob.get(), "me/o0")->front.gain);
    set(bob, spring("own"));
  }
  changes.join();
  OK(rig.sync(bob.get()));
  ck_assert_double_eq(Got(bob.get(), "me/o999")->front.gain, rounds);
}
END_TEST

int main() {
  Suite* suite = suite_create("connected_waiting");
  add_once(suite, "refused", {moves_after_a_refusal, abandoned_syncs, nobody_gave_a_start});
  add_once(suite, "waits", {groups_of_moves_wait_together, ready_when_it_was_not, removed_while_it_is_built,
                            small_beside_large, the_later_move_counts, half_of_a_group_is_seen_by_nobody});
  add_once(suite, "cost", {who_comes_later, looking_in_again_and_again, a_stream_of_changes,
                           a_client_that_costs_too_much});
  return run_suite(suite);
}
