// The life of a connection, with both ends in this process: the client or the server goes in the middle of anything.
// The same with processes: test_process.cpp.
#include <fstream>

#include "ipc/calls.h"
#include "ipc/case.h"

using namespace life;
using namespace scenes;

static bool is_listed(fs_scene* observer, const char* name) {
  fs_client clients[64];
  size_t count = 0;
  OK(fs_scene_get_clients(observer, clients, 64, &count));
  return std::any_of(clients, clients + std::min<size_t>(count, 64),
                     [&](const fs_client& client) { return !std::strcmp(client.name, name); });
}
// Waits until the server knows that it is gone. No tick comes by meanwhile, so its lease begins at the last one.
static void wait_until_gone(fs_scene* observer, const char* name) {
  ck_assert_msg(eventually([&] { return !is_listed(observer, name); }), "'%s' is listed still", name);
}
static fs_server_options with_lease(double lease) {
  fs_server_options options = fs_server_options_init();
  options.lease = lease;
  return options;
}
static fs_servo_options with_fade(double fade) {
  fs_servo_options options = world_options();
  options.fade = fade;
  return options;
}

// ------------------------------------------------------------------------------------------------------ lease and fade

struct Case {
  double lease, fade;      // s; 0: the defaults, 0.2 and 1
  double force, limit;     // N; of the client
  bool by_server;          // it is the server that goes: no lease
};
static const Case cases[] = {{0.03, 0.05, 2, 0, false}, {0.03, 0.05, 2, 0, true}, {0, 0, 2, 0, false},
                             {0.1, 0.2, 5, 3, false},   {0.001, 0.05, 2, 0, false}};

// A client is gone: its force stays for the lease, then goes down linearly, to the last digit. No step.
START_TEST(it_fades) {
  const Case& c = cases[_i];
  const double fade = c.fade > 0 ? c.fade : 1, lease = c.by_server ? 0 : c.lease > 0 ? c.lease : 0.2;
  fs_server_options options = with_lease(c.lease);
  options.force_limit = c.limit;
  ServerRig rig(options, with_fade(c.fade));
  const Scene observer = rig.join("observer");
  Scene client = rig.join("client");
  const fs_vec3 direction = unit(fs_vec3{1, 2, 3});
  const double full = c.limit > 0 ? c.limit : c.force;
  const fs_object o = push("push", c.force, direction);
  OK(fs_object_set(client.get(), &o));
  OK(rig.sync(client.get()));
  rig.step(static_cast<uint64_t>(1000 * fade) + 3);
  EXPECT_VECTOR(rig.fake.written.force, full * direction, 1e-12);

  const double death = now(rig.base.get());
  if (c.by_server) {
    rig.server.reset();
  } else {
    client.reset();
    wait_until_gone(observer.get(), "client");
  }
  double largest = 0;
  fs_vec3 before = rig.fake.written.force;
  const int ticks = static_cast<int>(1000 * (lease + fade) + 0.5);
  for (int k = 1; k <= ticks + 5; ++k) {
    rig.step();
    const double age = now(rig.base.get()) - death;
    const double weight = std::fmin(1, std::fmax(0, 1 - (age - lease) / fade));
    EXPECT_VECTOR(rig.fake.written.force, weight * full * direction, 1e-9);
    largest = std::fmax(largest, norm(rig.fake.written.force - before));
    before = rig.fake.written.force;
  }
  EXPECT_NEAR(largest, full / (1000 * fade), 1e-9);
  EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{}), 0);
  std::printf("  %g N, lease %g s, fade %g s, %s: largest step %.4f N per ms\n", full, lease, fade,
              c.by_server ? "the server stops" : "the client goes", largest);
}
END_TEST

// An object that is fading in goes on, and fades out with its client.
START_TEST(it_fades_while_it_comes) {
  constexpr double lease = 0.01, fade = 0.1;
  ServerRig rig(with_lease(lease), with_fade(fade));
  const Scene observer = rig.join("observer");
  Scene client = rig.join("client");
  const fs_object o = push("push", 2);
  OK(fs_object_set(client.get(), &o));
  ck_assert(eventually([&] {
    rig.step();
    return rig.fake.written.force.z > 0;
  }));
  const double begin = now(rig.base.get()) - fade * rig.fake.written.force.z / 2;
  rig.step(static_cast<uint64_t>(1000 * (begin + 0.03 - now(rig.base.get())) + 0.5));
  client.reset();
  wait_until_gone(observer.get(), "client");
  const double death = now(rig.base.get());
  for (int k = 0; k < 120; ++k) {
    rig.step();
    const double time = now(rig.base.get());
    const double in = std::fmin(1, (time - begin) / fade);
    const double out = std::fmin(1, std::fmax(0, 1 - (time - death - lease) / fade));
    EXPECT_NEAR(rig.fake.written.force.z, 2 * in * out, 1e-9);
  }
}
END_TEST

// The name is free at once; the next client of that name fades in while the one before fades out, and has nothing of
// it.
START_TEST(one_of_the_same_name) {
  constexpr double lease = 0.1, fade = 0.5;
  ServerRig rig(with_lease(lease), with_fade(fade));
  Scene first = rig.join("client");
  const fs_object old = push("push", 2, {1, 0, 0}), fresh = push("push", 1, {0, 1, 0});
  OK(fs_object_set(first.get(), &old));
  OK(rig.sync(first.get()));
  rig.step(static_cast<uint64_t>(1000 * fade) + 3);

  const double death = now(rig.base.get());
  first.reset();
  const Scene second = rig.join("client");
  ck_assert(!has(second.get(), "push"));
  OK(fs_object_set(second.get(), &fresh));
  double begin = 0;
  for (int k = 0; k < 1200; ++k) {
    rig.step();
    if (begin == 0) wait_a_little(1e-4);  // for the server to take the object
    const double time = now(rig.base.get());
    const fs_vec3 force = rig.fake.written.force;
    if (begin == 0 && force.y > 0) begin = time - fade * force.y;
    const double out = std::fmin(1, std::fmax(0, 1 - (time - death - lease) / fade));
    const double in = begin > 0 ? std::fmin(1, (time - begin) / fade) : 0;
    EXPECT_VECTOR(force, (fs_vec3{2 * out, in, 0}), 1e-9);
  }
  ck_assert_msg(begin > death && begin < death + lease + fade, "they were not there at a time");
  ck_assert_uint_eq(object_count(second.get()), 1);
}
END_TEST

// Again and again, without a pause.
START_TEST(names_are_free_at_once) {
  fs_server_options options = with_lease(0.001);
  options.max_clients = 500;
  fs_servo_options servo = with_fade(-1);
  servo.mode = FS_SERVO_THREAD;
  ServerRig rig(options, servo);
  const Scene observer = rig.join("observer");
  OK(fs_scene_sync(observer.get(), long_enough));  // the server is through with it
  const Holdings before = holdings();
  const fs_object o = push("push");
  for (int i = 0; i < 200; ++i) {
    const Scene scene = rig.join("client");
    if (i % 2) OK(fs_object_set(scene.get(), &o));
    if (i % 4 == 3) OK(fs_scene_sync(scene.get(), long_enough));
  }
  wait_until_gone(observer.get(), "client");
  Holdings after;
  ck_assert_msg(eventually([&] { return (after = holdings()) == before; }), "before: %s; after: %s",
                to_text(before).c_str(), to_text(after).c_str());
}
END_TEST

// ----------------------------------------------------------------------------------------------------- the server goes

// The table has all calls.
START_TEST(all_calls_are_there) {
  std::string missing;
  int found = 0;
  const std::vector<Call> calls = all_calls("");
  for (const auto& header : std::filesystem::directory_iterator(HEADER_FOLDER)) {
    std::ifstream file(header.path());
    for (std::string line; std::getline(file, line);) {
      const size_t end = line.find('('), argument = line.find("fs_scene *scene");
      if (!line.starts_with("FS_API") || argument == std::string::npos || argument < end) continue;
      const size_t begin = line.rfind(' ', end) + 1;
      const std::string name = line.substr(begin, end - begin);
      if (name == "fs_scene_destroy") continue;
      ++found;
      const auto is_it = [&](const Call& call) { return name == call.name; };
      if (std::none_of(calls.begin(), calls.end(), is_it)) missing += " " + name;
    }
  }
  ck_assert_int_gt(found, 30);
  ck_assert_msg(missing.empty(), "not in the table:%s", missing.c_str());
}
END_TEST

// One client per call, so that each call has to notice by itself.
START_TEST(every_call_says_so) {
  const bool stops_servo = _i;
  const Folder folder;
  const std::string path = folder / "scene.json";
  const std::vector<Call> calls = all_calls(path);
  fs_server_options options = fs_server_options_init();
  options.max_clients = 100;
  ServerRig rig(options);
  const Scene other = rig.join("other");
  const fs_object theirs = spring("theirs"), mine = spring("mine");
  OK(fs_object_set(other.get(), &theirs));
  std::vector<Scene> scenes;
  std::vector<Tool> tools;
  {
    const Stepper stepper(rig.servo.get());
    for (size_t i = 0; i < calls.size(); ++i) {
      scenes.push_back(rig.join(("client " + std::to_string(i)).c_str()));
      OK(fs_object_set(scenes.back().get(), &mine));
      OK(fs_scene_sync(scenes.back().get(), long_enough));
      tools.push_back(make_tool(scenes.back().get()));
    }
    OK(fs_scene_save(scenes[0].get(), path.c_str()));
    for (size_t i = 0; i < calls.size(); ++i) {  // all calls succeed as long as there is a server
      const std::string name = calls[i].name;
      if (name == "fs_object_remove" || name == "fs_scene_commit" || name == "fs_scene_cancel") continue;
      const fs_status status = calls[i].run(scenes[i].get());
      if (name == "fs_scene_sync" && status == FS_ERROR_TIMEOUT) continue;  // with timeout 0
      ck_assert_msg(status == (calls[i].when_lost == FS_ERROR_DISCONNECTED ? FS_OK : calls[i].when_lost), "%s: %s: %s",
                    calls[i].name, fs_status_name(status), fs_last_error());
    }
  }
  std::vector<fs_vec3> felt;
  for (const Tool& tool : tools) felt.push_back(force_at(tool.get(), {0.01, 0, 0}, 1));

  stops_servo ? rig.servo.reset() : rig.server.reset();
  for (size_t i = 0; i < calls.size(); ++i) {
    fs_status status = FS_OK;
    ck_assert_msg(eventually([&] { return (status = calls[i].run(scenes[i].get())) == calls[i].when_lost; }),
                  "%s: %s: %s", calls[i].name, fs_status_name(status), fs_last_error());
    ck_assert_msg(std::strlen(fs_last_error()) > 10, "%s: '%s'", calls[i].name, fs_last_error());
  }
  // A new server of the same name changes nothing for them.
  const Scene base = make_scene();
  const Device device = rig.fake.open();
  if (stops_servo) rig.servo = start_servo(rig.base.get(), device.get(), world_options());
  rig.server = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
  const Scene fresh = rig.join("client 0");
  for (const Scene& scene : scenes) {
    fs_event event;
    while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK) {
    }
    for (const Call& call : calls) EXPECT(call.when_lost, call.run(scene.get()));
  }
  // What a tool feels stays, except for objects that the client itself changes.
  for (size_t i = 0; i < tools.size(); ++i) {
    if (std::strcmp(calls[i].name, "fs_scene_get_hand") == 0) ck_assert(felt[i].x < -0.5);
    EXPECT_VECTOR(force_at(tools[i].get(), {0.01, 0, 0}, 1), felt[i], 0);
  }
  scenes.clear();
  EXPECT_VECTOR(force_at(tools[0].get(), {0.01, 0, 0}, 1), felt[0], 0);
  OK(fs_object_set(fresh.get(), &mine));
  OK(rig.sync(fresh.get()));
}
END_TEST

// Earlier events are still returned; then FS_EVENT_DISCONNECTED, once; then the status.
START_TEST(events_come_to_an_end) {
  ServerRig rig;
  const Scene client = rig.join("client"), other = rig.join("other");
  const fs_object mine = spring("mine");
  OK(fs_object_set(client.get(), &mine));
  OK(rig.sync(client.get()));
  fs_object edited = spring("client/mine", {}, 300);
  OK(fs_object_change(other.get(), &edited, FS_PART_PROFILES));
  OK(rig.sync(other.get()));  // else the server may be gone before it has looked at the change
  rig.server.reset();
  std::vector<int> kinds;
  fs_event event;
  fs_status status;
  while ((status = fs_scene_next_event(client.get(), long_enough, &event)) == FS_OK && kinds.size() < 100) {
    if (event.kind == FS_EVENT_DEVICE) continue;
    kinds.push_back(event.kind);
    if (event.kind != FS_EVENT_DISCONNECTED) continue;
    ck_assert_int_eq(event.status, FS_ERROR_DISCONNECTED);
    ck_assert(std::strlen(event.text) > 10);
    ck_assert_str_eq(event.name, "");
  }
  ck_assert_int_eq(status, FS_ERROR_DISCONNECTED);
  std::string told;
  for (const int kind : kinds) told += std::string(" ") + fs_event_kind_name(static_cast<fs_event_kind>(kind));
  ck_assert_str_eq(told.c_str(), " FS_EVENT_READY FS_EVENT_EDITED FS_EVENT_DISCONNECTED");
  for (int i = 0; i < 3; ++i) EXPECT(FS_ERROR_DISCONNECTED, fs_scene_next_event(client.get(), long_enough, &event));
}
END_TEST

// A group that is open when the server goes has no effect, and the scene can only be destroyed.
START_TEST(in_the_middle_of_a_group) {
  ServerRig rig;
  const Scene client = rig.join("client");
  const fs_object mine = spring("mine");
  OK(fs_scene_begin(client.get()));
  OK(fs_object_set(client.get(), &mine));
  rig.server.reset();
  EXPECT(FS_ERROR_DISCONNECTED, fs_object_set(client.get(), &mine));
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_commit(client.get()));
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_cancel(client.get()));
  rig.step();
  EXPECT_VECTOR(rig.force_at({0.01, 0, 0}), (fs_vec3{}), 0);
}
END_TEST

static constexpr size_t large = is_sanitized ? 10'000 : 50'000;  // triangles of a mesh that takes a while to build

// While a mesh is being built, its name and its slot at the server are given to others, and what is set later waits
// behind what was set before.
START_TEST(names_change_hands_while_a_mesh_is_built) {
  ServerRig rig;
  rig.fake.state.pose = at(0, 0, 0.02);  // not at the centre, where all triangles are equally near
  const Scene client = rig.join("client");
  const Shape mesh = make_mesh(sphere_mesh(0.05, large));
  fs_object a = spring("a"), b = spring("b", {0.01, 0, 0}), m = a;
  m.primitive = FS_PRIMITIVE_MESH;
  m.shape = mesh.get();
  const auto check_there = [&](std::vector<std::string> names) {
    OK(rig.sync(client.get()));
    std::vector<std::string> found;
    for (const fs_report& report : own_reports_of(client.get())) found.push_back(report.name);
    std::sort(found.begin(), found.end());
    ck_assert(found == names);
    OK(fs_scene_clear(client.get()));
    OK(rig.sync(client.get()));
  };
  OK(fs_object_set(client.get(), &m));  // waits for its mesh
  OK(fs_object_remove(client.get(), "a"));
  OK(fs_object_set(client.get(), &b));  // where "a" was
  OK(fs_object_set(client.get(), &a));  // elsewhere
  check_there({"a", "b"});

  OK(fs_object_set(client.get(), &a));
  OK(fs_scene_begin(client.get()));  // a group that waits for another mesh, and removes "a"
  const Shape other = make_mesh(sphere_mesh(0.06, large));
  std::strcpy(m.name, "m");
  m.shape = other.get();
  OK(fs_object_set(client.get(), &m));
  OK(fs_object_remove(client.get(), "a"));
  OK(fs_scene_commit(client.get()));
  OK(fs_object_set(client.get(), &b));
  OK(fs_object_set(client.get(), &a));
  check_there({"a", "b", "m"});
}
END_TEST

// Another client removes the version that is still felt: the set that waits takes effect nevertheless, for both ends.
START_TEST(removed_while_its_mesh_is_built) {
  ServerRig rig;
  rig.fake.state.pose = at(0, 0, 0.02);  // not at the centre, where all triangles are equally near
  const Scene client = rig.join("client"), editor = rig.join("editor");
  const Shape mesh = make_mesh(sphere_mesh(0.05, large));
  fs_object a = spring("a");
  OK(fs_object_set(client.get(), &a));
  OK(rig.sync(client.get()));
  a.primitive = FS_PRIMITIVE_MESH;
  a.shape = mesh.get();
  OK(fs_object_set(client.get(), &a));  // waits for its mesh
  OK(fs_object_remove(editor.get(), "client/a"));
  ck_assert(has(client.get(), "a"));
  const fs_object b = spring("b");
  OK(fs_object_set(client.get(), &b));
  OK(rig.sync(client.get()));
  ck_assert(has(client.get(), "a") && has(client.get(), "b"));
  ck_assert(has(editor.get(), "client/a") && has(editor.get(), "client/b"));

  // Changes during the wait are known when it has taken effect.
  a.shape = nullptr;
  a.primitive = FS_PRIMITIVE_POINT;
  OK(fs_object_set(client.get(), &a));
  const Shape other = make_mesh(sphere_mesh(0.06, large));
  a.primitive = FS_PRIMITIVE_MESH;
  a.shape = other.get();
  OK(fs_object_change(client.get(), &a, FS_PART_SHAPE));
  fs_object damped = spring("client/a");
  damped.damping = 7;
  OK(fs_object_change(editor.get(), &damped, FS_PART_PROFILES));
  ck_assert(has(client.get(), "a"));  // it looks what others have done, too early
  OK(rig.sync(client.get()));
  ck_assert(Got(client.get(), "a")->damping == 7);
  ck_assert(Got(client.get(), "a")->shape == other.get());
}
END_TEST

// ----------------------------------------------------------------------------------------------------- again and again

static std::atomic<bool> is_over;
static std::atomic<int> wrong;
static void check(bool is_good, const char* what) {
  if (!is_good && wrong++ < 5) std::fprintf(stderr, "  %s: %s\n", what, fs_last_error());
}
static bool is_one_of(fs_status status, std::initializer_list<fs_status> good) {
  return std::find(good.begin(), good.end(), status) != good.end();
}

// Connects again whenever the server has gone, and makes calls all the time. Each call ends soon.
static void come_back(const std::string& endpoint, int number, std::atomic<uint64_t>& connections) {
  Random random(static_cast<uint64_t>(number));
  const std::string name = "client " + std::to_string(number);
  while (!is_over) {
    fs_scene* scene = nullptr;
    const fs_status status = fs_scene_connect((endpoint + "?timeout=30").c_str(), name.c_str(), &scene);
    check(status == FS_OK, "connect");
    if (status != FS_OK) return;
    const Scene kept(scene);
    ++connections;
    for (fs_status last = FS_OK; last != FS_ERROR_DISCONNECTED && !is_over;) {
      const fs_object o = push("push", 0.1);
      fs_event event;
      switch (random.below(5)) {
        case 0: last = fs_object_set(scene, &o); break;
        case 1: last = fs_object_move(scene, "push", &o.pose, nullptr, FS_NOW); break;
        case 2: last = fs_scene_sync(scene, 1); break;
        case 3: last = fs_scene_next_event(scene, 0.001, &event); break;
        default: last = fs_scene_get_hand(scene, nullptr, nullptr, nullptr); break;
      }
      check(is_one_of(last, {FS_OK, FS_ERROR_DISCONNECTED, FS_ERROR_NOT_FOUND, FS_ERROR_TIMEOUT}), "a call");
    }
  }
}

START_TEST(the_server_comes_and_goes) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  ServerRig rig(fs_server_options_init(), options);
  is_over = false;
  wrong = 0;
  std::atomic<uint64_t> connections[8]{};
  std::vector<std::thread> clients;
  for (int i = 0; i < 8; ++i) clients.emplace_back([&, i] { come_back(rig.endpoint, i, connections[i]); });
  Random random(1);
  for (int round = 0; round < 50; ++round) {
    if (round % 10 == 0) {  // all are connected
      uint64_t seen[8];
      for (int i = 0; i < 8; ++i) seen[i] = connections[i];
      rig.server.reset();
      rig.server = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
      ck_assert(eventually([&] {
        for (int i = 0; i < 8; ++i) {
          if (connections[i] == seen[i]) return false;
        }
        return true;
      }));
    }
    wait_a_little(random.log_between(1e-4, 0.02));
    rig.server.reset();
    if (random.coin()) wait_a_little(random.log_between(1e-4, 0.01));
    rig.server = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
  }
  is_over = true;
  for (std::thread& client : clients) client.join();
  ck_assert_int_eq(wrong, 0);
  uint64_t all = 0;
  for (const auto& count : connections) all += count;
  std::printf("  the server came 55 times; %lu connections\n", static_cast<unsigned long>(all));
}
END_TEST

// --------------------------------------------------------------------------------------------- many threads, one scene

static bool is_asleep(pid_t thread) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/stat");
  const std::string line((std::istreambuf_iterator<char>(file)), {});
  const size_t end = line.rfind(')');
  return end != std::string::npos && line.size() > end + 2 && line[end + 2] == 'S';
}

// The scene is given back while other threads wait in its calls: they end.
START_TEST(given_back_while_calls_wait) {
  ServerRig rig;
  for (int round = 0; round < 5; ++round) {
    const fs_object mine = push("mine");
    Scene client = rig.join("client");
    OK(fs_object_set(client.get(), &mine));  // its servo is not stepped
    fs_scene* scene = client.get();
    std::atomic<pid_t> waiting[3]{};
    fs_status statuses[3]{};
    std::vector<std::thread> threads;
    for (int i = 0; i < 3; ++i) {
      threads.emplace_back([&, i] {
        waiting[i] = gettid();
        fs_event event{};
        statuses[i] = i == 0 ? fs_scene_next_event(scene, 1000, &event) : fs_scene_sync(scene, 1000);
        if (i == 0 && statuses[i] == FS_OK && event.kind == FS_EVENT_DEVICE) {
          statuses[i] = fs_scene_next_event(scene, 1000, &event);
        }
        if (i == 0 && statuses[i] == FS_OK && event.kind == FS_EVENT_DISCONNECTED) statuses[i] = FS_ERROR_DISCONNECTED;
      });
    }
    for (const auto& thread : waiting) {
      ck_assert(eventually([&] { return thread != 0 && is_asleep(thread); }));
    }
    wait_a_little(0.02);
    client.reset();
    for (std::thread& thread : threads) thread.join();
    for (const fs_status status : statuses) ck_assert_int_eq(status, FS_ERROR_DISCONNECTED);
  }
}
END_TEST

// All kinds of calls at the same time on a connected scene that another client also edits.
START_TEST(threads_on_one_scene) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  ServerRig rig(fs_server_options_init(), options);
  const Scene client = rig.join("client"), editor = rig.join("editor");
  fs_scene* const s = client.get();
  const Shape mesh = make_mesh(torus_mesh(0.03, 0.01, 200));
  const Tool tool = make_tool(s);
  for (int i = 0; i < 4; ++i) {
    const fs_object o = spring(("move" + std::to_string(i)).c_str());
    OK(fs_object_set(s, &o));
  }
  is_over = false;
  wrong = 0;
  const auto fine = [](fs_status status, const char* what) {  // FULL: a group that is open long
    check(is_one_of(status, {FS_OK, FS_ERROR_NOT_FOUND, FS_ERROR_STATE, FS_ERROR_TIMEOUT, FS_ERROR_FULL}), what);
  };
  const auto name = [](Random& random, const char* prefix) { return prefix + std::to_string(random.below(4)); };
  const std::function<void(Random&)> works[]{
      [&](Random& random) {
        const fs_pose pose = random.pose(0.1);
        fine(fs_object_move(s, name(random, "move").c_str(), &pose, nullptr, FS_NOW), "move");
      },
      [&](Random& random) {
        const fs_pose pose = random.pose(0.1);
        fine(fs_object_move(s, name(random, "move").c_str(), &pose, nullptr, FS_NOW), "move");
      },
      [&](Random& random) {
        fs_object o = spring(name(random, "set").c_str(), random.in_box(0.1));
        if (random.coin()) {
          o.primitive = FS_PRIMITIVE_MESH;
          o.shape = mesh.get();
        }
        fine(fs_object_set(s, &o), "set");
        o.front.gain *= 2;
        fine(fs_object_change(s, &o, FS_PART_PROFILES), "change");
        if (random.coin(0.3)) fine(fs_object_remove(s, o.name), "remove");
      },
      [&](Random& random) {
        if (fs_scene_begin(s) != FS_OK) return check(false, "begin");
        for (int i = 0; i < 4; ++i) {
          const fs_pose pose = random.pose(0.1);
          fine(fs_object_move(s, ("move" + std::to_string(i)).c_str(), &pose, nullptr, FS_NOW), "move in a group");
        }
        fine(random.coin(0.8) ? fs_scene_commit(s) : fs_scene_cancel(s), "commit");
      },
      [&](Random& random) {
        fs_event event;
        fine(fs_scene_next_event(s, random.between(0, 0.01), &event), "event");
        fine(fs_scene_sync(s, random.between(0, 0.05)), "sync");
      },
      [&](Random& random) {
        size_t count;
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        fine(fs_object_get(s, name(random, random.coin() ? "move" : "set").c_str(), &got), "get");
        fs_object_release(&got);
        fine(fs_scene_get_reports(s, nullptr, 0, &count), "reports");
        fine(fs_scene_get_motions(s, nullptr, nullptr, 0, &count), "motions");
        fine(fs_scene_get_clients(s, nullptr, 0, &count), "clients");
        fine(fs_scene_get_views(s, nullptr, 0, &count), "views");
        fine(fs_scene_get_record(s, 0, nullptr, 0, &count), "record");
        fine(fs_scene_get_hand(s, nullptr, nullptr, nullptr), "hand");
      },
      [&](Random& random) {
        fs_response response;
        const fs_state state = hand_at(random.in_box(0.1));
        check(fs_evaluate(tool.get(), &state, &response) == FS_OK, "evaluate");
      },
      [&](Random& random) {
        const std::string theirs = "client/" + name(random, random.coin() ? "move" : "set");
        const fs_object o = spring(theirs.c_str());
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        fine(fs_object_get(editor.get(), theirs.c_str(), &got), "get theirs");
        fs_object_release(&got);
        fine(fs_object_change(editor.get(), &o, FS_PART_PROFILES), "change theirs");
        fine(fs_object_move(editor.get(), theirs.c_str(), &o.pose, nullptr, FS_NOW), "move theirs");
        if (theirs.starts_with("client/set")) fine(fs_object_remove(editor.get(), theirs.c_str()), "remove theirs");
      }};
  uint64_t rounds[std::size(works)]{};
  std::vector<std::thread> threads;
  for (size_t i = 0; i < std::size(works); ++i) {
    threads.emplace_back([&, i] {
      Random random(i);
      for (; !is_over; ++rounds[i]) works[i](random);
    });
  }
  wait_a_little(1.5);
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_int_eq(wrong, 0);
  for (const uint64_t count : rounds) ck_assert_uint_gt(count, 0);
  OK(fs_scene_sync(s, long_enough));
  std::printf("  rounds of moves (2), sets, groups, waits, looks, a tool, another client:");
  for (const uint64_t count : rounds) std::printf(" %lu", static_cast<unsigned long>(count));
  std::printf("\n");
}
END_TEST

// The server stops meanwhile: all threads get the status, none hangs.
START_TEST(lost_while_threads_are_in_calls) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  ServerRig rig(fs_server_options_init(), options);
  for (int round = 0; round < 10; ++round) {
    const Scene client = rig.join("client");
    fs_scene* const s = client.get();
    const fs_object o = push("push");
    OK(fs_object_set(s, &o));
    const Folder folder;
    const std::string path = folder / "scene.json";
    OK(fs_scene_save(s, path.c_str()));
    std::atomic<int> begun{0};
    std::vector<std::thread> threads;
    for (const Call& call : all_calls(path)) {
      const std::string name = call.name;
      if (call.when_lost != FS_ERROR_DISCONNECTED) continue;
      if (name == "fs_scene_begin" || name == "fs_scene_next_event") continue;
      threads.emplace_back([&, s, call] {
        ++begun;
        while (call.run(s) != FS_ERROR_DISCONNECTED) {
        }
      });
    }
    ck_assert(eventually([&] { return begun == static_cast<int>(threads.size()); }));
    wait_a_little(0.02);
    rig.server.reset();
    for (std::thread& thread : threads) thread.join();
    rig.server = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("life");
  tcase_add_loop_test(life::new_case(suite, "fade"), it_fades, 0, std::size(cases));
  life::add_case(suite, "names", {it_fades_while_it_comes, one_of_the_same_name, names_are_free_at_once});
  tcase_add_loop_test(life::new_case(suite, "calls"), every_call_says_so, 0, 2);
  life::add_case(suite, "server", {all_calls_are_there, events_come_to_an_end, in_the_middle_of_a_group,
                                   the_server_comes_and_goes});
  life::add_case(suite, "waiting", {names_change_hands_while_a_mesh_is_built, removed_while_its_mesh_is_built});
  life::add_case(suite, "threads",
                 {given_back_while_calls_wait, threads_on_one_scene, lost_while_threads_are_in_calls});
  return run_suite(suite);
}
