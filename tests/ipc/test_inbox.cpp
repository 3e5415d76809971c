// Hostile use of the shared memory: which operations a client can do on it, arbitrary data in its inbox while the servo
// runs, and numbers as large as a client can make them. test_inbox --writes N: the number of random writes.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <bit>

#include "ipc/rig.h"
#include "servo/servo.h"

using namespace hostile;
using namespace fs::wire;
using fs::Descriptor;

static uint64_t wanted_writes = static_cast<uint64_t>(scenes::is_sanitized ? 50'000 : scenes::times(2'000'000, 20'000'000));

constexpr double infinity = std::numeric_limits<double>::infinity();
static const double nan_value = std::nan("");

// ------------------------------------------------------------------------------------------------------ who may do what

static void expect_no_change_of_size(const Descriptor& file, uint64_t bytes) {
  const auto size = static_cast<off_t>(bytes);
  for (const off_t other : {off_t{0}, off_t{4096}, size - 1, size + 1, 2 * size}) {
    errno = 0;
    ck_assert(ftruncate(file.get(), other) == -1 && errno == EPERM);
  }
  errno = 0;
  ck_assert(fallocate(file.get(), 0, size, 4096) == -1 && errno == EPERM);
  for (const int seal : {F_SEAL_WRITE, F_SEAL_SHRINK, 0x0010}) {
    errno = 0;
    ck_assert(fcntl(file.get(), F_ADD_SEALS, seal) == -1 && errno == EPERM);
  }
  const std::string path = "/proc/self/fd/" + std::to_string(file.get());
  const Descriptor emptied(open(path.c_str(), O_RDWR | O_TRUNC | O_CLOEXEC));
  ck_assert_msg(!emptied, "it could be opened to be emptied");
  ck_assert_int_eq(lseek(file.get(), 0, SEEK_END), size);
}

START_TEST(outbox_is_read_only) {
  Rig rig;
  RawClient client = rig.join("writer");
  const size_t bytes = client.welcome.outbox_bytes;
  expect_no_change_of_size(client.outbox_file, bytes);

  const auto expect_read_only = [&](const Descriptor& file) {
    for (const int flags : {MAP_SHARED, MAP_SHARED_VALIDATE}) {
      ck_assert(mmap(nullptr, bytes, PROT_READ | PROT_WRITE, flags, file.get(), 0) == MAP_FAILED);
      ck_assert(mmap(nullptr, bytes, PROT_WRITE, flags, file.get(), 0) == MAP_FAILED);
    }
    const uint64_t garbage = 0x5555555555555555;
    ck_assert_int_eq(pwrite(file.get(), &garbage, sizeof garbage, 0), -1);
    ck_assert_int_eq(pwrite(file.get(), &garbage, sizeof garbage, static_cast<off_t>(bytes) - 8), -1);
    ck_assert_int_eq(write(file.get(), &garbage, sizeof garbage), -1);
    ck_assert_int_eq(fallocate(file.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, 4096), -1);
    ck_assert_int_eq(fallocate(file.get(), FALLOC_FL_ZERO_RANGE, 0, 4096), -1);
    ck_assert_int_eq(fallocate(file.get(), FALLOC_FL_COLLAPSE_RANGE, 0, 4096), -1);
  };
  expect_read_only(client.outbox_file);
  const std::string path = "/proc/self/fd/" + std::to_string(client.outbox_file.get());
  for (const int mode : {O_RDWR, O_WRONLY, O_RDWR | O_APPEND}) {
    const Descriptor again(open(path.c_str(), mode | O_CLOEXEC));
    if (again) expect_read_only(again);
  }
  // An existing mapping cannot get more rights.
  ck_assert_int_eq(mprotect(client.outbox_memory.get(), bytes, PROT_READ | PROT_WRITE), -1);
  ck_assert_int_eq(madvise(client.outbox_memory.get(), 4096, MADV_REMOVE), -1);
  madvise(client.outbox_memory.get(), bytes, MADV_DONTNEED);

  // And it goes on.
  rig.tick();
  const uint64_t tick = client.outbox->servo.tick.load();
  rig.tick(3);
  ck_assert_uint_eq(client.outbox->servo.tick.load(), tick + 3);
  rig.check_honest();
}
END_TEST

START_TEST(inbox_keeps_its_size) {
  Rig rig;
  RawClient client = rig.join("holes");
  const auto bytes = static_cast<off_t>(client.welcome.inbox_bytes);
  expect_no_change_of_size(client.inbox_file, client.welcome.inbox_bytes);
  const uint64_t serial = client.set(0, push("push", 1));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  // The client may punch holes into it: they read as zeros, and the server goes on.
  for (int i = 0; i < 20; ++i) {
    client.move(0, serial, scenes::at(0, 0, 0));
    ck_assert_int_eq(fallocate(client.inbox_file.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, bytes), 0);
    ck_assert_int_eq(madvise(client.inbox_memory.get(), static_cast<size_t>(bytes), MADV_REMOVE), 0);
    rig.check_honest();
  }
  fs_pose down;
  OK(fs_pose_from_z({0, 0, 100}, {0, 0, -1}, &down));
  client.move(0, serial, down);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {0, 0, -1}); }));
  client.inbox_memory.reset();  // it may also unmap it
  client.inbox_file.reset();
  rig.check_honest();
}
END_TEST

// ------------------------------------------------------------------------------------------------------- wrong contents

// A client with objects of all kinds, whose places are in its inbox.
struct Writer {
  static constexpr uint32_t count = 64;
  RawClient client;
  uint64_t after[count];
  std::atomic<uint64_t>* words;
  size_t word_count;

  explicit Writer(Rig& rig) : client(rig.join("writer")) {
    const fs_vec3 line[3]{{0, 0, 0}, {0.01, 0, 0}, {0.02, 0.01, 0}};
    client.polyline(1, line);
    if (scenes::has_expressions()) client.expression(2, "1+sin(d+t)");
    for (uint32_t i = 0; i < count; ++i) {
      fs_object object = push(("o" + std::to_string(i)).c_str(), 1);
      object.damping = i % 5;
      if (i % 3 == 1) object.primitive = FS_PRIMITIVE_POINT;
      fs::wire::Object record = fs::to_record(object);
      if (i % 3 == 2) {
        record.primitive = FS_PRIMITIVE_POLYLINE;
        record.shape = 1;
      }
      if (i % 7 == 3 && scenes::has_expressions()) record.front = {FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 0, 1e6, 0, 2, {}};
      after[i] = client.set(i, record);
    }
    ck_assert_int_eq(rig.sync(client), FS_OK);
    words = static_cast<std::atomic<uint64_t>*>(client.inbox_memory.get());
    word_count = client.welcome.inbox_bytes / 8;
  }
  std::atomic<uint64_t>& batch() { return words[0]; }
  std::atomic<uint64_t>& summary(size_t i) { return words[1 + i]; }
  std::atomic<uint64_t>& dirty(size_t i) { return words[sizeof(fs::InboxHead) / 8 + i]; }
  std::atomic<uint64_t>& sequence(uint32_t slot) {  // of the record
    return words[sizeof(fs::InboxHead) / 8 + (client.welcome.max_objects + 63) / 64 + slot * sizeof(fs::Seqlock<Move>) / 8];
  }
  uint64_t moves(Rig& rig) { return rig.listed("writer").moves; }
};

// Numbers that often cause trouble.
static double odd_number(scenes::Random& random) {
  static const double numbers[] = {0, -0.0, 1, -1, 0.5, 0.7071067811865476, 1e-300, 5e-324, 0.1, 0.10000001, 1e15, -1e15,
                                   1.0000001e15, 1e154, 1e300, -1e308, infinity, -infinity, nan_value, 1000, 0.01};
  return random.coin(0.1) ? std::bit_cast<double>(random.bits()) : numbers[random.below(std::size(numbers))];
}
static Motion odd_motion(scenes::Random& random) {
  const auto vector = [&] {
    return random.coin() ? random.in_box(0.1) : fs_vec3{odd_number(random), odd_number(random), odd_number(random)};
  };
  Motion out{};
  out.pose = random.pose(0.1);
  if (random.coin()) out.pose.position = vector();
  if (random.coin(0.2)) out.pose.orientation = {odd_number(random), odd_number(random), odd_number(random), odd_number(random)};
  if (random.coin()) out.twist = {vector(), vector()};
  out.time = random.coin() ? fs::steady_now() : odd_number(random);
  out.horizon = random.coin() ? 0.1 : odd_number(random);
  return out;
}

// Arbitrary data at any place, from several threads; one thread writes records that are valid except for their numbers.
// In virtual time, and with a servo that has its own thread.
START_TEST(random_writes) {
  Rig rig(server_options(), servo_options(_i ? FS_SERVO_THREAD : FS_SERVO_VIRTUAL));
  Writer writer(rig);
  const uint64_t before = scenes::stats_of(rig.scene()).ticks;
  std::atomic<bool> is_over{false};
  std::atomic<uint64_t> writes{0};
  std::vector<std::thread> threads;
  for (uint64_t k = 0; k < 3; ++k) {
    threads.emplace_back([&, k] {
      scenes::Random random(100 + k);
      constexpr uint64_t at_once = 1000;
      while (!is_over) {
        // Half of the time no thread writes to the batch, as otherwise the server takes nothing.
        const size_t first = writes / 200'000 % 2;
        if (first) writer.batch().store(0, std::memory_order_relaxed);
        for (uint64_t i = 0; i < at_once; ++i) {
          // Half of them where the objects are.
          const size_t end = random.coin() ? writer.word_count : sizeof(fs::InboxHead) / 8 + 64 + 64 * 17;
          const size_t at = first + random.below(end - first);
          writer.words[at].store(random.bits() >> random.below(64), std::memory_order_relaxed);
        }
        writes += at_once;
      }
    });
  }
  threads.emplace_back([&] {
    scenes::Random random(99);
    while (!is_over) {
      const auto slot = static_cast<uint32_t>(random.below(Writer::count));
      if (writer.sequence(slot).load() & 1) writer.sequence(slot).fetch_add(1);
      writer.client.inbox.write(slot, {writer.after[slot], odd_motion(random)});
    }
  });
  const uint64_t wanted = wanted_writes / (_i ? 4 : 1);
  const int least = scenes::is_sanitized ? 2 : 10;  // four threads that only write leave little of two processors
  int rounds = 0;
  while (writes < wanted || rounds < least || writer.moves(rig) == 0) {  // however late the server comes to take one
    rig.tick(_i ? 1 : scenes::is_sanitized ? 10 : 50);
    rig.check_honest();
    ++rounds;
  }
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  const uint64_t moves = writer.moves(rig);
  ck_assert_uint_gt(scenes::stats_of(rig.scene()).ticks, before);
  std::printf("  %lu random writes, %lu moves taken of them, %lu ticks\n", (unsigned long)writes.load(), (unsigned long)moves,
              (unsigned long)(scenes::stats_of(rig.scene()).ticks - before));

  // When the client behaves again, its moves are taken again.
  for (size_t i = 0; i < sizeof(fs::InboxHead) / 8 + 64; ++i) writer.words[i].store(0);
  for (uint32_t i = 0; i < Writer::count; ++i) writer.sequence(i).fetch_and(~uint64_t{1});
  const uint64_t taken = writer.moves(rig);
  ck_assert(rig.until([&] {
    for (uint32_t i = 0; i < Writer::count; ++i) writer.client.move(i, writer.after[i], scenes::at(0, 0, 0));
    return writer.moves(rig) >= taken + Writer::count;
  }));
  rig.check_honest();
}
END_TEST

// A client that was stopped in the middle of a write, or never began one.
START_TEST(half_written) {
  Rig rig;
  Writer writer(rig);
  const auto is_silent = [&](const char* what) {
    const uint64_t before = writer.moves(rig);
    for (int i = 0; i < 5; ++i) rig.check_honest();
    ck_assert_msg(writer.moves(rig) == before, "moves are taken: %s", what);
  };
  const auto mark_all = [&] {
    for (size_t i = 0; i < std::size(fs::InboxHead().summary); ++i) writer.summary(i).store(~uint64_t{0});
    for (size_t i = 0; i < (writer.client.welcome.max_objects + 63) / 64; ++i) writer.dirty(i).store(~uint64_t{0});
  };
  mark_all();  // all slots, those that are nobody's and those beyond the last too; not a record is there
  is_silent("dirty bits without records");
  for (uint32_t i = 0; i < Writer::count; ++i) {
    writer.client.inbox.write(i, {writer.after[i], {scenes::at(0, 0, 0), {}, 1, 0}});
    writer.sequence(i).fetch_add(1);
  }
  mark_all();
  is_silent("odd sequences");
  for (uint32_t i = 0; i < Writer::count; ++i) writer.sequence(i).fetch_add(1);
  writer.client.inbox.begin_batch();
  mark_all();
  is_silent("a group that is being written");
  // A move that does not belong to the present object of its slot is not taken.
  for (uint32_t i = 0; i < Writer::count; ++i) writer.client.inbox.write(i, {writer.after[i] + 1, {scenes::at(0, 0, 0), {}, 1, 0}});
  writer.client.inbox.end_batch();
  is_silent("moves of another time");
  // Groups without a pause: whether any is taken is chance, but no thread waits.
  std::atomic<bool> is_over{false};
  std::thread restless([&] {
    while (!is_over) writer.batch().fetch_add(2);
  });
  mark_all();
  for (int i = 0; i < 5; ++i) rig.check_honest();
  is_over = true;
  restless.join();
  const uint64_t before = writer.moves(rig);
  for (uint32_t i = 0; i < Writer::count; ++i) writer.client.move(i, writer.after[i], scenes::at(0, 0, 0));
  ck_assert(rig.until([&] { return writer.moves(rig) == before + Writer::count; }));
  rig.check_honest();
}
END_TEST

// In each field of a move, and the same in the changes that do as much: bad ones are not taken, and are counted.
START_TEST(bad_numbers) {
  Rig rig;
  Writer writer(rig);
  std::vector<Motion> bad;
  const Motion good{scenes::at(0, 0, 0), {}, 1, 0};
  const auto with = [&](auto change) {
    Motion m = good;
    change(m);
    bad.push_back(m);
  };
  for (const double x : {nan_value, infinity, -infinity, 1.1e15, -1e300}) {
    for (double fs_vec3::*axis : {&fs_vec3::x, &fs_vec3::y, &fs_vec3::z}) {
      with([&](Motion& m) { m.pose.position.*axis = x; });
      with([&](Motion& m) { m.twist.linear.*axis = x; });
      with([&](Motion& m) { m.twist.angular.*axis = x; });
    }
    with([&](Motion& m) { m.pose.orientation.w = x; });
    with([&](Motion& m) { m.horizon = x; });
  }
  for (const double x : {nan_value, infinity, -infinity}) with([&](Motion& m) { m.time = x; });
  with([&](Motion& m) { m.pose.orientation = {1.01, 0, 0, 0}; });
  with([&](Motion& m) { m.pose.orientation = {1e-300, 0, 0, 0}; });
  with([&](Motion& m) { m.horizon = -1e-9; });
  with([&](Motion& m) { m.horizon = 0.1001; });

  const uint64_t moves = writer.moves(rig);
  uint64_t refused = rig.listed("writer").refused;
  for (const Motion& m : bad) {
    writer.client.inbox.write(0, {writer.after[0], m});
    ++refused;
    ck_assert_msg(rig.until([&] { return rig.listed("writer").refused == refused; }), "a bad move was not counted");
    writer.after[0] = writer.client.place("o0", m);
    rig.expect_refusal(writer.client, FS_ERROR_INVALID, "must be");
    rig.sync(writer.client);
    ++refused;
  }
  ck_assert_uint_eq(writer.moves(rig), moves);
  // Values at the bounds, and times of any size, are valid.
  for (const double time : {1e308, -1e308, 0.0, 5e-324}) {
    for (const double x : {1e15, -1e15, 0.0}) {
      const Motion m{scenes::at(x, x, x), {{x, x, x}, {x, x, x}}, time, 0.1};
      writer.client.inbox.write(0, {writer.after[0], m});
      rig.check_honest();
    }
  }
  ck_assert_uint_eq(rig.listed("writer").refused, refused);
  ck_assert_uint_gt(writer.moves(rig), moves);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------ the force

START_TEST(force_limit) {
  Rig rig;
  RawClient strong = rig.join("strong");
  scenes::Random random(5);
  for (int i = 0; i < 20; ++i) {
    const fs_vec3 direction = random.direction();
    const double force = random.log_between(2.1, 1e9);
    strong.set(0, push("push", force, direction));
    ck_assert_int_eq(rig.sync(strong), FS_OK);
    using namespace scenes;
    ck_assert_msg(rig.until([&] { return is_near(rig.foreign_force(), client_limit * direction); }), "%g N", force);
    const uint64_t limited = rig.listed("strong").limited;
    rig.tick(7);
    const fs_client listed = rig.listed("strong");
    ck_assert_uint_eq(listed.limited, limited + 7);
    ck_assert(is_near(listed.wrench.force, client_limit * direction));
    ck_assert_double_eq(listed.force_limit, client_limit);
  }
  // Many objects that push with the largest permitted force, through a frame that multiplies it by a billion.
  fs_frame frame = fs_frame_init();
  frame.force_scale = 1e9;
  strong.send(type_frame, Frame{frame});
  for (uint32_t i = 0; i < 1000; ++i) strong.set(i + 1, push(("p" + std::to_string(i)).c_str(), 1e9, {0, 1, 0}));
  strong.set(0, push("push", 1e9, {0, 1, 0}));
  ck_assert_int_eq(rig.sync(strong), FS_OK);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {0, client_limit, 0}); }));
  // A force below the limit is not changed.
  strong.send(type_clear);
  strong.set(0, push("push", 1e-9, {0, 0, 1}));
  ck_assert_int_eq(rig.sync(strong), FS_OK);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {0, 0, 1}); }));
  const uint64_t limited = rig.listed("strong").limited;
  rig.tick(20);
  ck_assert_uint_eq(rig.listed("strong").limited, limited);
  rig.check_honest();
}
END_TEST

// Force and torque keep their proportion; on a device without torque the force is not reduced for it.
START_TEST(torque_limit_of_a_client) {
  for (const bool has_torque : {true, false}) {
    Rig rig(server_options(), servo_options(), has_torque);
    RawClient client = rig.join("lever");
    Tool tool{1, {{1, 0, 0}}};  // m from the handle
    client.send(type_tool, tool);
    client.set(0, push("push", 1, {0, 0, 1}));
    ck_assert_int_eq(rig.sync(client), FS_OK);
    // The client may make client_limit / device_limit of the torque, 0.2 N m; 1 N m would come with its 1 N.
    const fs_vec3 force{0, 0, has_torque ? 0.2 : 1}, torque{0, has_torque ? -0.2 : -1, 0};
    ck_assert_msg(rig.until([&] { return is_near(rig.foreign_force(), force) && is_near(rig.torque(), torque); }),
                  "%g N, %g N m", rig.foreign_force().z, rig.torque().y);
    rig.tick(50);
    ck_assert(is_near(rig.foreign_force(), force) && is_near(rig.torque(), torque));
    ck_assert_int_eq(rig.listed("lever").limited > 0, has_torque);
    rig.check_honest();
  }
}
END_TEST

// No number that a client can send makes a force that is not finite. If one did so nevertheless, only its own scene
// would be lost: this test puts in a bad pose without the checks.
START_TEST(not_a_number) {
  fs_servo_options options = servo_options();
  options.max_stiffness = -1;  // else there would be no force at the surface itself
  Rig rig(server_options(), options);
  const fs::Ref<fs::LocalScene> scene = fs::make_ref<fs::LocalScene>();
  fs_object plane = push("plane", 1, {0, 0, 1});
  plane.pose = scenes::at(0, 0, 0);
  scene->set(plane);
  const fs::Ref<fs::Channel> channel = rig.servo()->add_channel(scene, {client_limit, torque_limit}, {"", 0});
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {0, 0, 1}); }));
  ck_assert(!channel->is_bad());
  fs::Movement movement;
  movement.motion.pose.orientation = {0, 1e150, 0, 0};  // a normal of 2e300, so a force of 2e309 N at the device
  fs_frame frame = fs_frame_init();
  frame.force_scale = 1e9;
  scene->begin();
  scene->set_motion("plane", movement.motion);
  scene->set_frame(frame);
  scene->commit();
  rig.tick(10);  // these check every force
  ck_assert(channel->is_bad());
  ck_assert(is_near(rig.foreign_force(), {}));
  scene->set(plane);  // the scene does not come back
  rig.tick(50);
  ck_assert(channel->is_bad());
  ck_assert(is_near(rig.foreign_force(), {}));
  rig.check_honest();
  channel->leave(0);
}
END_TEST

int main(int count, char** arguments) {
  if (count == 3 && std::strcmp(arguments[1], "--writes") == 0) wanted_writes = std::strtoull(arguments[2], nullptr, 10);
  Suite* suite = suite_create("inbox");
  scenes::add_once(suite, "rights", {outbox_is_read_only, inbox_keeps_its_size});
  scenes::add_once(suite, "contents", {half_written, bad_numbers});
  TCase* writes = scenes::new_case(suite, "writes");
  tcase_set_timeout(writes, 0);
  tcase_add_loop_test(writes, random_writes, 0, 2);
  scenes::add_once(suite, "force", {force_limit, torque_limit_of_a_client, not_a_number});
  return scenes::run_suite(suite);
}
