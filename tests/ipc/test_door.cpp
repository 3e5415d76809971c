// Who connects to the server: strangers, impostors, too many clients, and clients when no descriptors are left.
// Whatever they do, a connected client is not disturbed, and a new client is accepted.
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <ctime>

#include "ipc/rig.h"
#include "servo/servo.h"

using namespace hostile;
using fs::Descriptor;

extern char** environ;

// ------------------------------------------------------------------------------------------------------------- hello

START_TEST(another_version_of_the_wire) {
  Rig rig;
  for (const uint32_t wire : {0u, fs::wire::version + 1, ~0u}) {
    RawClient client = rig.stranger();
    fs::wire::Hello hello = RawClient::hello("other");
    hello.wire = wire;
    const RawClient::Greeting greeting = client.greet(hello);
    ck_assert(greeting.is_answered);
    ck_assert_int_eq(greeting.status, FS_ERROR_VERSION);
    ck_assert_uint_eq(greeting.magic, fs::wire::magic);
    ck_assert_uint_eq(greeting.wire, fs::wire::version);
    ck_assert_str_eq(greeting.version.c_str(), fs_version());
    // Both versions of the wire, and of the libraries.
    const std::string theirs = "version " + std::to_string(wire) + " of the wire";
    const std::string ours = "version " + std::to_string(fs::wire::version) + ':';
    for (const char* part : {"version test", theirs.c_str(), fs_version(), ours.c_str()}) {
      ck_assert_msg(std::strstr(greeting.text.c_str(), part), "'%s' is not in: %s", part, greeting.text.c_str());
    }
    rig.expect_dropped(client, "another version of the wire");
  }
  rig.check_honest();
}
END_TEST

// The sizes of the records that grow: what no version has is not taken.
START_TEST(hostile_sizes) {
  Rig rig;
  const fs::wire::Sizes own = fs::own_sizes(), first = fs::first_sizes();
  for (uint32_t fs::wire::Sizes::*member : {&fs::wire::Sizes::object, &fs::wire::Sizes::stats, &fs::wire::Sizes::device}) {
    for (const uint32_t size : {0u, 1u, 8u, first.*member - 8, own.*member + 1, own.*member + 4, 4104u, 1u << 31, ~7u, ~0u}) {
      RawClient client = rig.stranger();
      fs::wire::Hello hello = RawClient::hello("other");
      hello.sizes.*member = size;
      ck_assert(!client.greet(hello).is_answered);
      rig.expect_dropped(client, "sizes that no version has");
    }
  }
  rig.check_honest();
  // A client that knows more is served; a message as long as it would like is not.
  RawClient later(rig.endpoint);
  fs::wire::Hello hello = RawClient::hello("later");
  hello.sizes.object = 4096;
  hello.sizes.stats += 8;
  std::memset(hello.sizes.later, 0xff, sizeof hello.sizes.later);
  ck_assert_int_eq(later.greet(hello).status, FS_OK);
  later.set(0, fs_object_init("a", FS_PRIMITIVE_POINT));
  ck_assert_int_eq(rig.sync(later), FS_OK);
  const auto reply = later.reply_of(later.send(fs::wire::type_stats));
  ck_assert(reply && reply->body.size() == sizeof(fs_servo_stats));
  std::vector<std::byte> set(sizeof(fs::wire::Set) + 8);
  later.send(fs::wire::type_set, std::span<const std::byte>(set));
  rig.expect_dropped(later, "a record that is longer than both ends know");
  rig.check_honest();
}
END_TEST

// A message that is not a Hello is not answered: whoever sends it is disconnected at once, and not only after the two seconds in
// which a stranger may say nothing.
START_TEST(no_hello) {
  Rig rig;
  int tries = 0, quick = 0;
  const fs::wire::Hello good = RawClient::hello("other");
  const auto expect_no_answer = [&](std::span<const std::byte> bytes, const char* why) {
    RawClient client = rig.stranger();
    const double begin = fs::steady_now();
    ck_assert_msg(!client.greet_with(bytes).is_answered, "answered: %s", why);
    rig.expect_dropped(client, why);
    quick += fs::steady_now() - begin < 1;
    ck_assert_msg(++tries < 5 || quick > 0, "disconnected late: %s", why);  // a busy machine may make some late
  };
  for (size_t size = 0; size < sizeof good; ++size) expect_no_answer(fs::bytes_of(&good, 1).first(size), "too short");
  fs::wire::Hello wrong = good;
  for (int bit = 0; bit < 64; ++bit) {
    wrong.magic = fs::wire::magic ^ uint64_t{1} << bit;
    expect_no_answer(fs::bytes_of(&wrong, 1), "wrong magic");
  }
  std::vector<std::byte> large(100'000);
  std::memcpy(large.data(), &good, sizeof good);
  expect_no_answer(large, "too long for any message");
  scenes::Random random(1);
  for (int i = 0; i < 100; ++i) {
    std::vector<std::byte> bytes(1 + random.below(300));
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random.bits());
    expect_no_answer(bytes, "garbage");
  }
  rig.check_honest();

  // A longer Hello comes from a later library; its beginning is understood.
  RawClient later = rig.stranger();
  ck_assert_int_eq(later.greet_with(std::span(large).first(sizeof good + 8)).status, FS_OK);
  rig.check_honest();
}
END_TEST

// The first message comes with descriptors that it should not have.
START_TEST(hello_with_descriptors) {
  Rig rig;
  const size_t before = open_files();
  {
    const int files[20] = {};  // standard input, twenty times
    for (const size_t count : {1, 2, 16, 20}) {
      RawClient client = rig.stranger();
      const fs::wire::Hello hello = RawClient::hello("other");
      client.send_bytes(fs::bytes_of(&hello, 1), std::span(files).first(count));
      ck_assert(rig.until([&] { return fs::wait_for(client.socket, false, 1e-3); }));
    }
    rig.check_honest();
  }
  ck_assert(rig.until([&] { return open_files() == before; }));
}
END_TEST

START_TEST(bad_names) {
  Rig rig;
  const std::string bad[] = {"",  "server",  std::string(64, 'x'), std::string(127, 'x'), "a/b",    "/",        "bell\a",
                             "\x7f", "\xc2\x80", "\xff",  "\xc0\xaf", "\xed\xa0\x80", "caf\xc3", "\xf5\x80\x80\x80"};
  for (const std::string& name : bad) {
    RawClient client = rig.stranger();
    const RawClient::Greeting greeting = client.greet(RawClient::hello(name));
    ck_assert(greeting.is_answered);
    ck_assert_int_eq(greeting.status, FS_ERROR_INVALID);
    ck_assert_msg(greeting.text.find("client_name") != std::string::npos, "client_name is not in: %s",
                  greeting.text.c_str());
    rig.expect_dropped(client, "a bad name");
  }
  fs::wire::Hello endless = RawClient::hello("x");
  std::memset(endless.client, 'x', sizeof endless.client);
  std::memset(endless.version, 'x', sizeof endless.version);
  RawClient client = rig.stranger();
  ck_assert_int_eq(client.greet(endless).status, FS_ERROR_INVALID);
  RawClient good = rig.join("caf\xc3\xa9");
  rig.check_honest();
}
END_TEST

// -------------------------------------------------------------------------------------------------------------- names

START_TEST(two_of_one_name) {
  Rig rig;
  for (int i = 0; i < 20; ++i) {
    RawClient first = rig.join("twin");
    RawClient second = rig.stranger();
    const RawClient::Greeting greeting = second.greet(RawClient::hello("twin"));
    ck_assert_int_eq(greeting.status, FS_ERROR_EXISTS);
    const std::string process = std::to_string(getpid());
    ck_assert_msg(greeting.text.find(process) != std::string::npos, "%s is not in: %s", process.c_str(),
                  greeting.text.c_str());
    ck_assert(!first.is_dropped());
    // A client leaves and comes again at once.
    first.socket.reset();
    RawClient third = rig.stranger();
    ck_assert_int_eq(third.greet(RawClient::hello("twin")).status, FS_OK);
  }
  rig.check_honest();
}
END_TEST

// This program as another process: it says with a byte that it is there, and stays until it is killed. forks: its child
// has all that it has, as long as the other end of standard input is open.
[[noreturn]] static void stay(bool forks) {
  if (forks && fork() == 0) {
    char byte;
    while (read(STDIN_FILENO, &byte, 1) > 0) {
    }
    _exit(0);
  }
  [[maybe_unused]] const ssize_t said = write(STDOUT_FILENO, "", 1);
  for (;;) pause();
}
[[noreturn]] static void be_a_client(const char* endpoint, const char* name, bool forks) {
  RawClient client(endpoint);
  client.join(name);
  stay(forks);
}
[[noreturn]] static void be_a_server(const char* endpoint) {
  const scenes::Scene scene = scenes::make_scene();
  const scenes::Device device = scenes::open_device("sim:");
  const scenes::Servo servo = scenes::start_servo(scene.get(), device.get(), servo_options(FS_SERVO_THREAD));
  const scenes::Server server = scenes::start_server(servo.get(), endpoint, server_options());
  char byte = 0;
  [[maybe_unused]] const bool told = write(STDOUT_FILENO, &byte, 1) == 1 && read(STDIN_FILENO, &byte, 1) == 1;
  stay(true);
}

struct Other {
  pid_t process = 0;
  Descriptor input, output;  // its standard ones; its child lives as long as its input

  explicit Other(std::vector<std::string> words) {
    int in[2], out[2];
    ck_assert(pipe2(in, O_CLOEXEC) == 0 && pipe2(out, O_CLOEXEC) == 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, in[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
    words.insert(words.begin(), "test_door");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ck_assert_int_eq(posix_spawn(&process, "/proc/self/exe", &actions, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(in[0]);
    close(out[1]);
    input = Descriptor(in[1]);
    output = Descriptor(out[0]);
    hear();
  }
  void hear() {
    char byte;
    ck_assert_msg(read(output.get(), &byte, 1) == 1, "the other process has ended");
  }
  void tell() { ck_assert_int_eq(write(input.get(), "", 1), 1); }
  void kill_it() {
    kill(process, SIGKILL);
    ck_assert_int_eq(waitpid(process, nullptr, 0), process);
    process = 0;
  }
  ~Other() {
    if (process) kill_it();
  }
};

// A name is free at once after the death of its process, even if a child of that process still holds the socket.
START_TEST(name_of_the_dead) {
  Rig rig;
  for (const bool forks : {false, true}) {
    Other bearer({"--client", rig.endpoint, "bearer", forks ? "fork" : ""});
    RawClient early = rig.stranger();
    ck_assert_int_eq(early.greet(RawClient::hello("bearer")).status, FS_ERROR_EXISTS);
    ck_assert_uint_eq(rig.listed("bearer").process, static_cast<uint32_t>(bearer.process));
    bearer.kill_it();
    RawClient heir = rig.stranger();
    ck_assert_int_eq(heir.greet(RawClient::hello("bearer")).status, FS_OK);
    rig.check_honest();
  }
}
END_TEST

// --------------------------------------------------------------------------------------------------------------- forks

// A process that was forked from this one, and only holds what this one had.
struct Child {
  pid_t process;
  Descriptor input;  // it lives as long as this

  // is_clone: without the handlers of pthread_atfork, as a forked process is at its very beginning.
  explicit Child(bool is_clone = false) {
    int pipes[2];
    ck_assert_int_eq(pipe2(pipes, O_CLOEXEC), 0);
    process = is_clone ? static_cast<pid_t>(syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0)) : fork();
    if (process == 0) {
      close(pipes[1]);
      char byte;
      while (read(pipes[0], &byte, 1) > 0) {
      }
      _exit(0);
    }
    close(pipes[0]);
    input = Descriptor(pipes[1]);
  }
  ~Child() {
    input.reset();
    waitpid(process, nullptr, 0);
  }
};

// A forked process has the server's sockets, too: clients that are dropped, or whose server stops, learn of it all the
// same, and the endpoint is free.
START_TEST(server_that_forks) {
  Rig rig;
  RawClient bad = rig.join("bad"), good = rig.join("good");
  const Child child;
  bad.send(777);
  rig.expect_dropped(bad, "an unknown type");
  rig.check_honest();
  rig.stop_server();
  ck_assert(good.is_soon_dropped());
  fs_server* again = nullptr;
  OK(fs_server_start(rig.servo(), rig.endpoint.c_str(), nullptr, &again));
  fs_server_stop(again);
}
END_TEST

// The same before the forked process has run the handler that closes the listener. As the name is still taken, the new server
// listens at a file.
START_TEST(server_that_is_cloned) {
  Rig rig;
  const RawClient good = rig.join("good");
  const Child child(true);
  rig.stop_server();
  ck_assert(good.is_soon_dropped());
  fs_server* again = nullptr;
  OK(fs_server_start(rig.servo(), rig.endpoint.c_str(), nullptr, &again));
  ck_assert(scenes::connect(rig.endpoint, "new") != nullptr);
  fs_server_stop(again);
}
END_TEST

// A server that is killed is lost, even if a process forked from it lives on.
START_TEST(forked_server_is_killed) {
  const std::string endpoint = new_endpoint();
  Other server({"--server", endpoint});
  const scenes::Scene scene = scenes::connect(endpoint, "client");
  fs_state hand;
  OK(fs_scene_get_hand(scene.get(), &hand, nullptr, nullptr));
  server.tell();  // now it forks
  server.hear();
  server.kill_it();
  ck_assert(eventually([&] { return fs_scene_get_hand(scene.get(), &hand, nullptr, nullptr) == FS_ERROR_DISCONNECTED; }));
  // The killed server's name is free.
  Other next({"--server", endpoint});
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- too many

START_TEST(max_clients) {
  fs_server_options options = server_options();
  options.max_clients = 3;
  Rig rig(options);
  RawClient second = rig.join("second"), third = rig.join("third");
  for (int i = 0; i < 10; ++i) {
    RawClient fourth = rig.stranger();
    const RawClient::Greeting greeting = fourth.greet(RawClient::hello("fourth"));
    ck_assert_int_eq(greeting.status, FS_ERROR_FULL);
    ck_assert_msg(greeting.text.find('3') != std::string::npos, "the maximum is not in: %s", greeting.text.c_str());
  }
  // The answer says that a name is taken, whether or not the server is full.
  RawClient other = rig.stranger();
  ck_assert_int_eq(other.greet(RawClient::hello("third")).status, FS_ERROR_EXISTS);
  third.socket.reset();
  ck_assert(rig.until([&] {
    RawClient fourth = rig.stranger();
    return fourth.greet(RawClient::hello("fourth")).status == FS_OK;
  }));
  rig.check_honest();
}
END_TEST

// A process that connects and sends nothing is disconnected.
START_TEST(silent_stranger) {
  Rig rig;
  const size_t before = open_files();
  {
    const RawClient silent = rig.stranger();
    rig.tick(20);
    ck_assert(!silent.is_dropped());
    rig.expect_dropped(silent, "it says nothing");
    rig.check_honest();
  }
  ck_assert(rig.until([&] { return open_files() == before; }));
}
END_TEST

// Many processes that send nothing and connect again as soon as they are disconnected do not keep a client out.
START_TEST(crowd_at_the_door) {
  Rig rig;
  std::atomic<bool> is_over{false};
  std::atomic<int> came{0};
  std::thread crowd([&] {
    std::vector<RawClient> strangers;
    while (!is_over) {
      std::erase_if(strangers, [](const RawClient& stranger) { return stranger.is_dropped(); });
      while (strangers.size() < 150 && !is_over) {
        strangers.emplace_back(rig.endpoint);
        ++came;
      }
      scenes::wait_a_little();
    }
  });
  ck_assert(rig.until([&] { return came > 200; }));
  for (int i = 0; i < 5; ++i) {
    RawClient newcomer = rig.stranger();
    const int tries = newcomer.join("newcomer" + std::to_string(i));
    ck_assert_msg(tries < 200, "let in at the %dth try", tries);
    rig.check_honest();
  }
  is_over = true;
  crowd.join();
}
END_TEST

// Clients that connect, push and leave again and again: the number of scenes that fade out is bounded, too.
START_TEST(coming_and_going) {
  fs_server_options options = server_options();
  options.max_clients = 4;
  options.lease = 1e6;  // their objects go on pushing, as long as there is room
  Rig rig(options);
  rig.others = 100;
  int came = 0, refused = 0;
  for (int i = 0; i < 80; ++i) {
    RawClient client = rig.stranger();
    const RawClient::Greeting greeting = client.greet(RawClient::hello("guest"));
    if (greeting.status == FS_OK) {
      ++came;
      client.set(0, push("push", 1));
      ck_assert_int_eq(rig.sync(client), FS_OK);
    } else {
      ck_assert_int_eq(greeting.status, FS_ERROR_FULL);
      ++refused;
    }
    ck_assert_uint_le(rig.servo()->channels().count(), 4 + 32);  // the maximum that push at the same time
    rig.tick();
  }
  ck_assert_int_ge(came, 4 + 32 - 1);
  ck_assert_int_ge(refused, 1);  // then the leases end, so other clients can connect
  ck_assert_int_eq(came + refused, 80);
  rig.check_honest();
}
END_TEST

// -------------------------------------------------------------------------------------------------- no descriptors left

// The processor time of a thread of this process, by its name, s.
static pid_t thread_named(const char* name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream comm(task.path() / "comm");
    std::string found;
    if (std::getline(comm, found) && found == name) return std::stoi(task.path().filename());
  }
  ck_abort_msg("no thread '%s'", name);
  return 0;
}
static double processor_time(pid_t thread) {
  timespec used{};
  clock_gettime(static_cast<clockid_t>(~static_cast<unsigned>(thread) << 3 | 6), &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

// Sockets that are made before all descriptors are taken, to be connected afterwards.
struct Unconnected {
  std::vector<Descriptor> sockets;
  explicit Unconnected(int count) {
    for (int i = 0; i < count; ++i) sockets.emplace_back(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  }
  void connect_to(const std::string& endpoint) {
    const std::string address = fs::user_address(geteuid(), endpoint.substr(4));
    sockaddr_un place{};
    place.sun_family = AF_UNIX;
    std::memcpy(place.sun_path + 1, address.data(), address.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + address.size());
    for (const Descriptor& s : sockets) {
      ck_assert_int_eq(::connect(s.get(), reinterpret_cast<const sockaddr*>(&place), size), 0);
    }
  }
};

// Takes all free descriptors, and goes on taking those that become free.
struct Greedy {
  std::vector<Descriptor> taken;
  rlimit before{};
  std::atomic<bool> is_taking{false}, is_over{false};
  std::thread thread;  // it begins before there are none and ends after: a sanitizer wants one for that

  explicit Greedy(bool goes_on) {
    taken.reserve(100'000);
    getrlimit(RLIMIT_NOFILE, &before);
    thread = std::thread([this] {
      while (!is_over) {
        if (!is_taking || !take()) scenes::wait_a_little(1e-5);
      }
    });
    const rlimit low{open_files() + 50, before.rlim_max};
    setrlimit(RLIMIT_NOFILE, &low);
    while (take()) {
    }
    is_taking = goes_on;
  }
  bool take() {
    const int got = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (got >= 0) taken.emplace_back(got);
    return got >= 0;
  }
  ~Greedy() {
    is_taking = false;
    setrlimit(RLIMIT_NOFILE, &before);
    is_over = true;
    thread.join();
  }
};

static void run_out(bool goes_on) {
  Rig rig;
  fs_object other = push("other", 0.5, {0, 1, 0});
  other.enabled = false;  // a tick may come by before it is removed
  rig.honest().set(1, other);  // so that the next sync has something to do
  rig.honest().remove("other");
  ck_assert_int_eq(rig.sync(rig.honest()), FS_OK);
  const pid_t server = thread_named("fs-server");
  Unconnected waiting(40);
  {
    const Greedy greedy(goes_on);
    waiting.connect_to(rig.endpoint);
    const double before = processor_time(server), start = fs::steady_now();
    while (fs::steady_now() - start < 1) rig.check_honest();
    // The server serves the honest client all this time, and does not spin.
    const double share = (processor_time(server) - before) / (fs::steady_now() - start);
    ck_assert_msg(share < 0.5, "the server's thread takes %.0f %% of a processor", 100 * share);
    if (!goes_on) {
      for (const Descriptor& s : waiting.sockets) {
        pollfd look{s.get(), 0, 0};
        ck_assert_msg(poll(&look, 1, 10'000) > 0 && (look.revents & POLLHUP), "one that waits was not turned away");
      }
    }
    // A call that needs a descriptor fails, and the error sentence says why.
    const uint64_t serial = rig.honest().send(fs::wire::type_reports);
    const std::optional<RawClient::Reply> reply = rig.honest().reply_of(serial);
    ck_assert(reply && reply->status == FS_ERROR_FULL);
  }
  const RawClient newcomer = rig.join("newcomer");
  rig.check_honest();
}

START_TEST(no_descriptors) { run_out(false); }
END_TEST
START_TEST(no_descriptors_and_greedy) { run_out(true); }
END_TEST

int main(int count, char** arguments) {
  if (count == 5 && std::strcmp(arguments[1], "--client") == 0) {
    be_a_client(arguments[2], arguments[3], std::strcmp(arguments[4], "fork") == 0);
  }
  if (count == 3 && std::strcmp(arguments[1], "--server") == 0) be_a_server(arguments[2]);
  Suite* suite = suite_create("door");
  scenes::add_once(suite, "hello", {another_version_of_the_wire, hostile_sizes, no_hello, hello_with_descriptors, bad_names});
  scenes::add_once(suite, "names", {two_of_one_name, name_of_the_dead});
  scenes::add_once(suite, "forks", {server_that_forks, server_that_is_cloned, forked_server_is_killed});
  scenes::add_once(suite, "too many", {max_clients, silent_stranger, crowd_at_the_door, coming_and_going});
  scenes::add_once(suite, "descriptors", {no_descriptors, no_descriptors_and_greedy});
  return scenes::run_suite(suite);
}
