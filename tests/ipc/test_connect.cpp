// Connecting to a server and losing it: endpoints, who answers there, servers that stop, stall or are killed, forks of
// the client; and what a connected scene has to keep in order by itself. Through the public C contract alone.
#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>

#include <csignal>
#include <cstddef>
#include <functional>
#include <utility>

#include "api/world.h"

using namespace scenes;

// How often this thread has begun to wait: what the library calls for it goes by here.
static thread_local int waits = 0;
extern "C" int ppoll(pollfd* fds, nfds_t count, const timespec* timeout, const sigset_t* signals) {
  if (!timeout || timeout->tv_sec || timeout->tv_nsec) ++waits;
  timespec rest = timeout ? *timeout : timespec{};
  return static_cast<int>(syscall(SYS_ppoll, fds, count, timeout ? &rest : nullptr, signals, 8));
}
extern "C" int nanosleep(const timespec* time, timespec* rest) {
  ++waits;
  return static_cast<int>(syscall(SYS_nanosleep, time, rest));
}

static fs_status try_connect(const std::string& endpoint, const char* client = "me") {
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(endpoint.c_str(), client, &scene);
  ck_assert((scene != nullptr) == (status == FS_OK));
  fs_scene_destroy(scene);
  return status;
}

static size_t open_descriptors() {
  size_t count = 0;
  DIR* folder = opendir("/proc/self/fd");
  while (readdir(folder)) ++count;
  closedir(folder);
  return count;
}

// ------------------------------------------------------------------------------------------------------- connecting

START_TEST(endpoints) {
  const std::string name = new_endpoint();
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, try_connect(name), name.c_str() + 4);
  EXPECT(FS_ERROR_NOT_FOUND, try_connect(name + "?timeout=0"));
  EXPECT(FS_ERROR_NOT_FOUND, try_connect(name + "?timeout=0.05"));
  EXPECT(FS_ERROR_NOT_FOUND, try_connect(name + "?user=1&timeout=0"));
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, try_connect("dds:0"), "dds:0");
  for (const char* bad : {"", "lab", "tcp:lab", "shm:", "shm:a/b", "shm:a?timeout", "shm:a?timeout=",
                          "shm:a?timeout=-1", "shm:a?timeout=nan", "shm:a?timeout=1&timeout=2",
                          "shm:a?user=nobody-here", "shm:a?user=", "shm:a?color=red"}) {
    EXPECT(FS_ERROR_INVALID, try_connect(bad));
  }
  EXPECT(FS_ERROR_INVALID, try_connect("shm:" + std::string(65, 'a')));
  EXPECT_SENTENCE(FS_ERROR_INVALID, try_connect(name, "server"), "server");
  for (const char* bad : {"", "a/b", "a\n", "1234567890123456789012345678901234567890123456789012345678901234"}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, try_connect(name, bad), "client_name");
  }
  const ServerRig rig;
  OK(try_connect(rig.endpoint));
  OK(try_connect(rig.endpoint + "?timeout=1"));
  OK(try_connect(rig.endpoint + "?user=" + std::to_string(geteuid())));
  EXPECT(FS_ERROR_NOT_FOUND, try_connect(rig.endpoint + "?user=" + std::to_string(geteuid() + 1)));
}
END_TEST

START_TEST(a_name_is_free_again) {  // at once
  const ServerRig rig;
  for (int i = 0; i < 50; ++i) {
    const Scene me = rig.join("me");
    EXPECT_SENTENCE(FS_ERROR_EXISTS, try_connect(rig.endpoint), "me");
  }
}
END_TEST

// What answers at an endpoint without being a server: f gets each socket that comes.
class Impostor {
 public:
  const std::string endpoint = new_endpoint();

  explicit Impostor(std::function<void(int)> f) : f_(std::move(f)) {
    const std::string name = "forceserver/" + std::to_string(geteuid()) + "/" + endpoint.substr(4);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data(), name.size());
    listener_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    ck_assert_int_eq(bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    ck_assert_int_eq(listen(listener_, 4), 0);
    thread_ = std::thread([this] {
      for (int s; (s = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC)) >= 0; close(s)) f_(s);
    });
  }
  ~Impostor() {
    shutdown(listener_, SHUT_RDWR);
    thread_.join();
    close(listener_);
  }

 private:
  std::function<void(int)> f_;
  int listener_;
  std::thread thread_;
};

START_TEST(no_server_at_all) {
  const size_t before = open_descriptors();
  {
    const Impostor silent([](int s) {
      char hello[4096];
      while (recv(s, hello, sizeof hello, 0) > 0) continue;
    });
    EXPECT_SENTENCE(FS_ERROR_TIMEOUT, try_connect(silent.endpoint + "?timeout=0.1"), "0.1");
  }
  {
    const Impostor nonsense([](int s) {
      char hello[4096];
      const char text[] = "HTTP/1.1 400 Bad Request";
      (void)!recv(s, hello, sizeof hello, 0);
      (void)!send(s, text, sizeof text, MSG_NOSIGNAL);
    });
    EXPECT(FS_ERROR_VERSION, try_connect(nonsense.endpoint));
    EXPECT(FS_ERROR_VERSION, try_connect(nonsense.endpoint));
  }
  {  // as a server that stops just then
    std::atomic<int> came{0};
    const Impostor rude([&](int) { ++came; });
    EXPECT(FS_ERROR_FULL, try_connect(rude.endpoint));
    ck_assert_int_gt(came, 1);
  }
  ck_assert_uint_eq(open_descriptors(), before);
}
END_TEST

START_TEST(no_descriptor_is_left) {
  const ServerRig rig;
  const size_t before = open_descriptors();
  for (int i = 0; i < 20; ++i) {
    const Scene me = rig.join("me");
    const Shape shape = make_mesh(box_mesh({0.01, 0.02, 0.03}));
    fs_object o = fs_object_init("box", FS_PRIMITIVE_MESH);
    o.shape = shape.get();
    set(me, o);
    Got(me.get(), "box");
    reports_of(me.get());
  }
  ck_assert(eventually([&] { return open_descriptors() == before; }));  // the server's go a little later
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- losing it

// Every call that asks the server, or changes anything.
static std::vector<std::pair<const char*, std::function<fs_status()>>> calls(fs_scene* scene) {
  static const fs_object o = spring("x");
  static const fs_pose pose{};
  static const fs_frame frame = fs_frame_init();
  static const fs_vec3 point{};
  static size_t count;
  return {
      {"set", [=] { return fs_object_set(scene, &o); }},
      {"get", [=] {
         fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
         return fs_object_get(scene, "a", &out);
       }},
      {"change", [=] { return fs_object_change(scene, &o, 1); }},
      {"move", [=] { return fs_object_move(scene, "a", &pose, nullptr, FS_NOW); }},
      {"remove", [=] { return fs_object_remove(scene, "a"); }},
      {"clear", [=] { return fs_scene_clear(scene); }},
      {"begin", [=] { return fs_scene_begin(scene); }},
      {"commit", [=] { return fs_scene_commit(scene); }},
      {"cancel", [=] { return fs_scene_cancel(scene); }},
      {"sync", [=] { return fs_scene_sync(scene, long_enough); }},
      {"set_frame", [=] { return fs_scene_set_frame(scene, &frame); }},
      {"get_frame", [=] {
         fs_frame out;
         return fs_scene_get_frame(scene, nullptr, &out);
       }},
      {"set_clutch", [=] { return fs_scene_set_clutch(scene, true); }},
      {"set_tool", [=] { return fs_scene_set_tool(scene, &point, 1); }},
      {"get_tool", [=] { return fs_scene_get_tool(scene, nullptr, 0, &count); }},
      {"set_tool_radius", [=] { return fs_scene_set_tool_radius(scene, 0); }},
      {"set_accuracy", [=] { return fs_scene_set_accuracy(scene, 1); }},
      {"set_max_stiffness", [=] { return fs_scene_set_max_stiffness(scene, 0); }},
      {"get_time", [=] {
         double out;
         return fs_scene_get_time(scene, &out);
       }},
      {"reports", [=] { return fs_scene_get_reports(scene, nullptr, 0, &count); }},
      {"motions", [=] { return fs_scene_get_motions(scene, nullptr, nullptr, 0, &count); }},
      {"view", [=] {
         fs_view out;
         return fs_scene_get_view(scene, nullptr, &out);
       }},
      {"report", [=] {
         fs_report out;
         return fs_scene_get_report(scene, "a", &out);
       }},
      {"hand", [=] { return fs_scene_get_hand(scene, nullptr, nullptr, nullptr); }},
      {"stats", [=] {
         fs_servo_stats out = fs_servo_stats_init();
         return fs_scene_get_servo_stats(scene, &out);
       }},
      {"device", [=] {
         fs_device_info out = fs_device_info_init();
         return fs_scene_get_device_info(scene, &out);
       }},
      {"clients", [=] { return fs_scene_get_clients(scene, nullptr, 0, &count); }},
      {"views", [=] { return fs_scene_get_views(scene, nullptr, 0, &count); }},
      {"record", [=] { return fs_scene_get_record(scene, 0, nullptr, 0, &count); }},
      {"tool", [=] {
         fs_tool* out = nullptr;
         return fs_tool_create(scene, nullptr, 0, &out);
       }},
      {"field", [=] { return fs_evaluate_field(scene, nullptr, FS_NOW, nullptr, 0, nullptr); }},
      {"save", [=] { return fs_scene_save(scene, "/nonexistent/scene.json"); }},
  };
}

// All calls but the events, which come to their end first.
static void expect_lost(fs_scene* scene, const char* word) {
  for (const auto& [name, call] : calls(scene)) {
    const fs_status status = call();
    ck_assert_msg(status == FS_ERROR_DISCONNECTED && std::strstr(fs_last_error(), word), "%s: %s (%s)", name,
                  fs_status_name(status), fs_last_error());
  }
}

START_TEST(a_server_that_stops) {
  ServerRig rig;
  const Scene me = rig.join("me"), other = rig.join("other");
  set(me, spring("a"));
  rig.settle(me.get());
  const Tool tool = make_tool(me.get());
  const fs_pose pose = at(0.1, 0, 0);
  OK(fs_object_move(me.get(), "a", &pose, nullptr, FS_NOW));
  OK(fs_scene_begin(other.get()));
  std::thread waiting([&] { EXPECT(FS_ERROR_DISCONNECTED, fs_scene_sync(me.get(), 60)); });  // nobody steps
  wait_a_little(0.05);
  rig.server.reset();
  waiting.join();
  expect_lost(me.get(), "gone");
  expect_lost(other.get(), "gone");
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{10, 0, 0}), 1e-12);  // a tool goes on
  // The events that were there, then the end.
  next_event(me.get(), FS_EVENT_READY);
  const fs_event end = next_event(me.get(), FS_EVENT_DISCONNECTED);
  ck_assert_int_eq(end.status, FS_ERROR_DISCONNECTED);
  ck_assert_uint_gt(std::strlen(end.text), 10);
  fs_event event;
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_next_event(me.get(), 0, &event));
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_next_event(me.get(), long_enough, &event));
  // The next server is another one.
  rig.server = start_server(rig.servo.get(), rig.endpoint, fs_server_options_init());
  expect_lost(me.get(), "gone");
  OK(try_connect(rig.endpoint));
}
END_TEST

START_TEST(an_end_that_is_waited_for) {
  ServerRig rig;
  const Scene me = rig.join("me");
  std::thread stopper([&] {
    wait_a_little(0.02);
    rig.server.reset();
  });
  next_event(me.get(), FS_EVENT_DISCONNECTED);
  stopper.join();
}
END_TEST

// A server in a process of its own: this program, called again.
class ServerProcess {
 public:
  const std::string endpoint = new_endpoint();

  ServerProcess() {
    int ends[2];
    ck_assert_int_eq(pipe2(ends, O_CLOEXEC), 0);
    process_ = fork();
    if (process_ == 0) {
      const std::string end = std::to_string(dup(ends[1]));
      execl("/proc/self/exe", "test_connect", "--server", endpoint.c_str(), end.c_str(), nullptr);
      _exit(1);
    }
    close(ends[1]);
    char ready;
    ck_assert_int_eq(read(ends[0], &ready, 1), 1);
    close(ends[0]);
  }
  ~ServerProcess() { signal(SIGKILL); }
  void signal(int number) {
    if (process_ <= 0) return;
    kill(process_, number);
    if (number == SIGSTOP) waitpid(process_, nullptr, WUNTRACED);
    if (number == SIGKILL) waitpid(std::exchange(process_, 0), nullptr, 0);
  }

 private:
  pid_t process_;
};

// What it runs, until it is killed.
static int serve(const char* endpoint, int ready) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:");
  fs_servo_options options = fs_servo_options_init();
  options.priority = -1;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  const Server server = start_server(servo.get(), endpoint, fs_server_options_init());
  const char word = 1;
  if (write(ready, &word, 1) != 1) return 1;
  for (;;) pause();
}

START_TEST(a_server_that_is_killed) {
  ServerProcess process;
  const Scene me = connect(process.endpoint, "me");
  set(me, spring("a"));
  OK(fs_scene_sync(me.get(), long_enough));
  std::thread waiting([&] { next_event(me.get(), FS_EVENT_DISCONNECTED); });
  process.signal(SIGKILL);
  waiting.join();
  expect_lost(me.get(), "gone");
  EXPECT(FS_ERROR_NOT_FOUND, try_connect(process.endpoint));
}
END_TEST

// Stalled, it is waited for a while; then it goes on as if nothing had been.
START_TEST(a_server_that_stalls) {
  ServerProcess process;
  const Scene me = connect(process.endpoint, "me");
  set(me, spring("a"));
  OK(fs_scene_sync(me.get(), long_enough));
  process.signal(SIGSTOP);
  wait_a_little(0.15);  // longer than a heartbeat
  fs_frame frame;
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, fs_scene_get_frame(me.get(), nullptr, &frame), "1 s");
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, fs_scene_sync(me.get(), 0.05), "0.05");
  const fs_pose pose = at(0.25, 0, 0);
  OK(fs_object_move(me.get(), "a", &pose, nullptr, FS_NOW));
  OK(fs_scene_get_hand(me.get(), nullptr, nullptr, nullptr));
  set(me, spring("b"));  // sent without waiting
  EXPECT_VECTOR(Got(me.get(), "a")->pose.position, pose.position, 0);
  process.signal(SIGCONT);
  OK(fs_scene_sync(me.get(), long_enough));
  OK(fs_scene_get_frame(me.get(), nullptr, &frame));  // and not the answer to an old question
  ck_assert_double_eq(frame.scale, 1);
  const Scene other = connect(process.endpoint, "other");
  EXPECT_VECTOR(Got(other.get(), "me/a")->pose.position, pose.position, 0);
  ck_assert(has(other.get(), "me/b"));
}
END_TEST

// Calls without a time, and with a time of 0, do not wait for a server that stands still: whatever was on its way. Only a group
// that begins after an edit by another client waits for a moment.
START_TEST(who_does_not_wait) {
  ServerProcess process;
  const Scene me = connect(process.endpoint, "me"), other = connect(process.endpoint, "other");
  set(me, spring("a"));
  set(other, spring("a"));
  OK(fs_scene_sync(me.get(), long_enough));
  const fs_pose pose = at(0.25, 0, 0);
  const auto expect_no_wait = [&](const char* when, bool is_edited) {
    const auto none = [&](const char* what, fs_status wanted, const std::function<fs_status()>& call) {
      waits = 0;
      const fs_status status = call();
      ck_assert_msg(status == wanted, "%s, %s: %s", when, what, fs_status_name(status));
      ck_assert_msg(waits == 0, "%s, %s: it waited %d times", when, what, waits);
    };
    fs_event event;
    none("move", FS_OK, [&] { return fs_object_move(me.get(), "a", &pose, nullptr, FS_NOW); });
    none("sync", FS_ERROR_TIMEOUT, [&] { return fs_scene_sync(me.get(), 0); });
    none("event", FS_OK, [&] { return fs_scene_next_event(me.get(), 0, &event); });
    if (is_edited) {  // it asks what there is, in vain, and begins all the same
      const auto begin = std::chrono::steady_clock::now();
      waits = 0;
      OK(fs_scene_begin(me.get()));
      ck_assert_int_gt(waits, 0);
      const double waited = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      ck_assert_msg(waited >= 0.1 && waited < 0.9, "%s: it waited %g s, and must wait 0.1 s at most", when, waited);
    } else {
      none("begin", FS_OK, [&] { return fs_scene_begin(me.get()); });
    }
    none("move in a group", FS_OK, [&] { return fs_object_move(me.get(), "a", &pose, nullptr, FS_NOW); });
    none("cancel", FS_OK, [&] { return fs_scene_cancel(me.get()); });
    none("hand", FS_OK, [&] { return fs_scene_get_hand(me.get(), nullptr, nullptr, nullptr); });
  };
  process.signal(SIGSTOP);
  expect_no_wait("just stopped", false);
  process.signal(SIGCONT);
  OK(fs_scene_sync(me.get(), long_enough));

  OK(fs_object_move(other.get(), "me/a", &pose, nullptr, FS_NOW));  // me has not asked what became of it
  process.signal(SIGSTOP);
  const fs_object b = spring("b");
  waits = 0;
  OK(fs_object_set(me.get(), &b));
  ck_assert_int_eq(waits, 0);
  expect_no_wait("edited by another", true);
  waits = 0;
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, fs_object_move(me.get(), "other/a", &pose, nullptr, FS_NOW), "1 s");
  ck_assert_int_gt(waits, 0);  // so waits are counted
  process.signal(SIGCONT);
  OK(fs_scene_sync(me.get(), long_enough));

  // A group of many times what the socket holds is sent as a whole, without waiting.
  process.signal(SIGSTOP);
  OK(fs_scene_begin(me.get()));
  for (int i = 0; i < 3000; ++i) {
    fs_object o = spring(("n" + std::to_string(i)).c_str());
    o.enabled = false;  // so many that are felt may cost more than a tick has time for: then the server lets go of the client
    OK(fs_object_set(me.get(), &o));
  }
  waits = 0;
  OK(fs_scene_commit(me.get()));
  ck_assert_int_eq(waits, 0);
  // And where there is no room it stays open; nothing of it is sent.
  fs_status status = FS_OK;
  while (status == FS_OK) status = fs_object_set(me.get(), &b);
  ck_assert_int_eq(status, FS_ERROR_TIMEOUT);
  expect_no_wait("no room", false);
  OK(fs_scene_begin(me.get()));
  OK(fs_object_remove(me.get(), "a"));
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, fs_scene_commit(me.get()), "1 s");
  EXPECT(FS_ERROR_STATE, fs_scene_begin(me.get()));
  ck_assert(!has(me.get(), "a"));
  process.signal(SIGCONT);
  OK(fs_scene_cancel(me.get()));
  OK(fs_scene_sync(me.get(), long_enough));
  ck_assert(has(me.get(), "a") && has(other.get(), "me/a") && has(other.get(), "me/n2999"));
}
END_TEST

// A thread that waits for the server holds up no other thread of the scene.
START_TEST(who_waits_holds_no_lock) {
  ServerProcess process;
  const Scene me = connect(process.endpoint, "me");
  set(me, spring("a"));
  OK(fs_scene_sync(me.get(), long_enough));
  process.signal(SIGSTOP);
  std::atomic<int> began{0}, ended{0};
  std::vector<std::thread> asking;
  for (int i = 0; i < 4; ++i) {
    asking.emplace_back([&] {
      ++began;
      fs_report report;
      while (fs_scene_get_report(me.get(), "a", &report) == FS_ERROR_TIMEOUT && ended == 0) {
      }
    });
  }
  ck_assert(eventually([&] { return began == 4; }));
  const fs_pose pose = at(0.25, 0, 0);
  waits = 0;
  for (int i = 0; i < 2000; ++i) OK(fs_object_move(me.get(), "a", &pose, nullptr, FS_NOW));
  ck_assert_int_eq(waits, 0);
  ended = 1;
  process.signal(SIGCONT);
  for (std::thread& thread : asking) thread.join();
}
END_TEST

// Signals make no call fail, nor end a wait early.
START_TEST(signals) {
  static std::atomic<int> came{0};
  ServerProcess process;
  struct sigaction action {};
  action.sa_handler = [](int) { ++came; };
  sigaction(SIGALRM, &action, nullptr);
  const itimerval often{{0, 500}, {0, 500}}, never{};
  setitimer(ITIMER_REAL, &often, nullptr);
  for (int i = 0; i < 40; ++i) {
    const Scene me = connect(process.endpoint, ("c" + std::to_string(i)).c_str());
    set(me, spring("a"));
    OK(fs_scene_sync(me.get(), long_enough));
    fs_report report;
    OK(fs_scene_get_report(me.get(), "a", &report));
    Got(me.get(), "a");
  }
  {  // also where there is no room for a while
    const Scene me = connect(process.endpoint, "me");
    process.signal(SIGSTOP);
    const fs_object a = spring("a");
    fs_status status = FS_OK;
    while (status == FS_OK) status = fs_object_set(me.get(), &a);
    ck_assert_int_eq(status, FS_ERROR_TIMEOUT);
    process.signal(SIGCONT);
    OK(fs_scene_sync(me.get(), long_enough));
  }
  setitimer(ITIMER_REAL, &never, nullptr);
  ck_assert_int_gt(came, 0);
}
END_TEST

// As long as the server takes nothing, changes find no room some time: then they fail, with nothing changed.
START_TEST(no_room) {
  ServerProcess process;
  const Scene me = connect(process.endpoint, "me");
  process.signal(SIGSTOP);
  fs_object o = spring("a");
  fs_status status = FS_OK;
  int count = 0;
  for (; status == FS_OK && count < 100000; ++count) {
    o.front.gain = count + 1;
    status = fs_object_set(me.get(), &o);
  }
  EXPECT(FS_ERROR_TIMEOUT, status);
  ck_assert_double_eq(Got(me.get(), "a")->front.gain, count - 1);
  process.signal(SIGCONT);
  OK(fs_scene_sync(me.get(), long_enough));
  const Scene other = connect(process.endpoint, "other");
  ck_assert_double_eq(Got(other.get(), "me/a")->front.gain, count - 1);
  o.front.gain = 7;
  OK(fs_object_set(me.get(), &o));
  OK(fs_scene_sync(me.get(), long_enough));
  ck_assert_double_eq(Got(other.get(), "me/a")->front.gain, 7);
}
END_TEST

START_TEST(forks) {
  ServerRig rig;
  const Scene me = rig.join("me");
  set(me, spring("a"));
  rig.settle(me.get());
  const pid_t child = fork();
  if (child == 0) {
    int bad = 0;
    for (const auto& [name, call] : calls(me.get())) {
      bad += call() != FS_ERROR_DISCONNECTED || !std::strstr(fs_last_error(), "forked");
    }
    fs_event event;
    bad += fs_scene_next_event(me.get(), long_enough, &event) != FS_ERROR_DISCONNECTED;
    fs_scene_destroy(me.get());
    _exit(bad);
  }
  int status = -1;
  waitpid(child, &status, 0);
  ck_assert_msg(WIFEXITED(status) && WEXITSTATUS(status) == 0, "in the child: 0x%x", status);
  const fs_pose pose = at(0.1, 0, 0);  // the parent's goes on
  const fs_twist still{};
  OK(fs_object_move(me.get(), "a", &pose, &still, FS_NOW));
  rig.settle(me.get());
  EXPECT_VECTOR(rig.force_at({0, 0, 0}), (fs_vec3{10, 0, 0}), 1e-12);
}
END_TEST

// ------------------------------------------------------------------------------------------------ what it has to keep

START_TEST(a_group_that_is_too_long) {
  fs_server_options options = fs_server_options_init();
  options.max_objects = 1;
  ServerRig rig(options);
  const Scene me = rig.join("me");
  OK(fs_scene_begin(me.get()));
  fs_object o = spring("a");
  fs_status status = FS_OK;
  int count = 0;
  for (; status == FS_OK && count < 1000; ++count) {
    o.front.gain = count + 1;
    status = fs_object_set(me.get(), &o);
  }
  EXPECT(FS_ERROR_FULL, status);
  ck_assert_int_eq(count, 4 * 1 + 64 + 1);
  OK(fs_scene_commit(me.get()));
  rig.settle(me.get());
  EXPECT_VECTOR(rig.force_at({-1, 0, 0}), (fs_vec3{68, 0, 0}), 1e-12);
}
END_TEST

// Moves come to the server also where it sleeps; and to the tools of this process, those before them as well.
START_TEST(moves_wake_and_are_known_here) {
  ServerRig rig;
  const Scene me = rig.join("me");
  set(me, spring("a"));
  fs_object mortal = spring("b", {}, 0.5);
  mortal.lifetime = 1e6;
  set(me, mortal);
  rig.settle(me.get());
  for (int round = 0; round < 4; ++round) {
    wait_a_little(0.1);  // until it sleeps
    const fs_pose pose = at(0.1 * (round + 1), 0, 0);
    const fs_twist still{};
    for (const char* name : {"a", "b"}) OK(fs_object_move(me.get(), name, &pose, &still, FS_NOW));
    ck_assert(eventually([&] {
      rig.step();
      return std::fabs(rig.fake.written.force.x - 100.5 * pose.position.x) < 1e-9;
    }));
    for (const char* name : {"a", "b"}) EXPECT_VECTOR(Got(me.get(), name)->pose.position, pose.position, 0);
  }
  const fs_pose here = at(0.01, 0, 0), there = at(0.02, 0, 0);
  OK(fs_object_move(me.get(), "a", &here, nullptr, FS_NOW));
  const Tool tool = make_tool(me.get());
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{1.2, 0, 0}), 1e-12);
  OK(fs_object_move(me.get(), "a", &there, nullptr, FS_NOW));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{2.2, 0, 0}), 1e-12);
  OK(fs_scene_begin(me.get()));
  OK(fs_object_move(me.get(), "a", &here, nullptr, FS_NOW));
  OK(fs_object_remove(me.get(), "b"));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{2.2, 0, 0}), 1e-12);
  OK(fs_scene_commit(me.get()));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{1, 0, 0}), 1e-12);
  set(me, spring("a", {0, 0.5, 0}));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{0, 50, 0}), 1e-12);
  OK(fs_scene_clear(me.get()));
  EXPECT_VECTOR(force_at(tool.get(), {0, 0, 0}), (fs_vec3{}), 0);
}
END_TEST

// A mesh that is large is felt when the server has built it; calls meanwhile go on, and what was first stays first.
START_TEST(a_large_mesh) {
  ServerRig rig;
  const Scene me = rig.join("me");
  const Shape shape = make_mesh(sphere_mesh(0.05, is_sanitized ? 40'000 : 200'000));
  fs_object o = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  o.shape = shape.get();
  o.front = attract(100, 1000);
  set(me, o);
  const fs_pose pose = at(0.05, 0, 0);
  const fs_twist still{};
  OK(fs_object_move(me.get(), "mesh", &pose, &still, FS_NOW));  // of what is not there yet
  set(me, spring("a", {0, 0.5, 0}, 1));
  o.front.gain = 200;
  OK(fs_object_change(me.get(), &o, FS_PART_PROFILES));
  ck_assert_double_eq(Got(me.get(), "mesh")->front.gain, 200);
  EXPECT_VECTOR(Got(me.get(), "mesh")->pose.position, pose.position, 0);
  rig.settle(me.get());
  next_event(me.get(), FS_EVENT_READY);
  EXPECT_VECTOR(rig.force_at({0.2, 0, 0}), (fs_vec3{-200 * 0.1 - 0.2, 0.5, 0}), 0.01);
}
END_TEST

int main(int argc, char** argv) {
  if (argc == 4 && std::string(argv[1]) == "--server") return serve(argv[2], std::atoi(argv[3]));
  Suite* suite = suite_create("connect");
  add_once(suite, "connecting", {endpoints, a_name_is_free_again, no_server_at_all,
                                 no_descriptor_is_left});
  add_once(suite, "losing", {a_server_that_stops, an_end_that_is_waited_for, a_server_that_is_killed,
                             a_server_that_stalls, no_room, forks});
  add_once(suite, "waiting", {who_does_not_wait, who_waits_holds_no_lock, signals});
  add_once(suite, "keeping", {a_group_that_is_too_long, moves_wake_and_are_known_here, a_large_mesh});
  return run_suite(suite);
}
