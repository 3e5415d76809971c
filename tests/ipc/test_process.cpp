// Clients and servers as processes: how they die, fork, run out of descriptors, belong to other users, and are many.
#include <grp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <map>

#include "ipc/calls.h"
#include "ipc/case.h"
#include "ipc/watch.h"

using namespace life;
using namespace scenes;

constexpr double lease = 0.1, fade = 0.2;  // s
constexpr double full = 2;                 // N, of a client

// ========================================================================================= what the other processes do

// Such a process reports every failure, and then the expected line does not come.
static void expect(bool is_good, const std::string& what) {
  if (is_good) return;
  tell("wrong: " + what + ": " + fs_last_error());
  _exit(EXIT_FAILURE);
}
static void expect(fs_status wanted, fs_status status, const std::string& what) {
  expect(status == wanted, what + ": " + fs_status_name(status));
}
static fs_scene* join(const char* endpoint, const char* name) {
  fs_scene* scene = nullptr;
  expect(FS_OK, PATIENTLY(fs_scene_connect(endpoint, name, &scene)), "fs_scene_connect");
  return scene;
}
static void set_push(fs_scene* scene, double force, fs_vec3 direction = {1, 0, 0}) {
  const fs_object o = push("push", force, direction);
  expect(FS_OK, PATIENTLY(fs_object_set(scene, &o)), "fs_object_set");
  expect(FS_OK, PATIENTLY(fs_scene_sync(scene, long_enough)), "fs_scene_sync");
}

static fs_scene* kept = nullptr;  // for what ends without giving it back

// client ENDPOINT NAME FORCE x|y: pushes, then follows the lines that it reads.
static void be_a_client(char** words) {
  kept = join(words[0], words[1]);
  set_push(kept, std::atof(words[2]), words[3][0] == 'x' ? fs_vec3{1, 0, 0} : fs_vec3{0, 1, 0});
  tell("felt");
  for (std::string line; listen(line);) {
    if (line == "exit") std::exit(0);
    if (line == "_exit") _exit(0);
    if (line == "destroy") {
      fs_scene_destroy(kept);
      kept = nullptr;
    } else if (line == "sync") {
      expect(FS_OK, PATIENTLY(fs_scene_sync(kept, long_enough)), "fs_scene_sync");
    }
    tell("done: " + line);
  }
}

// server ENDPOINT [all_users]: runs until its standard input is closed.
static void be_a_server(char** words) {
  fs_server_options options = fs_server_options_init();
  options.max_clients = 100;
  options.all_users = words[1] != nullptr;
  fs_servo_options servo = world_options();
  servo.mode = FS_SERVO_THREAD;
  ServoRig rig(servo);
  const Server server = start_server(rig.servo.get(), words[0], options);
  tell("serves");
  for (std::string line; listen(line);) {
  }
}

// forks ENDPOINT NAME PATH: the child cannot use the scene, the parent can.
static void fork_while_connected(char** words) {
  fs_scene* scene = join(words[0], words[1]);
  const fs_object mine = spring("mine");
  expect(FS_OK, PATIENTLY(fs_object_set(scene, &mine)), "fs_object_set");
  set_push(scene, 1);
  fs_tool* tool = nullptr;
  expect(FS_OK, fs_tool_create(scene, nullptr, 0, &tool), "fs_tool_create");
  expect(FS_OK, PATIENTLY(fs_scene_save(scene, words[2])), "fs_scene_save");
  for (int round = 0; round < 3; ++round) {
    if (round == 2) expect(FS_OK, PATIENTLY(fs_scene_begin(scene)), "fs_scene_begin");  // and a group is open
    const pid_t child = fork();
    if (child == 0) {
      for (const Call& call : all_calls(words[2])) expect(call.when_lost, call.run(scene), call.name);
      if (round > 0) fs_scene_destroy(scene);
      fs_response response;
      const fs_state state = hand_at({0.01, 0, 0});
      expect(FS_OK, fs_evaluate(tool, &state, &response), "fs_evaluate");
      expect(response.felt_count >= 2, "the tool feels " + std::to_string(response.felt_count));
      fs_tool_destroy(tool);
      // The child connects a scene of its own by another name; the parent's name is taken.
      fs_scene* own = nullptr;
      expect(FS_ERROR_EXISTS, fs_scene_connect(words[0], words[1], &own), "fs_scene_connect");
      own = join(words[0], "child");
      set_push(own, 0.5);
      fs_scene_destroy(own);
      _exit(EXIT_SUCCESS);
    }
    int status = 0;
    expect(waitpid(child, &status, 0) == child && status == 0, "the child");
    if (round == 2) expect(FS_OK, PATIENTLY(fs_scene_cancel(scene)), "fs_scene_cancel");
    for (const Call& call : all_calls(words[2])) {
      const std::string name = call.name;
      for (const char* still : {"fs_object_move", "fs_object_set", "fs_object_get", "fs_scene_get_hand",
                                "fs_scene_get_reports", "fs_scene_get_clients"}) {
        if (name == still) expect(FS_OK, call.run(scene), name);
      }
    }
    expect(FS_OK, PATIENTLY(fs_scene_sync(scene, long_enough)), "fs_scene_sync");
    tell("goes on");
  }
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
  tell("over");
}

// parent ENDPOINT NAME FORCE: its child holds the socket, too, and lives until standard input is closed.
static void be_a_parent(char** words) {
  fs_scene* scene = join(words[0], words[1]);
  set_push(scene, std::atof(words[2]));
  if (fork() == 0) {
    tell("child " + std::to_string(getpid()));
    for (std::string line; listen(line);) {
    }
    _exit(EXIT_SUCCESS);
  }
  for (;;) pause();
}

// execs ENDPOINT NAME: a program that a client starts inherits the same descriptors as one that it started before it
// connected.
static void start_a_program(char** words) {
  const auto start = [] {
    const pid_t child = fork();
    if (child == 0) {
      execl("/proc/self/exe", "client", "--process", "descriptors", nullptr);
      _exit(EXIT_FAILURE);
    }
    waitpid(child, nullptr, 0);
  };
  start();
  fs_scene* scene = join(words[0], words[1]);
  set_push(scene, 1);
  start();
  fs_scene_destroy(scene);
}
static void list_descriptors(char**) {
  std::string all;
  for (const std::string& descriptor : descriptors()) all += " " + descriptor;
  tell("descriptors:" + all);
}

// user ID MODE ...: runs the mode as that user.
static void run(const std::string& mode, char** words);
static void become(char** words) {
  const auto user = static_cast<uid_t>(std::atoi(words[0]));
  expect(setgroups(0, nullptr) == 0 && setresgid(user, user, user) == 0, "setresgid");
  expect(setresuid(user, user, user) == 0, "setresuid");
  prctl(PR_SET_DUMPABLE, 1);  // its own folder in /proc is its own again
  leave_with_parent();        // which a change of the user has undone
  run(words[1], words + 2);
}

// knock ENDPOINT NAME: connects, and reports the answer.
static void knock(char** words) {
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(words[0], words[1], &scene);
  if (status != FS_OK) return tell(std::string(fs_status_name(status)) + ": " + fs_last_error());
  set_push(scene, 1);
  tell("FS_OK");
  for (std::string line; listen(line);) {
  }
  fs_scene_destroy(scene);
}

// squat ADDRESS: listens at this address in the abstract name space.
static void squat(char** words) {
  const std::string address = words[0];
  sockaddr_un place{};
  place.sun_family = AF_UNIX;
  std::memcpy(place.sun_path + 1, address.data(), address.size());
  const int listener = socket(AF_UNIX, SOCK_SEQPACKET, 0);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + address.size());
  expect(bind(listener, reinterpret_cast<const sockaddr*>(&place), size) == 0 && ::listen(listener, 8) == 0, "bind");
  tell("squats");
  for (std::string line; listen(line);) {
  }
}

// poor ENDPOINT NAME: calls for which no descriptor is left fail, nothing is lost, and later everything works.
static void run_out_of_descriptors(char** words) {
  rlimit before;
  getrlimit(RLIMIT_NOFILE, &before);
  const auto set_limit = [&](rlim_t limit) {
    const rlimit changed{limit, before.rlim_max};
    expect(setrlimit(RLIMIT_NOFILE, &changed) == 0, "setrlimit");
  };
  close_range(3, ~0u, 0);                                 // so that those in use have the lowest numbers
  const auto used = [] { return descriptors().size(); };  // needs one itself
  const Shape mesh = make_mesh(sphere_mesh(0.05, 1000));
  const size_t at_first = used();
  {  // as it should be; a sanitizer, too, may need a descriptor when it sees something for the first time
    const Folder folder;
    const Scene scene(join(words[0], words[1]));
    for (const Call& call : all_calls(folder / "scene")) call.run(scene.get());
  }
  expect(used() == at_first, "descriptors are lost");
  int refused = 0;
  for (int round = 0; round < 20; ++round) {
    fs_scene* scene = nullptr;
    fs_status status = FS_ERROR_FULL;
    for (rlim_t spare = 0; status != FS_OK; ++spare, ++refused) {
      expect(spare < 10, "it does not get in");
      set_limit(3 + at_first + spare);
      status = fs_scene_connect(words[0], words[1], &scene);
      const std::string sentence = fs_last_error();
      set_limit(before.rlim_cur);
      if (status == FS_OK) break;
      expect(FS_ERROR_FULL, status, "fs_scene_connect");
      expect(sentence.size() > 20, "no sentence: " + sentence);
      expect(used() == at_first, "descriptors are lost");
    }
    const size_t connected = used();
    fs_object o = fs_object_init("mesh", FS_PRIMITIVE_MESH);
    o.shape = mesh.get();
    o.front = attract(100, 2);
    set_limit(3 + connected);
    for (int i = 0; i < 3; ++i) expect(FS_ERROR_FULL, fs_object_set(scene, &o), "fs_object_set");
    size_t count = 0;
    expect(FS_ERROR_FULL, fs_scene_get_reports(scene, nullptr, 0, &count), "fs_scene_get_reports");
    expect(FS_ERROR_FULL, fs_scene_get_motions(scene, nullptr, nullptr, 0, &count), "fs_scene_get_motions");
    expect(FS_ERROR_FULL, fs_scene_get_clients(scene, nullptr, 0, &count), "fs_scene_get_clients");
    expect(FS_ERROR_FULL, fs_scene_get_views(scene, nullptr, 0, &count), "fs_scene_get_views");
    expect(FS_ERROR_FULL, fs_scene_get_record(scene, 0, nullptr, 0, &count), "fs_scene_get_record");
    fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
    expect(FS_ERROR_NOT_FOUND, fs_object_get(scene, "mesh", &got), "fs_object_get");
    o.primitive = FS_PRIMITIVE_POINT;  // what needs no descriptor is done
    o.shape = nullptr;
    expect(FS_OK, PATIENTLY(fs_object_set(scene, &o)), "fs_object_set");
    expect(FS_OK, PATIENTLY(fs_scene_sync(scene, long_enough)), "fs_scene_sync");
    set_limit(before.rlim_cur);
    expect(used() == connected, "descriptors are lost");
    o.primitive = FS_PRIMITIVE_MESH;
    o.shape = mesh.get();
    expect(FS_OK, PATIENTLY(fs_object_set(scene, &o)), "fs_object_set");
    expect(FS_OK, PATIENTLY(fs_scene_sync(scene, long_enough)), "fs_scene_sync");
    expect(FS_OK, PATIENTLY(fs_scene_get_reports(scene, nullptr, 0, &count)), "fs_scene_get_reports");
    expect(used() == connected, "descriptors are lost");
    fs_scene_destroy(scene);
    expect(used() == at_first, "descriptors are lost");
  }
  expect(refused > 0, "there were descriptors enough");
  tell("fine");
}

// crowd ENDPOINT NUMBER SCENES OBJECTS SECONDS: moves all of its objects 25 times a second.
static fs_pose place_in_crowd(int scene, int object, int step) { return at(10 + scene, 0.01 * object, 0.001 * step); }
static int steps_of_crowd(double seconds) { return static_cast<int>(25 * seconds); }

static void be_a_crowd(char** words) {
  const int scene_count = std::atoi(words[2]), object_count = std::atoi(words[3]);
  const int steps = steps_of_crowd(std::atof(words[4]));
  std::vector<fs_scene*> scenes;
  std::vector<std::string> names;
  for (int i = 0; i < object_count; ++i) names.push_back("object " + std::to_string(i));
  for (int s = 0; s < scene_count; ++s) {
    scenes.push_back(join(words[0], (std::string(words[1]) + "." + std::to_string(s)).c_str()));
    expect(FS_OK, PATIENTLY(fs_scene_begin(scenes[s])), "fs_scene_begin");
    for (int i = 0; i < object_count; ++i) {
      fs_object o = spring(names[i].c_str(), place_in_crowd(s, i, 0).position);
      o.front.reach = 0.01;
      expect(FS_OK, PATIENTLY(fs_object_set(scenes[s], &o)), "fs_object_set");
    }
    expect(FS_OK, PATIENTLY(fs_scene_commit(scenes[s])), "fs_scene_commit");
    expect(FS_OK, PATIENTLY(fs_scene_sync(scenes[s], long_enough)), "fs_scene_sync");
  }
  tell("ready");
  std::string line;
  listen(line);
  const fs_twist still{};
  auto next = std::chrono::steady_clock::now();
  for (int k = 1; k <= steps; ++k) {
    for (int s = 0; s < scene_count; ++s) {
      for (int i = 0; i < object_count; ++i) {
        const fs_pose pose = place_in_crowd(s, i, k);
        expect(FS_OK, PATIENTLY(fs_object_move(scenes[s], names[i].c_str(), &pose, &still, FS_NOW)), "fs_object_move");
      }
    }
    next += std::chrono::milliseconds(40);
    std::this_thread::sleep_until(next);
  }
  tell("moved");
  while (listen(line)) {
  }
  for (fs_scene* scene : scenes) {  // nobody was dropped
    expect(FS_OK, PATIENTLY(fs_scene_sync(scene, long_enough)), "fs_scene_sync");
    fs_scene_destroy(scene);
  }
  tell("over");
}

static void run(const std::string& mode, char** words) {
  static const std::map<std::string, void (*)(char**)> modes{
      {"client", be_a_client},          {"server", be_a_server},       {"forks", fork_while_connected},
      {"parent", be_a_parent},          {"execs", start_a_program},    {"descriptors", list_descriptors},
      {"user", become},                 {"knock", knock},              {"squat", squat},
      {"poor", run_out_of_descriptors}, {"crowd", be_a_crowd}};
  modes.at(mode)(words);
}

// =============================================================================================================== tests

static Process start(std::vector<std::string> words) {
  words.insert(words.begin(), "--process");
  return Process(words);
}

static fs_server_options server_options() {
  fs_server_options options = fs_server_options_init();
  options.lease = lease;
  options.max_clients = 100;
  return options;
}
static fs_servo_options thread_options(double the_fade = fade) {
  fs_servo_options options = world_options();
  options.mode = FS_SERVO_THREAD;
  options.fade = the_fade;
  return options;
}

// The force of all scenes at each tick, as the flight record has it.
struct Flight {
  struct Sample {
    double time;
    fs_vec3 force;
  };
  Watch watch;
  std::vector<Sample> samples;

  explicit Flight(fs_servo* servo) : watch(servo) {}
  void look() {
    watch.look([this](const fs_tick& tick, const fs_tick*) {
      check_tick(tick, 1000);
      samples.push_back({tick.state.time, tick.response.wrench.force});
    });
  }
  template <class F>
  bool until(F&& is_so) {
    return eventually([&] {
      look();
      return is_so();
    });
  }
  fs_vec3 newest() const { return samples.empty() ? fs_vec3{} : samples.back().force; }
  // N per ms, from a time on.
  double largest_step(double from) const {
    double largest = 0;
    for (size_t i = 1; i < samples.size(); ++i) {
      const double ms = std::fmax(1, 1000 * (samples[i].time - samples[i - 1].time));
      if (samples[i].time >= from) largest = std::fmax(largest, norm(samples[i].force - samples[i - 1].force) / ms);
    }
    return largest;
  }
  // The force is full at least until `death` plus the lease, then falls linearly.
  void check_fade(double death, double fs_vec3::*axis) const {
    double leave = 0;
    for (const Sample& sample : samples) {
      const double share = sample.force.*axis / full;
      if (sample.time < death) continue;
      if (leave == 0 && share < 1 - 1e-9) {
        leave = sample.time - fade * (1 - share);
        ck_assert_msg(leave >= death + lease - 1e-6, "the fade begins %g s after the death", leave - death);
      }
      const double wanted = leave == 0 ? 1 : std::fmax(0, 1 - (sample.time - leave) / fade);
      ck_assert_msg(std::fabs(share - wanted) < 1e-6, "%g s after the death it is %g N, not %g", sample.time - death,
                    full * share, full * wanted);
    }
    ck_assert_msg(leave > 0, "it never fades");
    ck_assert(samples.back().force.*axis == 0);
  }
};

// ------------------------------------------------------------------------------------------------------ lease and fade

enum Way { killed, exits, exits_at_once, gives_back, stopped_then_killed };
static const char* const ways[] = {"is killed", "calls exit", "calls _exit", "gives its scene back",
                                   "is stopped, then killed"};

START_TEST(a_client_dies) {
  ServerRig rig(server_options(), thread_options());
  Flight flight(rig.servo.get());
  Process client = start({"client", rig.endpoint, "client", std::to_string(full), "x"});
  client.expect("felt");
  ck_assert(flight.until([&] { return std::fabs(flight.newest().x - full) < 1e-9; }));
  wait_a_little(0.05);
  if (_i == stopped_then_killed) {
    client.send(SIGSTOP);
    wait_a_little(0.05);
  }
  const double death = now(rig.base.get());
  switch (_i) {
    case exits: client.say("exit"); break;
    case exits_at_once: client.say("_exit"); break;
    case gives_back: client.say("destroy"); break;
    default: client.send(SIGKILL); break;
  }
  if (_i == gives_back) {
    client.expect("done: destroy");
  } else {
    client.wait();
  }
  ck_assert(flight.until([&] { return flight.newest().x == 0; }));
  flight.check_fade(death, &fs_vec3::x);
  std::printf("  a client that pushes with %g N %s: largest step %.4f N per ms (%g N over %g s)\n", full, ways[_i],
              flight.largest_step(death), full, fade);
}
END_TEST

// A stopped client is not dead: it keeps its force, and works when it goes on.
START_TEST(a_silent_client) {
  ServerRig rig(server_options(), thread_options());
  Flight flight(rig.servo.get());
  Process client = start({"client", rig.endpoint, "client", std::to_string(full), "x"});
  client.expect("felt");
  ck_assert(flight.until([&] { return std::fabs(flight.newest().x - full) < 1e-9; }));
  const double begin = now(rig.base.get());
  client.send(SIGSTOP);
  while (now(rig.base.get()) < begin + 2) {
    flight.look();
    wait_a_little(0.1);
  }
  for (const Flight::Sample& sample : flight.samples) {
    if (sample.time >= begin) EXPECT_NEAR(sample.force.x, full, 1e-9);
  }
  client.send(SIGCONT);
  client.say("sync");
  client.expect("done: sync");
  client.kill_it();
}
END_TEST

// While a killed client fades out, the next one of the same name fades in: both are felt.
START_TEST(the_next_of_its_name) {
  fs_server_options options = server_options();
  options.lease = 0.5;
  ServerRig rig(options, thread_options(0.5));
  Flight flight(rig.servo.get());
  Process first = start({"client", rig.endpoint, "client", std::to_string(full), "x"});
  first.expect("felt");
  ck_assert(flight.until([&] { return std::fabs(flight.newest().x - full) < 1e-9; }));
  const double death = now(rig.base.get());
  first.kill_it();
  Process second = start({"client", rig.endpoint, "client", "1", "y"});
  second.expect("felt");
  ck_assert(flight.until([&] { return flight.newest().x == 0 && flight.newest().y == 1; }));
  bool have_met = false;
  for (const Flight::Sample& sample : flight.samples) have_met |= sample.force.x > 0 && sample.force.y > 0;
  ck_assert(have_met);
  const double largest = flight.largest_step(death);
  ck_assert_msg(largest < 2e-3 * (full + 1) * 1.001, "a step of %g N per ms", largest);
}
END_TEST

// ----------------------------------------------------------------------------------------------------- the server dies

// Each call notices by itself that the server's process has been killed, and keeps returning that status.
START_TEST(the_server_is_killed) {
  const Folder folder;
  const std::string path = folder / "scene.json", endpoint = new_endpoint();
  const std::vector<Call> calls = all_calls(path);
  Process server = start({"server", endpoint});
  server.expect("serves");
  const Scene other = connect(endpoint, "other");
  const fs_object theirs = spring("theirs"), mine = spring("mine");
  OK(fs_object_set(other.get(), &theirs));
  std::vector<Scene> scenes;
  for (size_t i = 0; i < calls.size(); ++i) {
    scenes.push_back(connect(endpoint, ("client " + std::to_string(i)).c_str()));
    OK(fs_object_set(scenes[i].get(), &mine));
    OK(fs_scene_sync(scenes[i].get(), long_enough));
  }
  const Tool tool = make_tool(scenes[0].get());
  OK(fs_scene_save(scenes[0].get(), path.c_str()));
  const fs_vec3 felt = force_at(tool.get(), {0.01, 0, 0});
  ck_assert(felt.x < -0.5);

  server.kill_it();
  const double death = now(make_scene().get());
  std::vector<double> found(calls.size());
  ck_assert(eventually([&] {  // in turns
    bool all = true;
    for (size_t i = 0; i < calls.size(); ++i) {
      if (found[i] == 0 && calls[i].run(scenes[i].get()) == calls[i].when_lost) found[i] = now(make_scene().get());
      all &= found[i] > 0;
    }
    return all;
  }));
  const double last = *std::max_element(found.begin(), found.end()) - death;
  std::printf("  the server is killed: the last of %zu calls says so %.0f ms later\n", calls.size(), 1000 * last);

  // A new server of the same name is another server.
  Process next = start({"server", endpoint});
  next.expect("serves");
  const Scene fresh = connect(endpoint, "client 0");
  OK(fs_object_set(fresh.get(), &mine));
  OK(fs_scene_sync(fresh.get(), long_enough));
  for (const Scene& scene : scenes) {
    fs_event event;
    int ends = 0;
    while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK) ends += event.kind == FS_EVENT_DISCONNECTED;
    for (const Call& call : calls) EXPECT(call.when_lost, call.run(scene.get()));
    ck_assert_int_le(ends, 1);
  }
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), felt, 1e-9);
  scenes.clear();
  EXPECT_VECTOR(force_at(tool.get(), {0.01, 0, 0}), felt, 1e-9);
  next.stop_saying();
  ck_assert_int_eq(next.wait(), 0);
}
END_TEST

// A stopped server is not gone: calls that need its answer time out, and calls that do not go on.
START_TEST(the_server_stands_still) {
  const std::string endpoint = new_endpoint();
  Process server = start({"server", endpoint});
  server.expect("serves");
  const Scene client = connect(endpoint, "client");
  const fs_object mine = spring("mine");
  OK(fs_object_set(client.get(), &mine));
  OK(fs_scene_sync(client.get(), long_enough));
  server.send(SIGSTOP);
  wait_a_little(0.3);
  const fs_pose pose = at(0.01, 0, 0);
  OK(fs_object_move(client.get(), "mine", &pose, nullptr, FS_NOW));
  OK(fs_object_set(client.get(), &mine));
  OK(fs_scene_get_hand(client.get(), nullptr, nullptr, nullptr));
  size_t count;
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_get_clients(client.get(), nullptr, 0, &count));
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(client.get(), 0.1));
  fs_scene* other = nullptr;
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_connect((endpoint + "?timeout=0.1").c_str(), "other", &other));
  server.send(SIGCONT);
  OK(fs_scene_sync(client.get(), long_enough));
  OK(fs_scene_get_clients(client.get(), nullptr, 0, &count));
  server.send(SIGSTOP);
  server.kill_it();
  ck_assert(eventually([&] { return fs_scene_sync(client.get(), long_enough) == FS_ERROR_DISCONNECTED; }));
}
END_TEST

// ------------------------------------------------------------------------------------------------------- fork and exec

START_TEST(fork_of_a_client) {
  const Folder folder;
  ServerRig rig(server_options(), thread_options());
  const Scene other = rig.join("other");
  const fs_object theirs = spring("theirs");
  OK(fs_object_set(other.get(), &theirs));
  Process client = start({"forks", rig.endpoint, "client", folder / "scene.json"});
  for (int round = 0; round < 3; ++round) client.expect("goes on");
  client.expect("over");
  ck_assert_int_eq(client.wait(), 0);
}
END_TEST

// A client is dead when its process is, even if a child of it lives on and holds its socket.
START_TEST(child_of_the_dead) {
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  ServerRig rig(server_options(), thread_options());
  Flight flight(rig.servo.get());
  Process parent = start({"parent", rig.endpoint, "client", std::to_string(full)});
  std::string line;
  ck_assert(parent.hear(line) && line.starts_with("child "));
  const pid_t child = std::stoi(line.substr(6));
  ck_assert(flight.until([&] { return std::fabs(flight.newest().x - full) < 1e-9; }));
  const double death = now(rig.base.get());
  parent.kill_it();
  ck_assert(flight.until([&] { return flight.newest().x == 0; }));
  flight.check_fade(death, &fs_vec3::x);
  ck_assert_int_eq(kill(child, 0), 0);  // it was there all the while
  const Scene next = rig.join("client");
  parent.stop_saying();
  ck_assert_int_eq(waitpid(child, nullptr, 0), child);
  prctl(PR_SET_CHILD_SUBREAPER, 0);
}
END_TEST

START_TEST(a_client_starts_a_program) {
  ServerRig rig(server_options(), thread_options());
  Process client = start({"execs", rig.endpoint, "client"});
  std::string before, after;
  ck_assert(client.hear(before) && client.hear(after));
  ck_assert_int_eq(client.wait(), 0);
  ck_assert(before.starts_with("descriptors:"));
  ck_assert_str_eq(before.c_str(), after.c_str());
}
END_TEST

// --------------------------------------------------------------------------------------------------------- other users

constexpr const char *nobody = "65534", *somebody = "65533";

static bool is_root() {
  if (geteuid() == 0) return true;
  std::printf("  SKIPPED, as only root can be another user\n");
  return false;
}
static std::string bare(const std::string& endpoint) { return endpoint.substr(endpoint.find(':') + 1); }
// The answer to a process of this user that connects.
static std::string answer_to(const char* user, const std::string& endpoint, Process* stays = nullptr) {
  Process client = start({"user", user, "knock", endpoint, "guest"});
  std::string line = "nothing";
  client.hear(line);
  if (stays) *stays = std::move(client);
  return line;
}
static void expect_answer(const std::string& answer, const std::string& beginning) {
  ck_assert_msg(answer.starts_with(beginning), "the answer is '%s', not '%s'", answer.c_str(), beginning.c_str());
}

// A server is for its own user, unless it has all_users.
START_TEST(a_server_of_one_user) {
  if (!is_root()) return;
  ServerRig rig(server_options(), thread_options());
  expect_answer(answer_to(nobody, rig.endpoint), "FS_ERROR_NOT_FOUND: ");  // of its own
  expect_answer(answer_to(nobody, rig.endpoint + "?user=root"),
                "FS_ERROR_DENIED: this server lets in its own user only");
  // Servers of different users can have the same name.
  Process theirs = start({"user", nobody, "server", rig.endpoint});
  theirs.expect("serves");
  expect_answer(answer_to(nobody, rig.endpoint), "FS_OK");
  fs_scene* scene = nullptr;
  EXPECT(FS_ERROR_DENIED, fs_scene_connect((rig.endpoint + "?user=" + nobody).c_str(), "root", &scene));
  const Scene own = rig.join("root");
  theirs.stop_saying();
  ck_assert_int_eq(theirs.wait(), 0);
}
END_TEST

START_TEST(a_server_of_all_users) {
  if (!is_root()) return;
  fs_server_options options = server_options();
  options.all_users = true;
  ServerRig rig(options, thread_options());
  for (const char* user : {nobody, somebody}) {
    expect_answer(answer_to(user, rig.endpoint), "FS_ERROR_NOT_FOUND: ");
    Process guest;
    expect_answer(answer_to(user, rig.endpoint + "?user=root", &guest), "FS_OK");
    const Scene observer = rig.join("observer");
    fs_client clients[8];
    size_t count = 0;
    OK(fs_scene_get_clients(observer.get(), clients, 8, &count));
    const auto found = std::find_if(clients, clients + count,
                                    [](const fs_client& client) { return !std::strcmp(client.name, "guest"); });
    ck_assert(found != clients + count);
    ck_assert_uint_eq(found->user, static_cast<uint32_t>(std::atoi(user)));
    ck_assert_uint_eq(found->process, static_cast<uint32_t>(guest.id()));
    guest.kill_it();  // its name is free: the server sees the death of a process that is another user's
    Process next;
    expect_answer(answer_to(user, rig.endpoint + "?user=0", &next), "FS_OK");
    next.stop_saying();
    ck_assert_int_eq(next.wait(), 0);
  }
  const Scene own = rig.join("root");
  // The name of an all_users server is taken for all users, but not that of a server for one user.
  Process other = start({"user", nobody, "server", rig.endpoint});
  other.expect("serves");

  // And the other way round: root and others connect to the server of a user.
  const std::string endpoint = new_endpoint();
  Process theirs = start({"user", nobody, "server", endpoint, "all_users"});
  theirs.expect("serves");
  const std::string place = endpoint + "?user=" + nobody;
  expect_answer(answer_to(somebody, place), "FS_OK");
  const Scene guest = connect(place, "root");
  const fs_object mine = spring("mine");
  OK(fs_object_set(guest.get(), &mine));
  OK(fs_scene_sync(guest.get(), long_enough));
  theirs.kill_it();
  ck_assert(eventually([&] { return fs_scene_sync(guest.get(), long_enough) == FS_ERROR_DISCONNECTED; }));
}
END_TEST

// Another user listens where a server of this user is expected: the client notices by the user id, and sends nothing.
START_TEST(somebody_squats) {
  if (!is_root()) return;
  const std::string endpoint = new_endpoint();
  Process thief = start({"user", nobody, "squat", "forceserver/0/" + bare(endpoint)});
  thief.expect("squats");
  fs_scene* scene = nullptr;
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_scene_connect(endpoint.c_str(), "client", &scene), nobody);
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_scene_connect((endpoint + "?timeout=1").c_str(), "client", &scene), nobody);
  Process shared_thief = start({"user", nobody, "squat", "forceserver/" + bare(endpoint)});
  shared_thief.expect("squats");
  const std::string elsewhere = endpoint + "?user=" + somebody;
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_scene_connect(elsewhere.c_str(), "client", &scene), nobody);
  // The name of a server of this user is not denied by that; that of one of all users is.
  ServoRig rig(thread_options()), second(thread_options());
  fs_server* server = nullptr;
  fs_server_options for_all = fs_server_options_init();
  for_all.all_users = true;
  EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_server_start(rig.servo.get(), endpoint.c_str(), &for_all, &server), "has that name already for all users");
  for (const bool is_thief_gone : {false, true}) {
    Server own = start_server(rig.servo.get(), endpoint, fs_server_options_init());
    const Scene client = connect(endpoint, "client");
    const auto is_taken = [&] {
      EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_server_start(second.servo.get(), endpoint.c_str(), nullptr, &server),
                      "a server of this user has that name already");
    };
    is_taken();
    if (mkdir("/run/user/0", 0700) == 0) {  // root logs in after the server has begun
      const Scene late = connect(endpoint, "late");
      is_taken();
      rmdir("/run/user/0");
    }
    if (is_thief_gone) thief.kill_it();  // the address is free, but the server is still there
    EXPECT(FS_ERROR_EXISTS, fs_server_start(second.servo.get(), endpoint.c_str(), nullptr, &server));
    const Scene another = connect(endpoint, "another");
  }
  EXPECT(FS_ERROR_NOT_FOUND, fs_scene_connect(endpoint.c_str(), "client", &scene));
  const Server own = start_server(rig.servo.get(), endpoint, fs_server_options_init());
  const Scene client = connect(endpoint, "client");
}
END_TEST

// ---------------------------------------------------------------------------------------------------------------- many

START_TEST(no_descriptors_at_the_client) {
  ServerRig rig(server_options(), thread_options());
  Process client = start({"poor", rig.endpoint, "poor"});
  std::string line = "nothing";
  client.hear(line, 60);
  ck_assert_str_eq(line.c_str(), "fine");
  ck_assert_int_eq(client.wait(), 0);
}
END_TEST

// Many clients move all their objects, and each object ends where it was moved last.
START_TEST(a_crowd) {
  const int process_count = is_sanitized ? 3 : 8, scene_count = is_sanitized ? 3 : 8;
  const int object_count = is_sanitized ? 30 : 100;
  const double seconds = is_sanitized ? 1 : times(1, 3);
  ServerRig rig(server_options(), thread_options());
  std::vector<Process> crowd;
  for (int p = 0; p < process_count; ++p) {
    crowd.push_back(start({"crowd", rig.endpoint, std::to_string(p), std::to_string(scene_count),
                           std::to_string(object_count), std::to_string(seconds)}));
  }
  for (Process& process : crowd) process.expect("ready");
  for (Process& process : crowd) process.say("go");
  const Scene observer = rig.join("observer");
  for (Process& process : crowd) process.expect("moved");

  const double begin = now(rig.base.get());
  for (int p = 0; p < process_count; ++p) {
    for (int s = 0; s < scene_count; ++s) {
      for (int i = 0; i < object_count; ++i) {
        const std::string name = std::to_string(p) + "." + std::to_string(s) + "/object " + std::to_string(i);
        const fs_vec3 wanted = place_in_crowd(s, i, steps_of_crowd(seconds)).position;
        ck_assert_msg(eventually([&] { return Got(observer.get(), name.c_str())->pose.position == wanted; }),
                      "'%s' is not where it was moved to", name.c_str());
      }
    }
  }
  std::printf("  %d clients have moved %d objects each, 25 times a second; %.2f s later all were at their last place\n",
              process_count * scene_count, object_count, now(rig.base.get()) - begin);
  fs_client clients[100];
  size_t count = 0;
  OK(fs_scene_get_clients(observer.get(), clients, 100, &count));
  ck_assert_uint_eq(count, static_cast<size_t>(process_count * scene_count) + 2);
  for (size_t i = 0; i < count; ++i) {
    ck_assert_uint_eq(clients[i].refused, 0);
    if (std::strchr(clients[i].name, '.')) ck_assert_uint_eq(clients[i].objects, static_cast<uint32_t>(object_count));
  }
  for (Process& process : crowd) process.stop_saying();
  for (Process& process : crowd) {
    process.expect("over");
    ck_assert_int_eq(process.wait(), 0);
  }
}
END_TEST

int main(int count, char** arguments) {
  if (count > 2 && std::strcmp(arguments[1], "--process") == 0) {
    leave_with_parent();
    run(arguments[2], arguments + 3);
    return EXIT_SUCCESS;
  }
  Suite* suite = suite_create("process");
  tcase_add_loop_test(life::new_case(suite, "deaths"), a_client_dies, 0, std::size(ways));
  life::add_case(suite, "fade", {a_silent_client, the_next_of_its_name});
  life::add_case(suite, "server", {the_server_is_killed, the_server_stands_still});
  life::add_case(suite, "fork", {fork_of_a_client, child_of_the_dead, a_client_starts_a_program});
  life::add_case(suite, "users", {a_server_of_one_user, a_server_of_all_users, somebody_squats});
  life::add_case(suite, "many", {no_descriptors_at_the_client, a_crowd});
  return run_suite(suite);
}
