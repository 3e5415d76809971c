// Shapes and curves from a hostile client: descriptors of anything but a sealed memory file of the right size, counts that
// lie, numbers that are none, expressions that are none. All are refused with a sentence, nobody else notices, and no
// descriptor is left behind.
#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "ipc/rig.h"

using namespace hostile;
using namespace fs::wire;
using fs::Descriptor;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr unsigned all_seals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;

static const fs_vec3 points[4]{{0, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}, {0.01, 0.01, 0}};
static const uint32_t corners[6]{0, 1, 2, 2, 1, 3};

static std::vector<std::byte> mesh_bytes() {
  std::vector<std::byte> out(sizeof points + sizeof corners);
  std::memcpy(out.data(), points, sizeof points);
  std::memcpy(out.data() + sizeof points, corners, sizeof corners);
  return out;
}
static Descriptor good_mesh() { return memory_file(mesh_bytes(), sizeof points + sizeof corners, all_seals); }

// Sends shapes and curves, each with an object that uses it.
struct Sender {
  Rig& rig;
  RawClient client;
  uint64_t id = 0;

  explicit Sender(Rig& r, const char* name = "sender") : rig(r), client(r.join(name)) { rig.sync(client); }

  void use(uint32_t primitive, bool is_curve) {
    fs::wire::Object record = fs::to_record(push("o", 1));
    record.primitive = is_curve ? 0 : static_cast<int32_t>(primitive & 3);
    if (is_curve) record.front = {FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 0, 1, 0, id, {}};
    else record.shape = id;
    client.set(0, record);
  }
  void send(Shape shape, int descriptor) {
    shape.id = ++id;
    client.send(type_shape, shape, descriptor);
    use(shape.primitive, false);
  }
  void send(Curve curve, int descriptor) {
    curve.id = ++id;
    client.send(type_curve, curve, descriptor);
    use(0, true);
  }
  template <class Record>
  fs_event refused(const Record& record, int descriptor, fs_status status, const char* part) {
    send(record, descriptor);
    const fs_event event = rig.expect_refusal(client, status, part);
    client.forget(id);
    ck_assert_int_eq(rig.sync(client), status);
    return event;
  }
  template <class Record>
  void taken(const Record& record, int descriptor) {
    send(record, descriptor);
    const fs_status status = rig.sync(client);
    fs_event event{};
    client.next_refusal(event);
    ck_assert_msg(status == FS_OK, "%s: %s", fs_status_name(status), event.text);
    client.remove("o");
    client.forget(id);
    ck_assert_int_eq(rig.sync(client), FS_OK);
  }
};

static Shape polyline(uint64_t count) { return {0, FS_PRIMITIVE_POLYLINE, 0, count, 0}; }
static Shape mesh(uint64_t point_count, uint64_t triangles) { return {0, FS_PRIMITIVE_MESH, 0, point_count, triangles}; }
static Curve table(uint64_t count, double step) {
  Curve out{};
  out.count = count;
  out.step = step;
  return out;
}
static Curve expression(const std::string& text) {
  Curve out{};
  text.copy(out.expression, sizeof out.expression);
  return out;
}

// -------------------------------------------------------------------------------------------------------- descriptors

START_TEST(seals) {
  Rig rig;
  Sender sender(rig);
  const size_t size = mesh_bytes().size();
  sender.taken(mesh(4, 2), good_mesh().get());
  for (unsigned present = 0; present < 16; ++present) {
    const unsigned seals = (present & 1 ? F_SEAL_SEAL : 0) | (present & 2 ? F_SEAL_SHRINK : 0) |
                           (present & 4 ? F_SEAL_GROW : 0) | (present & 8 ? F_SEAL_WRITE : 0);
    const Descriptor file = memory_file(mesh_bytes(), size, seals);
    if (seals == all_seals) sender.taken(mesh(4, 2), file.get());
    else sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, "seals");
  }
  constexpr unsigned future_write = 0x0010;  // F_SEAL_FUTURE_WRITE: what is mapped already may still be written
  const Descriptor file = memory_file(mesh_bytes(), size, F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | future_write);
  sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, "seals");
  const Descriptor unsealable(memfd_create("test", MFD_CLOEXEC));
  ck_assert_int_eq(ftruncate(unsealable.get(), static_cast<off_t>(size)), 0);
  sender.refused(mesh(4, 2), unsealable.get(), FS_ERROR_INVALID, "seals");
  // The regions themselves.
  sender.refused(mesh(4, 2), sender.client.inbox_file.get(), FS_ERROR_INVALID, "seals");
  sender.refused(mesh(4, 2), sender.client.outbox_file.get(), FS_ERROR_INVALID, "seals");
  rig.check_honest();
}
END_TEST

START_TEST(wrong_files) {
  Rig rig;
  Sender sender(rig);
  const size_t before = open_files();
  {
    int pipes[2], sockets[2];
    ck_assert(pipe2(pipes, O_CLOEXEC) == 0 && socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) == 0);
    const scenes::Folder folder;
    const Descriptor sealed = good_mesh();
    const std::string path = "/proc/self/fd/" + std::to_string(sealed.get());
    const std::string regular = folder / "file";
    const Descriptor files[] = {Descriptor(pipes[0]), Descriptor(pipes[1]), Descriptor(sockets[0]), Descriptor(sockets[1]),
                                Descriptor(eventfd(0, EFD_CLOEXEC)), Descriptor(epoll_create1(EPOLL_CLOEXEC)),
                                Descriptor(open("/", O_RDONLY | O_CLOEXEC)), Descriptor(open("/dev/zero", O_RDWR | O_CLOEXEC)),
                                Descriptor(open("/dev/null", O_RDWR | O_CLOEXEC)),
                                Descriptor(open(path.c_str(), O_PATH | O_CLOEXEC)),
                                Descriptor(open(regular.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600))};
    ck_assert_int_eq(ftruncate(files[10].get(), 96 + 24), 0);
    for (const Descriptor& file : files) {
      ck_assert(bool(file));
      sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, "seals");
      sender.refused(table(15, 1), file.get(), FS_ERROR_INVALID, "seals");
    }
    sender.refused(mesh(4, 2), -1, FS_ERROR_INVALID, "did not come");
    sender.refused(table(15, 1), -1, FS_ERROR_INVALID, "did not come");
    const Descriptor write_only(open(path.c_str(), O_WRONLY | O_CLOEXEC));
    if (write_only) sender.refused(mesh(4, 2), write_only.get(), FS_ERROR_IO, "read");
  }
  ck_assert(rig.until([&] { return open_files() == before; }));
  rig.check_honest();
}
END_TEST

START_TEST(wrong_lengths) {
  Rig rig;
  Sender sender(rig);
  const size_t right = mesh_bytes().size();
  for (const size_t size : {size_t{0}, right - 1, right + 1, right + 8, 2 * right, size_t{1} << 20}) {
    std::vector<std::byte> bytes = mesh_bytes();
    bytes.resize(std::min(right, size));
    const Descriptor file = memory_file(bytes, size, all_seals);
    sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, "120");  // the size that it must have
    sender.refused(table(15, 1), file.get(), FS_ERROR_INVALID, "120");
  }
  // The file offset of the descriptor does not matter.
  const Descriptor file = good_mesh();
  ck_assert_int_eq(lseek(file.get(), 50, SEEK_SET), 50);
  sender.taken(mesh(4, 2), file.get());
  rig.check_honest();
}
END_TEST

// More descriptors than the message needs, with every kind of message; and descriptors with messages that need none.
START_TEST(surplus_descriptors) {
  Rig rig;
  RawClient client = rig.join("generous");
  rig.sync(client);
  const size_t before = open_files();
  std::vector<int> files(253, STDIN_FILENO);
  std::vector<std::byte> bytes(sizeof(Header) + sizeof(Set));
  for (const size_t count : {size_t{1}, size_t{2}, size_t{3}, size_t{16}, size_t{17}, size_t{253}}) {
    Header header{type_set, 0, ++client.serial};
    const Set set{0, all_parts, fs::to_record(push("o", 0.1))};
    std::memcpy(bytes.data(), &header, sizeof header);
    std::memcpy(bytes.data() + sizeof header, &set, sizeof set);
    ck_assert(client.send_bytes(bytes, std::span(files).first(count)));
    ck_assert_int_eq(rig.sync(client), FS_OK);
    // Of several descriptors with a shape the first one counts.
    const Descriptor data = good_mesh();
    files[0] = data.get();
    header = {type_shape, 0, ++client.serial};
    Shape shape = mesh(4, 2);
    shape.id = client.serial;
    std::vector<std::byte> message(sizeof header + sizeof shape);
    std::memcpy(message.data(), &header, sizeof header);
    std::memcpy(message.data() + sizeof header, &shape, sizeof shape);
    ck_assert(client.send_bytes(message, std::span(files).first(count)));
    files[0] = STDIN_FILENO;
    ck_assert_int_eq(rig.sync(client), FS_OK);
  }
  ck_assert_msg(rig.until([&] { return open_files() == before; }), "descriptors are left: %zu, there were %zu",
                open_files(), before);
  // Descriptors are not left open either when the client is dropped for the message that came with them.
  for (int i = 0; i < 20; ++i) {
    RawClient bad = rig.join("bad");
    const Header header{777, 0, 1};
    bad.send_bytes(fs::bytes_of(&header, 1), std::span(files).first(10));
    rig.expect_dropped(bad, "an unknown type with descriptors");
  }
  ck_assert(rig.until([&] { return open_files() == before; }));
  rig.check_honest();
}
END_TEST

// ------------------------------------------------------------------------------------------------------------ content

START_TEST(lying_counts) {
  Rig rig;
  Sender sender(rig);
  const Descriptor file = good_mesh();
  const uint64_t largest = ~uint64_t{0};
  // Times 24, 12 or 8 these are 120 again, or near it, in 64 bits.
  const uint64_t around = (uint64_t{1} << 61) + 5, half = uint64_t{1} << 62;
  for (const uint64_t count : {largest, largest / 24, largest / 24 + 6, around, half, uint64_t{4'000'000'001}}) {
    sender.refused(polyline(count), file.get(), FS_ERROR_INVALID, "too many");
    sender.refused(mesh(count, 2), file.get(), FS_ERROR_INVALID, "too many");
    sender.refused(mesh(4, count), file.get(), FS_ERROR_INVALID, "too many");
    sender.refused(mesh(count, count), file.get(), FS_ERROR_INVALID, "too many");
  }
  sender.refused(mesh(4, 500'000'001), file.get(), FS_ERROR_INVALID, "too many");
  for (const uint64_t count : {largest, (uint64_t{1} << 61) + 15, (uint64_t{1} << 40) + 1}) {
    sender.refused(table(count, 1), file.get(), FS_ERROR_INVALID, "too many");
  }
  // Counts that are valid, but more than a client may have, or than the file holds.
  sender.refused(polyline(4'000'000'000), file.get(), FS_ERROR_FULL, "max_megabytes");
  sender.refused(mesh(4, 500'000'000), file.get(), FS_ERROR_FULL, "max_megabytes");
  sender.refused(table(uint64_t{1} << 40, 1), file.get(), FS_ERROR_FULL, "max_megabytes");
  sender.refused(mesh(3, 2), file.get(), FS_ERROR_INVALID, "must be 96");
  sender.refused(mesh(5, 2), file.get(), FS_ERROR_INVALID, "must be 144");
  Shape triangles_of_a_line = polyline(4);
  triangles_of_a_line.triangle_count = 2;
  sender.refused(triangles_of_a_line, file.get(), FS_ERROR_INVALID, "triangles");
  for (const uint32_t primitive : {0u, 2u, 4u, 1u << 31, ~0u}) {
    Shape shape = mesh(4, 2);
    shape.primitive = primitive;
    sender.refused(shape, file.get(), FS_ERROR_INVALID, "primitive");
  }
  rig.check_honest();
}
END_TEST

START_TEST(bad_points) {
  Rig rig;
  Sender sender(rig);
  const Descriptor nothing = memory_file({}, 0, all_seals);
  sender.refused(polyline(0), nothing.get(), FS_ERROR_INVALID, "at least 2");
  sender.refused(mesh(0, 0), nothing.get(), FS_ERROR_INVALID, "no triangle");
  const Descriptor one = memory_file(fs::bytes_of(points, 1), sizeof points[0], all_seals);
  sender.refused(polyline(1), one.get(), FS_ERROR_INVALID, "at least 2");
  const Descriptor unmeshed = memory_file(fs::bytes_of(points, 4), sizeof points, all_seals);
  sender.refused(mesh(4, 0), unmeshed.get(), FS_ERROR_INVALID, "no triangle");
  const Descriptor pointless = memory_file(fs::bytes_of(corners, 6), sizeof corners, all_seals);
  sender.refused(mesh(0, 2), pointless.get(), FS_ERROR_INVALID, "points");
  for (const double bad : {std::nan(""), infinity, -infinity, 1.1e15, -1e300}) {
    for (size_t at = 0; at < 12; ++at) {
      std::vector<std::byte> bytes = mesh_bytes();
      std::memcpy(bytes.data() + at * sizeof bad, &bad, sizeof bad);
      const Descriptor file = memory_file(bytes, bytes.size(), all_seals);
      const std::string named = "points[" + std::to_string(at / 3) + "]." + "xyz"[at % 3];
      sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, named.c_str());
    }
  }
  for (const uint32_t bad : {4u, 5u, 1u << 31, ~0u}) {
    for (size_t at = 0; at < 6; ++at) {
      std::vector<std::byte> bytes = mesh_bytes();
      std::memcpy(bytes.data() + sizeof points + at * sizeof bad, &bad, sizeof bad);
      const Descriptor file = memory_file(bytes, bytes.size(), all_seals);
      sender.refused(mesh(4, 2), file.get(), FS_ERROR_INVALID, ("triangles[" + std::to_string(at / 3) + "]").c_str());
    }
  }
  // All points in one place, or at the largest coordinates: these are valid shapes.
  const fs_vec3 same[8]{};
  const Descriptor heap = memory_file(fs::bytes_of(same, 8), sizeof same, all_seals);
  sender.taken(polyline(8), heap.get());
  const fs_vec3 far[2]{{-1e15, 1e15, 1e15}, {1e15, -1e15, 1e15}};
  const Descriptor line = memory_file(fs::bytes_of(far, 2), sizeof far, all_seals);
  sender.taken(polyline(2), line.get());
  rig.check_honest();
}
END_TEST

// A file of 900 MB that costs its maker nothing. The thread sanitizer would take minutes and five times the memory.
#ifdef __SANITIZE_THREAD__
constexpr uint64_t sparse_points = 3'750'000;
#else
constexpr uint64_t sparse_points = 37'500'000;
#endif

START_TEST(sparse_file) {
  fs_server_options options = server_options();
  options.max_megabytes = 80;
  {
    Rig rig(options);
    Sender sender(rig);
    constexpr uint64_t count = sparse_points;
    const Descriptor file = memory_file({}, count * sizeof(fs_vec3), all_seals);
    sender.refused(polyline(count), file.get(), FS_ERROR_FULL, "80 MB");
    rig.check_honest();
  }
  options.max_megabytes = 0;
  Rig rig(options);
  Sender sender(rig);
  constexpr uint64_t count = sparse_points;
  Descriptor file = memory_file({}, count * sizeof(fs_vec3), 0);
  const double nan = std::nan("");
  ck_assert_int_eq(pwrite(file.get(), &nan, sizeof nan, count * sizeof(fs_vec3) - sizeof nan), sizeof nan);
  ck_assert_int_eq(fcntl(file.get(), F_ADD_SEALS, all_seals), 0);
  sender.send(polyline(count), file.get());
  for (int i = 0; i < 10; ++i) rig.check_honest();  // while it is read
  rig.expect_refusal(sender.client, FS_ERROR_INVALID, ("points[" + std::to_string(count - 1) + "].z").c_str());
  rig.check_honest();
}
END_TEST

START_TEST(max_megabytes) {
  fs_server_options options = server_options();
  options.max_megabytes = 1;
  Rig rig(options);
  Sender sender(rig);
  const auto file_of = [](uint64_t count) { return memory_file({}, count * sizeof(fs_vec3), all_seals); };
  sender.refused(polyline(41'667), file_of(41'667).get(), FS_ERROR_FULL, "1 MB");
  sender.taken(polyline(41'666), file_of(41'666).get());
  ck_assert(rig.until([&] { return rig.listed("sender").shape_bytes == 0; }));
  // Two of half the size; the second is refused as long as the first is there, in use or not.
  const Descriptor half = file_of(30'000);
  sender.send(polyline(30'000), half.get());
  ck_assert_int_eq(rig.sync(sender.client), FS_OK);
  const uint64_t first = sender.id;
  const fs_event event = sender.refused(polyline(30'000), half.get(), FS_ERROR_FULL, "1.4 MB");
  ck_assert_str_eq(event.name, "o");
  ck_assert_uint_eq(rig.listed("sender").shape_bytes, 720'000);
  sender.client.forget(first);
  sender.refused(polyline(30'000), half.get(), FS_ERROR_FULL, "max_megabytes");
  sender.client.remove("o");
  ck_assert(rig.until([&] { return rig.listed("sender").shape_bytes == 0; }));
  sender.taken(polyline(30'000), half.get());
  // Another client has its own limit.
  Sender other(rig, "other");
  other.taken(polyline(30'000), half.get());
  rig.check_honest();
}
END_TEST

START_TEST(bad_curves) {
  Rig rig;
  Sender sender(rig);
  const double entries[15]{1, std::nan(""), infinity, -1, 1e300, 5};
  const Descriptor file = memory_file(fs::bytes_of(entries, 15), sizeof entries, all_seals);
  const Descriptor one = memory_file(fs::bytes_of(entries, 1), 8, all_seals);
  sender.taken(table(15, 0.01), file.get());
  sender.refused(table(1, 0.01), one.get(), FS_ERROR_INVALID, "at least 2");
  for (const double step : {0.0, -1.0, std::nan(""), infinity}) {
    sender.refused(table(15, step), file.get(), FS_ERROR_INVALID, "step");
  }
  if (!scenes::has_expressions()) return;
  const auto nested = [](int depth) { return std::string(depth, '(') + "d" + std::string(depth, ')'); };
  const std::string bad[] = {"", " ", "(", ")", "d)", "(d", std::string(250, '('), nested(127).substr(1), "d+", "*d",
                             "a", "d=1", "1,2", "\"x\"", "f(d)", "d\n", "\xff", "sin", "sin(", "sin()", "sin(1,2)",
                             "max()", "?:", "1?2", "d?d", "1:2", "--", "d d", "1e", "1.2.3", "0x", "d[1]", "$", "{d}",
                             "if(d", "rnd(", "_pi(", "!d", "d&&", "^", "d^", "%", "d%2", "~d", "#"};
  for (const std::string& text : bad) {
    sender.send(expression(text), -1);
    fs_event event;
    ck_assert_msg(rig.until([&] { return sender.client.next_refusal(event); }), "taken: %s", text.c_str());
    ck_assert_msg(event.status == FS_ERROR_PARSE || event.status == FS_ERROR_INVALID, "%s: %s", text.c_str(), event.text);
    rig.sync(sender.client);
  }
  sender.taken(expression(nested(127)), -1);
  std::string longest = "d";
  while (longest.size() < 255) longest += "+d";
  sender.taken(expression(longest.substr(0, 255)), -1);
  sender.refused(expression(longest + "+d"), -1, FS_ERROR_INVALID, "255");  // the text has no final 0

  // An expression with a bad value gives no force, and never more than the limit.
  for (const char* text : {"1/0", "0/0", "log(-1)", "1e308*1e308", "-1e308*1e308", "exp(1e9)", "sqrt(0-1)", "tan(1e300)",
                           "10^1000*d", "1e300"}) {
    sender.send(expression(text), -1);
    rig.sync(sender.client);
    rig.tick(30);
  }
  rig.check_honest();
}
END_TEST

// A mesh that is being built does not delay the end of its client or of the server.
START_TEST(gone_while_building) {
  const size_t before = open_files();
  {
    Rig rig;
    const Descriptor file = memory_file({}, 100'000 * sizeof(fs_vec3), all_seals);
    for (int i = 0; i < 5; ++i) {
      Sender sender(rig);
      for (int k = 0; k < 100; ++k) sender.send(polyline(100'000), file.get());
      sender.client.socket.reset();
      rig.check_honest();
    }
    Sender last(rig);
    for (int k = 0; k < 10; ++k) last.send(polyline(100'000), file.get());
    rig.stop_server();
    ck_assert(last.client.is_soon_dropped());
  }
  ck_assert_uint_eq(open_files(), before);
}
END_TEST

int main() {
  Suite* suite = suite_create("blobs");
  scenes::add_once(suite, "descriptors", {seals, wrong_files, wrong_lengths, surplus_descriptors});
  scenes::add_once(suite, "content", {lying_counts, bad_points, sparse_file, max_megabytes, bad_curves, gone_while_building});
  return scenes::run_suite(suite);
}
