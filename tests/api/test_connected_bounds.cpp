// The bounds of a connection: who gets in, how much a client may have, what waits for a mesh to be built, and the end
// of a server or of a client.
#include <algorithm>
#include <map>
#include <memory>

#include "api/world.h"
#include "scenes/longer.h"

using namespace scenes;

static std::vector<fs_client> clients_of(const Scene& scene) {
  std::vector<fs_client> clients(100);
  size_t count = 0;
  OK(fs_scene_get_clients(scene.get(), clients.data(), clients.size(), &count));
  clients.resize(count);
  return clients;
}

// ------------------------------------------------------------------------------------------------------- who gets in

static fs_status try_to_connect(const std::string& endpoint, const std::string& name) {
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(endpoint.c_str(), name.c_str(), &scene);
  ck_assert((status == FS_OK) == (scene != nullptr));
  fs_scene_destroy(scene);
  return status;
}

START_TEST(connecting) {
  ServerRig rig;
  const std::string nobody = new_endpoint();
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, try_to_connect(nobody, "me"), (" listens at " + nobody).c_str());
  ck_assert_ptr_nonnull(std::strstr(fs_last_error(), "no server of user "));
  EXPECT(FS_ERROR_NOT_FOUND, try_to_connect(nobody + "?timeout=0.05", "me"));
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, try_to_connect("dds:0", "me"), "DDS");
  const std::string user = std::to_string(geteuid());
  const std::string longest = rig.endpoint + std::string(64 - (rig.endpoint.size() - 4), 'x');
  ServoRig other;
  const Server long_one = start_server(other.servo.get(), longest, fs_server_options_init());
  for (const std::string& endpoint :
       {rig.endpoint, longest, rig.endpoint + "?timeout=1", rig.endpoint + "?timeout=1e1",
        rig.endpoint + "?user=" + user, rig.endpoint + "?user=" + user + "&timeout=0"}) {
    EXPECT(FS_OK, try_to_connect(endpoint, "me"));
  }
  for (const std::string& endpoint :
       {std::string(), std::string("shm"), std::string("shm:"), std::string("tcp:x"), std::string("sim:"),
        std::string("shm:a/b"), std::string("shm:?timeout=1"), std::string("shm:a\nb"), longest + "x",
        rig.endpoint + "?", rig.endpoint + "?timeout", rig.endpoint + "?timeout=", rig.endpoint + "?timeout=-1",
        rig.endpoint + "?timeout=abc", rig.endpoint + "?timeout=nan", rig.endpoint + "?timeout=1s",
        rig.endpoint + "?lease=1", rig.endpoint + "?timeout=1&timeout=1", rig.endpoint + "?user=no such user",
        rig.endpoint + "?user=0&user=0"}) {
    if (endpoint == rig.endpoint + "?") continue;  // no option is none
    EXPECT_SENTENCE(FS_ERROR_INVALID, try_to_connect(endpoint, "me"), "is");
  }
  for (const std::string& name : {std::string(), std::string(64, 'x'), std::string("a/b"), std::string("a\tb"),
                                  std::string("\xff"), std::string("server")}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, try_to_connect(rig.endpoint, name), "client_name");
  }
  EXPECT(FS_OK, try_to_connect(rig.endpoint, std::string(63, 'x')));
  EXPECT(FS_OK, try_to_connect(rig.endpoint, "J\xc3\xbcrg, 2nd"));
  fs_scene* scene = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_scene_connect(nullptr, "me", &scene));
  EXPECT(FS_ERROR_INVALID, fs_scene_connect(rig.endpoint.c_str(), nullptr, &scene));
  EXPECT(FS_ERROR_INVALID, fs_scene_connect(rig.endpoint.c_str(), "me", nullptr));
  // One server of a name, and one of a servo.
  fs_server* server = nullptr;
  EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_server_start(rig.servo.get(), rig.endpoint.c_str(), nullptr, &server),
                  rig.endpoint.c_str() + 4);
  ck_assert_ptr_null(server);
  EXPECT_SENTENCE(FS_ERROR_STATE, fs_server_start(rig.servo.get(), (rig.endpoint + "-2").c_str(), nullptr, &server),
                  "the servo has a server already");
  ck_assert_ptr_null(server);
  EXPECT(FS_OK, try_to_connect(rig.endpoint, "me"));  // the first goes on
}
END_TEST

START_TEST(places) {  // so many, and each name once
  fs_server_options options = fs_server_options_init();
  options.max_clients = 3;
  ServerRig rig(options);
  const Scene a = rig.join("a");
  Scene b = rig.join("b");
  EXPECT_SENTENCE(FS_ERROR_EXISTS, try_to_connect(rig.endpoint, "a"), "'a'");
  const Scene c = rig.join("c");
  EXPECT_SENTENCE(FS_ERROR_FULL, try_to_connect(rig.endpoint, "d"), "3");
  EXPECT(FS_ERROR_EXISTS, try_to_connect(rig.endpoint, "b"));
  b.reset();
  b = rig.join("b");  // the place and the name are free at once
  set(b, push("x"));
  rig.settle(b.get());
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  ck_assert_uint_eq(clients_of(a).size(), 4);
}
END_TEST

START_TEST(comings_and_goings) {
  fs_server_options options = fs_server_options_init();
  options.max_clients = 50;  // those that fade out still take some of the room
  ServerRig rig(options);
  const Scene stays = rig.join("stays");
  const Stepper stepper(rig.servo.get());
  for (int round = 0; round < 10; ++round) {
    std::vector<Scene> guests;
    for (int i = 0; i < 8; ++i) {
      guests.push_back(rig.join(("guest" + std::to_string(i)).c_str()));
      set(guests.back(), push("x", 0.1));
    }
    OK(fs_scene_sync(guests.back().get(), long_enough));
    ck_assert_uint_eq(clients_of(stays).size(), 10);
    guests.clear();
    ck_assert(eventually([&] { return clients_of(stays).size() == 2; }));
  }
}
END_TEST

START_TEST(a_server_that_comes_later) {
  ServoRig rig;
  const std::string endpoint = new_endpoint();
  fs_scene* raw = nullptr;
  fs_status status = FS_ERROR_INTERNAL;
  std::thread waiter([&] { status = fs_scene_connect((endpoint + "?timeout=30").c_str(), "me", &raw); });
  wait_a_little(0.05);
  const Server server = start_server(rig.servo.get(), endpoint, fs_server_options_init());
  waiter.join();
  const Scene scene(raw);
  EXPECT(FS_OK, status);
  set(scene, push("a"));
  rig.settle(scene.get());
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
}
END_TEST

START_TEST(what_is_not_for_connected_scenes) {
  ServerRig rig;
  const Scene me = rig.join("me");
  FakeDevice fake(new_endpoint());
  const Device device = fake.open();
  fs_servo* servo = nullptr;
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_servo_start(me.get(), device.get(), nullptr, &servo),
                  "the scene is at a server, whose servo runs it; use a scene made by fs_scene_create");
  ck_assert_ptr_null(servo);
  EXPECT(FS_ERROR_STATE, fs_scene_set_time(me.get(), 10));
  OK(fs_scene_set_max_stiffness(me.get(), 10));
  OK(fs_scene_set_max_stiffness(me.get(), 0));
  OK(fs_scene_set_accuracy(me.get(), 0.1));
  size_t count = 0;
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_scene_get_clients(rig.base.get(), nullptr, 0, &count),
                  "only a scene made by fs_scene_connect has clients to list");
  // The device is free still.
  const Scene own = make_scene();
  const Servo other = start_servo(own.get(), device.get(), virtual_options());
}
END_TEST

// ------------------------------------------------------------------------------------------------------- how much

START_TEST(max_objects) {
  fs_server_options options = fs_server_options_init();
  options.max_objects = 3;
  ServerRig rig(options);
  const Scene me = rig.join("me"), bob = rig.join("bob");
  for (const char* name : {"a", "b", "c"}) set(me, push(name, 1));
  for (const char* name : {"a", "b", "c"}) set(bob, push(name, 1));  // each client
  const fs_object one_more = push("d", 100);
  EXPECT_SENTENCE(FS_ERROR_FULL, fs_object_set(me.get(), &one_more),
                  "this would be object 4; the server allows a client 3 (max_objects)");
  set(me, push("a", 2));  // one that is there
  const auto felt = [&] {
    rig.settle(me.get());
    rig.settle(bob.get());
    return rig.fake.written.force.z;
  };
  EXPECT_NEAR(felt(), 4 + 3, 1e-12);
  ck_assert(!has(me.get(), "d"));
  OK(fs_object_remove(me.get(), "b"));  // though it is fading out still
  set(me, one_more);
  EXPECT_NEAR(felt(), 103 + 3, 1e-12);

  OK(fs_scene_begin(me.get()));
  const fs_object e = push("e", 7);
  EXPECT_SENTENCE(FS_ERROR_FULL, fs_object_set(me.get(), &e), "3");
  OK(fs_object_remove(me.get(), "d"));
  set(me, e);
  EXPECT(FS_ERROR_FULL, fs_object_set(me.get(), &one_more));
  OK(fs_scene_commit(me.get()));
  EXPECT_NEAR(felt(), 10 + 3, 1e-12);
  OK(fs_scene_begin(me.get()));
  OK(fs_scene_clear(me.get()));
  for (const char* name : {"x", "y", "z"}) set(me, push(name, 10));
  EXPECT(FS_ERROR_FULL, fs_object_set(me.get(), &e));
  OK(fs_scene_commit(me.get()));
  EXPECT_NEAR(felt(), 30 + 3, 1e-12);
  OK(fs_scene_begin(me.get()));  // one that is taken back leaves its places
  OK(fs_scene_clear(me.get()));
  set(me, push("u", 1));
  OK(fs_scene_cancel(me.get()));
  EXPECT(FS_ERROR_FULL, fs_object_set(me.get(), &e));
  EXPECT_NEAR(felt(), 30 + 3, 1e-12);
  OK(fs_scene_clear(me.get()));
  EXPECT_NEAR(felt(), 3, 1e-12);
  for (int round = 0; round < 10; ++round) {  // the same places, again and again
    const auto name = [round](int i) { return "o" + std::to_string((round + i) % 4); };
    OK(fs_scene_begin(me.get()));
    OK(fs_scene_clear(me.get()));
    for (int i = 0; i < 3; ++i) set(me, push(name(i).c_str(), 10));
    OK(fs_scene_commit(me.get()));
    OK(fs_object_remove(me.get(), name(0).c_str()));
    set(me, push(name(3).c_str(), 10));
    EXPECT_NEAR(felt(), 30 + 3, 1e-12);
  }
  for (const fs_event& event : events_now(me.get())) ck_assert_int_ne(event.kind, FS_EVENT_REFUSED);
  OK(fs_scene_clear(me.get()));
  EXPECT_NEAR(felt(), 3, 1e-12);
  for (const char* name : {"x", "y", "z"}) set(me, push(name, 10));

  const Folder folder;  // a file of too many adds none
  const std::string path = folder / "four.json";
  const Scene four = make_scene();
  for (const char* name : {"x", "v", "w"}) set(four, push(name, 1));
  OK(fs_scene_save(four.get(), path.c_str()));
  EXPECT_SENTENCE(FS_ERROR_FULL, fs_scene_load(me.get(), path.c_str()), "3");
  ck_assert(!has(me.get(), "v"));
  OK(fs_object_remove(me.get(), "y"));
  OK(fs_object_remove(me.get(), "z"));
  OK(fs_scene_load(me.get(), path.c_str()));
  EXPECT_NEAR(felt(), 3 + 3, 1e-12);
}
END_TEST

// The clients together have no more damping than one alone.
START_TEST(damping_of_clients) {
  fs_servo_options options = world_options();
  options.max_stiffness = 2000;
  options.damping = 0;  // the default
  ServerRig rig(fs_server_options_init(), options);
  const Scene me = rig.join("me"), bob = rig.join("bob");
  fs_object honey = push("honey", 1);
  honey.damping = 1000;
  honey.front.limit = 500;
  const auto damping = [&] {
    constexpr double speed = 0.01;
    const fs_vec3 before = rig.fake.written.force;
    rig.fake.state.twist.linear.y = speed;
    rig.step();
    const fs_vec3 after = rig.fake.written.force;
    rig.fake.state.twist.linear.y = 0;
    rig.step();
    return (before.y - after.y) / speed;
  };
  const auto set_and_wait = [&](const Scene& scene) {
    set(scene, honey);
    rig.settle(scene.get());
    rig.step(1000);
  };
  // Of a device that does not tell its mass, without delay: less the local damping.
  const double most = 0.7 * 0.05 / 0.0005 - stats_of(rig.base.get()).damping;
  for (const Scene* const scene : {&me, &bob}) {
    set_and_wait(*scene);
    double felt = 0;  // the bounds come from a thread, which a busy machine may hold up
    ck_assert_msg(eventually([&] { return std::fabs((felt = damping()) - most) < 1e-6; }), "%g, not %g N s/m", felt, most);
  }
}
END_TEST

// What can be rendered is shared among the clients of which the hand can reach something, by what they want.
START_TEST(stiffness_of_clients) {
  fs_servo_options options = world_options();
  options.max_stiffness = 2000;
  options.damping = options.speed_limit = 0;  // the defaults
  ServerRig rig(fs_server_options_init(), options);
  const Scene me = rig.join("me"), bob = rig.join("bob");
  set(me, fs_wall_init("wall", {0, 0, 0.002}, {0, 0, 1}, 2000, 100));
  fs_object far = push("far", 1);
  far.primitive = FS_PRIMITIVE_POINT;
  far.pose = at(0.5, 0, 0);
  far.front = attract(500, 1);
  far.front.reach = 0.02;
  set(bob, far);
  // The bounds come from a thread, which a busy machine may hold up.
  const auto gets = [&](const Scene& scene, const char* name, double expected) {
    double applied = 0;
    ck_assert_msg(eventually([&] {
                    rig.step();
                    applied = report_of(scene.get(), name).stiffness_applied;
                    return std::fabs(applied - expected) < 1e-6;
                  }),
                  "%s gets %g, not %g N/m", name, applied, expected);
  };
  const auto go_to = [&](double x) {
    constexpr double step = 1.5e-3;
    double& now = rig.fake.state.pose.position.x;
    while (now != x) {
      now = std::fabs(x - now) <= step ? x : now + (x > now ? step : -step);
      rig.fake.state.twist.linear.x = now == x ? 0 : x > now ? 1.5 : -1.5;
      rig.step();
    }
  };
  rig.settle(me.get());
  rig.settle(bob.get());
  gets(me, "wall", 2000);
  go_to(0.49);
  gets(me, "wall", 1000);
  gets(bob, "far", 1000);  // its force jumps
  go_to(0);
  rig.step(1500);  // what the hand has left counts for a second
  gets(me, "wall", 2000);
  // One that wants little gets that, and a tenth in reserve; the other has the rest.
  events_now(me.get());
  fs_object soft = spring("soft", {}, 300);
  set(bob, soft);
  rig.settle(bob.get());
  rig.step(4000);  // the more often something was told of an object, the longer it takes
  gets(me, "wall", 2000 - 330);
  gets(bob, "soft", 300);
  fs_event event = next_event(me.get(), FS_EVENT_CAPPED);
  while (std::strstr(event.text, "no longer bounded")) event = next_event(me.get(), FS_EVENT_CAPPED);  // of the second alone
  ck_assert_str_eq(event.name, "wall");
  ck_assert_msg(std::strstr(event.text, "; it shares with other clients"), "%s", event.text);
  const auto wall_report = report_of(me.get(), "wall"), soft_report = report_of(bob.get(), "soft");
  ck_assert_str_eq(wall_report.shares_with, "other clients");
  ck_assert_str_eq(soft_report.shares_with, "");  // it gets what it wants
  soft.front.gain = 1;
  set(bob, soft);
  rig.settle(bob.get());
  rig.step(100);
  gets(me, "wall", 2000 - 1.1);
  gets(bob, "soft", 1);
  soft.front.gain = 1e5;
  set(bob, soft);
  rig.settle(bob.get());
  rig.step(100);
  gets(me, "wall", 1000);
  gets(bob, "soft", 1000);
  soft.enabled = false;
  set(bob, soft);
  rig.settle(bob.get());
  rig.step(100);
  gets(me, "wall", 2000);
  // One that allows itself little wants no more than that.
  soft.enabled = true;
  set(bob, soft);
  OK(fs_scene_set_max_stiffness(bob.get(), 100));
  rig.settle(bob.get());
  rig.step(200);
  gets(bob, "soft", 100);
  gets(me, "wall", 2000 - 110);
  const fs_report little = report_of(bob.get(), "soft");
  ck_assert_str_eq(little.shares_with, "");
  // With whom a wall shares is told also where there are many.
  for (int i = 0; i < 12; ++i) {
    set(me, fs_wall_init(("another wall " + std::to_string(i)).c_str(), {0, 0, 0.002}, {0, 0, 1}, 2000, 100));
  }
  rig.settle(me.get());
  rig.step(200);
  const std::string with = report_of(me.get(), "wall").shares_with;
  ck_assert_msg(with.starts_with("another wall ") && with.ends_with(" more; other clients"), "%s", with.c_str());
}
END_TEST

static fs_report wait_for_state(ServerRig& rig, const Scene& scene, const char* name, fs_object_state state) {
  fs_report report{};
  const bool is_so = eventually([&] {
    rig.step();
    report = report_of(scene.get(), name);
    return report.state == state;
  });
  ck_assert_msg(is_so, "'%s' is in state %d, not %d", name, report.state, state);
  return report;
}

// Not at the centre of a sphere, where all triangles are equally near and each tick looks at all of them.
static const fs_pose off_centre = at(0, 0, 0.02);

START_TEST(max_megabytes) {
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 1;
  ServerRig rig(options);
  rig.fake.state.pose = off_centre;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  const Shape large = make_mesh(sphere_mesh(0.1, 50000));  // 12 bytes a triangle, 24 a point: 1.2 MB
  const Shape half = make_mesh(sphere_mesh(0.1, 22000)), other_half = make_mesh(sphere_mesh(0.1, 23000));
  set(me, solid("a", large));  // it is not known here
  ck_assert(has(me.get(), "a"));
  EXPECT_SENTENCE(FS_ERROR_FULL, rig.sync(me.get()), "the server allows 1 MB (max_megabytes)");
  const fs_report report = wait_for_state(rig, me, "a", FS_OBJECT_REFUSED);
  ck_assert(report.weight == 0 && std::isinf(report.distance) && report.primitive == FS_PRIMITIVE_MESH);
  const fs_event event = next_event(me.get(), FS_EVENT_REFUSED);
  ck_assert_int_eq(event.status, FS_ERROR_FULL);
  ck_assert_str_eq(event.name, "a");
  ck_assert_ptr_nonnull(std::strstr(event.text, "the server allows 1 MB (max_megabytes)"));
  OK(rig.sync(me.get()));  // told once
  for (const fs_client& c : clients_of(bob)) {
    const bool is_me = std::string_view(c.name) == "me";
    ck_assert_uint_eq(c.refused, is_me ? 1 : 0);
    ck_assert_uint_eq(c.shape_bytes, 0);
    ck_assert_uint_eq(c.objects, 0);
  }
  // Others can have theirs; the next word on the refused one counts.
  set(bob, solid("a", half));
  set(me, push("a", 1));
  rig.settle(me.get());
  wait_for_state(rig, me, "a", FS_OBJECT_FELT);
  OK(fs_object_remove(me.get(), "a"));
  // One by one they have their turn.
  set(me, solid("first", half));
  set(me, solid("second", other_half));
  EXPECT(FS_ERROR_FULL, rig.sync(me.get()));
  wait_for_state(rig, me, "second", FS_OBJECT_REFUSED);
  rig.step_through_fade();
  wait_for_state(rig, me, "first", FS_OBJECT_FELT);
  OK(fs_scene_clear(me.get()));
  ck_assert_uint_eq(own_reports_of(me.get()).size(), 0);
  ck_assert(eventually([&] {  // when the first has faded out
    rig.step_through_fade();
    set(me, solid("second", other_half));
    if (rig.sync(me.get()) == FS_OK) return true;
    OK(fs_object_remove(me.get(), "second"));
    return false;
  }));
  rig.step_through_fade();
  wait_for_state(rig, me, "second", FS_OBJECT_FELT);
  // A group with one that is refused is refused as a whole, and what was there stays.
  OK(fs_scene_begin(me.get()));
  set(me, push("plain", 5));
  set(me, solid("huge", large));
  OK(fs_object_remove(me.get(), "second"));
  OK(fs_scene_commit(me.get()));
  EXPECT(FS_ERROR_FULL, rig.sync(me.get()));
  rig.step_through_fade();
  wait_for_state(rig, me, "plain", FS_OBJECT_REFUSED);
  std::map<std::string, int> refused;
  for (const fs_event& e : events_now(me.get())) refused[e.name] += e.kind == FS_EVENT_REFUSED;
  ck_assert(refused["plain"] == 1 && refused["huge"] == 1);
  ck_assert_uint_eq(clients_of(bob)[1].objects, 1);
  ck_assert(has(bob.get(), "me/second"));
}
END_TEST

START_TEST(refused_and_set_again) {  // when there is room: it need not be removed first
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 1;
  ServerRig rig(options);
  rig.fake.state.pose = off_centre;
  const Scene me = rig.join("me");
  const Shape half = make_mesh(sphere_mesh(0.1, 22000)), other_half = make_mesh(sphere_mesh(0.1, 23000));
  set(me, solid("first", half));
  set(me, solid("second", other_half));
  EXPECT(FS_ERROR_FULL, rig.sync(me.get()));
  OK(fs_object_remove(me.get(), "first"));
  ck_assert(eventually([&] {
    rig.step_through_fade();
    set(me, solid("second", other_half));
    return rig.sync(me.get()) == FS_OK;
  }));
  rig.step_through_fade();
  wait_for_state(rig, me, "second", FS_OBJECT_FELT);
}
END_TEST

// --------------------------------------------------------------------------------------------- meshes that take long

START_TEST(a_big_mesh) {
  ServerRig rig;
  const Scene me = rig.join("me");
  const Shape big = make_mesh(sphere_mesh(0.05, is_sanitized ? 60000 : 300000));
  set(me, push("other", 1, {1, 0, 0}));
  rig.settle(me.get());
  next_event(me.get(), FS_EVENT_READY);
  rig.fake.state.pose = at(0, 0, 0.1);

  set(me, solid("big", big, 1000));
  ck_assert(has(me.get(), "big"));
  // Changes of the same object wait behind it, in order; those of others go on.
  fs_object o = solid("big", big, 500);
  OK(fs_object_change(me.get(), &o, FS_PART_PROFILES));
  const fs_pose away = at(0, 0, -7), there = at(0, 0, 0.02);
  const fs_twist still{};
  OK(fs_object_move(me.get(), "big", &away, &still, FS_NOW));
  OK(fs_object_move(me.get(), "big", &there, &still, FS_NOW));
  o.front = attract(200, 1000);
  o.back = attract(300, 1000);
  OK(fs_object_change(me.get(), &o, FS_PART_PROFILES));
  EXPECT_VECTOR(Got(me.get(), "big")->pose.position, there.position, 0);
  ck_assert_double_eq(Got(me.get(), "big")->front.gain, 200);
  int moves_meanwhile = 0;
  for (int k = 0; k < 20; ++k) {
    const fs_pose pose{{-100.0 - k, 0, 0}, push("", 1, {1, 0, 0}).pose.orientation};
    OK(fs_object_move(me.get(), "other", &pose, &still, FS_NOW));
    const bool is_moved = eventually([&] {
      rig.step();
      return std::fabs(report_of(me.get(), "other").distance - 100 - k) < 1e-6;
    });
    ck_assert(is_moved);
    const fs_report report = report_of(me.get(), "big");
    if (report.state != FS_OBJECT_PENDING) break;
    ck_assert(report.weight == 0 && report.primitive == FS_PRIMITIVE_MESH);
    ++moves_meanwhile;
  }
  ck_assert_int_gt(moves_meanwhile, 0);
  set(me, push("late", 1, {1, 0, 0}));
  OK(rig.sync(me.get()));  // that waits for all of it
  rig.step_through_fade();
  std::vector<std::string> ready;
  for (int i = 0; i < 2; ++i) ready.push_back(next_event(me.get(), FS_EVENT_READY).name);
  ck_assert_str_eq(ready[0].c_str(), "late");
  ck_assert_str_eq(ready[1].c_str(), "big");
  EXPECT_NEAR(rig.fake.written.force.z, -200 * (0.1 - 0.02 - 0.05), 0.01);
  ck_assert_int_eq(report_of(me.get(), "big").state, FS_OBJECT_FELT);
  // What is known already is there at once, also for another object.
  set(me, solid("twin", big, 100));
  rig.settle(me.get());
  EXPECT_NEAR(rig.fake.written.force.z, -200 * (0.1 - 0.02 - 0.05) - 100 * (0.1 - 0.05), 0.01);
}
END_TEST

START_TEST(second_thoughts) {  // while a mesh is built
  ServerRig rig;
  const Scene me = rig.join("me");
  rig.fake.state.pose = off_centre;
  const Shape first = make_mesh(sphere_mesh(0.05, 10000)), second = make_mesh(sphere_mesh(0.04, 10000));
  // Removed before it was there.
  set(me, solid("gone", first));
  OK(fs_object_remove(me.get(), "gone"));
  ck_assert(!has(me.get(), "gone"));
  // Something else before it was there; and the place of one that is gone, with its shape again.
  set(me, solid("point", second));
  set(me, push("point", 3));
  set(me, solid("again", first));
  // Cleared, and all anew.
  OK(fs_scene_clear(me.get()));
  set(me, solid("again", second, 100));
  set(me, push("plain", 1));
  rig.settle(me.get());
  EXPECT_NEAR(rig.force_at({0, 0, 0.1}).z, 1 - 100 * 0.06, 0.01);
  ck_assert_uint_eq(own_reports_of(me.get()).size(), 2);
  // In a group, all of which waits, and is felt as one.
  const Shape third = make_mesh(sphere_mesh(0.03, 10000));
  std::vector<fs_wrench> log;
  rig.fake.log = &log;
  OK(fs_scene_begin(me.get()));
  OK(fs_scene_clear(me.get()));
  fs_object o = push("mesh", 5);
  o.primitive = FS_PRIMITIVE_MESH;
  o.shape = third.get();
  o.front = constant(FS_SENSE_REPULSIVE, 7);
  set(me, o);
  set(me, push("down", 7, {0, 0, -1}));
  OK(fs_scene_commit(me.get()));
  rig.settle(me.get());
  rig.fake.log = nullptr;
  EXPECT_NEAR(rig.fake.written.force.z, 0, 1e-9);
  const double before = log.front().force.z;
  for (const fs_wrench& w : log) {  // on a straight way from what was
    ck_assert_double_ge(w.force.z, std::fmin(before, 0) - 1e-9);
    ck_assert_double_le(w.force.z, std::fmax(before, 0) + 1e-9);
  }
  for (const fs_event& e : events_now(me.get())) ck_assert_int_ne(e.kind, FS_EVENT_REFUSED);
}
END_TEST

START_TEST(views_wait_too) {  // in a group with a mesh; and what comes after it comes after it
  ServerRig rig;
  const Scene me = rig.join("me");
  rig.fake.state.pose = off_centre;
  const Shape big = make_mesh(sphere_mesh(0.05, 30000));
  fs_frame first = fs_frame_init(), second = fs_frame_init();
  first.scale = 2;
  second.scale = 3;
  const fs_vec3 near{0.1, 0, 0}, far{0.2, 0, 0};
  set(me, push("a", 2));
  rig.settle(me.get());
  OK(fs_scene_begin(me.get()));
  set(me, solid("big", big, 1));
  OK(fs_scene_set_frame(me.get(), &first));
  OK(fs_scene_set_tool(me.get(), &near, 1));
  OK(fs_scene_set_clutch(me.get(), true));
  OK(fs_scene_commit(me.get()));
  ck_assert_double_eq(frame_of(me.get()).scale, 2);  // as it was said
  OK(fs_scene_set_frame(me.get(), &second));
  ck_assert_double_eq(frame_of(me.get()).scale, 3);
  OK(fs_scene_set_tool(me.get(), &far, 1));
  OK(fs_scene_set_clutch(me.get(), false));
  OK(fs_object_remove(me.get(), "big"));
  rig.settle(me.get());
  ck_assert_double_eq(frame_of(me.get()).scale, 3);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  EXPECT_VECTOR(rig.fake.written.torque, (fs_vec3{0, -2 * 0.2 / 3, 0}), 1e-12);
}
END_TEST

START_TEST(edits_wait_for_shapes) {  // a change of another's object brings a mesh
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob");
  rig.fake.state.pose = off_centre;
  const Shape big = make_mesh(sphere_mesh(0.05, 20000));
  set(me, push("a", 1));
  rig.settle(me.get());
  const fs_object o = solid("me/a", big, 100);
  OK(fs_object_change(bob.get(), &o, 31));
  const fs_object p = push("me/a", 2);
  OK(rig.sync(bob.get()));
  rig.step_through_fade();
  EXPECT_NEAR(rig.force_at({0, 0, 0.1}).z, -5, 0.01);
  size_t count = 0;
  const Got seen(me.get(), "a");
  fs_shape_get_triangles(seen->shape, &count);
  size_t wanted = 0;
  fs_shape_get_triangles(big.get(), &wanted);
  ck_assert_uint_eq(count, wanted);
  OK(fs_object_change(bob.get(), &p, 31));
  OK(rig.sync(bob.get()));
  rig.step_through_fade();
  EXPECT_NEAR(rig.force_at({0, 0, 0.1}).z, 2, 1e-9);
}
END_TEST

// ---------------------------------------------------------------------------------------------------------- the end

static void expect_lost(fs_scene* scene) {
  const fs_object o = push("a");
  const fs_pose pose = at(0, 0, 0);
  const fs_frame frame = fs_frame_init();
  const fs_vec3 point{};
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  fs_report report;
  fs_view view;
  fs_frame other_frame;
  fs_state state;
  fs_servo_stats stats = fs_servo_stats_init();
  fs_device_info info = fs_device_info_init();
  fs_vec3 points[1];
  size_t count = 0;
  double time = 0;
  const std::vector<std::function<fs_status()>> calls{
      [&] { return fs_object_set(scene, &o); },
      [&] { return fs_object_change(scene, &o, 1); },
      [&] { return fs_object_get(scene, "a", &got); },
      [&] { return fs_object_get(scene, "bob/a", &got); },
      [&] { return fs_object_move(scene, "a", &pose, nullptr, FS_NOW); },
      [&] { return fs_object_remove(scene, "a"); },
      [&] { return fs_scene_clear(scene); },
      [&] { return fs_scene_begin(scene); },
      [&] { return fs_scene_commit(scene); },
      [&] { return fs_scene_cancel(scene); },
      [&] { return fs_scene_sync(scene, 1); },
      [&] { return fs_scene_save(scene, "/tmp/forceserver-never.json"); },
      [&] { return fs_scene_set_frame(scene, &frame); },
      [&] { return fs_scene_get_frame(scene, nullptr, &other_frame); },
      [&] { return fs_scene_set_clutch(scene, true); },
      [&] { return fs_scene_set_tool(scene, &point, 1); },
      [&] { return fs_scene_get_tool(scene, points, 1, &count); },
      [&] { return fs_scene_set_accuracy(scene, 0); },
      [&] { return fs_scene_set_max_stiffness(scene, 0); },
      [&] { return fs_scene_get_time(scene, &time); },
      [&] { return fs_scene_get_reports(scene, nullptr, 0, &count); },
      [&] { return fs_scene_get_report(scene, "a", &report); },
      [&] { return fs_scene_get_motions(scene, nullptr, nullptr, 0, &count); },
      [&] { return fs_scene_get_motions(scene, "me", nullptr, 0, &count); },
      [&] { return fs_scene_get_view(scene, nullptr, &view); },
      [&] { return fs_scene_get_hand(scene, &state, nullptr, nullptr); },
      [&] { return fs_scene_get_servo_stats(scene, &stats); },
      [&] { return fs_scene_get_device_info(scene, &info); },
      [&] { return fs_scene_stop_force(scene); },
      [&] { return fs_scene_resume_force(scene); },
      [&] { return fs_scene_get_clients(scene, nullptr, 0, &count); },
      [&] { return fs_scene_get_views(scene, nullptr, 0, &count); },
      [&] { return fs_scene_get_record(scene, 0, nullptr, 0, &count); }};
  for (size_t i = 0; i < calls.size(); ++i) {
    const fs_status status = calls[i]();
    ck_assert_msg(status == FS_ERROR_DISCONNECTED, "call %zu gives %s", i, fs_status_name(status));
    ck_assert_uint_gt(std::strlen(fs_last_error()), 5);
  }
}

START_TEST(a_server_that_goes) {
  for (const bool is_servo : {false, true}) {
    ServerRig rig;
    const Scene me = rig.join("me"), bob = rig.join("bob");
    const Tool tool = make_tool(me.get());
    set(me, push("a", 2));
    set(bob, push("a", 3, {1, 0, 0}));
    set(rig.base, push("a", 4, {0, 1, 0}));
    rig.settle(me.get());
    EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{3, 4, 2}), 1e-12);
    fs_event last{};
    std::thread waiter([&] {
      do {
        fs_scene_next_event(me.get(), long_enough, &last);
      } while (last.kind != FS_EVENT_NONE && last.kind != FS_EVENT_DISCONNECTED);
    });
    fs_status of_sync = FS_OK;
    set(bob, push("b"));  // nobody steps: it waits for a tick that never comes
    std::thread syncing([&] { of_sync = fs_scene_sync(bob.get(), long_enough); });
    wait_a_little(0.02);
    std::vector<fs_wrench> log{rig.fake.written};
    if (is_servo) {
      rig.servo.reset();
    } else {
      rig.server.reset();
    }
    waiter.join();
    syncing.join();
    EXPECT(FS_ERROR_DISCONNECTED, of_sync);
    ck_assert_int_eq(last.kind, FS_EVENT_DISCONNECTED);
    ck_assert_int_eq(last.status, FS_ERROR_DISCONNECTED);
    ck_assert_uint_gt(std::strlen(last.text), 3);
    EXPECT(FS_ERROR_DISCONNECTED, fs_scene_next_event(me.get(), long_enough, &last));  // that was the last
    expect_lost(me.get());
    expect_lost(bob.get());
    EXPECT_VECTOR(force_at(tool.get(), {}), (fs_vec3{0, 0, 2}), 1e-12);  // a tool has what it had
    if (is_servo) continue;
    // Its clients' objects fade; its own scene stays.
    rig.fake.log = &log;
    ck_assert(eventually([&] {
      rig.step();
      return norm(rig.fake.written.force - fs_vec3{0, 4, 0}) < 1e-12;
    }));
    rig.fake.log = nullptr;
    for (size_t k = 1; k < log.size(); ++k) {
      ck_assert_double_le(norm(log[k].force - log[k - 1].force), (2 + 3 + 2) * 0.001 / world_fade * (1 + 1e-6));
    }
    // A server that comes after it is another one.
    const Server again = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
    expect_lost(me.get());
    const Scene anew = rig.join("me");
    set(anew, push("a", 5));
    rig.settle(anew.get());
    EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 4, 5}), 1e-12);
  }
}
END_TEST

START_TEST(a_client_that_goes) {  // while calls wait in other threads, and in the middle of a group
  ServerRig rig;
  const Scene stays = rig.join("stays");
  Scene me = rig.join("me");
  rig.fake.state.pose = off_centre;
  const Shape big = make_mesh(sphere_mesh(0.05, 50000));
  set(me, push("a", 2));
  set(me, solid("big", big));
  OK(fs_scene_begin(me.get()));
  set(me, push("b", 2));
  rig.step(2);
  Tool tool = make_tool(me.get());  // that goes on with what it has
  me.reset();
  EXPECT_NEAR(force_at(tool.get(), {}).z, 2, 0.02 * 100 + 1);
  tool.reset();
  ck_assert(eventually([&] { return clients_of(stays).size() == 2; }));
  ck_assert_uint_eq(reports_of(stays.get()).size(), 0);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_object_remove(stays.get(), "me/a"), "me");
  ck_assert(eventually([&] {
    rig.step(10);
    return norm(rig.fake.written.force) == 0;
  }));
}
END_TEST

START_TEST(bad_servers) {
  ServoRig rig;
  fs_server* server = nullptr;
  const auto start = [&](const std::string& endpoint, const fs_server_options& options) {
    return fs_server_start(rig.servo.get(), endpoint.c_str(), &options, &server);
  };
  const fs_server_options good = fs_server_options_init();
  const struct {
    const char* field;
    void (*spoil)(fs_server_options&);
  } cases[]{{"max_clients", [](fs_server_options& o) { o.max_clients = 4097; }},
            {"max_objects", [](fs_server_options& o) { o.max_objects = 65537; }},
            {"max_megabytes", [](fs_server_options& o) { o.max_megabytes = 1000001; }},
            {"lease", [](fs_server_options& o) { o.lease = -1; }},
            {"lease", [](fs_server_options& o) { o.lease = NAN; }},
            {"lease", [](fs_server_options& o) { o.lease = 1e7; }},
            {"force_limit", [](fs_server_options& o) { o.force_limit = 1001; }},
            {"force_limit", [](fs_server_options& o) { o.force_limit = -1; }},
            {"reserved", [](fs_server_options& o) { o.reserved[3] = 1; }},
            {"struct_size", [](fs_server_options& o) { o.struct_size -= 8; }}};
  for (const auto& c : cases) {
    fs_server_options options = good;
    c.spoil(options);
    EXPECT_SENTENCE(FS_ERROR_INVALID, start(new_endpoint(), options), c.field);
  }
  const Longer newer(good, 1);
  EXPECT(FS_ERROR_VERSION, start(new_endpoint(), newer.known));
  for (const char* endpoint : {"", "shm:", "tcp:1", "shm:a/b", "shm:a?timeout=1"}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, start(endpoint, good), "endpoint");
  }
  EXPECT(FS_ERROR_UNSUPPORTED, start("dds:1", good));
  ck_assert_ptr_null(server);
  fs_server_options most = good;
  most.max_clients = 4096;
  most.max_objects = 65536;
  most.max_megabytes = 1000000;
  most.force_limit = 1000;
  most.lease = 1e6;
  const std::string endpoint = new_endpoint();
  OK(start(endpoint, most));
  const Server owner(server);
  const Scene me = connect(endpoint, "me");
  set(me, push("a"));
  rig.settle(me.get());
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 2}), 1e-12);
  fs_server_stop(nullptr);
}
END_TEST

int main() {
  Suite* suite = suite_create("connected_bounds");
  add_once(suite, "in", {connecting, places, comings_and_goings, a_server_that_comes_later,
                         what_is_not_for_connected_scenes, bad_servers});
  add_once(suite, "much", {max_objects, damping_of_clients, stiffness_of_clients, max_megabytes, refused_and_set_again});
  add_once(suite, "long", {a_big_mesh, second_thoughts, views_wait_too, edits_wait_for_shapes});
  add_once(suite, "end", {a_server_that_goes, a_client_that_goes});
  return run_suite(suite);
}
