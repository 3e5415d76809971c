// Sites that come late, are killed, stopped and started twice; servers that go and come back; many objects; a site without a device.
#include <signal.h>

#include <cmath>
#include <map>

#include "dds/bridge_rig.h"

using namespace dds;
using namespace scenes;

namespace {

const char* const felt = "app@lab/spring";

// One of many: it is felt only where it is, as a client that makes the ticks late is disconnected.
fs_object one_of_many(int i, fs_vec3 place) {
  fs_object out = spring_at("s" + std::to_string(i), place);
  out.front.reach = 1e-4;
  return out;
}

bool has_said(const Site& site, const std::string& text) { return site.bridge.output().find(text) != std::string::npos; }

}  // namespace

START_TEST(who_comes_late_gets_all) {
  const RoomName room;
  const Site lab(room, "lab");
  const Scene app = lab.connect("app");
  for (int i = 0; i < 100; ++i) app.object_set(spring_at("s" + std::to_string(i), {0.001 * i, 0, 0}));
  app.object_move("s7", at({0, 0.05, 0}), &at_rest, FS_NOW);
  wait_a_little(1);
  const Site desk(room, "desk");
  const Scene viewer = desk.connect("viewer");
  EVENTUALLY(objects_of(viewer, "app@lab") == 100);
  EVENTUALLY(viewer.object_get("app@lab/s7").pose.position.y == 0.05);
}
END_TEST

START_TEST(a_bridge_that_is_killed) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  const double killed = viewer.get_time();
  lab.bridge.kill();
  EVENTUALLY(!has_object(viewer, felt));
  const double lost = viewer.get_time() - killed;
  ck_assert_msg(lost > 0.3, "the lease is 1 s, and it was lost after %g s", lost);
  lab.start_bridge();
  EVENTUALLY(weight_of(viewer, felt) == 1);
}
END_TEST

// A bridge that is started again at once takes over: nothing fades.
START_TEST(a_bridge_that_is_started_again) {
  const RoomName room;
  SiteOptions options;
  options.bridge = {"--lease", "10"};
  Site lab(room, "lab", options), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  lab.bridge.kill();
  lab.start_bridge();
  for (int i = 0; i < 150; ++i) {
    ck_assert(weight_of(viewer, felt) == 1);
    wait_a_little(0.02);
  }
  app.object_change(spring_at("spring", {0.05, 0, 0}), FS_PART_POSE);
  EVENTUALLY(viewer.object_get(felt).pose.position.x == 0.05);
  app.object_remove("spring");
  EVENTUALLY(!has_object(viewer, felt));
}
END_TEST

// It ends by itself: its objects fade at once, whatever the lease.
START_TEST(a_bridge_that_ends) {
  const RoomName room;
  SiteOptions options;
  options.bridge = {"--lease", "1000"};
  Site lab(room, "lab", options), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  ck_assert_int_eq(lab.bridge.end(), 0);
  EVENTUALLY(!has_object(viewer, felt));
  ck_assert(has_said(desk, "site lab has left"));
}
END_TEST

// After a pause DDS does not bring back what it has declared dead: the sites compare what they have.
START_TEST(a_bridge_that_is_stopped_for_a_while) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  for (int i = 0; i < 20; ++i) app.object_set(spring_at("s" + std::to_string(i), {0.001 * i, 0, 0}));
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  lab.bridge.send(SIGSTOP);
  EVENTUALLY(!has_object(viewer, felt));
  app.object_remove("s3");
  lab.bridge.send(SIGCONT);
  EVENTUALLY(weight_of(viewer, felt) == 1 && objects_of(viewer, "app@lab") == 20);
  ck_assert(!has_object(viewer, "app@lab/s3"));
}
END_TEST

START_TEST(a_bridge_that_does_not_listen_for_a_while) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  desk.bridge.send(SIGSTOP);
  app.object_set(spring_at("more", {0.04, 0, 0}));
  app.object_remove("spring");
  wait_a_little(3);
  desk.bridge.send(SIGCONT);
  EVENTUALLY(has_object(viewer, "app@lab/more") && !has_object(viewer, felt));
}
END_TEST

// A bridge ends at once also when another has just been lost, which will never take what was written for it.
START_TEST(a_bridge_ends_beside_one_that_is_lost) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  desk.bridge.send(SIGSTOP);
  for (int i = 0; i < 20; ++i) app.object_set(spring_at("s" + std::to_string(i), {0.001 * i, 0, 0}));
  wait_a_little(0.5);
  const double start = app.get_time();
  ck_assert_int_eq(lab.bridge.end(), 0);
  const double took = app.get_time() - start;
  ck_assert_msg(took < 4, "it took %g s", took);  // on a busy machine; 9 s were seen
}
END_TEST

// The clock of a virtual servo is another one, and may stand still.
START_TEST(a_server_in_virtual_time) {
  const RoomName room;
  Site lab(room, "lab");
  const Scene app = lab.connect("app");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  const FakeDevice fake(room.room + "virtual");
  const Device device = fake.open();
  const Scene own = make_scene();
  const Servo servo = start_servo(own.get(), device.get(), virtual_options());
  const Server server = Server::start(servo, "shm:" + room.room + "virtual");
  const Stepper stepper(servo.get());
  const Process bridge({BRIDGE, "shm:" + room.room + "virtual", "--site", "virtual", "--room", room.room, "--domain", room.domain});
  const Scene viewer = Scene::connect("shm:" + room.room + "virtual", "viewer");
  EVENTUALLY(has_object(viewer, felt));
  app.object_set(spring_at("later", {0.03, 0, 0}));
  EVENTUALLY(has_object(viewer, "app@lab/later"));
  viewer.object_set(spring_at("there", {0, 0, 0}));
  EVENTUALLY(has_object(app, "viewer@virtual/there"));
}
END_TEST

START_TEST(two_sites_of_one_name) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  Site other(room, "other");
  other.bridge.end();
  Process twin({BRIDGE, other.endpoint, "--site", "lab", "--room", room.room, "--domain", room.domain});
  ck_assert_int_eq(twin.wait(), 2);
  ck_assert(twin.output().find("there is a site lab in the room already") != std::string::npos);
  ck_assert(weight_of(viewer, felt) == 1);
}
END_TEST

START_TEST(a_bridge_started_twice_at_one_server) {
  const RoomName room;
  Site lab(room, "lab");
  EVENTUALLY(has_said(lab, "connected to"));
  const Process second({BRIDGE, lab.endpoint, "--site", "other", "--room", room.room, "--domain", room.domain});
  EVENTUALLY(second.output().find("has a bridge already; it is tried again") != std::string::npos);
}
END_TEST

START_TEST(a_server_that_goes_and_comes_back) {
  const RoomName room;
  Site lab(room, "lab"), desk(room, "desk");
  const Scene viewer = desk.connect("viewer");
  Scene app = lab.connect("app");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  lab.stop_server();
  EVENTUALLY(!has_object(viewer, felt));
  lab.start_server();
  app = lab.connect("app");
  app.object_set(spring_at("spring", {0.05, 0, 0}));
  EVENTUALLY(weight_of(viewer, felt) == 1);
  // And that of those who feel it.
  desk.stop_server();
  wait_a_little(1);
  desk.start_server();
  const Scene again = desk.connect("viewer");
  EVENTUALLY(weight_of(again, felt) == 1);
}
END_TEST

START_TEST(ten_thousand_objects) {
  const RoomName room;
  SiteOptions options;
  options.server.max_objects = 20000;
  const Site lab(room, "lab", options), desk(room, "desk", options);
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  constexpr int count = 10000;
  {
    forceserver::Group group(app);
    for (int i = 0; i < count; ++i) app.object_set(one_of_many(i, {1 + 0.001 * i, 0, 0}));
    group.commit();
  }
  EVENTUALLY(objects_of(viewer, "app@lab") == count);
  app.object_move("s77", at({0, 0.05, 0}), &at_rest, FS_NOW);
  EVENTUALLY(viewer.object_get("app@lab/s77").pose.position.y == 0.05);
  app.clear();
  EVENTUALLY(objects_of(viewer, "app@lab") == 0);
}
END_TEST

// More than 100 objects that move share the bandwidth: each is told less often, none is forgotten.
START_TEST(three_hundred_objects_move) {
  const RoomName room;
  const Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  constexpr int count = 300;
  for (int i = 0; i < count; ++i) app.object_set(one_of_many(i, {0.001 * i, 0, 0}));
  EVENTUALLY(objects_of(viewer, "app@lab") == count);
  int behind = 0;  // most objects that were not told for 0.5 s
  for (int k = 1; k <= 75; ++k) {
    forceserver::Group group(app);
    for (int i = 0; i < count; ++i) app.object_move("s" + std::to_string(i), at({0.001 * i, 0.001 * k, 0}), nullptr, FS_NOW);
    group.commit();
    wait_a_little(0.04);
    if (k < 25) continue;
    int late = 0;
    for (const fs_motion& motion : viewer.get_motions("app@lab")) late += motion.pose.position.y < 0.001 * (k - 12);
    behind = std::max(behind, late);
  }
  ck_assert_msg(behind < count / 10, "%d objects were not told for half a second", behind);
  const auto where_it_comes_to = [](const Scene& scene, const char* client) {  // m, where each stops at the end of its horizon
    std::map<std::string, double> out;
    for (const fs_motion& motion : scene.get_motions(client)) {
      const std::string name = motion.name;
      out[name.substr(name.find('/') + 1)] = motion.pose.position.y + motion.horizon * motion.twist.linear.y;
    }
    return out;
  };
  EVENTUALLY(([&] {
    const auto wanted = where_it_comes_to(app, "app"), got = where_it_comes_to(viewer, "app@lab");
    for (const auto& [name, y] : wanted) {
      if (!got.count(name) || std::fabs(got.at(name) - y) > 1e-6) return false;
    }
    return wanted.size() == count;
  }()));
}
END_TEST

// A large mesh is on its way for long. Meanwhile what moves goes on.
START_TEST(a_large_mesh_does_not_hold_up_motions) {
  const RoomName room;
  const Site lab(room, "lab"), desk(room, "desk");
  const Scene app = lab.connect("app"), viewer = desk.connect("viewer");
  app.object_set(spring_at("spring", {0.03, 0, 0}));
  EVENTUALLY(has_object(viewer, felt));
  constexpr int n = 256;  // 1.6 MB of points, 1.6 MB of triangles: 2.5 s
  std::vector<fs_vec3> points;
  std::vector<uint32_t> triangles;
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) points.push_back({0.001 * x, 0.001 * y, 1 + 1e-4 * std::sin(0.1 * x * y)});
  }
  for (uint32_t y = 0; y < n; ++y) {
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t a = y * (n + 1) + x, b = a + n + 1;
      for (const uint32_t i : {a, a + 1, b, b, a + 1, b + 1}) triangles.push_back(i);
    }
  }
  const Shape shape = Shape::create_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3);
  fs_object mesh = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  mesh.shape = shape.get();
  mesh.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  app.object_set(mesh);
  int changes = 0, looks = 0;
  double before = -1;
  for (; !has_object(viewer, "app@lab/mesh") && looks < 2000; ++looks) {
    app.object_move("spring", at({0.03, 1e-5 * looks, 0}), nullptr, FS_NOW);
    const double y = viewer.object_get(felt).pose.position.y;
    changes += y != before;
    before = y;
    wait_a_little(0.02);
  }
  ck_assert_msg(looks > 50, "it came within %d looks: the test shows nothing", looks);
  ck_assert_msg(changes > looks / 5, "in %d looks the spring had moved %d times", looks, changes);
}
END_TEST

START_TEST(a_mirror_shows_the_hand) {
  const RoomName room;
  SiteOptions options;
  options.device = "sim:?path=figure8&hand=firm";
  Site lab(room, "lab", options);
  const Scene app = lab.connect("app");
  app.object_set(spring_at("spring", {0, 0, 0}));
  const std::string name = room.room + "desk";
  Process bridge({BRIDGE, "--listen", name, "--mirror", "lab", "--site", "desk", "--room", room.room, "--domain", room.domain});
  Scene viewer, other;
  EVENTUALLY(([&] {
    fs_scene* scene = nullptr;
    if (fs_scene_connect(("shm:" + name).c_str(), "viewer", &scene) != FS_OK) return false;
    viewer = Scene(scene);
    return true;
  }()));
  other = Scene::connect("shm:" + name, "other");
  EVENTUALLY(weight_of(viewer, felt) == 1);
  other.object_set(spring_at("there", {0, 0.01, 0}));
  const Scene look = lab.connect("look");
  EVENTUALLY(weight_of(look, "other@desk/there") == 1);
  EVENTUALLY(weight_of(viewer, "other/there") == 1);
  double worst = 0;
  int ready = 0;
  for (int i = 0; i < 100; ++i) {
    fs_state here{}, there{};
    lab.own.get_hand(&here, nullptr, nullptr);
    viewer.get_hand(&there, nullptr, nullptr);
    if (there.flags & FS_STATE_READY) {
      ++ready;
      worst = std::max(worst, norm(here.pose.position - there.pose.position));
    }
    wait_a_little(0.01);
  }
  ck_assert_msg(ready > 90, "the hand was there in %d of 100 looks", ready);
  ck_assert_msg(worst < 0.02, "the hand is %g mm off", 1e3 * worst);  // 0.13 m/s, on a busy machine
  // Its forces are those of the lab, so the bounds of slopes are the same.
  EXPECT_NEAR(stats_of(viewer.get()).max_stiffness, stats_of(lab.own.get()).max_stiffness, 1);
  const fs_device_info info = viewer.get_device_info();
  ck_assert(std::string(info.name).find("of site lab") != std::string::npos && info.force_max == 25);
  // A stop at the mirror stops the device, and the mirror goes on when the device does.
  viewer.stop_force();
  EVENTUALLY(stats_of(lab.own.get()).enabled == 0);
  wait_a_little(2.5);
  viewer.resume_force();  // returns only at the lab
  EVENTUALLY(stats_of(viewer.get()).enabled == 0 && bridge.output().find("returns there only") != std::string::npos);
  ck_assert(stats_of(lab.own.get()).enabled == 0);
  lab.servo.set_enabled(true);
  EVENTUALLY(stats_of(viewer.get()).enabled == 1 && stats_of(lab.own.get()).enabled == 1);
  // Without the other bridge there is no hand; it comes back.
  lab.bridge.kill();
  EVENTUALLY(stats_of(viewer.get()).faults & FS_FAULT_DEVICE);
  lab.start_bridge();
  EVENTUALLY(stats_of(viewer.get()).faults == 0);
  viewer = {};
  other = {};
  ck_assert_int_eq(bridge.end(), 0);
}
END_TEST

static struct { std::vector<std::string> words; const char* sentence; } const bad_lines[] = {
    {{"lab"}, "--site is required"},
    {{"lab", "--site", "La b"}, "must be 1 to 20 of a-z"},
    {{"--site", "a"}, "the server of this machine"},
    {{"lab", "--site", "a", "--room", "*"}, "must be 1 to 63 of"},
    {{"lab", "--site", "a", "--interface", "eth0"}, "anyone could push the hand"},
    {{"lab", "--site", "a", "--mirror", "b"}, "either the server"},
    {{"--listen", "x", "--site", "a", "--mirror", "a"}, "must be the name of another site"},
    {{"lab", "--site", "a", "--frame", "b=-1"}, "must be SITE=SCALE"},
    {{"lab", "--site", "a", "--frame", "b=1,2"}, "must be SITE=SCALE"},
    {{"lab", "--site", "a", "--open", "--security", "x"}, "exclude each other"},
    {{"lab", "--site", "a", "--interface", "nope0", "--open"}, "nope0"},
    {{"lab", "--site", "a", "--security", "/nowhere"}, "/nowhere"},
    {{"lab", "--site", "a", "--lease", "0"}, "--lease"},
    {{"lab", "--site", "a", "--follow", "x"}, "must be OBJECT=/TOPIC"},
};
START_TEST(a_bad_command_line_is_refused) {
  std::vector<std::string> command = {BRIDGE};
  command.insert(command.end(), bad_lines[_i].words.begin(), bad_lines[_i].words.end());
  Process process(command);
  const int code = process.wait();
  const std::string said = process.output();
  ck_assert_msg(code == 2, "%d: %s", code, said.c_str());
  ck_assert_msg(said.find(bad_lines[_i].sentence) != std::string::npos, "%s", said.c_str());
}
END_TEST

int main() {
  Suite* const suite = suite_create("life of bridges");
  add_case(suite, "bridges", {who_comes_late_gets_all, a_bridge_that_is_killed, a_bridge_that_is_started_again, a_bridge_that_ends,
                              a_bridge_that_is_stopped_for_a_while, a_bridge_that_does_not_listen_for_a_while,
                              two_sites_of_one_name, a_bridge_ends_beside_one_that_is_lost, a_bridge_started_twice_at_one_server});
  add_case(suite, "servers", {a_server_that_goes_and_comes_back, a_server_in_virtual_time, a_mirror_shows_the_hand});
  add_case(suite, "many", {ten_thousand_objects, three_hundred_objects_move, a_large_mesh_does_not_hold_up_motions});
  tcase_add_loop_test(new_case(suite, "command line"), a_bad_command_line_is_refused, 0,
                      sizeof bad_lines / sizeof bad_lines[0]);
  return run_suite(suite);
}
