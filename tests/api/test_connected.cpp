// Several clients of one server: their forces add, each has its own names, and each sees and may change the objects of
// the others. What one scene alone does: test_scenario.
#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "api/world.h"

using namespace scenes;

// A server, its own scene, and two clients.
struct Two : ServerRig {
  Scene me, bob;
  explicit Two(const fs_server_options& options = fs_server_options_init())
      : ServerRig(options), me(join("me")), bob(join("bob")) {}
  void settle_all() {
    for (fs_scene* scene : {me.get(), bob.get(), base.get()}) {
      if (scene) OK(sync(scene));
    }
    for (int i = 0; i < 2; ++i) step_through_fade();
  }
};

START_TEST(forces_add) {
  ServerRig rig;
  const Scene a = rig.join("a"), c = rig.join("c");
  Scene b = rig.join("b");
  set(rig.base, push("x", 1, {0, 0, 1}));
  set(a, push("x", 2, {0, 1, 0}));
  set(b, push("x", 3, {1, 0, 0}));
  set(c, push("x", 4, {0, 0, -1}));
  for (fs_scene* scene : {a.get(), b.get(), c.get()}) rig.settle(scene);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{3, 2, -3}), 1e-12);
  fs_response response;
  fs_wrench sent;
  OK(fs_scene_get_hand(a.get(), nullptr, &response, &sent));
  EXPECT_VECTOR(response.wrench.force, (fs_vec3{0, 2, 0}), 1e-12);  // the force of this scene alone
  EXPECT_VECTOR(sent.force, (fs_vec3{3, 2, -3}), 1e-12);            // the force of all scenes
  EXPECT_VECTOR(record_of(rig.servo.get()).back().response.wrench.force, (fs_vec3{3, 2, -3}), 1e-12);
  ck_assert_uint_eq(record_of(rig.servo.get()).back().response.felt_count, 4);
  EXPECT_VECTOR(record_of(rig.servo.get()).back().response.proxy.position, rig.fake.state.pose.position, 1e-12);
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  wall.pose = at(0, 0, 0.002);
  wall.contact.keep = FS_KEEP_FRONT;
  wall.contact.stiffness = 500;
  wall.contact.limit = 10;
  set(a, wall);
  rig.settle(a.get());
  EXPECT_VECTOR(record_of(rig.servo.get()).back().response.proxy.position, (fs_vec3{0, 0, 0.002}), 1e-6);
  OK(fs_object_remove(a.get(), "wall"));
  rig.settle(a.get());

  // When a client leaves, its force fades out without a step, and its name is free.
  std::vector<fs_wrench> log{rig.fake.written};
  rig.fake.log = &log;
  b.reset();
  const bool is_gone = eventually([&] {
    rig.step();
    return rig.fake.written.force.x == 0;
  });
  rig.fake.log = nullptr;
  ck_assert(is_gone);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 2, -3}), 1e-12);
  for (size_t k = 1; k < log.size(); ++k) {
    ck_assert_double_le(norm(log[k].force - log[k - 1].force), 3 * 0.001 / world_fade * (1 + 1e-6));
  }
  b = rig.join("b");
  ck_assert_uint_eq(own_reports_of(b.get()).size(), 0);
  set(b, push("x", 5, {1, 0, 0}));
  rig.settle(b.get());
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{5, 2, -3}), 1e-12);
}
END_TEST

START_TEST(names_are_private) {
  Two two;
  set(two.base, push("a", 1, {0, 0, 1}));
  set(two.me, push("a", 2, {0, 1, 0}));
  set(two.bob, push("a", 3, {1, 0, 0}));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{3, 2, 1}), 1e-12);
  ck_assert_double_eq(Got(two.me.get(), "a")->front.gain, 2);
  ck_assert_double_eq(Got(two.bob.get(), "a")->front.gain, 3);
  ck_assert_double_eq(Got(two.me.get(), "me/a")->front.gain, 2);  // its own, by its full name
  ck_assert_double_eq(Got(two.me.get(), "bob/a")->front.gain, 3);
  ck_assert_double_eq(Got(two.bob.get(), "me/a")->front.gain, 2);
  ck_assert_double_eq(Got(two.bob.get(), "server/a")->front.gain, 1);
  OK(fs_object_remove(two.me.get(), "a"));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{3, 0, 1}), 1e-12);
  ck_assert(!has(two.me.get(), "a") && !has(two.bob.get(), "me/a") && has(two.me.get(), "bob/a"));
  OK(fs_scene_clear(two.bob.get()));  // its own only
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 1}), 1e-12);
  for (const char* name : {"nobody/a", "me/none", "server/none", "/a", "me/", "bob/a/b", "bob//a"}) {
    ck_assert_msg(!has(two.bob.get(), name), "%s", name);
    fs_report report;
    EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_report(two.bob.get(), name, &report));
    EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(two.bob.get(), name));
  }
}
END_TEST

// Its own object by its full name: each call is the same.
START_TEST(own_names_in_full) {
  Two two;
  set(two.me, push("a", 2));
  fs_object o = push("a", 3);
  std::strcpy(o.name, "me/a");
  OK(fs_object_change(two.me.get(), &o, FS_PART_PROFILES));
  fs_object bad = o;
  bad.front.gain = -1;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(two.me.get(), &bad, FS_PART_PROFILES), "object 'me/a': front.");
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 3}), 1e-12);
  const Got seen(two.me.get(), "me/a");
  ck_assert_str_eq(seen->name, "a");
  const fs_pose pose{{0, -100, 0}, turn({1, 0, 0}, -1.5707963267948966)};
  OK(fs_object_move(two.me.get(), "me/a", &pose, nullptr, FS_NOW));
  const fs_twist still{};
  OK(fs_object_move(two.me.get(), "me/a", &pose, &still, FS_NOW));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 3, 0}), 1e-12);
  fs_report report;
  OK(fs_scene_get_report(two.me.get(), "me/a", &report));
  ck_assert_str_eq(report.name, "a");
  EXPECT_VECTOR(report.wrench.force, (fs_vec3{0, 3, 0}), 1e-12);
  OK(fs_object_remove(two.me.get(), "me/a"));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 1e-12);
  for (const fs_event& e : events_now(two.me.get())) ck_assert_int_ne(e.kind, FS_EVENT_EDITED);
  EXPECT(FS_ERROR_INVALID, fs_object_set(two.me.get(), &o));  // fs_object_set does not take another client's name
}
END_TEST

// Who is told of an edit, or of a refusal, finds it done when it looks at once.
START_TEST(what_an_event_tells_is_there) {
  Two two;
  set(two.me, push("a", 1));
  OK(two.sync(two.me.get()));
  for (int i = 1; i <= 100; ++i) {
    std::thread bob([&] {  // the change waits until the server has told the owner
      const fs_object o = push("me/a", 1 + i);
      OK(fs_object_change(two.bob.get(), &o, FS_PART_PROFILES));
    });
    fs_event event;
    do OK(fs_scene_next_event(two.me.get(), 0, &event)); while (event.kind != FS_EVENT_EDITED);
    const double gain = Got(two.me.get(), "a")->front.gain;
    bob.join();
    ck_assert_double_eq(gain, 1 + i);
  }
}
END_TEST

// Another client's object: seen, changed, moved and removed; the owner is told, and sees the same.
static void change_of_others(Two& two, fs_scene* owner, const std::string& prefix) {
  fs_scene* const bob = two.bob.get();
  const std::string name = prefix + "/a";
  const char* const full = name.c_str();
  const auto is_told = [&] {
    const fs_event event = next_event(owner, FS_EVENT_EDITED);
    ck_assert_str_eq(event.name, "a");
    ck_assert_str_eq(event.text, "bob");
    ck_assert_int_eq(event.status, FS_OK);
    ck_assert_double_le(event.time, now(owner));
  };
  const auto settle = [&] {
    OK(two.sync(bob));
    if (owner != two.base.get()) OK(two.sync(owner));
    two.step_through_fade();
  };
  two.fake.state.pose = at(0.1, 0, 0);
  fs_object o = spring("a", {0.3, 0, 0});
  o.time = 1e-3;
  o.lifetime = 1e7;
  o.start = -4;
  OK(fs_object_set(owner, &o));
  settle();
  {
    const Got seen(bob, full);
    ck_assert_str_eq(seen->name, full);  // so it can be changed as it is
    EXPECT_VECTOR(seen->pose.position, o.pose.position, 0);
    ck_assert(seen->time == o.time && seen->lifetime == o.lifetime && seen->start == -4 && seen->front.gain == 100);
  }
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{20, 0, 0}), 1e-12);

  // Parts of it: the owner's pose stays, and its moves go on.
  fs_object change = spring("", {9, 9, 9}, 50);
  change.lifetime = 3;
  std::strcpy(change.name, full);
  OK(fs_object_change(bob, &change, FS_PART_PROFILES));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{10, 0, 0}), 1e-12);
  is_told();
  ck_assert_double_eq(Got(owner, "a")->front.gain, 50);
  ck_assert_double_eq(Got(owner, "a")->lifetime, 1e7);
  ck_assert_double_eq(Got(owner, "a")->start, -4);
  EXPECT_VECTOR(Got(owner, "a")->pose.position, o.pose.position, 0);
  const fs_pose here = at(0.2, 0, 0), there = at(0.1, 0.04, 0);
  const fs_twist still{};
  OK(fs_object_move(owner, "a", &here, &still, FS_NOW));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{5, 0, 0}), 1e-12);
  EXPECT_VECTOR(Got(bob, full)->pose.position, here.position, 0);

  // Moved by the other, then by the owner again.
  OK(fs_object_move(bob, full, &there, &still, FS_NOW));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 2, 0}), 1e-12);
  is_told();
  EXPECT_VECTOR(Got(owner, "a")->pose.position, there.position, 0);
  OK(fs_object_move(owner, "a", &here, &still, FS_NOW));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{5, 0, 0}), 1e-12);
  change.pose = there;
  OK(fs_object_change(bob, &change, FS_PART_POSE | FS_PART_OTHER));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 2, 0}), 1e-12);
  is_told();
  ck_assert_double_eq(Got(owner, "a")->lifetime, 3);
  EXPECT_VECTOR(Got(owner, "a")->pose.position, there.position, 0);
  OK(fs_object_change(bob, &change, 0));
  OK(fs_object_set(owner, &o));  // the owner sets it again
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{20, 0, 0}), 1e-12);

  // A shape and a curve of the other's.
  const Shape box = make_mesh(box_mesh({0.01, 0.02, 0.03}));
  const double table[]{2, 2};
  const Curve curve = make_table(table, 2, 0.1);
  fs_object mesh = fs_object_init(full, FS_PRIMITIVE_MESH);
  mesh.shape = box.get();
  mesh.front = mesh.back = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 2, 0, 100);
  mesh.front.curve = mesh.back.curve = curve.get();
  OK(fs_object_change(bob, &mesh, FS_PART_SHAPE | FS_PART_PROFILES));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4, 0, 0}), 1e-12);
  is_told();
  {
    const Got seen(owner, "a");
    size_t points = 0, triangles = 0, entries = 0;
    double step = 0;
    ck_assert_int_eq(seen->primitive, FS_PRIMITIVE_MESH);
    const fs_vec3* p = fs_shape_get_points(seen->shape, &points);
    const uint32_t* t = fs_shape_get_triangles(seen->shape, &triangles);
    ck_assert(points == 8 && triangles == 12);
    ck_assert_int_eq(std::memcmp(p, fs_shape_get_points(box.get(), &points), points * sizeof *p), 0);
    ck_assert_int_eq(std::memcmp(t, fs_shape_get_triangles(box.get(), &triangles), 3 * triangles * sizeof *t), 0);
    const double* f = fs_curve_get_table(seen->back.curve, &entries, &step);
    ck_assert(entries == 2 && step == 0.1 && f[0] == 2 && f[1] == 2);
    fs_object again = seen.object;  // as the owner sees it, it can set it
    again.pose = at(-1, 0, 0);
    again.time = FS_NOW;
    OK(fs_object_set(owner, &again));
  }
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-4, 0, 0}), 1e-12);
  fs_vec3 f{}, x{0.1, 0, 0};
  OK(fs_evaluate_field(owner, nullptr, FS_NOW, &x, 1, &f));  // its own tools feel it too
  EXPECT_VECTOR(f, (fs_vec3{-4, 0, 0}), 1e-12);

  // These are refused and change nothing: a change that makes an invalid object, and names that do not exist.
  change.front.gain = -1;
  const std::string as_asked = std::string("object '") + full + "': front.gain is -1";
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(bob, &change, FS_PART_PROFILES), as_asked.c_str());
  OK(fs_scene_begin(bob));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(bob, &change, FS_PART_PROFILES), as_asked.c_str());
  OK(fs_scene_cancel(bob));
  change = fs_object_init(full, FS_PRIMITIVE_MESH);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(bob, &change, FS_PART_SHAPE), "shape");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(bob, &change, 64), "parts");
  fs_pose bad = here;
  bad.orientation.w = 2;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(bob, full, &bad, nullptr, FS_NOW), "orientation");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_move(bob, full, &here, nullptr, NAN), "time");
  const std::string missing = prefix + "/missing";
  fs_object none = spring(missing.c_str());
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_change(bob, &none, FS_PART_POSE), "missing");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_change(bob, &none, 0), "missing");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_move(bob, missing.c_str(), &here, nullptr, FS_NOW), "missing");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_remove(bob, missing.c_str()), "missing");
  EXPECT(FS_ERROR_INVALID, fs_object_set(bob, &none));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-4, 0, 0}), 1e-12);

  // In a group, which is cancelled.
  OK(fs_scene_begin(bob));
  OK(fs_object_remove(bob, full));
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_move(bob, full, &here, nullptr, FS_NOW), full);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_remove(bob, missing.c_str()), "missing");
  OK(fs_scene_cancel(bob));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-4, 0, 0}), 1e-12);

  // Removed by the other client: the owner no longer has it, and can set it again.
  OK(fs_object_remove(bob, full));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 0);
  is_told();
  ck_assert(!has(owner, "a") && !has(bob, full));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(owner, "a", &here, nullptr, FS_NOW));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(owner, "a"));
  OK(fs_object_set(owner, &o));
  settle();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{20, 0, 0}), 1e-12);
  // these objects are not this client's
  for (const fs_event& e : events_now(bob)) ck_assert_int_ne(e.kind, FS_EVENT_EDITED);
}
START_TEST(objects_of_others) {
  Two two;
  change_of_others(two, two.me.get(), "me");
}
END_TEST
START_TEST(objects_of_the_server) {
  Two two;
  change_of_others(two, two.base.get(), "server");
}
END_TEST

// A group begins with what others have changed before: its getters show that, and setting what they gave undoes nothing.
START_TEST(edits_before_a_group) {
  Two two;
  fs_scene* const me = two.me.get();
  for (int i = 1; i <= 20; ++i) {
    for (const char* name : {"a", "b"}) set(two.me, push(name, 1));
    OK(two.sync(me));
    const fs_object edit = push("me/a", 1 + i);
    OK(fs_object_change(two.bob.get(), &edit, FS_PART_PROFILES));
    OK(fs_object_remove(two.bob.get(), "me/b"));
    OK(fs_scene_begin(me));
    for (Patience p; Got(me, "a")->front.gain != 1 + i && p.lasts();) {  // the server was held up for longer than the call waits
      OK(fs_scene_cancel(me));
      OK(fs_scene_begin(me));
    }
    {
      Got a(me, "a");
      ck_assert_double_eq(a->front.gain, 1 + i);
      ck_assert(!has(me, "b"));
      OK(fs_object_set(me, &a.object));
    }
    OK(fs_scene_commit(me));
    OK(two.sync(me));
    ck_assert_double_eq(Got(two.bob.get(), "me/a")->front.gain, 1 + i);
  }
}
END_TEST

// A group that is refused leaves its objects where others have moved them since this client moved them.
START_TEST(a_refused_group_moves_nothing) {
  Two two;
  fs_scene *const me = two.me.get(), *const bob = two.bob.get();
  for (const bool is_removal : {true, false}) {
    set(two.me, push("a", 1));
    set(two.bob, push("b", 1));
    OK(two.sync(bob));
    const fs_pose mine = at(0.2, 0, 0), his = at(0.3, 0, 0);
    OK(fs_object_move(me, "a", &mine, nullptr, FS_NOW));
    OK(two.sync(me));
    OK(fs_object_move(bob, "me/a", &his, nullptr, FS_NOW));
    OK(two.sync(bob));
    OK(fs_scene_begin(me));
    const fs_object o = push("a", 5);
    OK(is_removal ? fs_object_remove(me, "a") : fs_object_change(me, &o, FS_PART_PROFILES));
    OK(fs_object_remove(me, "bob/b"));
    OK(fs_object_remove(bob, "b"));
    OK(two.sync(bob));
    OK(fs_scene_commit(me));
    ck_assert_int_eq(two.sync(me), FS_ERROR_NOT_FOUND);
    for (const auto& [scene, name] : {std::pair{me, "a"}, std::pair{bob, "me/a"}}) {
      const Got a(scene, name);
      ck_assert_double_eq(a->pose.position.x, 0.3);
      ck_assert_double_eq(a->front.gain, 1);
    }
  }
}
END_TEST

START_TEST(edits_in_an_open_group) {  // the owner's group and the other client's changes both take effect
  Two two;
  for (const char* name : {"a", "b"}) set(two.me, push(name, 1));
  two.settle_all();
  OK(fs_scene_begin(two.me.get()));
  set(two.me, push("c", 10));
  fs_object o = push("me/a", 5);
  OK(fs_object_change(two.bob.get(), &o, FS_PART_PROFILES));
  OK(fs_object_remove(two.bob.get(), "me/b"));
  o = push("b", 100);
  // a change of an object that the other client has removed meanwhile
  OK(fs_object_change(two.me.get(), &o, FS_PART_PROFILES));
  OK(fs_scene_commit(two.me.get()));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 15}), 1e-12);
  ck_assert_double_eq(Got(two.me.get(), "a")->front.gain, 5);
  ck_assert(has(two.me.get(), "c") && !has(two.me.get(), "b"));
  set(two.me, push("b", 100));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 115}), 1e-12);
}
END_TEST

// A group changes the parts that it names. What somebody else has changed of the same object meanwhile stays, and what is
// gone stays gone; a set replaces the whole.
START_TEST(groups_change_only_their_parts) {
  Two two;
  for (const char* name : {"a", "b", "c", "d", "e"}) set(two.base, push(name, 1, {0, 0, 1}));
  two.settle_all();
  OK(fs_scene_begin(two.base.get()));
  fs_object o = push("a", 2);
  OK(fs_object_change(two.base.get(), &o, FS_PART_PROFILES));
  o.pose.position.x = 5;
  std::strcpy(o.name, "b");
  OK(fs_object_change(two.base.get(), &o, FS_PART_POSE));
  for (const char* name : {"c", "d"}) {
    std::strcpy(o.name, name);
    OK(fs_object_change(two.base.get(), &o, FS_PART_PROFILES));
  }
  set(two.base, push("e", 7));
  // Not evaluated yet, so nobody else is told of it.
  fs_report report;
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_report(two.bob.get(), "server/new", &report));
  set(two.base, push("new", 1));
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_report(two.bob.get(), "server/new", &report));
  fs_pose pose{};
  pose.position.y = 3;
  const fs_twist still{};
  OK(fs_object_move(two.bob.get(), "server/a", &pose, &still, FS_NOW));
  o = push("server/b", 4);
  o.lifetime = 1e6;
  OK(fs_object_change(two.bob.get(), &o, FS_PART_PROFILES | FS_PART_OTHER));
  o.enabled = false;
  std::strcpy(o.name, "server/c");
  OK(fs_object_change(two.bob.get(), &o, FS_PART_OTHER));
  OK(fs_object_remove(two.bob.get(), "server/d"));
  OK(fs_object_remove(two.bob.get(), "server/e"));
  OK(fs_scene_commit(two.base.get()));
  two.settle_all();
  const Got a(two.base.get(), "a"), b(two.base.get(), "b"), c(two.base.get(), "c");
  ck_assert_double_eq(a->front.gain, 2);
  ck_assert_double_eq(a->pose.position.y, 3);
  ck_assert_double_eq(b->front.gain, 4);
  ck_assert_double_eq(b->lifetime, 1e6);
  ck_assert_double_eq(b->pose.position.x, 5);
  ck_assert_double_eq(c->front.gain, 2);
  ck_assert(!c->enabled);
  ck_assert(!has(two.base.get(), "d"));
  ck_assert_double_eq(Got(two.base.get(), "e")->front.gain, 7);
}
END_TEST

// What other threads do while this one has a group open goes past the group, and both ends agree on what there is.
START_TEST(others_go_past_a_group) {
  Two two;
  fs_scene* const me = two.me.get();
  const fs_twist still{};
  const auto move = [&](const char* name, double z) {
    const fs_pose pose = at(0, 0, z);
    OK(fs_object_move(me, name, &pose, &still, FS_NOW));
  };
  const auto elsewhere = [](auto&& f) { std::thread(f).join(); };
  const auto expect_at = [&](const char* name, double z) {
    EXPECT_NEAR(Got(me, name)->pose.position.z, z, 0);
    OK(two.sync(me));
    EXPECT_NEAR(Got(two.bob.get(), ("me/" + std::string(name)).c_str())->pose.position.z, z, 0);
    EXPECT_NEAR(Got(me, name)->pose.position.z, z, 0);
  };
  set(two.me, spring("x"));
  set(two.me, spring("y"));
  two.settle_all();

  // A move that this thread looks at within its group is not part of it.
  OK(fs_scene_begin(me));
  elsewhere([&] { move("x", 0.01); });
  EXPECT_NEAR(Got(me, "x")->pose.position.z, 0.01, 0);
  OK(fs_scene_cancel(me));
  expect_at("x", 0.01);
  // Nor does it matter to the group that the object is removed in it.
  OK(fs_scene_begin(me));
  OK(fs_object_remove(me, "x"));
  elsewhere([&] { move("x", 0.02); });
  EXPECT_NEAR(Got(me, "y")->pose.position.z, 0, 0);
  ck_assert(!has(me, "x"));
  OK(fs_scene_cancel(me));
  expect_at("x", 0.02);
  // The group's own move comes after it.
  OK(fs_scene_begin(me));
  move("x", 0.03);
  elsewhere([&] { move("x", 0.04); });
  EXPECT_NEAR(Got(me, "x")->pose.position.z, 0.03, 0);
  OK(fs_scene_commit(me));
  expect_at("x", 0.03);

  // A clear takes what the group knew.
  OK(fs_scene_begin(me));
  set(two.me, spring("of the group"));
  OK(fs_scene_clear(me));
  elsewhere([&] { set(two.me, spring("later")); });
  set(two.me, spring("after"));
  OK(fs_scene_commit(me));
  two.settle_all();
  for (const char* name : {"x", "y", "of the group"}) {
    ck_assert(!has(me, name) && !has(two.bob.get(), ("me/" + std::string(name)).c_str()));
  }
  move("later", 0.05);
  move("after", 0.06);
  expect_at("later", 0.05);
  expect_at("after", 0.06);
}
END_TEST

// Accuracy and the bound of the slope belong to no group: a cancel does not take them back.
START_TEST(settings_belong_to_no_group) {
  fs_servo_options options = world_options();
  options.max_stiffness = 2000;
  options.damping = 0;  // the default
  ServerRig rig(fs_server_options_init(), options);
  const Scene me = rig.join("me");
  fs_object hill = fs_object_init("hill", FS_PRIMITIVE_POINT);
  hill.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  hill.front.width = 0.01;
  hill.pose = at(0.05, 0, 0);  // five widths away
  set(me, hill);
  set(me, spring("wall"));
  rig.settle(me.get());
  const auto error = [&] { return record_of(rig.servo.get()).back().response.error_bound; };
  EXPECT_NEAR(report_of(me.get(), "wall").stiffness_applied, 100, 1e-9);
  ck_assert_double_eq(error(), 0);
  OK(fs_scene_begin(me.get()));
  OK(fs_scene_set_accuracy(me.get(), 0.5));
  OK(fs_scene_set_max_stiffness(me.get(), 20));
  OK(fs_scene_cancel(me.get()));
  rig.settle(me.get());
  rig.step(100);
  ck_assert_double_le(report_of(me.get(), "wall").stiffness_applied, 20 * (1 + 1e-9));
  ck_assert_double_gt(error(), 0);
}
END_TEST

// The server keeps so many shapes and curves of a client: what the client uses no more makes room while a call waits.
START_TEST(room_for_shapes) {
  fs_server_options few = fs_server_options_init();
  few.max_objects = 1;
  ServerRig rig(few);
  const Scene me = rig.join("me");
  for (int round = 0; round < 4; ++round) {
    OK(fs_scene_begin(me.get()));
    for (int i = 0; i < 67; ++i) {
      const fs_vec3 points[]{{0, 0, 0}, {0.01, 0, 0.001 * i}};
      const Shape line = make_polyline(points, 2, false);
      const Curve curve = make_expression("1 - d");
      fs_object o = fs_object_init("x", FS_PRIMITIVE_POLYLINE);
      o.shape = line.get();
      o.front.kind = FS_PROFILE_CUSTOM;
      o.front.limit = 1;
      o.front.curve = curve.get();
      set(me, o);
    }
    const Stepper stepper(rig.servo.get());
    OK(fs_scene_commit(me.get()));
  }
}
END_TEST

START_TEST(many_edits) {  // many objects are edited, some of them repeatedly
  Two two;
  for (int i = 0; i < 100; ++i) set(two.me, push(("o" + std::to_string(i)).c_str(), 0.5));
  two.settle_all();
  double sum = 0;
  for (int i = 0; i < 100; ++i) {
    const std::string name = "me/o" + std::to_string(i);
    if (i % 10 == 9) {
      OK(fs_object_remove(two.bob.get(), name.c_str()));
      continue;
    }
    for (int k = 0; k <= i % 3; ++k) {
      const fs_object o = push(name.c_str(), 0.01 * i + k + 0.01);
      OK(fs_object_change(two.bob.get(), &o, FS_PART_PROFILES));
    }
    sum += 0.01 * i + i % 3 + 0.01;
  }
  two.settle_all();
  EXPECT_NEAR(two.fake.written.force.z, sum, 1e-9);
  std::map<std::string, int> told;
  for (const fs_event& e : events_now(two.me.get())) told[e.name] += e.kind == FS_EVENT_EDITED;
  ck_assert_uint_ge(told.size(), 100);
  for (int i = 0; i < 100; ++i) {
    const std::string name = "o" + std::to_string(i);
    ck_assert_int_ge(told[name], 1);
    ck_assert(has(two.me.get(), name.c_str()) == (i % 10 != 9));
    if (i % 10 != 9) ck_assert_double_eq(Got(two.me.get(), name.c_str())->front.gain, 0.01 * i + i % 3 + 0.01);
  }
  ck_assert_uint_eq(own_reports_of(two.me.get()).size(), 90);
}
END_TEST

// A group with all kinds of changes: each client feels its part in one tick, or nothing of it.
START_TEST(groups_of_all) {
  Two two;
  set(two.base, push("s", 1, {0, 0, 1}));
  set(two.me, push("a", 2, {0, 1, 0}));
  set(two.me, push("b", 3, {0, 1, 0}));
  set(two.bob, push("x", 4, {1, 0, 0}));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4, 5, 1}), 1e-12);
  fs_scene* const bob = two.bob.get();
  const auto change_all = [&](double factor) {
    OK(fs_scene_begin(bob));
    for (const char* name : {"x", "me/a", "server/s"}) {
      Got got(bob, name);
      got.object.front.gain *= factor;
      got.object.front.limit *= factor;
      OK(fs_object_change(bob, &got.object, FS_PART_PROFILES));
      ck_assert_double_eq(Got(bob, name)->front.gain, got.object.front.gain);  // with the change of the open group
    }
    OK(fs_object_remove(bob, "me/b"));
    ck_assert(!has(bob, "me/b"));
    const fs_pose pose = at(0, 0, -50);
    const fs_twist still{};
    OK(fs_object_move(bob, "server/s", &pose, &still, FS_NOW));
    EXPECT_VECTOR(Got(bob, "server/s")->pose.position, pose.position, 0);
  };
  change_all(2);
  two.step(20);
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4, 5, 1}), 1e-12);  // not before
  ck_assert(has(two.me.get(), "b"));
  OK(fs_scene_cancel(bob));
  ck_assert_double_eq(Got(bob, "me/a")->front.gain, 2);

  change_all(2);
  std::vector<fs_wrench> log;
  two.fake.log = &log;
  OK(fs_scene_commit(bob));
  OK(two.sync(bob));
  two.step_through_fade();
  two.fake.log = nullptr;
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{8, 4, 2}), 1e-12);
  for (const fs_wrench& w : log) {  // profiles act at once; what was removed fades
    ck_assert(std::fabs(w.force.x - 4) < 1e-9 || std::fabs(w.force.x - 8) < 1e-9);
    ck_assert_msg(std::fabs(w.force.z - 1) < 1e-9 || std::fabs(w.force.z - 2) < 1e-9, "%.17g", w.force.z);
    ck_assert(std::fabs(w.force.y - 5) < 1e-9 || (w.force.y >= 4 - 1e-9 && w.force.y <= 7 + 1e-9));
  }
  ck_assert(!has(two.me.get(), "b"));
  ck_assert_double_eq(Got(two.me.get(), "a")->front.gain, 4);
  EXPECT_VECTOR(Got(two.base.get(), "s")->pose.position, (fs_vec3{0, 0, -50}), 0);
  std::set<std::string> told;
  for (const fs_event& e : events_now(two.me.get())) {
    if (e.kind == FS_EVENT_EDITED) told.insert(e.name);
  }
  ck_assert(told == (std::set<std::string>{"a", "b"}));

  // One part of the group is impossible, as its object was removed before the group arrived. So nothing of the group is
  // done.
  OK(fs_scene_begin(bob));
  for (const char* name : {"x", "server/s", "me/a"}) {
    Got got(bob, name);
    got.object.front.gain = 100;
    OK(fs_object_change(bob, &got.object, FS_PART_PROFILES));
  }
  OK(fs_object_remove(two.me.get(), "a"));
  OK(two.sync(two.me.get()));
  OK(fs_scene_commit(bob));
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, two.sync(bob), "me/a");
  two.step_through_fade();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{8, 0, 2}), 1e-12);
  ck_assert_double_eq(Got(bob, "x")->front.gain, 8);  // and bob knows
  ck_assert_double_eq(Got(two.base.get(), "s")->front.gain, 2);

  // The server's own scene has an open group, too: the two groups do not affect each other.
  OK(fs_scene_begin(two.base.get()));
  fs_object s = push("s2", 1, {0, 0, 1});
  OK(fs_object_set(two.base.get(), &s));
  OK(fs_scene_begin(bob));
  OK(fs_object_remove(bob, "server/s"));
  OK(fs_object_remove(bob, "x"));
  OK(fs_scene_commit(bob));
  OK(two.sync(bob));
  two.step_through_fade();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 0}), 1e-12);
  OK(fs_scene_commit(two.base.get()));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 1}), 1e-12);
  ck_assert(!has(two.base.get(), "s") && has(two.base.get(), "s2"));

  // A single change does not join that group either.
  OK(fs_scene_begin(two.base.get()));
  OK(fs_object_remove(two.base.get(), "s2"));
  ck_assert(has(bob, "server/s2"));
  Got alone(bob, "server/s2");
  alone.object.front.gain = alone.object.front.limit = 3;
  OK(fs_object_change(bob, &alone.object, FS_PART_PROFILES));
  OK(fs_scene_cancel(two.base.get()));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 3}), 1e-12);

  // Changed parts are checked at once together with the rest of the object.
  OK(fs_scene_begin(bob));
  fs_object bad = fs_object_init("server/s2", FS_PRIMITIVE_PLANE);
  bad.front = constant(FS_SENSE_REPULSIVE, -1);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_change(bob, &bad, FS_PART_PROFILES), "front.gain");
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(bob, "server/s"));
  OK(fs_scene_commit(bob));
  OK(two.sync(bob));
}
END_TEST

// A client may end the force of all, unless the server keeps it; the servo's owner, or a client of the same user, lets it
// return.
START_TEST(a_client_stops_the_force) {
  Two two;
  set(two.me, push("a", 2));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  OK(fs_scene_stop_force(two.bob.get()));
  two.step();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 0);
  ck_assert_uint_eq(stats_of(two.bob.get()).enabled, 0);
  OK(fs_scene_stop_force(two.me.get()));  // once more
  const auto resumes = std::vector<std::function<fs_status()>>{
      [&] { return fs_servo_set_enabled(two.servo.get(), true); }, [&] { return fs_scene_resume_force(two.bob.get()); },
      [&] { return fs_scene_resume_force(two.base.get()); }};
  for (const auto& resume : resumes) {
    OK(fs_scene_stop_force(two.bob.get()));
    two.step(2);
    EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 0);
    OK(resume());
    two.step(2);
    EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
    ck_assert_uint_eq(stats_of(two.bob.get()).enabled, 1);
  }
  OK(fs_scene_begin(two.me.get()));
  set(two.me, push("b", 5));
  OK(fs_scene_stop_force(two.me.get()));  // it does not wait for the group
  two.step();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 0);
  OK(fs_scene_commit(two.me.get()));
}
END_TEST

START_TEST(a_server_keeps_the_force) {
  fs_server_options options = fs_server_options_init();
  options.no_stop = true;
  Two two(options);
  set(two.me, push("a", 2));
  two.settle_all();
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_scene_stop_force(two.bob.get()), "does not let a client end the force");
  two.step();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  OK(fs_scene_stop_force(two.base.get()));  // the owner's own scene is no client
  two.step();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{}), 0);
}
END_TEST

START_TEST(locked) {
  fs_server_options options = fs_server_options_init();
  options.locked = true;
  Two two(options);
  set(two.base, push("a", 1));
  set(two.me, push("a", 2));
  two.settle_all();
  const fs_pose pose = at(0, 0, 0);
  for (const char* name : {"me/a", "server/a"}) {
    const fs_object o = push(name, 9);
    EXPECT_SENTENCE(FS_ERROR_DENIED, fs_object_change(two.bob.get(), &o, FS_PART_PROFILES), name);
    EXPECT(FS_ERROR_DENIED, fs_object_move(two.bob.get(), name, &pose, nullptr, FS_NOW));
    EXPECT(FS_ERROR_DENIED, fs_object_remove(two.bob.get(), name));
    ck_assert(has(two.bob.get(), name));  // reading is allowed
    fs_view view;
    OK(fs_scene_get_view(two.bob.get(), name[0] == 'm' ? "me" : "server", &view));
    ck_assert(view.locked);
  }
  const fs_object o = push("me/a", 3);
  OK(fs_object_change(two.me.get(), &o, FS_PART_PROFILES));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{0, 0, 4}), 1e-12);
  ck_assert_uint_eq(events_now(two.base.get()).size(), 3);  // the device is ready, and two clients are there
}
END_TEST

START_TEST(views) {  // each client has a frame, a clutch and a tool of its own
  Two two;
  fs_frame mine = fs_frame_init(), bobs = fs_frame_init();
  mine.scale = 2;
  bobs.pose.orientation = turn({0, 0, 1}, 1.5707963267948966);
  bobs.force_scale = 3;
  OK(fs_scene_set_frame(two.me.get(), &mine));
  OK(fs_scene_set_frame(two.bob.get(), &bobs));
  const fs_vec3 arm{0, 0, 0.5};
  OK(fs_scene_set_tool(two.bob.get(), &arm, 1));
  set(two.base, spring("a", {}, 1));
  set(two.me, spring("a", {}, 10));
  set(two.bob, push("a", 2, {1, 0, 0}));
  two.fake.state.pose = at(0.1, 0, 0);
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-0.1 - 2, 6, 0}), 1e-12);
  EXPECT_VECTOR(two.fake.written.torque, (fs_vec3{-3, 0, 0}), 1e-12);
  ck_assert_uint_eq(tool_of(two.me.get()).size(), 1);
  EXPECT_VECTOR(tool_of(two.me.get())[0], (fs_vec3{}), 0);
  // The frame of any client.
  ck_assert_double_eq(frame_of(two.me.get(), "bob").force_scale, 3);
  ck_assert_double_eq(frame_of(two.bob.get(), "bob").force_scale, 3);
  ck_assert_double_eq(frame_of(two.bob.get(), "me").scale, 2);
  ck_assert_double_eq(frame_of(two.bob.get(), "server").scale, 1);
  fs_frame none;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_frame(two.me.get(), "nobody", &none), "nobody");
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_frame(two.base.get(), "me", &none), "me");
  // A clutch holds only its own scene.
  OK(fs_scene_set_clutch(two.me.get(), true));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-0.1, 6, 0}), 1e-12);
  fs_state state;
  OK(fs_scene_get_hand(two.me.get(), &state, nullptr, nullptr));
  ck_assert_uint_eq(state.flags, FS_STATE_READY | FS_STATE_CLUTCHED);
  OK(fs_scene_get_hand(two.bob.get(), &state, nullptr, nullptr));
  ck_assert_uint_eq(state.flags, FS_STATE_READY);
  EXPECT_VECTOR(state.pose.position, (fs_vec3{0, -0.1, 0}), 1e-12);
  two.fake.state.pose = at(0.3, 0, 0);
  two.settle_all();
  OK(fs_scene_set_clutch(two.me.get(), false));
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{-0.3 - 2, 6, 0}), 1e-12);
  EXPECT_VECTOR(frame_of(two.bob.get(), "me").pose.position, (fs_vec3{0.2, 0, 0}), 1e-12);
  EXPECT_VECTOR(frame_of(two.bob.get()).pose.position, (fs_vec3{}), 0);
}
END_TEST

START_TEST(reports_of_all) {
  Two two;
  Random random(31);
  const fs_vec3 arms[]{{0.1, 0, 0}, {0, 0.05, 0}};
  fs_frame frames[3];  // of me, bob, the server
  fs_scene* const scenes[]{two.me.get(), two.bob.get(), two.base.get()};
  for (int i = 0; i < 3; ++i) {
    frames[i] = {random.pose(0.1), random.between(0.5, 3), random.between(0.2, 2), {}};
    OK(fs_scene_begin(scenes[i]));  // tool and frame are one version, which fades in once
    if (i < 2) OK(fs_scene_set_tool(scenes[i], arms, i == 0 ? 2 : 1));
    OK(fs_scene_set_frame(scenes[i], &frames[i]));
    OK(fs_scene_commit(scenes[i]));
    const fs_object near = spring("near", random.in_box(0.1), 20);
    fs_object far = spring("far", {50, 0, 0});
    far.front.reach = 0.1;
    OK(fs_object_set(scenes[i], &near));
    OK(fs_object_set(scenes[i], &far));
  }
  two.fake.state.pose = random.pose(0.05);
  two.settle_all();

  const char* const prefixes[]{"me/", "bob/", "server/"};
  for (int viewer = 0; viewer < 2; ++viewer) {
    std::map<std::string, fs_report> all;
    for (const fs_report& r : reports_of(scenes[viewer])) all[r.name] = r;
    ck_assert_uint_eq(all.size(), 6);
    for (int owner = 0; owner < 3; ++owner) {
      const std::string prefix = owner == viewer ? "" : prefixes[owner];
      ck_assert(all.contains(prefix + "near") && all.contains(prefix + "far"));
      const fs_report seen = all[prefix + "near"], own = report_of(scenes[owner], "near");
      const fs_report single = report_of(scenes[viewer], (prefix + "near").c_str());
      ck_assert_int_eq(std::memcmp(&single, &seen, sizeof seen), 0);
      ck_assert(seen.state == FS_OBJECT_FELT && seen.weight == 1 && seen.primitive == FS_PRIMITIVE_POINT);
      ck_assert(seen.revision == own.revision && seen.stiffness_wanted == own.stiffness_wanted);
      ck_assert(std::isinf(all[prefix + "far"].distance));
      EXPECT_VECTOR(all[prefix + "far"].wrench.force, (fs_vec3{}), 0);
      if (owner == viewer) {
        EXPECT_VECTOR(seen.point, Got(scenes[owner], "near")->pose.position, 1e-12);
        continue;
      }
      // The point through the device into the viewer's frame; the force at the device, along the viewer's axes.
      const fs_frame &f = frames[owner], &v = frames[viewer];
      fs_pose pose = Got(scenes[owner], "near")->pose;
      OK(fs_frame_to_device(&f, &pose, &pose));
      OK(fs_frame_to_scene(&v, &pose, &pose));
      EXPECT_VECTOR(seen.point, pose.position, 0);
      fs_response response;
      OK(fs_scene_get_hand(scenes[owner], nullptr, &response, nullptr));
      const fs_vec3 force = f.force_scale * rotate(f.pose.orientation, response.wrench.force);
      const fs_vec3 torque = (f.force_scale / f.scale) * rotate(f.pose.orientation, response.wrench.torque);
      ck_assert_double_gt(norm(force), 0.01);
      EXPECT_VECTOR(seen.wrench.force, rotate(inverse(v.pose.orientation), force), 1e-12);
      EXPECT_VECTOR(seen.wrench.torque, rotate(inverse(v.pose.orientation), torque), 1e-12);
      EXPECT_NEAR(seen.distance, own.distance / f.scale * v.scale, 1e-12);
    }
    // Their sum is what the device gets.
    fs_vec3 sum{};
    for (const auto& [name, r] : all) {
      const bool is_own = name.find('/') == std::string::npos;
      sum = sum + (is_own ? frames[viewer].force_scale : 1) * rotate(frames[viewer].pose.orientation, r.wrench.force);
    }
    EXPECT_VECTOR(sum, two.fake.written.force, 1e-11);
  }
  // A scene in this process has reports of its own objects.
  ck_assert_uint_eq(reports_of(two.base.get()).size(), 2);
  fs_report one;
  size_t count = 0;
  OK(fs_scene_get_reports(two.me.get(), &one, 1, &count));
  ck_assert_uint_eq(count, 6);
}
END_TEST

START_TEST(shapes_of_others) {
  Two two;
  const Shape torus = make_mesh(torus_mesh(0.05, 0.02, 2000));
  const std::vector<fs_vec3> points = helix(0.03, 0.1, 3, 50);
  const Shape line = make_polyline(points.data(), points.size(), true);
  const double table[]{0.1, 1.0 / 3, 7};
  const Curve curve = make_table(table, 3, 1e-3);
  set(two.me, solid("torus", torus));
  fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  o.shape = line.get();
  o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 10);
  o.front.curve = curve.get();
  set(two.me, o);
  if (has_expressions()) {
    const Curve expression = make_expression("1+sin(t)*d");
    fs_object e = push("expression");
    e.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 10);
    e.front.curve = expression.get();
    set(two.base, e);
    const Got seen(two.bob.get(), "server/expression");
    ck_assert_str_eq(fs_curve_get_expression(seen->front.curve), "1+sin(t)*d");
  }
  two.settle_all();
  {
    const Got mesh(two.bob.get(), "me/torus"), again(two.bob.get(), "me/torus"), wire(two.bob.get(), "me/line");
    size_t n = 0, m = 0;
    const fs_vec3* p = fs_shape_get_points(mesh->shape, &n);
    const fs_vec3* q = fs_shape_get_points(torus.get(), &m);
    ck_assert(n == m && std::memcmp(p, q, n * sizeof *p) == 0);
    const uint32_t* t = fs_shape_get_triangles(mesh->shape, &n);
    const uint32_t* u = fs_shape_get_triangles(torus.get(), &m);
    ck_assert(n == m && std::memcmp(t, u, 3 * n * sizeof *t) == 0);
    ck_assert_ptr_eq(mesh->shape, again->shape);  // fetched once
    p = fs_shape_get_points(wire->shape, &n);
    ck_assert(n == points.size() && std::memcmp(p, points.data(), n * sizeof *p) == 0);
    fs_shape_info info = fs_shape_info_init();
    OK(fs_shape_get_info(wire->shape, &info));
    ck_assert(info.closed && info.primitive == FS_PRIMITIVE_POLYLINE);
    double step = 0;
    const double* f = fs_curve_get_table(wire->front.curve, &n, &step);
    ck_assert(n == 3 && step == 1e-3 && std::memcmp(f, table, sizeof table) == 0);
    // A fetched shape can be used like one that was created here.
    fs_object copy = mesh.object;
    copy.time = copy.start = 0;
    std::strcpy(copy.name, "torus");
    OK(fs_object_set(two.bob.get(), &copy));
    copy = wire.object;
    copy.time = copy.start = 0;
    std::strcpy(copy.name, "line");
    OK(fs_object_set(two.bob.get(), &copy));
    std::strcpy(copy.name, "me/torus");
    OK(fs_object_change(two.bob.get(), &copy, FS_PART_SHAPE | FS_PART_PROFILES));  // and for the other
  }
  two.settle_all();
  const fs_vec3 x{0.07, 0.03, 0.02};
  const auto own = [&](const Scene& scene, const char* name) {
    fs_vec3 f{};
    OK(fs_evaluate_field(scene.get(), name, FS_NOW, &x, 1, &f));
    return f;
  };
  const Scene plain = make_scene();
  set(plain, solid("torus", torus));
  set(plain, o);
  const fs_vec3 of_torus = own(plain, "torus"), of_line = own(plain, "line");
  EXPECT_VECTOR(own(two.bob, "torus"), of_torus, 0);
  EXPECT_VECTOR(own(two.bob, "line"), of_line, 0);
  EXPECT_VECTOR(own(two.me, "torus"), of_line, 0);
  OK(fs_object_remove(two.bob.get(), "server/expression") == FS_OK || !has_expressions() ? FS_OK : FS_ERROR_INTERNAL);
  two.settle_all();
  EXPECT_VECTOR(two.force_at(x), of_torus + 3.0 * of_line, 1e-12);
  // The fetched copies outlive the client that made them.
  two.me.reset();
  ck_assert(eventually([&] {
    two.step(50);
    return norm(two.fake.written.force - of_torus - of_line) < 1e-12;
  }));
}
END_TEST

// A server offers the last curves that a client was told of. One that it offers no longer goes back as the client's own.
START_TEST(curves_offered_no_longer) {
  Two two;
  const auto custom = [](const std::string& name, const fs_curve* curve) {
    fs_object out = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
    out.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 10);
    out.front.curve = const_cast<fs_curve*>(curve);
    return out;
  };
  std::vector<Curve> curves;
  for (int i = 0; i < 12; ++i) {
    const double forces[]{1.0 + i, 2};
    curves.push_back(make_table(forces, 2, 1));
    set(two.me, custom("o" + std::to_string(i), curves.back().get()));
  }
  two.settle_all();
  const Got first(two.bob.get(), "me/o0");
  for (int i = 1; i < 12; ++i) const Got other(two.bob.get(), ("me/o" + std::to_string(i)).c_str());
  const fs_object change = custom("me/o11", first->front.curve);
  OK(fs_object_change(two.bob.get(), &change, FS_PART_PROFILES));
  const Got changed(two.me.get(), "o11");
  size_t n = 0;
  double step = 0;
  const double* const forces = fs_curve_get_table(changed->front.curve, &n, &step);
  ck_assert(n == 2 && forces[0] == 1);
}
END_TEST

START_TEST(force_limit) {
  fs_server_options options = fs_server_options_init();
  options.force_limit = 5;
  Two two(options);
  const fs_vec3 arm{0.5, 0, 0};
  OK(fs_scene_set_tool(two.me.get(), &arm, 1));
  set(two.me, push("a", 3, {0, 0, 1}));
  set(two.bob, push("a", 4, {1, 0, 0}));
  set(two.base, push("a", 20, {0, 1, 0}));  // the server's own scene has no such limit
  two.settle_all();
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4, 20, 3}), 1e-12);
  set(two.me, push("b", 3, {0, 0, 1}));
  set(two.me, push("c", 8, {1, 0, 0}));
  two.settle_all();
  // (8, 0, 6) N and its torque (0, 8 * 0 - 6 * 0.5, 0) N m, shortened to 5 N.
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4 + 4, 20, 3}), 1e-12);
  EXPECT_VECTOR(two.fake.written.torque, (fs_vec3{0, -1.5, 0}), 1e-12);
  std::vector<fs_client> clients(9);
  size_t count = 0;
  OK(fs_scene_get_clients(two.bob.get(), clients.data(), clients.size(), &count));
  ck_assert_uint_eq(count, 3);
  for (size_t i = 0; i < count; ++i) {
    const fs_client& c = clients[i];
    const std::string name = c.name;
    ck_assert_double_eq(c.force_limit, name == "server" ? 1000 : 5);
    if (name == "me") {
      ck_assert_uint_gt(c.limited, 0);
      EXPECT_VECTOR(c.wrench.force, (fs_vec3{4, 0, 3}), 1e-12);
    } else {
      ck_assert_uint_eq(c.limited, 0);
    }
  }
  OK(fs_scene_clear(two.me.get()));  // back below it
  two.settle_all();
  OK(fs_scene_get_clients(two.bob.get(), clients.data(), clients.size(), &count));
  const uint64_t limited = clients[1].limited;
  two.step(100);
  OK(fs_scene_get_clients(two.bob.get(), clients.data(), clients.size(), &count));
  ck_assert_uint_eq(clients[1].limited, limited);
  EXPECT_VECTOR(two.fake.written.force, (fs_vec3{4, 20, 0}), 1e-12);
}
END_TEST

// A program that is lost and connects again and again pushes no more than one client does: what its lost scenes still push
// counts to the limit of those that come by its name or for its user.
START_TEST(lost_scenes_and_the_force_limit) {
  fs_server_options options = fs_server_options_init();
  options.force_limit = 2;
  options.lease = 0.3;
  ServerRig rig(options);
  double last = 0;
  const auto step = [&](int ticks) {
    for (; ticks > 0; --ticks) {
      rig.step();
      const double force = norm(rig.fake.written.force);
      ck_assert_msg(force <= 2 + 1e-9, "the lost scenes push with %g N together", force);
      ck_assert_msg(std::fabs(force - last) <= 11 * 0.001 / world_fade + 1e-9, "from %g N to %g N", last, force);
      last = force;
    }
  };
  for (int i = 0; i < 6; ++i) {
    const Scene client = rig.join(i % 3 ? "again" : ("by another name " + std::to_string(i)).c_str());
    const fs_object o = push("push", i % 2 ? 9 : 2);
    OK(fs_object_set(client.get(), &o));
    ck_assert(eventually([&] {
      step(1);
      return fs_scene_sync(client.get(), 0.02) == FS_OK;
    }));
    step(30);
  }
  EXPECT_NEAR(last, 2, 1e-9);  // some are within their lease
  ck_assert(eventually([&] {
    step(20);
    return last == 0;
  }));
  const Scene client = rig.join("again");  // it has the whole limit again
  const fs_object o = push("push", 9);
  OK(fs_object_set(client.get(), &o));
  OK(rig.sync(client.get()));
  rig.step_through_fade();
  EXPECT_NEAR(norm(rig.fake.written.force), 2, 1e-9);
}
END_TEST

// Two that leave together and come again, in any order and with any name, push no more than two that stay.
START_TEST(several_lost_scenes_and_the_force_limit) {
  fs_server_options options = fs_server_options_init();
  options.force_limit = 2;
  options.lease = 0.1;
  ServerRig rig(options);
  double most = 0;
  const auto step = [&](int ticks) {
    for (; ticks > 0; --ticks) {
      rig.step();
      most = std::fmax(most, norm(rig.fake.written.force));
    }
  };
  const auto come = [&](const std::string& name) {
    Scene client = rig.join(name.c_str());
    set(client, push("push", 9));
    ck_assert(eventually([&] {
      step(1);
      return fs_scene_sync(client.get(), 0.02) == FS_OK;
    }));
    return client;
  };
  const char* const names[][2] = {{"a", "b"}, {"a", "b"}, {"b", "a"}, {"c", "d"}, {"d", "e"}};
  for (const auto& [first, second] : names) {
    const Scene one = come(first), other = come(second);
    step(60);
  }
  ck_assert_msg(most <= 4 + 1e-9, "two clients push with %g N", most);
  EXPECT_NEAR(most, 4, 1e-9);
}
END_TEST

START_TEST(clients) {
  Two two;
  size_t count = 0;
  EXPECT(FS_ERROR_UNSUPPORTED, fs_scene_get_clients(two.base.get(), nullptr, 0, &count));
  EXPECT(FS_ERROR_INVALID, fs_scene_get_clients(two.me.get(), nullptr, 0, nullptr));
  EXPECT(FS_ERROR_INVALID, fs_scene_get_clients(two.me.get(), nullptr, 1, &count));
  const auto list = [&](const Scene& scene) {
    std::vector<fs_client> clients(9);
    OK(fs_scene_get_clients(scene.get(), clients.data(), clients.size(), &count));
    clients.resize(count);
    return clients;
  };
  const Shape box = make_mesh(box_mesh({0.01, 0.01, 0.01}));
  set(two.me, push("a", 2));
  set(two.me, solid("b", box));
  set(two.base, push("own", 1));
  two.settle_all();
  for (int k = 0; k < 5; ++k) {
    const fs_pose pose = at(0, 0, -100 - k);
    OK(fs_object_move(two.me.get(), "a", &pose, nullptr, FS_NOW));
    OK(two.sync(two.me.get()));
  }
  two.settle_all();
  std::vector<fs_client> clients = list(two.bob);
  ck_assert_uint_eq(clients.size(), 3);
  ck_assert_str_eq(clients[0].name, "server");  // the first
  for (const fs_client& c : clients) {
    ck_assert_uint_eq(c.process, static_cast<uint32_t>(getpid()));
    ck_assert_uint_eq(c.user, geteuid());
    ck_assert_double_eq(c.force_limit, 1000);
    ck_assert_double_le(c.connected, now(two.me.get()));
    ck_assert_uint_eq(c.refused, 0);
    ck_assert_uint_eq(c.reserved_32, 0);
    for (uint64_t x : c.reserved) ck_assert_uint_eq(x, 0);
  }
  ck_assert_uint_eq(clients[0].objects, 1);
  EXPECT_NEAR(clients[0].wrench.force.z, 1, 1e-12);
  const fs_client& me = clients[std::string(clients[1].name) == "me" ? 1 : 2];
  ck_assert_str_eq(me.name, "me");
  ck_assert_uint_eq(me.objects, 2);
  ck_assert_uint_eq(me.moves, 5);
  ck_assert_uint_eq(me.changes, 2);
  ck_assert_uint_eq(me.shape_bytes, 8 * 24 + 12 * 12);
  ck_assert_double_gt(me.wrench.force.z, 1);
  two.bob.reset();
  ck_assert(eventually([&] { return list(two.me).size() == 2; }));
  OK(fs_scene_clear(two.me.get()));
  two.settle_all();
  clients = list(two.me);
  ck_assert_uint_eq(clients[1].objects, 0);
  ck_assert(eventually([&] {  // its shapes are freed when they are no longer needed
    two.step(10);
    set(two.me, push("x"));
    return list(two.me)[1].shape_bytes == 0;
  }));
}
END_TEST

// Clients in several threads do everything that is possible to their own objects and to those of the others.
START_TEST(all_at_once) {
  ServerRig rig;
  std::atomic<int> failures{0};
  {
    const Stepper stepper(rig.servo.get());
    std::vector<std::thread> threads;
    std::array<Scene, 3> clients{rig.join("c0"), rig.join("c1"), rig.join("c2")};
    for (int i = 0; i < 4; ++i) {  // two threads share the last one
      threads.emplace_back([&, i] {
        fs_scene* const scene = clients[static_cast<size_t>(std::min(i, 2))].get();
        const Shape box = make_mesh(box_mesh({0.01, 0.01, 0.01}));
        Random random(static_cast<uint64_t>(i));
        const auto expect = [&](fs_status status, std::initializer_list<fs_status> allowed) {
          if (status == FS_OK || std::find(allowed.begin(), allowed.end(), status) != allowed.end()) return;
          ++failures;
          std::fprintf(stderr, "  %s: %s\n", fs_status_name(status), fs_last_error());
        };
        for (int k = 0; k < 150; ++k) {
          const std::string own = "o" + std::to_string(random.below(4));
          const std::string others = "c" + std::to_string(random.below(3)) + "/" + own;
          const fs_pose pose = random.pose(0.1);
          fs_object o = random.coin() ? spring(own.c_str()) : solid(own.c_str(), box);
          switch (random.below(10)) {
            case 0:
            case 1: expect(fs_object_set(scene, &o), {}); break;
            case 2: expect(fs_object_move(scene, own.c_str(), &pose, nullptr, FS_NOW), {FS_ERROR_NOT_FOUND}); break;
            case 3:
              expect(fs_object_move(scene, others.c_str(), &pose, nullptr, FS_NOW),
                     {FS_ERROR_NOT_FOUND, FS_ERROR_STATE});
              break;
            case 4: {
              std::snprintf(o.name, sizeof o.name, "%s", others.c_str());
              expect(fs_object_change(scene, &o, 31), {FS_ERROR_NOT_FOUND, FS_ERROR_STATE});
              break;
            }
            case 5: {
              fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
              expect(fs_object_get(scene, others.c_str(), &got), {FS_ERROR_NOT_FOUND, FS_ERROR_STATE});
              fs_object_release(&got);
              break;
            }
            case 6:
              expect(fs_object_remove(scene, random.coin() ? others.c_str() : own.c_str()),
                     {FS_ERROR_NOT_FOUND, FS_ERROR_STATE});
              break;
            case 7: {
              std::vector<fs_report> reports(40);
              size_t count = 0;
              expect(fs_scene_get_reports(scene, reports.data(), reports.size(), &count), {});
              expect(fs_scene_get_motions(scene, nullptr, nullptr, 0, &count), {});
              fs_view view;
              expect(fs_scene_get_view(scene, "c0", &view), {});
              expect(fs_scene_get_views(scene, nullptr, 0, &count), {});
              expect(fs_scene_get_record(scene, 0, nullptr, 0, &count), {});
              fs_event event;
              expect(fs_scene_next_event(scene, 0, &event), {});
              break;
            }
            case 8: expect(fs_scene_sync(scene, long_enough), {}); break;
            default:
              expect(fs_scene_begin(scene), {FS_ERROR_STATE});
              expect(fs_object_set(scene, &o), {});
              expect(fs_object_move(scene, own.c_str(), &pose, nullptr, FS_NOW), {FS_ERROR_NOT_FOUND});
              expect(random.coin(0.8) ? fs_scene_commit(scene) : fs_scene_cancel(scene), {FS_ERROR_STATE});
          }
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  ck_assert_msg(failures == 0, "%d calls failed", failures.load());
}
END_TEST

int main() {
  Suite* suite = suite_create("connected");
  add_once(suite, "several", {forces_add, what_an_event_tells_is_there, names_are_private, own_names_in_full, views, force_limit,
                              lost_scenes_and_the_force_limit, several_lost_scenes_and_the_force_limit});
  add_once(suite, "others", {objects_of_others, objects_of_the_server, edits_before_a_group, a_refused_group_moves_nothing,
                             edits_in_an_open_group,
                             groups_change_only_their_parts, others_go_past_a_group,
                             settings_belong_to_no_group, room_for_shapes, many_edits, groups_of_all, a_client_stops_the_force, a_server_keeps_the_force, locked,
                             shapes_of_others, curves_offered_no_longer});
  add_once(suite, "seen", {reports_of_all, clients});
  add_once(suite, "threads", {all_at_once});
  return run_suite(suite);
}
