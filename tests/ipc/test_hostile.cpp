// Messages that no good client would send: of wrong size, out of order, about other clients' objects, more than the
// server can take. They harm only the client that sends them; an honest client keeps its object, its force and its
// answers.
#include <fcntl.h>

#include "ipc/rig.h"
#include "transfer/records.h"

using namespace hostile;
using namespace fs::wire;

struct Known {
  uint32_t type;
  size_t size;  // of its record
};
static const std::vector<Known> known_types = {
    {type_shape, sizeof(Shape)},   {type_curve, sizeof(Curve)},   {type_forget, sizeof(Forget)},
    {type_set, sizeof(Set)},       {type_change, sizeof(Set)},    {type_place, sizeof(Place)},
    {type_remove, sizeof(Remove)}, {type_clear, 0},               {type_frame, sizeof(Frame)},
    {type_clutch, sizeof(Clutch)}, {type_tool, sizeof(Tool)},     {type_wake, 0},
    {type_bind, sizeof(Bind)},     {type_sync, 0},                {type_pull, sizeof(Target)},   {type_get, sizeof(Target)},
    {type_fetch, sizeof(Fetch)},   {type_report, sizeof(Target)}, {type_reports, 0},
    {type_clients, 0},             {type_views, 0},               {type_record, sizeof(After)},
    {type_view, sizeof(Target)},   {type_stats, 0},
    {type_stop_force, 0},          {type_resume_force, 0},        {type_device, 0},              {type_motions, sizeof(Target)},
    {type_motions_since, sizeof(Since)},
    {type_accuracy, sizeof(Accuracy)}, {type_max_stiffness, sizeof(MaxStiffness)},
    {type_tool_radius, sizeof(ToolRadius)}};

static const std::vector<std::byte> zeros(fs::most_message);

static std::span<const std::byte> body(size_t size) { return std::span(zeros).first(size); }

static Target target_of(const char* name) {
  Target out{};
  fs::put_text(out.name, name);
  return out;
}

static fs_vec3 line[]{{0, 0, 0}, {0.01, 0, 0}, {0.02, 0.01, 0}};

// ------------------------------------------------------------------------------------------------------- wrong sizes

START_TEST(wrong_sizes) {
  Rig rig;
  rig.others = 100;  // the clients before are still fading out
  for (const Known& known : known_types) {
    for (const size_t size : {size_t{0}, size_t{1}, known.size / 2, known.size - 1, known.size + 1, known.size + 8,
                              size_t{60'000}, size_t{fs::most_message}}) {
      if (size == known.size || size > fs::most_message) continue;
      RawClient client = rig.join("wrong");
      client.set(0, push("push", 1));
      client.send(known.type, body(size));
      rig.expect_dropped(client, "a wrong size");
    }
  }
  // Not even a header, and one byte more than any message has.
  for (const size_t size : {size_t{1}, size_t{8}, sizeof(Header) - 1, fs::most_message + 1}) {
    RawClient client = rig.join("wrong");
    const std::vector<std::byte> bytes(size);
    client.send_bytes(bytes);
    rig.expect_dropped(client, "no header");
  }
  rig.check_honest();
}
END_TEST

START_TEST(unknown_types) {
  Rig rig;
  std::vector<uint32_t> types{type_reply, ~0u, 1u << 31, 1u << 16, 256 + type_set};
  for (uint32_t type = 0; type < 300; ++type) {
    const bool is_known = std::any_of(known_types.begin(), known_types.end(), [&](const Known& k) { return k.type == type; });
    if (!is_known && type != type_group) types.push_back(type);
  }
  for (const uint32_t type : types) {
    RawClient client = rig.join("unknown");
    client.send(type);
    rig.expect_dropped(client, "an unknown type");
  }
  rig.check_honest();
}
END_TEST

// Records of the right size, full of anything: with each type many times, in one client after the other.
START_TEST(random_bodies) {
  Rig rig;
  scenes::Random random(3);
  rig.others = 10;
  int dropped = 0;
  RawClient client = rig.join("random");
  for (int round = 0; round < 40; ++round) {
    for (const Known& known : known_types) {
      std::vector<std::byte> bytes(known.size);
      for (std::byte& byte : bytes) {
        // Mostly zeros and small numbers, or the first field would already be refused.
        byte = static_cast<std::byte>(random.coin(0.8) ? 0 : random.coin() ? random.below(4) : random.bits());
      }
      client.send(known.type, bytes);
      if (client.is_dropped()) {
        client = rig.join("random");
        ++dropped;
      }
    }
    if (round % 10 == 0) rig.check_honest();
    while (client.reply_of(0, 1e-3)) {  // they are read, so that it is not dropped for that
    }
  }
  ck_assert_int_gt(dropped, 0);
  rig.check_honest();
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- order

START_TEST(serials_that_do_not_rise) {
  Rig rig;
  for (const uint64_t next : {uint64_t{0}, uint64_t{1}, uint64_t{9}, uint64_t{10}}) {
    RawClient client = rig.join("serial");
    client.serial = 9;
    ck_assert_int_eq(rig.sync(client), FS_OK);  // of serial 10
    client.serial = next - 1;
    client.send(type_clear);
    rig.expect_dropped(client, "a serial that was there");
  }
  RawClient client = rig.join("serial");
  client.serial = ~uint64_t{0} - 1;
  ck_assert_int_eq(rig.sync(client), FS_OK);  // the last that there is
  client.send(type_clear);                    // 0
  rig.expect_dropped(client, "no serial is left");
  rig.check_honest();
}
END_TEST

START_TEST(what_belongs_in_no_group) {
  Rig rig;
  std::vector<Known> strangers{{type_group, sizeof(Group)}, {type_reply, 0}, {77, 0}};
  for (const Known& known : known_types) {
    const bool is_change = known.type >= type_set && known.type <= type_tool && known.type != type_clear;
    if (!is_change && known.type != type_bind && known.type != type_tool_radius) strangers.push_back(known);
  }
  for (const Known& stranger : strangers) {
    RawClient client = rig.join("group");
    client.set(0, push("push", 1), true);
    client.send(stranger.type, body(stranger.size), -1, true);
    client.set(1, push("pull", 1));
    rig.expect_dropped(client, "what belongs in no group");
  }
  rig.tick(50);
  ck_assert(is_near(rig.foreign_force(), {}));  // none of these groups had an effect
  rig.check_honest();
}
END_TEST

// A group that is shorter or longer than it declares, or whose last change is cut off; in the message or in a memory
// file.
START_TEST(groups_that_lie) {
  Rig rig;
  rig.others = 100;
  const Header head{type_set, 0, 0};
  const Set set{0, all_parts, fs::to_record(push("push", 1))};
  std::vector<std::byte> changes;
  for (const auto part : {fs::bytes_of(&head, 1), std::as_bytes(std::span(&set, 1))}) {
    changes.insert(changes.end(), part.begin(), part.end());
  }
  const uint64_t size = changes.size();
  const unsigned sealed = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;
  struct Lie {
    uint64_t told;
    size_t there;
    unsigned seals;
  };
  for (const Lie& lie : {Lie{size, size - 1, sealed}, Lie{size - 8, size - 8, sealed}, Lie{size + 8, size + 8, sealed},
                         Lie{size, size + 8, sealed}, Lie{0, size, sealed}, Lie{~uint64_t{0}, size, sealed},
                         Lie{uint64_t{1} << 40, size, sealed}, Lie{size, size, 0u}, Lie{size, size, F_SEAL_SHRINK}}) {
    const fs::wire::Group group{lie.told};
    if (lie.seals == sealed) {
      std::vector<std::byte> bytes(sizeof group + lie.there);
      std::memcpy(bytes.data(), &group, sizeof group);
      std::memcpy(bytes.data() + sizeof group, changes.data(), std::min<size_t>(lie.there, size));
      RawClient client = rig.join("lie");
      client.send(type_group, bytes);
      rig.expect_dropped(client, "a group that lies");
    }
    RawClient client = rig.join("lie");
    const fs::Descriptor file = memory_file(std::span(changes).first(std::min<size_t>(lie.there, size)), lie.there, lie.seals);
    client.send(type_group, group, file.get());
    rig.expect_dropped(client, "a group that lies, in a file");
  }
  rig.tick(50);
  ck_assert(is_near(rig.foreign_force(), {}));
  RawClient good = rig.join("good");
  const fs::wire::Group group{size};
  good.send(type_group, group, memory_file(changes, size, sealed).get());
  ck_assert_int_eq(rig.sync(good), FS_OK);
  ck_assert_uint_eq(rig.listed("good").objects, 1);
  rig.check_honest();
}
END_TEST

START_TEST(group_without_end) {
  fs_server_options options = server_options();
  options.max_objects = 100;
  Rig rig(options);
  RawClient endless = rig.join("endless"), broken = rig.join("broken");
  for (int i = 0; i < 4 * 100 + 65; ++i) endless.set(static_cast<uint32_t>(i) % 100, push("push", 1), i < 4 * 100 + 64);
  rig.expect_dropped(endless, "a group without end");
  // A client that leaves before its group is complete has changed nothing.
  broken.set(0, push("push", 1), true);
  broken.socket.reset();
  rig.tick(50);
  ck_assert(is_near(rig.foreign_force(), {}));
  // A group of the largest permitted size is taken.
  RawClient longest = rig.join("longest");
  for (uint32_t i = 0; i < 4 * 100 + 63; ++i) {
    longest.set(i % 100, push(("push" + std::to_string(i % 100)).c_str(), 1e-4), true);
  }
  longest.send(type_clutch, Clutch{0});
  ck_assert_int_eq(rig.sync(longest), FS_OK);
  ck_assert_uint_eq(rig.listed("longest").objects, 100);
  rig.check_honest();
}
END_TEST

// All of a group takes effect or none of it, even if a name gets another slot.
START_TEST(group_refused) {
  Rig rig;
  RawClient client = rig.join("group");
  client.set(0, push("a", 0.5));
  client.set(1, push("b", 0.5, {0, 1, 0}));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {0.5, 0.5, 0}); }));
  fs_object bad = push("bad", 1);
  bad.front.limit = -1;
  client.remove("a", true);
  client.set(5, push("a", 1), true);
  client.remove("b", true);
  client.set(7, push("b", 1), true);
  client.set(2, bad);
  ck_assert_int_eq(rig.sync(client), FS_ERROR_INVALID);
  ck_assert_int_eq(rig.sync(client), FS_OK);  // returned once
  for (int i = 0; i < 5; ++i) rig.expect_refusal(client, FS_ERROR_INVALID, "limit");
  ck_assert(is_near(rig.foreign_force(), {0.5, 0.5, 0}));
  ck_assert_uint_eq(rig.listed("group").objects, 2);
  ck_assert_uint_eq(rig.listed("group").refused, 5);
  client.set(0, push("a", 1));  // the slots are as they were
  client.set(1, push("b", 1, {0, 1, 0}));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {1, 1, 0}); }));
  rig.check_honest();
}
END_TEST

// ------------------------------------------------------------------------------------------------- slots and numbers

START_TEST(slot_out_of_range) {
  fs_server_options options = server_options();
  options.max_objects = 100;
  Rig rig(options);
  for (const uint32_t slot : {100u, 101u, 128u, 65536u, 1u << 31, ~0u - 1}) {
    for (const bool more : {false, true}) {
      const auto expect_dropped = [&](RawClient& client, const char* what) {
        if (more) client.remove("push");
        rig.expect_dropped(client, what);
      };
      RawClient set = rig.join("slot");
      set.set(slot, push("push", 1), more);
      expect_dropped(set, "set");
      RawClient change = rig.join("slot");
      change.send(type_change, Set{slot, all_parts, fs::to_record(push("push", 1))}, -1, more);
      expect_dropped(change, "change");
      RawClient bind = rig.join("slot");
      bind.send(type_bind, Bind{slot, 0, "push"}, -1, more);
      expect_dropped(bind, "bind");
    }
  }
  rig.check_honest();
}
END_TEST

// A slot belongs to the object that got it last; the object before keeps everything but its moves.
START_TEST(slots_of_others) {
  Rig rig;
  RawClient client = rig.join("mixed");
  client.set(1, push("a", 0.5));
  client.set(2, push("b", 0.5, {0, 1, 0}));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  const uint64_t after = client.set(2, push("a", 1));  // b has none any more
  ck_assert_int_eq(rig.sync(client), FS_OK);
  ck_assert_uint_eq(rig.listed("mixed").objects, 2);
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {1, 0.5, 0}); }));
  client.move(1, after, scenes::at(1, 0, 0));  // nobody's
  client.send(type_bind, Bind{~0u, 0, "a"});
  client.send(type_bind, Bind{1, 0, "b"});
  client.send(type_bind, Bind{7, 0, "nobody"});
  client.remove("nobody");
  client.place("nobody", fs::to_record(fs::Motion{}));
  client.send(type_change, Set{9, all_parts, fs::to_record(push("unknown", 2))});
  ck_assert_int_eq(rig.sync(client), FS_OK);
  fs_event event;
  ck_assert(!client.next_refusal(event));
  ck_assert(rig.until([&] { return is_near(rig.foreign_force(), {1, 0.5, 0}); }));
  // A client that uses another client's names for its own objects does not touch that client's objects.
  client.set(4, push("wall", 1, {0, 0, 1}));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  client.remove("wall");
  client.set(5, push("honest/wall", 1));
  rig.expect_refusal(client, FS_ERROR_INVALID, "'/'");
  rig.check_honest();
}
END_TEST

START_TEST(numbers_of_shapes) {
  Rig rig;
  for (const uint64_t id : {uint64_t{0}, of_server, of_server | 1, ~uint64_t{0}}) {
    RawClient shape = rig.join("number");
    shape.polyline(id, line);
    rig.expect_dropped(shape, "a shape's number");
    RawClient curve = rig.join("number");
    curve.expression(id, "d");
    rig.expect_dropped(curve, "a curve's number");
  }
  for (const bool is_shape : {false, true}) {  // the same twice
    RawClient twice = rig.join("twice");
    twice.polyline(1, line);
    if (is_shape) twice.polyline(1, line);
    else twice.expression(1, "d");
    rig.expect_dropped(twice, "a number twice");
  }

  RawClient client = rig.join("number");
  fs_object object = push("o", 1);
  object.primitive = FS_PRIMITIVE_POLYLINE;
  fs::wire::Object record = fs::to_record(object);
  const auto refused = [&](uint64_t shape, uint64_t curve, fs_status status, const char* part) {
    record.shape = shape;
    record.front = {FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 0, 1, 0, curve, {}};
    client.set(0, record);
    rig.expect_refusal(client, status, part);
  };
  client.polyline(1, line);
  client.expression(2, "1");
  refused(0, 2, FS_ERROR_INVALID, "shape is null");
  refused(7, 2, FS_ERROR_INVALID, "not sent");
  refused(1, 7, FS_ERROR_INVALID, "not sent");
  refused(1, 0, FS_ERROR_INVALID, "curve is null");
  refused(2, 2, FS_ERROR_INVALID, "shape is null");   // a curve is no shape
  refused(1, 1, FS_ERROR_INVALID, "curve is null");   // nor the other way round
  refused(of_server | 1, 2, FS_ERROR_STATE, "no longer");
  refused(1, of_server | 1, FS_ERROR_STATE, "no longer");
  refused(of_server, of_server, FS_ERROR_STATE, "no longer");
  client.forget(1);
  client.forget(1);
  client.forget(99);
  client.forget(of_server | 1);
  refused(1, 2, FS_ERROR_INVALID, "not sent");
  client.polyline(1, line);  // free again
  record.shape = 1;
  record.front.curve = 2;
  client.set(0, record);
  rig.sync(client);
  ck_assert_uint_eq(rig.listed("number").objects, 1);
  // A shape that is in use may be forgotten: the object keeps it.
  client.forget(1);
  client.forget(2);
  record.front.gain = 0.5;
  client.send(type_change, Set{0, FS_PART_POSE, record});
  ck_assert_int_eq(rig.sync(client), FS_OK);
  ck_assert_uint_gt(rig.listed("number").shape_bytes, 0);
  client.remove(fs::text_of(record.name));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  ck_assert_msg(rig.until([&] { return rig.listed("number").shape_bytes == 0; }), "its bytes are not given back");
  rig.check_honest();
}
END_TEST

// --------------------------------------------------------------------------------------------------- others' objects

START_TEST(bad_requests) {
  Rig rig;
  RawClient client = rig.join("asker");
  const char* nowhere[] = {"", "/", "honest", "honest/", "/wall", "honest/nothing", "nobody/wall", "server/", "server/x",
                           "honest/wall/", "honest//wall", "\xff/\xff"};
  for (const char* name : nowhere) {
    for (const uint32_t type : {type_get, type_report}) {
      ck_assert_int_eq(client.ask(type, target_of(name)), FS_ERROR_NOT_FOUND);
    }
    if (!std::strchr(name, '/')) continue;  // its own
    ck_assert_int_eq(client.ask(type_remove, remove_of(name)), FS_ERROR_NOT_FOUND);
    ck_assert_int_eq(client.ask(type_change, change_of(name, all_parts, push("wall", 1))), FS_ERROR_NOT_FOUND);
    ck_assert_int_eq(client.ask(type_place, move_of(name)), FS_ERROR_NOT_FOUND);
  }
  for (const char* name : {"", "nobody", "honest/wall", "/"}) {
    ck_assert_int_eq(client.ask(type_view, target_of(name)), FS_ERROR_NOT_FOUND);
  }
  Target endless;
  std::memset(endless.name, 'x', sizeof endless.name);
  for (const uint32_t type : {type_get, type_report, type_view}) {
    ck_assert_int_eq(client.ask(type, endless), FS_ERROR_NOT_FOUND);
  }
  for (const uint64_t id : {uint64_t{0}, uint64_t{1}, of_server | 1, ~uint64_t{0}}) {
    ck_assert_int_eq(client.ask(type_fetch, Fetch{id}), FS_ERROR_NOT_FOUND);
  }

  // A change that would make the object invalid is refused.
  const char* const wall = "honest/wall";
  const double nan = std::nan("");
  fs_object bad = push("wall", 1);
  bad.front.limit = nan;
  ck_assert_int_eq(client.ask(type_change, change_of(wall, FS_PART_PROFILES, bad)), FS_ERROR_INVALID);
  bad.pose.position.x = 1e300;
  ck_assert_int_eq(client.ask(type_change, change_of(wall, FS_PART_POSE, bad)), FS_ERROR_INVALID);
  ck_assert_int_eq(client.ask(type_change, change_of(wall, ~0u, bad)), FS_ERROR_INVALID);
  ck_assert_int_eq(client.ask(type_change, change_of(wall, 1u << 31, push("wall", 5))), FS_ERROR_INVALID);
  fs::wire::Object record = fs::to_record(bad);
  record.primitive = -7;
  ck_assert_int_eq(client.ask(type_change, change_of(wall, FS_PART_SHAPE, record)), FS_ERROR_INVALID);
  record.shape = of_server | 12345;
  ck_assert_int_eq(client.ask(type_change, change_of(wall, FS_PART_SHAPE, record)), FS_ERROR_STATE);
  const fs_pose poses[] = {{{nan, 0, 0}, {1, 0, 0, 0}}, {{1e16, 0, 0}, {1, 0, 0, 0}}, {{0, 0, 0}, {2, 0, 0, 0}}};
  for (const fs_pose& pose : poses) {
    ck_assert_int_eq(client.ask(type_place, move_of(wall, pose)), FS_ERROR_INVALID);
  }
  const fs_twist twist{{0, INFINITY, 0}, {}};
  ck_assert_int_eq(client.ask(type_place, move_of(wall, scenes::at(0, 0, 0), &twist)), FS_ERROR_INVALID);
  ck_assert_int_eq(client.ask(type_place, move_of(wall, scenes::at(0, 0, 0), nullptr, nan)), FS_ERROR_INVALID);
  rig.check_honest();
}
END_TEST

// A change of another client's object that waits for its shape is not overtaken by later changes of the same object.
START_TEST(later_changes_come_later) {
  for (const bool is_group : {false, true}) {
    Rig rig;
    RawClient alice = rig.join("alice"), bob = rig.join("bob");
    alice.set(0, push("t", 0.1));
    ck_assert_int_eq(rig.sync(alice), FS_OK);
    std::vector<fs_vec3> ring(scenes::is_sanitized ? 60000 : 300000);
    for (size_t i = 0; i < ring.size(); ++i) {
      const double angle = 2 * M_PI * static_cast<double>(i) / static_cast<double>(ring.size());
      ring[i] = {std::cos(angle), std::sin(angle), 0};
    }
    bob.polyline(77, ring);
    Set first = change_of("alice/t", all_parts, push("t", 0.1)), second = first;
    first.object.primitive = FS_PRIMITIVE_POLYLINE;
    first.object.shape = 77;
    const uint64_t first_serial = bob.send(type_change, first);
    if (is_group) bob.send(type_place, move_of("alice/t"), -1, true);
    const uint64_t second_serial = bob.send(type_change, second);
    ck_assert_int_eq(bob.status_of(bob.reply_of(first_serial)), FS_OK);
    if (!is_group) ck_assert_int_eq(bob.status_of(bob.reply_of(second_serial)), FS_OK);
    ck_assert_int_eq(rig.sync(bob), FS_OK);
    const auto got = bob.reply_of(bob.send(type_get, target_of("alice/t")));
    ck_assert_int_eq(bob.status_of(got), FS_OK);
    ck_assert_int_eq(got->as<Object>().primitive, FS_PRIMITIVE_PLANE);
  }
}
END_TEST

// The answer to a pull of an object that waits for its shape says of which. It does not count as applied until it is there.
START_TEST(a_pull_of_what_waits) {
  Rig rig;
  RawClient client = rig.join("waits");
  std::vector<fs_vec3> ring(300000);
  for (size_t i = 0; i < ring.size(); ++i) ring[i] = {std::cos(1e-5 * double(i)), std::sin(1e-5 * double(i)), 0};
  bool has_waited = false;
  for (uint64_t id = 1; id < 20 && !has_waited; ++id) {
    client.polyline(id, ring);
    Object line = fs::to_record(push("line", 0.1));
    line.primitive = FS_PRIMITIVE_POLYLINE;
    line.shape = id;
    const uint64_t set_serial = client.set(0, line);
    const auto reply = client.reply_of(client.send(type_pull, target_of("line")));
    ck_assert_int_eq(client.status_of(reply), FS_OK);
    const PullAnswer& told = reply->as<PullAnswer>();
    ck_assert_str_eq(told.object.name, "line");
    has_waited = told.state == pulled_waiting && client.outbox->applied.load() < set_serial;
    ck_assert_int_eq(rig.sync(client), FS_OK);
  }
  ck_assert(has_waited);
  rig.check_honest();
}
END_TEST

START_TEST(locked) {
  fs_server_options options = server_options();
  options.locked = true;
  Rig rig(options);
  OK(fs_object_set(rig.scene(), &(const fs_object&)push("own", 0.01)));
  RawClient client = rig.join("editor");
  for (const char* name : {"honest/wall", "server/own", "server/nothing"}) {
    ck_assert_int_eq(client.ask(type_change, change_of(name, 0, push("wall", 1))), FS_ERROR_DENIED);
    ck_assert_int_eq(client.ask(type_place, move_of(name)), FS_ERROR_DENIED);
    ck_assert_int_eq(client.ask(type_remove, remove_of(name)), FS_ERROR_DENIED);
  }
  ck_assert_int_eq(client.ask(type_get, target_of("honest/wall")), FS_OK);  // reading is allowed
  OK(fs_object_remove(rig.scene(), "own"));
  rig.check_honest();
}
END_TEST

// An own object is changed by its bare name only.
START_TEST(own_as_another) {
  Rig rig;
  RawClient client = rig.join("self");
  client.set(0, push("o", 1));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  for (const char* name : {"o", "self/o"}) {
    ck_assert_int_eq(client.ask(type_get, target_of(name)), FS_OK);
    ck_assert_int_eq(client.ask(type_report, target_of(name)), FS_OK);
  }
  ck_assert_int_eq(client.ask(type_remove, remove_of("self/o")), FS_ERROR_INVALID);
  ck_assert_int_eq(client.ask(type_place, move_of("self/o")), FS_ERROR_INVALID);
  ck_assert_int_eq(client.ask(type_change, change_of("self/o", 0, push("o", 1))), FS_ERROR_INVALID);
  client.remove("o");
  client.set(3, push("o", 1));
  ck_assert_int_eq(rig.sync(client), FS_OK);
  rig.check_honest();
}
END_TEST

// What the honest client reads about a hostile client's objects is valid: printable names and known primitives.
START_TEST(reports_of_nonsense) {
  Rig rig;
  RawClient client = rig.join("nonsense");
  fs::wire::Object record = fs::to_record(push("x", 1));
  const char* names[] = {"", "a/b", "\xff\xfe", "bell\a", "0123456789012345678901234567890123456789012345678901234567890123456789"};
  uint32_t slot = 0;
  for (const char* name : names) {
    fs::put_text(record.name, name);
    client.set(slot++, record);
  }
  fs::put_text(record.name, "odd");
  for (const int32_t primitive : {-1, 4, 0x7fffffff, INT32_MIN}) {
    record.primitive = primitive;
    client.set(slot++, record);
  }
  // The same, waiting for a shape.
  client.polyline(1, line);
  record.shape = 1;
  for (const char* name : names) {
    fs::put_text(record.name, name);
    client.set(slot++, record);
  }
  std::memset(record.name, 'x', sizeof record.name);
  client.set(slot++, record);
  rig.sync(client);
  const std::optional<RawClient::Reply> reply = rig.honest().reply_of(rig.honest().send(type_reports));
  ck_assert(reply && reply->status == FS_OK);
  std::vector<fs_report> list(reply->as<Count>().count);
  fs::read_blob(reply->data, 0, std::as_writable_bytes(std::span(list)));
  for (const fs_report& report : list) {
    int32_t primitive;
    std::memcpy(&primitive, &report.primitive, sizeof primitive);
    ck_assert_msg(primitive >= 0 && primitive <= FS_PRIMITIVE_MESH, "primitive %d", primitive);
    const std::string name = report.name;
    const size_t slash = name.find('/');
    ck_assert(slash == std::string::npos || name.find('/', slash + 1) == std::string::npos);
    ck_assert_msg(std::all_of(name.begin(), name.end(), [](char c) { return c >= 0x20 && c != 0x7f; }), "'%s'", name.c_str());
  }
  rig.check_honest();
}
END_TEST

// A refused object is reported as refused until it is removed, set again, or all objects are cleared.
START_TEST(refused_until_removed) {
  Rig rig;
  RawClient client = rig.join("refused");
  const auto state = [&](const char* name) {
    const auto reply = client.reply_of(client.send(type_report, target_of(name)));
    ck_assert(reply.has_value());
    return reply->status != FS_OK ? int{reply->status} : int{reply->as<fs_report>().state};
  };
  fs_object bad = push("bad", 1);
  bad.front.limit = -1;
  client.set(3, bad);
  rig.sync(client);
  ck_assert_int_eq(state("bad"), FS_OBJECT_REFUSED);
  ck_assert_int_eq(state("refused/bad"), FS_OBJECT_REFUSED);
  client.remove("bad");
  rig.sync(client);
  ck_assert_int_eq(state("bad"), FS_ERROR_NOT_FOUND);
  client.set(3, bad);
  client.set(3, push("bad", 1));
  rig.sync(client);
  ck_assert(rig.until([&] { return state("bad") == FS_OBJECT_FELT; }));
  client.set(3, bad);  // a change that is refused leaves it as it was
  rig.sync(client);
  ck_assert_int_eq(state("bad"), FS_OBJECT_FELT);
  client.set(4, [&] { fs_object o = bad; std::strcpy(o.name, "other"); return o; }());
  client.send(type_clear);
  rig.sync(client);
  ck_assert_int_eq(state("bad"), FS_ERROR_NOT_FOUND);
  ck_assert_int_eq(state("other"), FS_ERROR_NOT_FOUND);
  rig.check_honest();
}
END_TEST

// ------------------------------------------------------------------------------------------------------------ too much

// A client that sends requests all the time, and never reads the answers.
START_TEST(never_reads) {
  Rig rig;
  for (const uint32_t type : {type_pull, type_stats, type_reports, type_views, type_motions, type_motions_since, type_record, type_sync, type_get}) {
    RawClient client = rig.join("deaf");
    for (int i = 0; i < 100'000 && !client.is_dropped(); ++i) {
      client.send(type, body(*fs::record_size(type, fs::own_sizes())));
      if (i % 256 == 0) rig.tick();
    }
    rig.expect_dropped(client, "it never reads");
    // The answers that were under way arrive; they take little memory of the server.
    int files = 0;
    for (std::vector<std::byte> buffer(fs::most_message);;) {
      fs::Descriptor data;
      size_t size;
      bool is_cut;
      if (fs::receive_message(client.socket, buffer, size, {&data, 1}, is_cut) != fs::Transfer::done) break;
      files += bool(data);
    }
    ck_assert_msg(files <= 16, "%d answers with data were on their way", files);
    rig.check_honest();
  }
}
END_TEST

// Long lists, which take a while: for a client that leaves meanwhile, and for one that requests too many of them.
START_TEST(lists_for_nobody) {
  Rig rig;
  OK(fs_scene_begin(rig.scene()));
  for (int i = 0; i < 1500; ++i) {
    fs_object object = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    OK(fs_object_set(rig.scene(), &object));
  }
  OK(fs_scene_commit(rig.scene()));
  const size_t files = open_files();
  for (int round = 0; round < 30; ++round) {
    RawClient client = rig.join("nobody");
    for (int i = 0; i < 1 + round * 4; ++i) client.send(type_motions, target_of(round % 2 ? "" : "server"));
    if (round % 3) rig.tick(round % 3);
    if (round < 2) {  // who has more of them unread is let go of
      const auto reply = client.reply_of(client.serial);
      ck_assert(reply && reply->status == FS_OK && reply->as<Count>().count == (round % 2 ? 1501 : 1500));
    }
  }
  ck_assert(rig.until([&] { return open_files() == files; }));
  rig.check_honest();
}
END_TEST

// A client sends changes and moves as fast as it can: those of another client are still taken.
START_TEST(flood) {
  Rig rig;
  rig.others = 3;
  std::atomic<bool> is_over{false};
  std::atomic<int> rounds{0};
  RawClient clients[3] = {rig.join("sets"), rig.join("moves"), rig.join("asks")};
  const std::function<void(RawClient&, uint32_t)> works[3] = {
      [](RawClient& client, uint32_t i) { client.set(i % 64, push(("o" + std::to_string(i % 64)).c_str(), 0.01)); },
      [](RawClient& client, uint32_t i) {
        if (i < 64) client.set(i, push(("o" + std::to_string(i)).c_str(), 0.01));
        for (uint32_t slot = 0; slot < 64; ++slot) client.move(slot, slot + 1, scenes::at(0.001 * (i % 100), 0, 0));
      },
      [](RawClient& client, uint32_t) { client.ask(type_reports); }};
  std::vector<std::thread> threads;
  for (int k = 0; k < 3; ++k) {
    threads.emplace_back([&, k] {
      for (uint32_t i = 0; !is_over; ++i, ++rounds) works[k](clients[k], i);
    });
  }
  for (int i = 0; i < 100; ++i) rig.check_honest();
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_int_gt(rounds, 100);
  for (RawClient& client : clients) ck_assert_int_eq(rig.sync(client), FS_OK);  // that is no offence
}
END_TEST

// The server's own scene hears who comes, and how each goes.
START_TEST(comings_and_goings_are_told) {
  Rig rig;
  const auto expect_told = [&](const char* name, fs_status status, const char* text) {
    fs_event event;
    do event = scenes::next_event(rig.scene(), FS_EVENT_CLIENT);
    while (std::strcmp(event.name, name) != 0);
    ck_assert_str_eq(event.text, text);
    ck_assert_int_eq(event.status, status);
    ck_assert_double_eq(event.value, getpid());
    ck_assert_double_ge(event.time, 0);
  };
  expect_told("honest", FS_OK, "connected");
  fs_scene* polite = nullptr;
  ck_assert_int_eq(fs_scene_connect(rig.endpoint.c_str(), "polite", &polite), FS_OK);
  expect_told("polite", FS_OK, "connected");
  fs_scene_destroy(polite);
  expect_told("polite", FS_OK, "left");
  RawClient lost = rig.join("lost");
  expect_told("lost", FS_OK, "connected");
  lost.socket.reset();  // as the system does when its process ends
  expect_told("lost", FS_ERROR_DISCONNECTED, "was lost: it was killed, or ended without a word");
  RawClient bad = rig.join("bad");
  bad.send(9999);
  expect_told("bad", FS_OK, "connected");
  expect_told("bad", FS_ERROR_DISCONNECTED, "was disconnected by the server");
  RawClient stranger = rig.stranger();  // of one that never said its name nothing is told
  stranger.socket.reset();
  rig.check_honest();
  fs_event event;
  ck_assert_int_eq(fs_scene_next_event(rig.scene(), 0, &event), FS_OK);
  ck_assert_int_ne(event.kind, FS_EVENT_CLIENT);
}
END_TEST

int main() {
  Suite* suite = suite_create("hostile");
  scenes::add_once(suite, "sizes", {wrong_sizes, unknown_types, random_bodies});
  scenes::add_once(suite, "order", {serials_that_do_not_rise, what_belongs_in_no_group, groups_that_lie, group_without_end, group_refused});
  scenes::add_once(suite, "numbers", {slot_out_of_range, slots_of_others, numbers_of_shapes});
  scenes::add_once(suite, "others", {bad_requests, later_changes_come_later, a_pull_of_what_waits, locked, own_as_another, reports_of_nonsense, refused_until_removed});
  scenes::add_once(suite, "too much", {never_reads, lists_for_nobody, flood});
  scenes::add_once(suite, "told", {comings_and_goings_are_told});
  return scenes::run_suite(suite);
}
