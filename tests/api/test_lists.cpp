// What viewers, editors and bridges ask for with one request: how all objects move, and where a tool stands. With the
// same words for a scene in this process and for one that is connected; then for several clients of a server.
#include <atomic>
#include <map>
#include <thread>

#include "api/world.h"

using namespace scenes;

static std::vector<fs_motion> motions_of(fs_scene* scene, const char* client = nullptr) {
  size_t count = 0;
  OK(fs_scene_get_motions(scene, client, nullptr, 0, &count));
  std::vector<fs_motion> out(count + 10);
  OK(fs_scene_get_motions(scene, client, out.data(), out.size(), &count));
  out.resize(std::min(count, out.size()));
  return out;
}
static std::map<std::string, fs_motion> by_name(const std::vector<fs_motion>& motions) {
  std::map<std::string, fs_motion> out;
  for (const fs_motion& m : motions) out[m.name] = m;
  ck_assert_uint_eq(out.size(), motions.size());
  return out;
}
static fs_motion motion_of(fs_scene* scene, const std::string& name, const char* client = nullptr) {
  const std::map<std::string, fs_motion> all = by_name(motions_of(scene, client));
  const auto found = all.find(name);
  ck_assert_msg(found != all.end(), "'%s' is not in the list", name.c_str());
  return found->second;
}
static fs_view view_of(fs_scene* scene, const char* client = nullptr) {
  fs_view view;
  OK(fs_scene_get_view(scene, client, &view));
  for (uint32_t i = view.point_count; i < FS_TOOL_POINTS_MAX; ++i) EXPECT_VECTOR(view.points[i], (fs_vec3{}), 0);
  for (const double x : view.reserved) ck_assert_double_eq(x, 0);
  for (const uint8_t x : view.reserved_8) ck_assert_uint_eq(x, 0);
  return view;
}

// The list has exactly the objects that fs_object_get has, as it has them.
static void expect_as_got(fs_scene* scene, std::initializer_list<const char*> names) {
  const std::map<std::string, fs_motion> all = by_name(motions_of(scene));
  ck_assert_uint_eq(all.size(), names.size());
  for (const char* name : names) {
    ck_assert_msg(all.contains(name), "'%s' is not in the list", name);
    const fs_motion& m = all.at(name);
    const Got got(scene, name);
    ck_assert_int_eq(m.primitive, got->primitive);
    ck_assert_int_eq(std::memcmp(&m.pose, &got->pose, sizeof m.pose), 0);
    ck_assert_int_eq(std::memcmp(&m.twist, &got->twist, sizeof m.twist), 0);
    ck_assert_double_eq(m.time, got->time);
    ck_assert(m.horizon >= 0 && m.motion_revision >= m.revision && m.revision > 0);
    ck_assert_uint_eq(m.reserved_32, 0);
    for (const double x : m.reserved) ck_assert_double_eq(x, 0);
  }
}
static fs_vec3 position_at(const fs_motion& m, double t) {
  fs_pose pose;
  OK(fs_motion_at(&m, t, &pose));
  return pose.position;
}

// ---------------------------------------------------------------------------------------------------------- motions

START_TEST(the_list) {
  World w(_i);
  ck_assert_uint_eq(motions_of(w.scene).size(), 0);
  const Shape torus = make_mesh(torus_mesh(0.05, 0.02, 200));
  fs_object moving = spring("moving", {0.1, 0.2, 0.3});
  moving.twist = {{1, 2, 3}, {0.1, 0.2, 0.3}};
  fs_object off = push("off");
  off.enabled = false;
  fs_object mortal = spring("mortal");
  mortal.lifetime = 0.01;
  w.set(moving);
  w.set(off);
  w.set(mortal);
  w.set(solid("torus", torus));  // at once, whether a tick has used it or not
  expect_as_got(w.scene, {"moving", "off", "mortal", "torus"});
  w.settle();
  next_event(w.scene, FS_EVENT_EXPIRED);
  expect_as_got(w.scene, {"moving", "off", "mortal", "torus"});
  ck_assert_double_eq(motion_of(w.scene, "moving").horizon, 0.1);
  ck_assert_double_eq(motion_of(w.scene, "torus").horizon, 0);
  OK(fs_object_remove(w.scene, "off"));
  expect_as_got(w.scene, {"moving", "mortal", "torus"});
  w.settle();
  expect_as_got(w.scene, {"moving", "mortal", "torus"});

  // As all lists.
  fs_motion two[3]{};
  size_t count = 0;
  OK(fs_scene_get_motions(w.scene, nullptr, two, 2, &count));
  ck_assert(count == 3 && two[1].name[0] && !two[2].name[0]);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_get_motions(w.scene, nullptr, nullptr, 1, &count), "out");
  for (const char* nobody : {"nobody", "", "a/b"}) {
    count = 7;
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_motions(w.scene, nobody, two, 2, &count), "client");
    ck_assert_uint_eq(count, 7);
    fs_view view{};
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_view(w.scene, nobody, &view), "client");
    ck_assert_uint_eq(view.point_count, 0);
  }
  const std::string too_long(200, 'x');
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_get_motions(w.scene, too_long.c_str(), two, 2, &count));
  OK(fs_scene_clear(w.scene));
  expect_as_got(w.scene, {});
}
END_TEST

START_TEST(what_is_felt) {  // is what the list says, extrapolated as the header says
  World w(_i);
  w.step(100);
  w.set(spring("a", {0.01, 0, 0}, 100));
  w.settle();
  const auto expect_felt = [&](const char* what) {
    OK(w.sync(w.scene));
    const fs_motion m = motion_of(w.scene, "a");
    for (int i = 0; i < 15; ++i) {
      w.step(20);
      const fs_vec3 there = position_at(m, now(w.scene));
      ck_assert_msg(norm(w.fake.written.force - 100.0 * there) < 1e-9, "%s, step %d: %g N, not %g", what, i,
                    w.fake.written.force.x, 100 * there.x);
    }
    return m;
  };
  ck_assert_double_eq(expect_felt("set").horizon, 0);
  fs_pose pose = at(0.02, 0, 0);
  const double before = now(w.scene);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, before - 0.02));
  pose = at(0.022, 0, 0);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, before));
  const fs_motion worked_out = expect_felt("worked out");
  EXPECT_NEAR(worked_out.twist.linear.x, 0.1, 1e-9);
  EXPECT_NEAR(worked_out.horizon, 0.04, 1e-9);
  ck_assert_double_eq(worked_out.time, before);
  const fs_twist twist{{0, 0.05, 0}, {}};
  OK(fs_object_move(w.scene, "a", &pose, &twist, now(w.scene) + 0.01));  // to come
  ck_assert_double_eq(expect_felt("given").horizon, 0.1);
  const fs_twist still{};
  OK(fs_object_move(w.scene, "a", &pose, &still, FS_NOW));
  ck_assert_double_eq(expect_felt("still").horizon, 0);
}
END_TEST

START_TEST(the_two_revisions) {
  World w(_i);
  fs_object o = spring("a");
  w.set(o);
  w.set(spring("other"));
  fs_motion last = motion_of(w.scene, "a");
  const fs_motion other = motion_of(w.scene, "other");
  uint64_t highest = 0;
  const auto expect_grown = [&](const char* what, bool revision, bool motion_revision) {
    const fs_motion m = motion_of(w.scene, "a");
    ck_assert_msg((m.revision > last.revision) == revision && m.revision >= last.revision, "%s", what);
    ck_assert_msg((m.motion_revision > last.motion_revision) == motion_revision, "%s", what);
    const fs_motion same = motion_of(w.scene, "other");
    ck_assert_int_eq(std::memcmp(&same, &other, sizeof same), 0);
    last = m;
    highest = std::max(highest, m.motion_revision);
  };
  expect_grown("nothing", false, false);
  w.settle();
  expect_grown("felt", false, false);
  w.set(o);
  expect_grown("set", true, true);
  const fs_pose pose = at(1, 0, 0);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  expect_grown("moved", false, true);
  OK(fs_object_change(w.scene, &o, 0));
  expect_grown("no part changed", false, false);
  for (const uint32_t part : {FS_PART_POSE, FS_PART_PROFILES, FS_PART_OTHER}) {
    OK(fs_object_change(w.scene, &o, part));
    expect_grown("changed", true, true);
  }
  o.front.gain = -1;
  EXPECT(FS_ERROR_INVALID, fs_object_set(w.scene, &o));
  o = spring("a");
  expect_grown("refused", false, false);

  // In a group: its own getters see it, and what is taken back is as it was.
  const fs_motion before = last;
  OK(fs_scene_begin(w.scene));
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  expect_grown("moved in a group", false, true);
  w.set(o);
  expect_grown("set in a group", true, true);
  OK(fs_object_remove(w.scene, "a"));
  ck_assert(!by_name(motions_of(w.scene)).contains("a"));
  w.set(spring("new"));
  ck_assert(by_name(motions_of(w.scene)).contains("new"));
  OK(fs_scene_cancel(w.scene));
  const fs_motion after = motion_of(w.scene, "a");
  ck_assert_int_eq(std::memcmp(&after, &before, sizeof after), 0);
  ck_assert(!by_name(motions_of(w.scene)).contains("new"));
  last = after;
  OK(fs_scene_begin(w.scene));
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  OK(fs_scene_commit(w.scene));
  expect_grown("moved by a group", false, true);
  OK(fs_scene_begin(w.scene));
  w.set(o);
  OK(fs_object_move(w.scene, "a", &pose, nullptr, FS_NOW));
  OK(fs_scene_commit(w.scene));
  expect_grown("set and moved by a group", true, true);

  // Another one of the name.
  for (const bool is_faded : {false, true}) {
    OK(fs_object_remove(w.scene, "a"));
    if (is_faded) w.settle();
    w.set(o);
    const uint64_t so_far = highest;
    expect_grown("set again", true, true);
    ck_assert_uint_gt(last.revision, so_far);
  }
}
END_TEST

START_TEST(a_new_clock) {  // ages stay, so the times are others, and that is told
  FakeDevice fake("lists");
  const Scene scene = make_scene();
  const Device device = fake.open();
  OK(fs_scene_set_time(scene.get(), 100));
  set(scene, spring("a"));
  const fs_motion before = motion_of(scene.get(), "a");
  ck_assert_double_eq(before.time, 100);
  const Servo servo = start_servo(scene.get(), device.get(), virtual_options());
  const fs_motion after = motion_of(scene.get(), "a");
  ck_assert(after.time != before.time && after.time == Got(scene.get(), "a")->time);
  ck_assert(after.revision == before.revision && after.motion_revision > before.motion_revision);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- views

static void expect_as_single_calls(fs_scene* scene, const fs_view& view) {
  const fs_frame frame = frame_of(scene);
  ck_assert_int_eq(std::memcmp(&frame, &view.frame, sizeof frame), 0);
  const std::vector<fs_vec3> points = tool_of(scene);
  ck_assert_uint_eq(points.size(), view.point_count);
  for (size_t i = 0; i < points.size(); ++i) EXPECT_VECTOR(view.points[i], points[i], 0);
}
static void expect_pose(const fs_pose& a, const fs_pose& b) {
  EXPECT_VECTOR(a.position, b.position, 1e-12);
  const fs_quat p = a.orientation, q = b.orientation;
  EXPECT_NEAR(std::fabs(p.w * q.w + p.x * q.x + p.y * q.y + p.z * q.z), 1, 1e-12);
}

START_TEST(the_view) {
  World w(_i);
  Random random(5);
  fs_view v = view_of(w.scene);
  expect_as_single_calls(w.scene, v);
  ck_assert(v.frame.scale == 1 && v.point_count == 1 && !v.held);
  expect_pose(v.tool, at(0, 0, 0));

  const fs_frame frame{random.pose(0.1), 2, 3, {}};
  const fs_vec3 points[]{{0.1, 0, 0}, {0, 0.2, 0}, {0, 0, 0.3}};
  OK(fs_scene_set_frame(w.scene, &frame));
  OK(fs_scene_set_tool(w.scene, points, 3));
  w.fake.state.pose = random.pose(0.05);
  w.settle();
  v = view_of(w.scene);
  expect_as_single_calls(w.scene, v);
  ck_assert(v.frame.scale == 2 && v.point_count == 3 && !v.held);
  fs_state hand;
  OK(fs_scene_get_hand(w.scene, &hand, nullptr, nullptr));
  expect_pose(v.tool, hand.pose);

  // Held, it stays where it is; let go, it is there still, also before a tick has moved the frame.
  const fs_pose held = v.tool;
  for (int round = 0; round < 3; ++round) {
    OK(fs_scene_set_clutch(w.scene, true));
    v = view_of(w.scene);
    ck_assert(v.held);
    expect_pose(v.tool, held);
    w.settle();
    fs_pose pose = w.fake.state.pose;
    pose.position = pose.position + fs_vec3{0.01, 0.02, -0.03};
    w.fake.state.pose = pose;
    w.step(3);
    v = view_of(w.scene);
    ck_assert(v.held);
    expect_pose(v.tool, held);
    expect_as_single_calls(w.scene, v);
    OK(fs_scene_set_clutch(w.scene, false));
    v = view_of(w.scene);
    ck_assert(!v.held);
    expect_pose(v.tool, held);
    if (round == 1) continue;  // held again before a tick has come by
    w.settle();
    v = view_of(w.scene);
    ck_assert(!v.held);
    expect_pose(v.tool, held);
    expect_as_single_calls(w.scene, v);
  }
  w.fake.state.pose = random.pose(0.05);
  w.step(2);
  OK(fs_scene_get_hand(w.scene, &hand, nullptr, nullptr));
  expect_pose(view_of(w.scene).tool, hand.pose);

  // As an open group has it.
  const fs_view before = view_of(w.scene);
  const fs_frame other = fs_frame_init();
  OK(fs_scene_begin(w.scene));
  OK(fs_scene_set_frame(w.scene, &other));
  OK(fs_scene_set_tool(w.scene, points + 1, 1));
  OK(fs_scene_set_clutch(w.scene, true));
  v = view_of(w.scene);
  ck_assert(v.held && v.frame.scale == 1 && v.point_count == 1);
  EXPECT_VECTOR(v.points[0], points[1], 0);
  expect_as_single_calls(w.scene, v);
  OK(fs_scene_cancel(w.scene));
  v = view_of(w.scene);
  ck_assert_int_eq(std::memcmp(&v, &before, sizeof v), 0);
}
END_TEST

START_TEST(without_a_servo) {
  const Scene scene = make_scene();
  for (const bool held : {false, true, false}) {
    OK(fs_scene_set_clutch(scene.get(), held));
    const fs_view v = view_of(scene.get());
    ck_assert_int_eq(v.held, held);
    expect_pose(v.tool, at(0, 0, 0));
  }
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- several

struct Two : ServerRig {
  Scene me, bob;
  explicit Two(const fs_server_options& options = fs_server_options_init())
      : ServerRig(options), me(join("me")), bob(join("bob")) {}
};

static void expect_same_motion(const fs_motion& a, const fs_motion& b) {
  ck_assert_int_eq(a.primitive, b.primitive);
  ck_assert_int_eq(std::memcmp(&a.pose, &b.pose, sizeof a.pose), 0);
  ck_assert_int_eq(std::memcmp(&a.twist, &b.twist, sizeof a.twist), 0);
  ck_assert_double_eq(a.time, b.time);
  ck_assert_double_eq(a.horizon, b.horizon);
}

START_TEST(of_all_clients) {
  Two two;
  two.step(10);  // not at time 0, which means now
  Random random(6);
  fs_scene* const scenes[]{two.me.get(), two.bob.get(), two.base.get()};
  const char* const names[]{"me", "bob", "server"};
  for (fs_scene* scene : scenes) {  // frames do not matter
    const fs_frame frame{random.pose(0.1), random.between(0.5, 3), 1, {}};
    OK(fs_scene_set_frame(scene, &frame));
    for (const char* name : {"x", "y"}) {
      fs_object o = name[0] == 'x' ? spring(name) : push(name);
      o.pose = random.pose(0.1);
      o.twist = {random.in_box(1), random.in_box(1)};
      OK(fs_object_set(scene, &o));
    }
  }
  for (fs_scene* scene : scenes) OK(two.sync(scene));  // what a client sets is on its way for a while
  // Moves need no tick and no turn of the server to be seen.
  for (int round = 0; round < 20; ++round) {
    for (fs_scene* scene : scenes) {
      const fs_pose pose = random.pose(0.1);
      const fs_twist twist{random.in_box(1), random.in_box(1)};
      OK(fs_object_move(scene, "x", &pose, random.coin() ? &twist : nullptr, FS_NOW));
    }
    two.step(random.below(3));
    for (int viewer = 0; viewer < 2; ++viewer) {
      const std::vector<fs_motion> list = motions_of(scenes[viewer]);
      ck_assert_uint_eq(list.size(), 6);
      ck_assert(!std::strchr(list[0].name, '/') && !std::strchr(list[1].name, '/'));  // its own first
      const std::map<std::string, fs_motion> all = by_name(list);
      for (int owner = 0; owner < 3; ++owner) {
        const std::string prefix = owner == viewer ? "" : std::string(names[owner]) + "/";
        const std::map<std::string, fs_motion> only = by_name(motions_of(scenes[viewer], names[owner]));
        ck_assert_uint_eq(only.size(), 2);
        for (const char* name : {"x", "y"}) {
          ck_assert_msg(all.contains(prefix + name), "%s%s", prefix.c_str(), name);
          const fs_motion seen = all.at(prefix + name), alone = only.at(prefix + name);
          ck_assert_int_eq(std::memcmp(&seen, &alone, sizeof seen), 0);
          expect_same_motion(seen, motion_of(scenes[owner], name, owner == 2 ? nullptr : names[owner]));
          const Got got(scenes[viewer], (prefix + name).c_str());
          ck_assert_int_eq(std::memcmp(&seen.pose, &got->pose, sizeof got->pose), 0);
          ck_assert_double_eq(seen.time, got->time);
        }
      }
    }
  }
  ck_assert_uint_eq(motions_of(two.base.get()).size(), 2);  // a scene in this process has its own
  size_t count = 0;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_motions(two.base.get(), "me", nullptr, 0, &count), "me");
}
END_TEST

START_TEST(revisions_of_others) {
  Two two;
  const auto set_his = [&](const fs_object& o) {
    set(two.bob, o);
    OK(two.sync(two.bob.get()));
  };
  set_his(spring("a"));
  fs_motion last = motion_of(two.me.get(), "bob/a");
  ck_assert_uint_eq(last.revision, report_of(two.me.get(), "bob/a").revision);
  const auto expect_grown = [&](const std::string& wanted) {
    const fs_motion m = motion_of(two.me.get(), "bob/a");
    const bool revision = m.revision > last.revision, motion = m.motion_revision > last.motion_revision;
    last = m;
    const std::string found = std::string(revision ? "changed " : "") + (motion ? "moved" : "");
    ck_assert_msg(found == wanted, "'%s', not '%s'", found.c_str(), wanted.c_str());
  };
  expect_grown("");
  const fs_pose pose = at(1, 0, 0);
  OK(fs_object_move(two.bob.get(), "a", &pose, nullptr, FS_NOW));
  expect_grown("moved");
  OK(fs_object_move(two.me.get(), "bob/a", &pose, nullptr, FS_NOW));
  expect_grown("moved");
  set_his(spring("a", {1, 2, 3}));
  expect_grown("changed moved");
  const fs_object edited = spring("bob/a", {3, 2, 1});
  OK(fs_object_change(two.me.get(), &edited, FS_PART_PROFILES));
  expect_grown("changed moved");
  // The owner is told the same.
  const fs_motion before = motion_of(two.bob.get(), "a");
  const fs_twist given{{1, 2, 3}, {}};
  OK(fs_object_move(two.me.get(), "bob/a", &pose, &given, FS_NOW));
  const fs_motion after = motion_of(two.bob.get(), "a");
  ck_assert(after.motion_revision > before.motion_revision);
  expect_same_motion(after, motion_of(two.me.get(), "bob/a"));
  last = motion_of(two.me.get(), "bob/a");

  // Another client of that name.
  for (int round = 0; round < 3; ++round) {
    two.bob.reset();
    ck_assert(eventually([&] { return motions_of(two.me.get()).empty(); }));
    two.bob = two.join("bob");
    set_his(spring("a"));
    expect_grown("changed moved");
  }
}
END_TEST

START_TEST(groups_are_whole) {  // of other clients and of the server's own scene, of moves and of changes
  Two two;
  const auto pair = [](fs_scene* scene, double x, bool is_moved) {
    OK(fs_scene_begin(scene));
    for (const char* name : {"left", "right"}) {
      const fs_pose pose = at(x, 0, 0);
      const fs_object o = spring(name, pose.position);
      const fs_twist still{};
      OK(is_moved ? fs_object_move(scene, name, &pose, &still, FS_NOW) : fs_object_set(scene, &o));
    }
    OK(fs_scene_commit(scene));
  };
  pair(two.bob.get(), 0, false);
  pair(two.base.get(), 0, false);
  OK(two.sync(two.bob.get()));
  std::atomic<bool> is_over{false};
  std::vector<std::thread> threads;
  for (fs_scene* scene : {two.bob.get(), two.base.get()}) {
    threads.emplace_back([&, scene] {
      Random random(7);
      for (int k = 1; !is_over; ++k) pair(scene, k, random.coin(0.8));
    });
  }
  uint64_t seen = 0;
  for (int k = 0; k < 500; ++k) {
    const std::map<std::string, fs_motion> all = by_name(motions_of(two.me.get()));
    ck_assert_uint_eq(all.size(), 4);
    for (const std::string owner : {"bob", "server"}) {
      const fs_motion &left = all.at(owner + "/left"), &right = all.at(owner + "/right");
      ck_assert_double_eq(left.pose.position.x, right.pose.position.x);
      seen += left.pose.position.x > 0;
    }
  }
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_uint_gt(seen, 0);
}
END_TEST

START_TEST(a_long_list) {  // which the server does not write at once: it is of one instant, too
  constexpr int many = 3000;
  Two two;
  two.step(10);
  const auto name = [](int i) { return "object " + std::to_string(i); };
  const auto group = [&](double x, bool is_moved) {
    OK(fs_scene_begin(two.bob.get()));
    for (int i = 0; i < many; ++i) {
      fs_object o = spring(name(i).c_str(), {x, 0.001 * i, 0});
      o.enabled = false;  // ticks may be short
      const fs_twist still{};
      OK(is_moved ? fs_object_move(two.bob.get(), o.name, &o.pose, &still, FS_NOW) : fs_object_set(two.bob.get(), &o));
    }
    OK(fs_scene_commit(two.bob.get()));
  };
  group(0, false);
  OK(two.sync(two.bob.get()));
  set(two.base, spring("last"));
  std::atomic<bool> is_over{false};
  std::thread mover([&] {
    for (int k = 1; !is_over; ++k) group(k, k % 4 != 0);
  });
  for (int k = 0; k < times(is_sanitized ? 6 : 16, 60); ++k) {
    const std::vector<fs_motion> list = motions_of(two.me.get(), k % 2 ? "bob" : nullptr);
    const std::map<std::string, fs_motion> all = by_name(list);
    ck_assert_uint_eq(all.size(), k % 2 ? many : many + 1);
    const double x = all.at("bob/object 0").pose.position.x;
    for (int i = 0; i < many; ++i) EXPECT_VECTOR(all.at("bob/" + name(i)).pose.position, (fs_vec3{x, 0.001 * i, 0}), 0);
  }
  is_over = true;
  mover.join();
  OK(two.sync(two.bob.get()));
  const std::map<std::string, fs_motion> own = by_name(motions_of(two.bob.get(), "bob"));
  const std::map<std::string, fs_motion> seen = by_name(motions_of(two.me.get(), "bob"));
  ck_assert_uint_eq(own.size(), many);
  for (const auto& [bare, motion] : own) expect_same_motion(motion, seen.at("bob/" + bare));
}
END_TEST

START_TEST(an_open_group_of_the_servers) {  // is its own alone
  Two two;
  set(two.base, spring("a", {1, 0, 0}));
  const fs_motion before = motion_of(two.me.get(), "server/a");
  const fs_view view_before = view_of(two.me.get(), "server");
  OK(fs_scene_begin(two.base.get()));
  set(two.base, spring("a", {2, 0, 0}));
  set(two.base, spring("b"));
  fs_frame frame = fs_frame_init();
  frame.scale = 5;
  OK(fs_scene_set_frame(two.base.get(), &frame));
  OK(fs_scene_set_clutch(two.base.get(), true));
  ck_assert_uint_eq(motions_of(two.base.get()).size(), 2);
  ck_assert_uint_eq(motions_of(two.me.get()).size(), 1);
  const fs_motion amid = motion_of(two.me.get(), "server/a");
  ck_assert_int_eq(std::memcmp(&before, &amid, sizeof amid), 0);
  const fs_view view_amid = view_of(two.me.get(), "server");
  ck_assert_int_eq(std::memcmp(&view_before, &view_amid, sizeof view_amid), 0);
  OK(fs_scene_commit(two.base.get()));
  ck_assert_uint_eq(motions_of(two.me.get()).size(), 2);
  EXPECT_VECTOR(motion_of(two.me.get(), "server/a").pose.position, (fs_vec3{2, 0, 0}), 0);
  const fs_view view_after = view_of(two.me.get(), "server");
  ck_assert(view_after.frame.scale == 5 && view_after.held);
}
END_TEST

START_TEST(what_is_on_its_way) {  // a mesh that is being built, and one that is refused, and what is moved behind them
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 1;
  Two two(options);
  const Shape good = make_mesh(sphere_mesh(0.1, 5000)), large = make_mesh(sphere_mesh(0.1, 60000));
  set(two.me, solid("good", good));
  const fs_pose pose = at(0.1, 0.2, 0.3);
  OK(fs_object_move(two.me.get(), "good", &pose, nullptr, FS_NOW));
  EXPECT_VECTOR(motion_of(two.me.get(), "good").pose.position, pose.position, 0);
  two.settle(two.me.get());
  expect_same_motion(motion_of(two.me.get(), "good"), motion_of(two.bob.get(), "me/good"));
  set(two.me, solid("large", large));
  next_event(two.me.get(), FS_EVENT_REFUSED);
  const std::map<std::string, fs_motion> mine = by_name(motions_of(two.me.get())), his = by_name(motions_of(two.bob.get()));
  ck_assert(mine.contains("good") && mine.contains("large") == has(two.me.get(), "large"));
  ck_assert(his.contains("me/good") && !his.contains("me/large") && !has(two.bob.get(), "me/large"));
}
END_TEST

START_TEST(views_of_all) {
  Two two;
  Random random(8);
  const char* const names[]{"me", "bob", "server"};
  fs_scene* const scenes[]{two.me.get(), two.bob.get(), two.base.get()};
  for (int i = 0; i < 3; ++i) {
    const fs_frame frame{random.pose(0.1), random.between(0.5, 3), random.between(0.2, 2), {}};
    std::vector<fs_vec3> points(1 + random.below(FS_TOOL_POINTS_MAX));
    for (fs_vec3& point : points) point = random.in_box(0.1);
    OK(fs_scene_set_frame(scenes[i], &frame));
    OK(fs_scene_set_tool(scenes[i], points.data(), points.size()));
    OK(fs_scene_set_clutch(scenes[i], i == 1));
  }
  two.fake.state.pose = random.pose(0.05);
  for (fs_scene* scene : scenes) two.settle(scene);
  two.fake.state.pose = random.pose(0.05);
  two.step(5);
  for (int owner = 0; owner < 3; ++owner) {
    const fs_view own = view_of(scenes[owner]);
    ck_assert_int_eq(own.held, owner == 1);
    expect_as_single_calls(scenes[owner], own);
    fs_state hand;
    OK(fs_scene_get_hand(scenes[owner], &hand, nullptr, nullptr));
    if (owner != 1) expect_pose(own.tool, hand.pose);
    if (owner == 1) ck_assert_double_gt(norm(own.tool.position - hand.pose.position), 1e-3);
    for (int viewer = 0; viewer < 2; ++viewer) {
      const fs_view seen = view_of(scenes[viewer], names[owner]);
      ck_assert_int_eq(std::memcmp(&own, &seen, sizeof own), 0);
    }
  }
  fs_view none;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_view(two.base.get(), "me", &none), "me");
}
END_TEST

// A client gets the server's record, in short and in long lists, with the ticks since it last asked.
START_TEST(the_record) {
  Two two;
  const fs_frame frame{at(0.1, 0, 0), 2, 2, {}};
  OK(fs_scene_set_frame(two.me.get(), &frame));
  two.settle(two.me.get());
  const auto record_of = [](fs_scene* scene, uint64_t after) {
    std::vector<fs_recorded_tick> out(3000);
    size_t count = 0;
    OK(fs_scene_get_record(scene, after, out.data(), out.size(), &count));
    out.resize(count);
    return out;
  };
  uint64_t last = record_of(two.base.get(), 0).back().number;
  for (const uint64_t steps : {0, 1, 64, 65, 2000, 2600}) {
    two.step(steps);
    const std::vector<fs_recorded_tick> found = record_of(two.me.get(), last), same = record_of(two.base.get(), last);
    ck_assert_uint_eq(found.size(), std::min<uint64_t>(steps, 2000));
    ck_assert_uint_eq(found.size(), same.size());
    for (size_t i = 0; i < found.size(); ++i) {
      ck_assert_int_eq(std::memcmp(&found[i], &same[i], sizeof found[i]), 0);
      ck_assert_uint_eq(found[i].number, last + steps - found.size() + i + 1);
    }
    last += steps;
  }
  ck_assert_uint_eq(record_of(two.me.get(), ~uint64_t{0}).size(), 0);
  two.servo.reset();
  size_t count = 0;
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_get_record(two.me.get(), 0, nullptr, 0, &count));
}
END_TEST

static std::vector<fs_client_view> views_of(fs_scene* scene) {
  size_t count = 0;
  OK(fs_scene_get_views(scene, nullptr, 0, &count));
  std::vector<fs_client_view> out(count + 3);
  OK(fs_scene_get_views(scene, out.data(), out.size(), &count));
  out.resize(count);
  return out;
}
// The list is what single calls give, in the order of the clients.
static void expect_as_single_views(fs_scene* viewer) {
  const std::vector<fs_client_view> list = views_of(viewer);
  std::vector<fs_client> clients(list.size());
  size_t count = 0;
  OK(fs_scene_get_clients(viewer, clients.data(), clients.size(), &count));
  ck_assert_uint_eq(count, list.size());
  for (size_t i = 0; i < count; ++i) {
    ck_assert_str_eq(list[i].name, clients[i].name);
    const fs_view alone = view_of(viewer, list[i].name);
    ck_assert_msg(std::memcmp(&list[i].view, &alone, sizeof alone) == 0, "the view of %s differs", list[i].name);
  }
}

START_TEST(views_in_one_request) {
  fs_server_options options = fs_server_options_init();
  options.locked = _i == 1;
  Two two(options);
  const Scene third = two.join("third");
  Random random(9);
  fs_scene* const scenes[]{two.base.get(), two.me.get(), two.bob.get(), third.get()};
  const char* const names[]{"server", "me", "bob", "third"};
  for (int i = 0; i < 4; ++i) {
    const fs_frame frame{random.pose(0.1), 1.0 + i, 2.0 + i, {}};
    std::vector<fs_vec3> points(1 + static_cast<size_t>(i) * 3);
    for (fs_vec3& point : points) point = random.in_box(0.1);
    OK(fs_scene_set_frame(scenes[i], &frame));
    OK(fs_scene_set_tool(scenes[i], points.data(), points.size()));
    OK(fs_scene_set_clutch(scenes[i], i == 2));
  }
  two.fake.state.pose = random.pose(0.05);
  for (fs_scene* scene : scenes) two.settle(scene);
  two.fake.state.pose = random.pose(0.05);
  two.step(5);
  for (int viewer = 1; viewer < 4; ++viewer) {
    expect_as_single_views(scenes[viewer]);
    const std::vector<fs_client_view> list = views_of(scenes[viewer]);
    ck_assert_uint_eq(list.size(), 4);
    for (int i = 0; i < 4; ++i) {
      const fs_view& view = list[i].view;
      ck_assert_str_eq(list[i].name, names[i]);
      ck_assert_uint_eq(view.point_count, 1 + 3 * i);
      ck_assert_int_eq(view.held, i == 2);
      ck_assert_int_eq(view.locked, _i == 1);
      if (i == 2) continue;  // the clutch moves the frame
      ck_assert_double_eq(view.frame.scale, 1 + i);
      ck_assert_double_eq(view.frame.force_scale, 2 + i);
    }
    ck_assert_double_gt(norm(list[1].view.tool.position - list[2].view.tool.position), 1e-3);
  }

  // A group that is not committed is in the view of the scene that has it, and in no other's.
  const fs_frame frame{random.pose(0.1), 7, 8, {}};
  for (const int i : {0, 1, 2}) {
    OK(fs_scene_begin(scenes[i]));
    OK(fs_scene_set_frame(scenes[i], &frame));
    OK(fs_scene_set_clutch(scenes[i], i != 2));
  }
  for (int viewer = 1; viewer < 4; ++viewer) {
    expect_as_single_views(scenes[viewer]);
    const std::vector<fs_client_view> list = views_of(scenes[viewer]);
    for (int i = 0; i < 4; ++i) {
      const bool has_group = i == viewer && i != 3;
      ck_assert_int_eq(list[i].view.frame.scale == 7, has_group);
      ck_assert_int_eq(list[i].view.held, has_group ? i != 2 : i == 2);
    }
  }
  OK(fs_scene_cancel(scenes[0]));
  OK(fs_scene_cancel(scenes[2]));
  OK(fs_scene_commit(scenes[1]));
  OK(two.sync(scenes[1]));
  ck_assert_double_eq(views_of(scenes[3])[1].view.frame.scale, 7);

  // What waits at the server behind a mesh is in the own view at once.
  const Shape mesh = make_mesh(sphere_mesh(0.1, 20000));
  const fs_frame next{random.pose(0.1), 9, 9, {}};
  OK(fs_scene_begin(scenes[3]));
  set(third, solid("mesh", mesh));
  OK(fs_scene_set_frame(scenes[3], &next));
  OK(fs_scene_commit(scenes[3]));
  ck_assert_double_eq(views_of(scenes[3])[3].view.frame.scale, 9);

  // As every list: what fits, and the number of all.
  fs_client_view two_of_them[3]{};
  size_t count = 0;
  OK(fs_scene_get_views(scenes[1], two_of_them, 2, &count));
  ck_assert_uint_eq(count, 4);
  ck_assert_str_eq(two_of_them[1].name, "me");
  ck_assert_str_eq(two_of_them[2].name, "");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_get_views(scenes[1], nullptr, 1, &count), "out");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_get_views(scenes[1], nullptr, 0, nullptr), "count");
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_scene_get_views(scenes[0], nullptr, 0, &count),
                  "only a scene made by fs_scene_connect lists the views of clients");
  two.bob.reset();
  ck_assert(eventually([&] { return views_of(scenes[1]).size() == 3; }));
}
END_TEST

int main() {
  Suite* suite = suite_create("lists");
  add_on_both(suite, "motions", {the_list, what_is_felt, the_two_revisions});
  add_on_both(suite, "view", {the_view});
  add_once(suite, "in this process", {a_new_clock, without_a_servo});
  add_once(suite, "several", {of_all_clients, revisions_of_others, groups_are_whole, a_long_list,
                              an_open_group_of_the_servers, what_is_on_its_way, views_of_all, the_record});
  tcase_add_loop_test(new_case(suite, "one request"), views_in_one_request, 0, 2);  // 1: the server is locked
  return run_suite(suite);
}
