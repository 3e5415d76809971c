// Clients that a bridge brings from other machines: all of one site, the text after the last '@' of their names, push no more
// than one client may.
#include <map>

#include "api/world.h"

using namespace scenes;

static constexpr double limit = 5;  // N

static fs_server_options with_limit(double force = limit) {
  fs_server_options options = fs_server_options_init();
  options.force_limit = force;
  return options;
}

struct Sites : ServerRig {
  std::map<std::string, Scene> clients;

  explicit Sites(double force = limit) : ServerRig(with_limit(force)) {}
  // A client that pushes with this force; 0: it has no object.
  void add(const std::string& name, double force, fs_vec3 direction = {0, 0, 1}) {
    clients[name] = join(name.c_str());
    if (force > 0) set(name, force, direction);
  }
  void set(const std::string& name, double force, fs_vec3 direction = {0, 0, 1}) {
    const fs_object o = push("push", force, direction);
    OK(fs_object_set(clients.at(name).get(), &o));
  }
  fs_vec3 settled() {
    for (const auto& [name, scene] : clients) settle(scene.get());
    return fake.written.force;
  }
  fs_client told(const std::string& name) {
    fs_client all[32];
    size_t count = 0;
    OK(fs_scene_get_clients(clients.begin()->second.get(), all, 32, &count));
    for (size_t i = 0; i < count; ++i) {
      if (name == all[i].name) return all[i];
    }
    ck_abort_msg("'%s' is not listed", name.c_str());
    return {};
  }
  void expect_told(const std::string& name, fs_vec3 force, bool is_limited) {
    const uint64_t before = told(name).limited;
    step(7);
    const fs_client after = told(name);
    EXPECT_VECTOR(after.wrench.force, force, 1e-12);
    ck_assert_double_eq(after.force_limit, limit);
    ck_assert_msg(after.limited - before == (is_limited ? 7 : 0), "%s: %d", name.c_str(), static_cast<int>(after.limited - before));
  }
};

START_TEST(one_direction) {
  Sites rig;
  rig.add("a@x", 5);
  rig.add("b@x", 5);
  rig.add("c@y", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 10}), 1e-12);
  rig.expect_told("a@x", {0, 0, 2.5}, true);
  rig.expect_told("b@x", {0, 0, 2.5}, true);
  rig.expect_told("c@y", {0, 0, 5}, false);
  // One alone has its own limit too.
  rig.set("c@y", 20);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 10}), 1e-12);
  rig.expect_told("c@y", {0, 0, 5}, true);
  rig.set("a@x", 1000);
  rig.set("b@x", 2.5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 10}), 1e-12);
  rig.expect_told("a@x", {0, 0, 5 / 1.5}, true);
  rig.expect_told("b@x", {0, 0, 2.5 / 1.5}, true);
  // A report tells what an object gives before that.
  EXPECT_NEAR(norm(report_of(rig.clients.at("b@x").get(), "push").wrench.force), 2.5, 1e-12);
  // Together within the limit.
  rig.set("a@x", 2);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 9.5}), 1e-12);
  rig.expect_told("a@x", {0, 0, 2}, false);
  // One that does not push is not bounded.
  rig.set("a@x", 5);
  rig.add("idle@x", 0);
  rig.settled();
  rig.expect_told("idle@x", {0, 0, 0}, false);
}
END_TEST

START_TEST(names) {  // of sites; and others as before
  Sites rig;
  rig.add("a@y@x", 5);
  rig.add("b@x", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 5}), 1e-12);
  rig.add("x", 5);
  rig.add("y", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 15}), 1e-12);
  rig.add("c@y", 5);
  rig.add("@y", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 20}), 1e-12);
  rig.add("d@", 5);
  rig.add("e@", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 25}), 1e-12);
  set(rig.base, push("own", 20, {1, 0, 0}));
  rig.settle(rig.base.get());
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{20, 0, 25}), 1e-12);
  rig.expect_told("x", {0, 0, 5}, false);
}
END_TEST

START_TEST(directions) {
  Sites rig;
  rig.add("a@x", 5);
  rig.add("b@x", 5, {0, 0, -1});
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 0}), 1e-12);  // they cancel
  rig.expect_told("a@x", {0, 0, 5}, false);
  rig.expect_told("b@x", {0, 0, -5}, false);
  rig.set("a@x", 3);
  rig.set("b@x", 4, {1, 0, 0});
  EXPECT_VECTOR(rig.settled(), (fs_vec3{4, 0, 3}), 1e-12);
  rig.set("a@x", 4.5);
  rig.add("c@x", 2, {1, 0, 0});
  EXPECT_VECTOR(rig.settled(), (fs_vec3{4, 0, 3}), 1e-12);  // (6, 0, 4.5) with its direction kept
  rig.expect_told("c@x", {4. / 3, 0, 0}, true);

  // The torque is reduced in proportion.
  const fs_vec3 arm{0.5, 0, 0};
  OK(fs_scene_set_tool(rig.clients.at("a@x").get(), &arm, 1));
  EXPECT_VECTOR(rig.settled(), (fs_vec3{4, 0, 3}), 1e-12);
  EXPECT_VECTOR(rig.fake.written.torque, (fs_vec3{0, -1.5, 0}), 1e-12);
  EXPECT_VECTOR(rig.told("a@x").wrench.torque, (fs_vec3{0, -1.5, 0}), 1e-12);
}
END_TEST

// While lost ones fade the others get what these leave, so the force stays.
START_TEST(one_leaves) {
  Sites rig;
  rig.add("a@x", 5);
  rig.add("b@x", 5);
  rig.add("c@y", 3);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 8}), 1e-12);
  rig.clients.erase("a@x");
  ck_assert(eventually([&] {
    rig.step();
    EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 8}), 1e-9);
    return norm(rig.told("b@x").wrench.force - fs_vec3{0, 0, 5}) < 1e-9;
  }));
  rig.expect_told("b@x", {0, 0, 5}, false);
  for (int k = 0; k < 100; ++k) {
    rig.step();
    EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{0, 0, 8}), 1e-9);
  }
  rig.add("d@x", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 8}), 1e-9);
  rig.expect_told("b@x", {0, 0, 2.5}, true);
}
END_TEST

START_TEST(they_come_and_go) {  // within the limit at every tick, and without a step
  constexpr int most = 4;
  constexpr double force = 4;  // N, of each
  Sites rig;
  rig.add("z", 0);
  Random random(8);
  fs_vec3 last{};
  const auto step = [&] {
    rig.step();
    const fs_vec3 now = rig.fake.written.force;
    ck_assert_msg(norm(now) <= limit + 1e-9, "%g N", norm(now));
    const double change = norm(now - last), allowed = 3 * most * force * 0.001 / world_fade;
    ck_assert_msg(change <= allowed, "from (%g, %g, %g) to (%g, %g, %g) N", last.x, last.y, last.z, now.x, now.y, now.z);
    last = now;
  };
  fs_vec3 directions[most];
  for (fs_vec3& direction : directions) direction = unit(random.in_box(1) + fs_vec3{0, 0, 1});
  uint64_t at_limit = 0;
  for (int k = 0; k < times(150, 2000); ++k) {
    const uint64_t i = random.below(most);
    const std::string name = std::to_string(i) + "@x";
    if (!rig.clients.contains(name)) {
      rig.add(name, force, directions[i]);
    } else if (random.coin(0.4)) {
      rig.clients.erase(name);
    } else {
      const Scene& scene = rig.clients.at(name);
      fs_object o = push("push", force, directions[i]);
      o.enabled = random.coin();
      OK(fs_object_set(scene.get(), &o));
    }
    for (uint64_t ticks = random.below(60); ticks > 0; --ticks) step();
    at_limit += norm(last) > limit - 1e-9;
  }
  ck_assert_uint_gt(at_limit, 3);
}
END_TEST

START_TEST(another_server) {  // of the same servo, with another limit, while what the first had still fades
  Sites rig;
  rig.add("a@x", 5);
  rig.add("b@x", 5);
  EXPECT_VECTOR(rig.settled(), (fs_vec3{0, 0, 5}), 1e-12);
  rig.clients.clear();
  rig.server.reset();
  const std::string endpoint = new_endpoint();
  rig.server = start_server(rig.servo.get(), endpoint, with_limit(1));
  double last = 5;
  const auto step = [&] {
    rig.step();
    const double force = rig.fake.written.force.z;
    EXPECT_NEAR(force, last, 20 * 0.001 / world_fade);
    last = force;
  };
  step();
  const Scene c = connect(endpoint, "c@x");
  set(c, push("push", 9));
  ck_assert(eventually([&] {
    step();
    return fs_scene_sync(c.get(), 0.01) == FS_OK;
  }));
  for (int k = 0; k < 400; ++k) step();
  EXPECT_NEAR(last, 1, 1e-12);
}
END_TEST

int main() {
  Suite* suite = suite_create("sites");
  add_case(suite, "sites", {one_direction, names, directions, one_leaves, they_come_and_go, another_server});
  return run_suite(suite);
}
