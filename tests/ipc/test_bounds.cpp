// What a client can make the server keep is bounded, whatever it sends and for how long: memory, jobs, descriptors, objects
// that the servo has to evaluate. Memory is what the heap of this process has in use.
#include <fcntl.h>
#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>

#include "ipc/rig.h"

using namespace hostile;
using namespace fs::wire;
using fs::Descriptor;

constexpr unsigned all_seals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;

static double megabytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

static fs_server_options few_objects() {
  fs_server_options options = server_options();
  options.max_objects = 256;
  return options;
}

// A round, again and again, takes no more memory than it did at first. Without bounds each of these floods would come to
// several times what is allowed here.
static void expect_bounded(const char* what, int all_rounds, double most, const std::function<void(int)>& round) {
  const int rounds = scenes::times(all_rounds / 2, all_rounds);
  for (int i = 0; i < rounds / 10; ++i) round(i);
  const double before = megabytes();
  for (int i = rounds / 10; i < rounds; ++i) round(i);
  const double grown = megabytes() - before;
  std::printf("  %s: %.1f MB more\n", what, grown);
  ck_assert_msg(grown < most, "%s: %g MB more", what, grown);
}

static const char* name_of(int i) {
  static char name[32];
  std::snprintf(name, sizeof name, "o%d", i);
  return name;
}

// Objects of ever new names that come and go, while no tick comes by: none of them can fade out.
START_TEST(names_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("names");
  expect_bounded("names, no tick", 60'000, 10, [&](int i) {
    client.set(7, push(name_of(i), 0.001));
    client.remove(name_of(i));
  });
  rig.sync(client);
  fs_event event;
  ck_assert_msg(rig.until([&] { return client.next_refusal(event); }), "all of them were taken");
  ck_assert_int_eq(event.status, FS_ERROR_FULL);
  rig.check_honest();
  // When they have faded out there is room again.
  rig.tick(50);
  client.set(7, push("new", 0.001));
  ck_assert_int_eq(rig.sync(client), FS_OK);
}
END_TEST

// The same while it ticks: the number of objects felt at a time is bounded, too.
START_TEST(felt_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("names");
  for (int i = 0; i < 20'000; ++i) {
    client.set(static_cast<uint32_t>(i) % 256, push(name_of(i), 0.001));
    if (i % 16 == 0) rig.tick();
    client.remove(name_of(i));
    fs::HandSample hand;
    ck_assert(client.outbox->servo.hand.read(hand));
    ck_assert_msg(hand.response.felt_count <= 2 * 256, "%u objects are felt", hand.response.felt_count);
  }
  rig.check_honest();
}
END_TEST

START_TEST(one_name_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("name");
  expect_bounded("one name, no tick", 100'000, 2, [&](int) {
    client.set(7, push("o", 0.001));
    client.remove("o");
  });
  rig.sync(client);
  rig.check_honest();
}
END_TEST

// Changes that wait for a shape that takes long.
START_TEST(waiting_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("waiting");
  std::vector<fs_vec3> points(100'000);
  for (size_t i = 0; i < points.size(); ++i) points[i] = {1e-5 * static_cast<double>(i), 0.01, 0};
  const Descriptor file = fs::make_blob({fs::bytes_of(points.data(), points.size())});
  uint64_t id = 0;
  const auto round = [&](int i) {
    client.forget(id);
    client.send(type_shape, Shape{++id, FS_PRIMITIVE_POLYLINE, 0, points.size(), 0}, file.get());
    fs::wire::Object record = fs::to_record(push("o", 0.001));
    record.primitive = FS_PRIMITIVE_POLYLINE;
    record.shape = id;
    for (int k = 0; k < 6000; ++k) {
      fs::put_text(record.name, name_of(i * 6000 + k));
      client.set(static_cast<uint32_t>(k) % 256, record);
    }
    rig.tick(40);
  };
  expect_bounded("waiting for a shape", 20, 20, round);
  rig.sync(client);
  rig.check_honest();
}
END_TEST

// Shapes and curves that are forgotten as soon as they were sent; then their memory comes back.
START_TEST(uploads_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("uploads");
  rig.sync(client);
  const size_t files = open_files();
  const double before = megabytes();
  std::vector<fs_vec3> points(1000);
  const Descriptor file = memory_file({}, points.size() * sizeof(fs_vec3), all_seals);
  uint64_t id = 0;
  size_t most_files = 0;
  expect_bounded("uploads", 10'000, 20, [&](int i) {
    if (i % 2) client.send(type_shape, Shape{++id, FS_PRIMITIVE_POLYLINE, 0, points.size(), 0}, file.get());
    else client.expression(++id, "1+sin(d)*exp(-t)");
    client.forget(id);
    if (i % 100 == 0) most_files = std::max(most_files, open_files());
  });
  ck_assert_msg(most_files < files + 40, "%zu descriptors wait", most_files - files);
  rig.sync(client);
  ck_assert(rig.until([&] { return rig.listed("uploads").shape_bytes == 0; }));
  ck_assert_msg(megabytes() < before + 10, "%g MB are left", megabytes() - before);
  // If they are kept, each kind is refused from some number on.
  RawClient keeper = rig.join("keeper");
  for (uint64_t k = 1; k < fs::wire::most_assets(256) + 100 && !keeper.is_dropped(); ++k) keeper.expression(k, "d");
  rig.expect_dropped(keeper, "it sends shapes without end");
  rig.check_honest();
}
END_TEST

// Copies of a mesh, asked for again and again.
START_TEST(fetches_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("fetches");
  const scenes::Shape mesh = scenes::make_mesh(scenes::sphere_mesh(0.01, 20'000));
  fs_object object = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  object.shape = mesh.get();
  OK(fs_object_set(rig.scene(), &object));
  rig.tick(2);
  Target target{};
  fs::put_text(target.name, "server/mesh");
  const size_t files = open_files();
  RawClient greedy = rig.join("greedy");
  const std::optional<RawClient::Reply> got = greedy.reply_of(greedy.send(type_get, target));
  ck_assert(got && got->status == FS_OK);
  const uint64_t id = got->as<fs::wire::Object>().shape;
  ck_assert(id & of_server);
  size_t most_files = 0;
  for (int i = 0; i < 20'000 && !greedy.is_dropped(); ++i) {
    greedy.send(type_fetch, Fetch{id});
    if (i % 100 == 0) most_files = std::max(most_files, open_files());
  }
  rig.expect_dropped(greedy, "it never reads what it asked for");
  ck_assert_msg(most_files < files + 60, "%zu descriptors", most_files - files);
  OK(fs_object_remove(rig.scene(), "mesh"));
  rig.tick(50);
  rig.check_honest();
}
END_TEST

// Refusals, requests about objects that do not exist, waiting syncs: the answers that wait are bounded.
START_TEST(answers_without_end) {
  Rig rig(few_objects());
  RawClient client = rig.join("answers");
  fs_object bad = push("bad", 1);
  bad.front.limit = -1;
  expect_bounded("refusals", 50'000, 4, [&](int i) {
    std::strcpy(bad.name, name_of(i));
    client.set(static_cast<uint32_t>(i) % 256, bad);
  });
  expect_bounded("syncs", 10'000, 1, [&](int) {
    client.send(type_sync);
    while (client.reply_of(0, 1e-6)) {
    }
  });
  rig.sync(client);
  rig.check_honest();
}
END_TEST

// Edits that wait for a shape, by a client that does not wait for the answer.
START_TEST(edits_without_end) {
  Rig rig(few_objects());
  RawClient owner = rig.join("owner"), client = rig.join("editor");
  owner.set(0, push("o", 0.001));
  ck_assert_int_eq(rig.sync(owner), FS_OK);
  std::vector<fs_vec3> points(30'000);  // so that the sixteen shapes that may be in work at a time come to less than 30 MB
  for (size_t i = 0; i < points.size(); ++i) points[i] = {1e-5 * static_cast<double>(i), 0.01, 0};
  const Descriptor file = fs::make_blob({fs::bytes_of(points.data(), points.size())});
  Set edit{no_slot, FS_PART_SHAPE, fs::to_record(push("o", 0.001))};
  fs::put_text(edit.object.name, "owner/o");
  edit.object.primitive = FS_PRIMITIVE_POLYLINE;
  uint64_t id = 0;
  expect_bounded("edits", 10, 40, [&](int) {
    client.forget(id);
    client.send(type_shape, Shape{++id, FS_PRIMITIVE_POLYLINE, 0, points.size(), 0}, file.get());
    edit.object.shape = id;
    for (int k = 0; k < 3000; ++k) {
      client.send(type_change, edit);
      while (client.reply_of(0, 1e-6)) {
      }
    }
  });
  rig.sync(client);
  rig.check_honest();
}
END_TEST

// An edit is answered even if the shape that it waits for is forgotten meanwhile; 64 wait at most.
START_TEST(edits_of_the_forgotten) {
  Rig rig;
  RawClient owner = rig.join("owner"), client = rig.join("editor");
  owner.set(0, push("o", 0.001));
  ck_assert_int_eq(rig.sync(owner), FS_OK);
  std::vector<fs_vec3> points(1'000'000);
  const Descriptor file = memory_file({}, points.size() * sizeof(fs_vec3), all_seals);
  client.send(type_shape, Shape{1, FS_PRIMITIVE_POLYLINE, 0, points.size(), 0}, file.get());
  Set edit{no_slot, FS_PART_SHAPE, fs::to_record(push("o", 0.001))};
  fs::put_text(edit.object.name, "owner/o");
  edit.object.primitive = FS_PRIMITIVE_POLYLINE;
  edit.object.shape = 1;
  const uint64_t serial = client.send(type_change, edit);
  for (int i = 1; i < 64; ++i) client.send(type_change, edit);
  const uint64_t one_more = client.send(type_change, edit);
  ck_assert_int_eq(client.status_of(client.reply_of(one_more)), FS_ERROR_FULL);
  client.forget(1);
  const std::optional<RawClient::Reply> reply = client.reply_of(serial);
  ck_assert_msg(reply.has_value(), "no answer");
  ck_assert_int_eq(rig.sync(client), FS_OK);
  rig.check_honest();
}
END_TEST

// What a client had is freed when it goes.
START_TEST(clients_without_end) {
  Rig rig(few_objects());
  rig.others = 100;
  const Descriptor file = memory_file({}, 1000 * sizeof(fs_vec3), all_seals);
  expect_bounded("clients", 100, 5, [&](int i) {
    RawClient client = rig.join("guest");
    client.send(type_shape, Shape{1, FS_PRIMITIVE_POLYLINE, 0, 1000, 0}, file.get());
    fs::wire::Object record = fs::to_record(push("o", 0.001));
    record.primitive = FS_PRIMITIVE_POLYLINE;
    record.shape = 1;
    for (uint32_t k = 0; k < 200; ++k) {
      fs::put_text(record.name, name_of(i * 200 + static_cast<int>(k)));
      client.set(k, record);
    }
    rig.sync(client);
    client.socket.reset();
    rig.tick(40);
    ck_assert(rig.until([&] { return rig.listed("guest").name[0] == 0; }));
  });
  rig.check_honest();
}
END_TEST

int main() {
  Suite* suite = suite_create("bounds");
  scenes::add_once(suite, "objects", {names_without_end, felt_without_end, one_name_without_end});
  scenes::add_once(suite, "shapes", {waiting_without_end, uploads_without_end, fetches_without_end, edits_without_end,
                                     edits_of_the_forgotten});
  scenes::add_once(suite, "the rest", {answers_without_end, clients_without_end});
  return scenes::run_suite(suite);
}
