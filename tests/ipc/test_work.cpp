// A server that stops, and a client that is killed, in the middle of each kind of a client's work: nothing waits for the end of
// that work, and no half of it is ever felt. And work that needs the scenes of others, who work themselves.
#include <sys/wait.h>

#include <csignal>

#include "ipc/rig.h"

using namespace hostile;
using namespace fs::wire;

namespace {

constexpr double push_force = 1.5;  // N
constexpr int many = 3000;          // objects

fs_object plain(int i) { return fs_object_init(("m" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT); }

void fill(RawClient& client) {
  client.set(0, push("a", push_force), true);
  for (int i = 0; i < many; ++i) client.set(no_slot, plain(i), true);
  client.set(1, push("z", push_force, {-1, 0, 0}));
}

// A mesh of so many triangles.
void send_mesh(RawClient& client, uint64_t id, uint32_t triangles) {
  scenes::Random random(id);
  std::vector<fs_vec3> points(3 * triangles);
  std::vector<uint32_t> corners(points.size());
  for (fs_vec3& point : points) point = random.in_box(1);
  for (uint32_t i = 0; i < corners.size(); ++i) corners[i] = i;
  const fs::Descriptor data = fs::make_blob({fs::bytes_of(points.data(), points.size()),
                                             fs::bytes_of(corners.data(), corners.size())});
  client.send(type_shape, Shape{id, FS_PRIMITIVE_MESH, 0, points.size(), triangles}, data.get());
}
Object with_mesh(const std::string& name, uint64_t id) {
  Object out = fs::to_record(fs_object_init(name.c_str(), FS_PRIMITIVE_MESH));
  out.shape = id;
  return out;
}

// What a client does. The first object of each pushes, the last pushes back: together they are not felt, but one alone would be.
struct Kind {
  const char* name;
  void (*prepare)(RawClient& client);
  void (*begin)(RawClient& client);
  fs_status status = FS_OK;  // that a sync gives afterwards
};
const Kind kinds[] = {
    {"group", [](RawClient&) {}, fill},
    {"group that is refused", fill,
     [](RawClient& client) {
       client.remove("z", true);
       for (int i = 0; i < many; ++i) client.remove("m" + std::to_string(i), true);
       fs_object bad = push("a", 1);
       bad.front.gain = NAN;
       client.set(0, bad);
     },
     FS_ERROR_INVALID},
    {"clear", fill, [](RawClient& client) { client.send(type_clear); }},
    {"parked changes", [](RawClient&) {},
     [](RawClient& client) {
       send_mesh(client, 1, 10'000);
       client.set(0, push("a", push_force), true);
       client.set(no_slot, with_mesh("m0", 1), all_parts, true);
       client.set(1, push("z", push_force, {-1, 0, 0}));
       for (int i = 1; i < 1000; ++i) client.set(no_slot, with_mesh("m" + std::to_string(i), 1), all_parts);
     }},
    {"changes of another's object", [](RawClient&) {},
     [](RawClient& client) {
       for (int i = 0; i < many; ++i) client.send(type_place, move_of("honest/prey"), -1, true);
       client.send(type_place, move_of("honest/prey"));
     }},
    {"lists", fill,
     [](RawClient& client) {
       for (int i = 0; i < 10; ++i) {
         for (const uint32_t type : {type_reports, type_clients, type_views}) client.send(type);
         client.send(type_motions, Target{});
       }
     }},
    {"mesh", [](RawClient&) {},
     [](RawClient& client) {
       send_mesh(client, 1, 40'000);
       client.set(0, with_mesh("m", 1), all_parts);
     }},
};

void prepare(Rig& rig, const Kind& kind, RawClient& client) {
  kind.prepare(client);
  const fs_status status = rig.sync(client);
  fs_event event{};
  client.next_refusal(event);
  ck_assert_msg(status == FS_OK, "%s: %s: %s", kind.name, event.name, event.text);
}
bool is_done(const RawClient& client) { return client.outbox->applied.load() >= client.serial; }

void set_prey(Rig& rig) { rig.honest().set(1, fs_object_init("prey", FS_PRIMITIVE_POINT)); }

// How long the work takes where nothing disturbs it, s.
double duration_of(const Kind& kind) {
  Rig rig;
  set_prey(rig);
  RawClient client = rig.join("works");
  prepare(rig, kind, client);
  const double begin = fs::steady_now();
  kind.begin(client);
  ck_assert(scenes::eventually([&] { return is_done(client); }));
  const double end = fs::steady_now();
  ck_assert_int_eq(rig.sync(client), kind.status);
  return end - begin;
}

constexpr int moments = scenes::is_sanitized ? 4 : 10;

}  // namespace

START_TEST(server_that_stops) {
  const Kind& kind = kinds[_i];
  double duration = duration_of(kind);
  int amid = 0;
  // A busy machine may have measured it too long, and may be done before this thread looks: then there are more moments.
  for (int k = 0; k < moments || (amid == 0 && k < 10 * moments); ++k) {
    Rig rig;
    set_prey(rig);
    RawClient client = rig.join("works");
    prepare(rig, kind, client);
    const double begin = fs::steady_now();
    kind.begin(client);
    while (!is_done(client) && fs::steady_now() - begin < duration * (k % moments) / moments) {
    }
    if (is_done(client)) {
      duration = std::min(duration, fs::steady_now() - begin);
    } else {
      ++amid;
    }
    rig.stop_server();
    ck_assert_msg(client.is_dropped() && rig.honest().is_dropped(), "%s: a client is still connected", kind.name);
    fs_vec3 force{};
    for (int tick = 0; tick < 200; ++tick) {
      OK(fs_servo_step(rig.servo(), 1));
      fs_tick newest;
      size_t count;
      OK(fs_servo_get_record(rig.servo(), &newest, 1, &count));
      force = newest.response.wrench.force;
      ck_assert_msg(scenes::norm(force) <= 1 + 1e-9, "%s: %g N are felt", kind.name, scenes::norm(force));
    }
    ck_assert_double_eq(scenes::norm(force), 0);
  }
  ck_assert_msg(amid > 0, "%s: it was over each time", kind.name);
}
END_TEST

// A process that is the client; it works when it is told to, until it is killed.
namespace {

struct Victim {
  pid_t process;
  fs::Descriptor go;

  Victim(const std::string& endpoint, const Kind& kind) {
    int in[2], out[2];
    ck_assert(pipe(in) == 0 && pipe(out) == 0);
    process = fork();
    if (process == 0) {
      char byte = 0;
      RawClient client(endpoint);
      client.join("works");
      kind.prepare(client);
      const bool is_synced = client.ask(type_get, Target{}) != FS_ERROR_TIMEOUT;
      if (!is_synced || write(out[1], &byte, 1) != 1 || read(in[0], &byte, 1) != 1) _exit(1);
      kind.begin(client);
      for (;;) pause();
    }
    close(in[0]);
    close(out[1]);
    const fs::Descriptor ready(out[0]);
    go = fs::Descriptor(in[1]);
    char byte;
    ck_assert(read(ready.get(), &byte, 1) == 1);
  }
  void begin() { ck_assert(write(go.get(), "", 1) == 1); }
  void kill_it() {
    kill(process, SIGKILL);
    ck_assert_int_eq(waitpid(process, nullptr, 0), process);
  }
};

}  // namespace

START_TEST(client_that_is_killed) {
  const Kind& kind = kinds[_i];
  const double duration = duration_of(kind);
  Rig rig;
  set_prey(rig);
  for (int k = 0; k < moments; ++k) {
    Victim victim(rig.endpoint, kind);
    rig.tick(50);
    victim.begin();
    const double begin = fs::steady_now();
    const auto tick = [&] {
      rig.tick();
      ck_assert_msg(is_near(rig.foreign_force(), {}), "%s: half of it is felt", kind.name);
    };
    while (fs::steady_now() - begin < duration * (k + 0.5) / moments) tick();
    victim.kill_it();
    // Its name is free, nobody waits for its work, and what it had fades.
    ck_assert(rig.until([&] { return !rig.listed("works").name[0]; }));
    for (int i = 0; i < 60; ++i) tick();
    RawClient next = rig.join("works");
    next.set(0, plain(0));
    ck_assert_int_eq(rig.sync(next), FS_OK);
    const uint64_t serial = rig.honest().send(type_reports);
    ck_assert(rig.honest().reply_of(serial));
    rig.check_honest();
    next.socket.reset();
    ck_assert(rig.until([&] { return !rig.listed("works").name[0]; }));
  }
}
END_TEST

// Clients whose groups change each other's objects, and one that looks at all of them again and again: each gets what it wants,
// and no half of a group is in a list.
START_TEST(work_about_each_other) {
  constexpr int rounds = 20, changes = 200;
  Rig rig;
  rig.others = 3;
  std::vector<RawClient> pair;
  for (const char* name : {"one", "two"}) {
    pair.push_back(rig.join(name));
    pair.back().set(0, push("a", push_force), true);
    pair.back().set(no_slot, fs_object_init("prey", FS_PRIMITIVE_POINT), true);
    pair.back().set(1, push("z", push_force, {-1, 0, 0}));
    ck_assert_int_eq(rig.sync(pair.back()), FS_OK);
  }
  RawClient asking = rig.join("asks");
  for (int round = 0; round < rounds; ++round) {
    for (int i = 0; i < 2; ++i) {
      RawClient& client = pair[static_cast<size_t>(i)];
      const char* const target = i == 0 ? "two/prey" : "one/prey";
      for (int k = 0; k < changes; ++k) {
        client.set(no_slot, plain(round * changes + k % 100), true);
        client.send(type_place, move_of(target), -1, true);
      }
      client.send(type_place, move_of(target));
    }
    std::vector<uint64_t> asked;
    for (int k = 0; k < 5; ++k) asked.push_back(asking.send(type_clients));
    for (const uint64_t serial : asked) {
      const std::optional<RawClient::Reply> reply = asking.reply_of(serial);
      ck_assert(reply && reply->status == FS_OK);
      std::vector<fs_client> list(reply->as<Count>().count);
      fs::read_blob(reply->data, 0, std::as_writable_bytes(std::span(list)));
      for (const fs_client& client : list) {
        if (std::string(client.name) != "one" && std::string(client.name) != "two") continue;
        ck_assert_msg((client.objects - 3) % 100 == 0, "%u objects are listed", client.objects);
      }
    }
    rig.tick(3);
    ck_assert(is_near(rig.foreign_force(), {}));
  }
  for (RawClient& client : pair) ck_assert_int_eq(rig.sync(client), FS_OK);
  for (RawClient& client : pair) {
    fs_event event;
    ck_assert(!client.next_refusal(event));
  }
  for (const char* name : {"one", "two"}) ck_assert_uint_eq(rig.listed(name).objects, 3 + 100 * rounds);
  rig.check_honest();
}
END_TEST

int main() {
  Suite* suite = suite_create("work");
  const int count = static_cast<int>(std::size(kinds));
  tcase_add_loop_test(scenes::new_case(suite, "a server that stops"), server_that_stops, 0, count);
  tcase_add_loop_test(scenes::new_case(suite, "a client that is killed"), client_that_is_killed, 0, count);
  scenes::add_once(suite, "each other", {work_about_each_other});
  return scenes::run_suite(suite);
}
