// fs_scene_get_motions_since: what has changed since the last look. A follower who asks for that alone, and for the numbers of
// objects, knows what there is.
#include <atomic>
#include <map>
#include <thread>

#include "api/world.h"

using namespace scenes;

using Names = std::vector<std::string>;

static std::vector<fs_motion> motions_since(fs_scene* scene, const char* client, uint64_t since, size_t room = 1000) {
  std::vector<fs_motion> out(room);
  size_t count = 0;
  OK(fs_scene_get_motions_since(scene, client, since, out.data(), room, &count));
  out.resize(std::min(count, room));
  for (size_t i = 0; i < out.size(); ++i) {
    ck_assert_uint_gt(out[i].motion_revision, i ? out[i - 1].motion_revision : since);
  }
  return out;
}

// Looks again and again; what it was told.
struct Look {
  fs_scene* scene;
  const char* client;
  uint64_t since = 0;

  Names operator()(size_t room = 1000) {
    Names out;
    for (const fs_motion& m : motions_since(scene, client, since, room)) {
      out.push_back(m.name);
      since = m.motion_revision;
    }
    return out;
  }
};

static void expect(const Names& names, const Names& wanted) {
  std::string found;
  for (const std::string& name : names) found += name + ' ';
  ck_assert_msg(names == wanted, "%s", found.c_str());
}

static void move(fs_scene* scene, const char* name, double x) {
  const fs_pose pose = at(x, 0, 0);
  OK(fs_object_move(scene, name, &pose, nullptr, FS_NOW));
}

static std::map<std::string, fs_motion> listed(fs_scene* scene, const char* client) {
  size_t count = 0;
  OK(fs_scene_get_motions(scene, client, nullptr, 0, &count));
  std::vector<fs_motion> list(count + 100);
  OK(fs_scene_get_motions(scene, client, list.data(), list.size(), &count));
  ck_assert_uint_le(count, list.size());
  std::map<std::string, fs_motion> out;
  for (size_t i = 0; i < count; ++i) out[list[i].name] = list[i];
  return out;
}

static std::map<std::string, size_t> counts_of(fs_scene* scene) {
  fs_client clients[32];
  size_t count = 0;
  OK(fs_scene_get_clients(scene, clients, 32, &count));
  std::map<std::string, size_t> out;
  for (size_t i = 0; i < count; ++i) out[clients[i].name] = clients[i].objects;
  return out;
}

// ------------------------------------------------------------------------------------------------------------- one scene

START_TEST(of_its_own) {
  World w(_i);
  const char* const client = _i == connected ? "me" : nullptr;
  Look look{w.scene, client};
  expect(look(), {});
  for (const char* name : {"c", "a", "b"}) w.set(spring(name));
  expect(look(), {"c", "a", "b"});  // in the order of their numbers
  expect(look(), {});
  w.step(3);
  w.settle();
  expect(look(), {});
  move(w.scene, "c", 1);
  expect(look(), {"c"});
  const fs_object other = push("a");
  OK(fs_object_change(w.scene, &other, FS_PART_PROFILES));
  move(w.scene, "c", 2);
  expect(look(), {"a", "c"});
  OK(fs_object_remove(w.scene, "a"));
  expect(look(), {});
  w.set(spring("a"));
  expect(look(), {"a"});
  for (const char* name : {"a", "b", "c"}) {
    const fs_motion m = listed(w.scene, client).at(name);
    ck_assert_int_eq(std::memcmp(&m, &motions_since(w.scene, client, m.motion_revision - 1)[0], sizeof m), 0);
  }
  expect(Look{w.scene, client}(), {"b", "c", "a"});

  // What a small buffer has no room for comes the next time.
  Look little{w.scene, client};
  expect(little(0), {});
  expect(little(1), {"b"});
  expect(little(2), {"c", "a"});
  size_t count = 0;
  OK(fs_scene_get_motions_since(w.scene, client, 0, nullptr, 0, &count));
  ck_assert_uint_eq(count, 3);
  OK(fs_scene_get_motions_since(w.scene, client, UINT64_MAX, nullptr, 0, &count));
  ck_assert_uint_eq(count, 0);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_scene_get_motions_since(w.scene, client, 0, nullptr, 1, &count), "out");
  for (const char* nobody : {"nobody", "", "a/b"}) {
    EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_scene_get_motions_since(w.scene, nobody, 0, nullptr, 0, &count), "client");
  }
  OK(fs_scene_clear(w.scene));
  expect(Look{w.scene, client}(), {});
}
END_TEST

START_TEST(of_its_own_in_groups) {
  World w(_i);
  const char* const client = _i == connected ? "me" : nullptr;
  Look look{w.scene, client};
  for (const char* name : {"a", "b", "c"}) w.set(spring(name));
  look();
  const auto move_elsewhere = [&](const char* name, double x) { std::thread([&] { move(w.scene, name, x); }).join(); };
  OK(fs_scene_begin(w.scene));
  move(w.scene, "a", 1);
  w.set(spring("new"));
  expect(look(), {});
  move_elsewhere("b", 2);
  expect(look(), {"b"});
  OK(fs_scene_commit(w.scene));
  expect(look(), {"a", "new"});  // though their changes were made before that of b

  OK(fs_scene_begin(w.scene));
  move(w.scene, "a", 3);
  OK(fs_object_remove(w.scene, "new"));
  move_elsewhere("c", 2);
  expect(look(), {"c"});
  OK(fs_scene_cancel(w.scene));
  expect(look(), {});

  // Changes and moves of one object that others have moved since.
  OK(fs_scene_begin(w.scene));
  const fs_object other = push("a");
  OK(fs_object_change(w.scene, &other, FS_PART_PROFILES));
  move(w.scene, "b", 4);
  move_elsewhere("a", 5);
  move_elsewhere("b", 5);
  const auto expect_both = [&] {
    Names both = look();
    std::sort(both.begin(), both.end());
    expect(both, {"a", "b"});
  };
  expect_both();
  OK(fs_scene_commit(w.scene));
  expect_both();
  ck_assert_double_eq(listed(w.scene, client).at("b").pose.position.x, 4);
}
END_TEST

START_TEST(another_clock) {  // shifts all times
  Scene scene = make_scene();
  set(scene, spring("a"));
  Look look{scene.get(), nullptr};
  expect(look(), {"a"});
  OK(fs_scene_begin(scene.get()));
  move(scene.get(), "a", 1);
  FakeDevice fake(new_endpoint());
  const Device device = fake.open();
  Servo servo = start_servo(scene.get(), device.get(), world_options());
  expect(look(), {"a"});
  OK(fs_scene_commit(scene.get()));
  expect(look(), {"a"});
  servo.reset();
  expect(look(), {"a"});
}
END_TEST

// ---------------------------------------------------------------------------------------------------------------- several

START_TEST(of_others) {
  ServerRig rig;
  const Scene me = rig.join("me"), bob = rig.join("bob"), carl = rig.join("carl");
  Look all{me.get(), nullptr}, bobs{me.get(), "bob"}, servers{me.get(), "server"};
  expect(all(), {});
  set(me, spring("mine"));
  OK(rig.sync(me.get()));
  set(bob, spring("a"));
  OK(rig.sync(bob.get()));
  set(rig.base, spring("s"));
  set(carl, spring("a"));
  OK(rig.sync(carl.get()));
  expect(all(), {"bob/a", "server/s", "carl/a"});
  expect(bobs(), {"bob/a"});
  expect(servers(), {"server/s"});
  for (int round = 0; round < 10; ++round) {  // a move needs no tick to be seen
    move(bob.get(), "a", round);
    expect(all(), {"bob/a"});
    expect(bobs(), {"bob/a"});
    move(me.get(), "carl/a", round);
    move(rig.base.get(), "s", round);
    expect(all(), {"carl/a", "server/s"});
    expect(bobs(), {});
    expect(servers(), {"server/s"});
  }

  // Groups that are committed after later changes have been told: of the server's own scene, of a client, and of one client's
  // objects by another.
  OK(fs_scene_begin(rig.base.get()));
  move(rig.base.get(), "s", 100);
  set(rig.base, spring("s2"));
  OK(fs_scene_begin(bob.get()));
  move(bob.get(), "a", 100);
  move(bob.get(), "carl/a", 100);
  std::thread([&] { set(rig.base, spring("later")); }).join();
  move(me.get(), "carl/a", 50);
  expect(all(), {"server/later", "carl/a"});
  OK(fs_scene_commit(rig.base.get()));
  expect(all(), {"server/s", "server/s2"});
  OK(fs_scene_commit(bob.get()));
  OK(rig.sync(bob.get()));
  expect(all(), {"bob/a", "carl/a"});
  ck_assert_double_eq(listed(me.get(), "carl").at("carl/a").pose.position.x, 100);
}
END_TEST

START_TEST(counts) {  // fs_client.objects is the number of motions that are listed
  fs_server_options options = fs_server_options_init();
  options.max_megabytes = 12;
  ServerRig rig(options);
  const Scene me = rig.join("me"), bob = rig.join("bob");
  const auto expect_counts = [&](size_t bobs, size_t servers) {
    std::map<std::string, size_t> found = counts_of(me.get());
    ck_assert_uint_eq(found.at("bob"), bobs);
    ck_assert_uint_eq(found.at("server"), servers);
    ck_assert_uint_eq(listed(me.get(), "bob").size(), bobs);
    ck_assert_uint_eq(listed(me.get(), "server").size(), servers);
    ck_assert_uint_eq(motions_since(me.get(), nullptr, 0).size(), bobs + servers);
  };
  expect_counts(0, 0);
  fs_object off = push("off"), brief = spring("brief");
  off.enabled = false;
  brief.lifetime = 0.01;
  const Shape torus = make_mesh(torus_mesh(0.05, 0.02, 200));
  for (fs_scene* scene : {bob.get(), rig.base.get()}) {
    for (const fs_object& o : {spring("a"), off, brief, solid("torus", torus)}) OK(fs_object_set(scene, &o));
    rig.settle(scene);
  }
  expect_counts(4, 4);
  for (fs_scene* scene : {bob.get(), rig.base.get()}) {
    OK(fs_object_remove(scene, "torus"));
    OK(rig.sync(scene));
  }
  expect_counts(3, 3);  // while it fades out
  OK(fs_object_remove(me.get(), "bob/off"));
  OK(fs_object_remove(me.get(), "server/off"));
  expect_counts(2, 2);
  OK(fs_scene_begin(rig.base.get()));
  set(rig.base, spring("open"));
  OK(fs_object_remove(rig.base.get(), "a"));
  expect_counts(2, 2);
  OK(fs_scene_commit(rig.base.get()));
  expect_counts(2, 2);

  // Pending: a big mesh is being built.
  set(bob, solid("big", make_mesh(terrain_mesh(0.1, 0.01, times(100'000, 200'000)))));
  ck_assert(eventually([&] {
    const size_t before = counts_of(me.get()).at("bob"), between = listed(me.get(), "bob").size();
    const size_t after = counts_of(me.get()).at("bob");
    ck_assert_msg(before <= between && between <= after, "%zu, %zu, %zu", before, between, after);
    return after == 3;
  }));
  expect_counts(3, 2);
  // Refused: there is no room for the mesh.
  const Shape too_big = make_mesh(terrain_mesh(0.1, 0.01, 800'000));
  set(bob, solid("refused", too_big));
  EXPECT(FS_ERROR_FULL, rig.sync(bob.get()));
  expect_counts(3, 2);
  ck_assert_uint_eq(listed(bob.get(), "bob").size(), 4);  // with the one that was refused
  OK(fs_scene_begin(bob.get()));
  OK(fs_object_remove(bob.get(), "a"));
  set(bob, spring("new"));
  set(bob, solid("refused too", too_big));
  OK(fs_scene_commit(bob.get()));
  EXPECT(FS_ERROR_FULL, rig.sync(bob.get()));
  expect_counts(3, 2);
  OK(fs_scene_clear(bob.get()));
  OK(rig.sync(bob.get()));
  expect_counts(0, 2);
}
END_TEST

// --------------------------------------------------------------------------------------------------------------- followers

// Knows the objects of all others by fs_scene_get_motions_since and the counts, and lists those of a client only where it has
// too many of them.
struct Follower {
  explicit Follower(fs_scene* the_scene) : scene(the_scene) {}
  fs_scene* const scene;
  uint64_t since = 0;
  std::map<std::string, std::map<std::string, fs_motion>> known;  // by client

  void look(size_t room) {
    for (const fs_motion& m : motions_since(scene, nullptr, since, room)) {
      since = m.motion_revision;
      const std::string name = m.name;
      known[name.substr(0, name.find('/'))][name] = m;
    }
    std::map<std::string, size_t> counts = counts_of(scene);
    for (auto client = known.begin(); client != known.end();) {
      const auto found = counts.find(client->first);
      if (found != counts.end() && found->second < client->second.size()) {
        std::vector<fs_motion> list(1000);
        size_t count = 0;
        const fs_status status =
            PATIENTLY(fs_scene_get_motions(scene, client->first.c_str(), list.data(), list.size(), &count));
        ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND);
        if (status == FS_OK) {
          client->second.clear();
          for (size_t i = 0; i < count; ++i) client->second[list[i].name] = list[i];
        }
      }
      client = found == counts.end() ? known.erase(client) : std::next(client);
    }
  }
  void expect_all() const {
    std::map<std::string, fs_motion> all;
    for (const auto& [client, motions] : known) all.insert(motions.begin(), motions.end());
    const std::map<std::string, fs_motion> there = listed(scene, nullptr);
    for (const auto& [name, motion] : there) {
      ck_assert_msg(all.contains(name), "'%s' was not told", name.c_str());
      ck_assert_msg(std::memcmp(&all.at(name), &motion, sizeof motion) == 0, "the last change of '%s' was not told", name.c_str());
    }
    ck_assert_uint_eq(all.size(), there.size());
  }
};

static void change_something(fs_scene* scene, Random& random, const Names& others) {
  const bool is_group = random.coin(0.4);
  if (is_group) fs_scene_begin(scene);
  for (uint64_t k = is_group ? random.below(8) : 1; k > 0; --k) {
    const bool is_foreign = !others.empty() && random.coin(0.2);
    const std::string name = (is_foreign ? others[random.below(others.size())] + "/" : "") + std::to_string(random.below(12));
    const fs_pose pose = random.pose(0.1);
    fs_object object = random.coin() ? spring(name.c_str()) : push(name.c_str());
    object.pose = pose;
    const double kind = random.unit_interval();
    if (kind < 0.15) fs_object_remove(scene, name.c_str());
    else if (kind < 0.3 && !is_foreign) fs_object_set(scene, &object);
    else if (kind < 0.4) fs_object_change(scene, &object, FS_PART_PROFILES | (random.coin() ? FS_PART_POSE : 0));
    else fs_object_move(scene, name.c_str(), &pose, nullptr, FS_NOW);
    if (is_group && random.coin(0.2)) wait_a_little();
  }
  if (is_group && (random.coin(0.2) || fs_scene_commit(scene) != FS_OK)) fs_scene_cancel(scene);
}

START_TEST(followers) {
  ServerRig rig;
  const Scene me = rig.join("me"), other = rig.join("other");
  Follower wide(me.get()), narrow(other.get());
  Scene clients[3];
  const char* const names[]{"a", "b", "c"};
  for (int i = 0; i < 3; ++i) clients[i] = rig.join(names[i]);
  for (int round = 0; round < times(is_sanitized ? 3 : 12, 100); ++round) {
    std::atomic<bool> is_over{false};
    std::vector<std::thread> threads;
    const auto add = [&](fs_scene* scene, const Names& others) {
      const uint64_t seed = 100 * static_cast<uint64_t>(round) + threads.size();
      threads.emplace_back([&is_over, scene, others, seed] {
        for (Random random(seed); !is_over;) {
          change_something(scene, random, others);
          if (random.coin(0.1)) wait_a_little();
        }
      });
    };
    for (int i = 0; i < 3; ++i) add(clients[i].get(), {names[(i + 1) % 3], "server"});
    add(clients[0].get(), {});
    add(rig.base.get(), {});
    add(rig.base.get(), {});
    Random random(static_cast<uint64_t>(round));
    {
      const Stepper stepper(rig.servo.get());
      for (int k = 0; k < 40; ++k) {
        wide.look(1000);
        narrow.look(1 + random.below(10));
        if (random.coin(0.3)) wait_a_little();
      }
    }
    is_over = true;
    for (std::thread& thread : threads) thread.join();
    for (const Scene& client : clients) {
      const fs_status status = rig.sync(client.get());
      ck_assert_msg(status == FS_OK || status == FS_ERROR_NOT_FOUND, "%s", fs_last_error());  // a group that was refused
    }
    wide.look(1000);
    wide.expect_all();
    narrow.look(1000);
    narrow.expect_all();
    if (round % 3 == 2) {  // another of the same name
      clients[2].reset();
      ck_assert(eventually([&] { return !counts_of(me.get()).contains("c"); }));
      clients[2] = rig.join("c");
    }
  }
}
END_TEST

START_TEST(groups_of_the_servers) {  // are told as a whole, also where other clients are looked at
  ServerRig rig;
  const Scene me = rig.join("me"), other = rig.join("other");
  const auto put = [&](double x) {
    OK(fs_scene_begin(rig.base.get()));
    for (const char* name : {"1", "2", "3", "4"}) {
      const fs_pose pose = at(x, 0, 0);
      const fs_object o = spring(name, pose.position);
      const fs_twist still{};
      OK(x > 0 ? fs_object_move(rig.base.get(), name, &pose, &still, FS_NOW) : fs_object_set(rig.base.get(), &o));
    }
    OK(fs_scene_commit(rig.base.get()));
  };
  put(0);
  std::atomic<bool> is_over{false};
  std::thread mover([&] {
    for (int k = 1; !is_over; ++k) put(k);
  });
  uint64_t since = 0, told = 0;
  for (int k = 0; k < (is_sanitized ? 600 : 3000); ++k) {
    const std::vector<fs_motion> list = motions_since(me.get(), nullptr, since);
    ck_assert(list.empty() || list.size() == 4);
    for (const fs_motion& m : list) ck_assert_double_eq(m.pose.position.x, list[0].pose.position.x);
    if (list.empty()) continue;
    since = list.back().motion_revision;
    ++told;
  }
  is_over = true;
  mover.join();
  ck_assert_uint_gt(told, 1);
}
END_TEST

int main() {
  Suite* suite = suite_create("since");
  add_on_both(suite, "own", {of_its_own, of_its_own_in_groups});
  add_once(suite, "several", {another_clock, of_others, counts});
  add_once(suite, "followers", {followers, groups_of_the_servers});
  return run_suite(suite);
}
