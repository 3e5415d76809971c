// Random clients: what they send has the right form mostly, and any content; they come and go, edit each other's objects
// and write into their inboxes, while the servo ticks and the honest client must not notice. test_random_clients --seed N
// --seconds T.
#include <fcntl.h>
#include <sys/mman.h>

#include <bit>

#include "ipc/rig.h"
#include "servo/servo.h"

using namespace hostile;
using namespace fs::wire;
using fs::Descriptor;
using scenes::Random;

static uint64_t seed = 1;
static double seconds = 3;

constexpr size_t most_clients = 5;
constexpr uint32_t slots = 40;  // a client
constexpr uint64_t ids = 30;

static double number(Random& random) {
  static const double numbers[] = {0, 1, -1, 1e-9, 1e9, 1e15, -1e15, 1e300, std::numeric_limits<double>::infinity(),
                                   std::numeric_limits<double>::quiet_NaN()};
  if (random.coin(0.03)) return std::bit_cast<double>(random.bits());
  if (random.coin(0.1)) return numbers[random.below(std::size(numbers))];
  return random.between(-1, 1);
}
static fs_vec3 vector(Random& random) {
  return random.coin(0.8) ? random.in_box(0.05) : fs_vec3{number(random), number(random), number(random)};
}
static fs_pose pose(Random& random) {
  if (random.coin(0.9)) return random.pose(0.05);
  return {vector(random), {number(random), number(random), number(random), number(random)}};
}

static std::string formula(Random& random, int depth) {
  static const char* leaves[] = {"d", "t", "1", "0.01", "1e3", "_pi", "", "x", "1e400"};
  static const char* calls[] = {"sin", "exp", "log", "sqrt", "abs", "min", "max", "sum", "rint", "atan2", "nothing"};
  static const char* operators[] = {"+", "-", "*", "/", "^", "<", "&&", "==", ",", "?", "="};
  const uint64_t kind = depth == 0 ? 0 : random.below(5);
  if (kind == 0) return leaves[random.below(random.coin(0.9) ? 6 : std::size(leaves))];
  if (kind == 1) return "(" + formula(random, depth - 1) + ")";
  if (kind == 2) return std::string(calls[random.below(std::size(calls))]) + "(" + formula(random, depth - 1) + ")";
  if (kind == 3) return formula(random, depth - 1) + "?" + formula(random, depth - 1) + ":" + formula(random, depth - 1);
  return formula(random, depth - 1) + operators[random.below(random.coin(0.8) ? 8 : std::size(operators))] +
         formula(random, depth - 1);
}

class Actor {
 public:
  Actor(Rig& rig, Random& random) : rig_(rig), random_(random) {}

  void act() {
    if (!client_ || client_->is_dropped() || random_.coin(0.002)) return come();
    if (!client_->outbox) return greet();
    const double kind = random_.unit_interval();
    if (kind < 0.4) change();
    else if (kind < 0.5) upload();
    else if (kind < 0.75) write_inbox();
    else if (kind < 0.97) ask();
    else if (kind < 0.975) nonsense();
    else while (client_->reply_of(0, 1e-6)) {
    }
  }

 private:
  std::string name() { return std::string(1, static_cast<char>('a' + random_.below(most_clients))); }
  std::string object_name(uint32_t slot) { return "o" + std::to_string(random_.coin(0.95) ? slot : random_.below(slots)); }
  Target target() {
    Target out{};
    const std::string object = object_name(static_cast<uint32_t>(random_.below(slots)));
    const uint64_t kind = random_.below(10);
    fs::put_text(out.name, kind == 0 ? "server/" + object : kind == 1 ? object : kind == 2 ? name() : name() + "/" + object);
    if (random_.coin(0.02)) out.name[random_.below(sizeof out.name)] = static_cast<char>(random_.bits());
    return out;
  }
  // One of its own objects, or of the server's.
  uint64_t id() { return random_.coin(0.9) ? 1 + random_.below(ids) : of_server | random_.below(100'000); }

  // Changes a few bytes of a record.
  template <class Record>
  Record spoiled(Record record) {
    if (random_.coin(0.1)) {
      auto* bytes = reinterpret_cast<unsigned char*>(&record);
      const size_t count = 1 + random_.below(8);
      for (size_t i = 0; i < count; ++i) bytes[random_.below(sizeof record)] = static_cast<unsigned char>(random_.bits());
    }
    return record;
  }

  void come() {
    client_.reset();
    client_ = std::make_unique<RawClient>(rig_.stranger());
    is_in_group_ = false;
  }
  void greet() {
    if (random_.coin(0.1)) return come();
    client_->greet(spoiled(RawClient::hello(name())));
  }

  Profile profile() {
    Profile out{static_cast<int32_t>(random_.below(8)), static_cast<int32_t>(random_.below(2)), 0, 0, 0, 0, 0, 0, {}};
    if (out.kind == FS_PROFILE_NONE) return out;
    out.gain = out.kind == FS_PROFILE_LINEAR_DECREASING ? -random_.log_between(1e-3, 1e6) : random_.log_between(1e-3, 1e6);
    out.limit = random_.log_between(1e-6, 1e9);
    if (out.kind == FS_PROFILE_GAUSSIAN) out.width = random_.log_between(1e-4, 1);
    if (out.kind == FS_PROFILE_CUSTOM) out.curve = id();
    if (random_.coin(0.1)) out.gain = number(random_);
    if (random_.coin(0.1)) out.gain = 0;
    if (random_.coin(0.3)) out.reach = random_.log_between(1e-4, 10);
    return out;
  }
  Object object(uint32_t slot) {
    Object out = fs::to_record(fs_object_init(object_name(slot).c_str(), FS_PRIMITIVE_POINT));
    out.primitive = static_cast<int32_t>(random_.below(4));
    out.pose = pose(random_);
    if (random_.coin(0.2)) out.twist = {vector(random_), vector(random_)};
    out.front = profile();
    if (random_.coin(0.3)) out.back = profile();
    if (out.primitive == FS_PRIMITIVE_POLYLINE || out.primitive == FS_PRIMITIVE_MESH) out.shape = id();
    if (random_.coin(0.2)) out.damping = random_.log_between(1e-3, 1e9);
    if (random_.coin(0.2)) out.lifetime = random_.log_between(1e-3, 10);
    out.tool_points = random_.coin(0.9) ? 0 : static_cast<uint32_t>(random_.bits());
    out.enabled = random_.coin(0.9);
    if (random_.coin(0.2)) out.start = number(random_);
    return spoiled(out);
  }
  Motion motion() {
    return spoiled(Motion{pose(random_), {vector(random_), vector(random_)},
                            random_.coin(0.8) ? fs::steady_now() : number(random_),
                            random_.coin(0.8) ? random_.between(0, 0.1) : number(random_)});
  }

  Set foreign_change(uint32_t slot) {
    return change_of(target().name, static_cast<uint32_t>(random_.below(32)), object(slot));
  }
  Place foreign_move(const fs_twist& twist, double time) {
    return move_of(target().name, pose(random_), random_.coin() ? &twist : nullptr, time);
  }

  Bind bind(uint32_t slot) {
    Bind out{slot, 0, {}};
    fs::put_text(out.name, object_name(slot));
    return out;
  }

  void change() {
    const bool is_amid = is_in_group_;
    if (random_.coin(0.05)) is_in_group_ = !is_in_group_;
    const bool more = is_in_group_ && random_.coin(0.9);
    is_in_group_ = more;
    const auto slot = static_cast<uint32_t>(random_.below(slots));
    fs_frame frame = fs_frame_init();
    switch (random_.below(17)) {
      case 16: if (!is_amid && !more) client_->send(type_accuracy, spoiled(Accuracy{random_.log_between(1e-9, 1)})); break;
      case 0: if (!is_amid && !more) client_->send(type_clear); break;
      case 1:
        frame.pose = pose(random_);
        if (random_.coin()) frame.scale = random_.log_between(1e-9, 1e9);
        if (random_.coin()) frame.force_scale = random_.log_between(1e-9, 1e9);
        client_->send(type_frame, spoiled(Frame{frame}), -1, more);
        break;
      case 2: client_->send(type_clutch, Clutch{random_.below(2)}, -1, more); break;
      case 3: {
        if (random_.coin(0.3)) {
          const double radius = random_.coin() ? 0 : random_.log_between(1e-4, 0.1);
          client_->send(type_tool_radius, spoiled(ToolRadius{radius}), -1, more);
          break;
        }
        Tool tool{1 + random_.below(FS_TOOL_POINTS_MAX), {}};
        for (fs_vec3& point : tool.points) point = random_.in_box(0.05);
        client_->send(type_tool, spoiled(tool), -1, more);
        break;
      }
      case 4: client_->remove(object_name(slot), more); break;
      case 5: case 6: after_[slot] = client_->place(object_name(slot), motion(), more); break;
      case 7: case 8:
        client_->send(type_change, Set{slot, static_cast<uint32_t>(random_.below(32)), object(slot)}, -1, more);
        break;
      case 9: if (!is_in_group_) client_->forget(id()); break;
      case 10: after_[slot] = client_->send(type_bind, bind(slot), -1, more); break;
      case 11:
        if (!more) break;
        switch (random_.below(3)) {
          case 0: client_->send(type_change, spoiled(foreign_change(slot)), -1, true); break;
          case 1: client_->send(type_place, foreign_move({}, 0), -1, true); break;
          default: client_->send(type_remove, remove_of(target().name), -1, true);
        }
        break;
      default: after_[slot] = client_->set(slot, object(slot), all_parts, more);
    }
  }

  void upload() {
    if (is_in_group_) return;
    if (random_.coin(0.3)) return void(client_->expression(next_id_++ % ids + 1, formula(random_, 5).substr(0, 255).c_str()));
    const size_t count = random_.below(60), triangles = random_.coin() ? random_.below(40) : 0;
    std::vector<fs_vec3> points(count);
    for (fs_vec3& point : points) point = random_.coin(0.995) ? random_.in_box(0.1) : vector(random_);
    std::vector<uint32_t> corners(3 * triangles);
    for (uint32_t& corner : corners) corner = static_cast<uint32_t>(random_.below(count + (random_.coin(0.01) ? 2 : 0) + (count == 0)));
    std::vector<std::byte> bytes(count * sizeof(fs_vec3) + triangles * 12);
    if (count) std::memcpy(bytes.data(), points.data(), count * sizeof(fs_vec3));
    if (triangles) std::memcpy(bytes.data() + count * sizeof(fs_vec3), corners.data(), triangles * 12);
    constexpr unsigned all_seals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;
    const Descriptor file = memory_file(bytes, bytes.size() + (random_.coin(0.03) ? 8 : 0), random_.coin(0.97) ? all_seals : 0);
    const int descriptor = random_.coin(0.97) ? file.get() : -1;
    const uint64_t next = next_id_++ % ids + 1;
    if (random_.coin(0.5)) client_->forget(next);
    if (triangles == 0 && random_.coin(0.3)) {
      Curve curve{};
      curve.id = next;
      curve.count = 3 * count;
      curve.step = random_.log_between(1e-6, 1);
      client_->send(type_curve, spoiled(curve), descriptor);
    } else {
      const uint32_t primitive = triangles ? FS_PRIMITIVE_MESH : FS_PRIMITIVE_POLYLINE;
      client_->send(type_shape, spoiled(Shape{next, primitive, static_cast<uint32_t>(random_.below(2)), count, triangles}), descriptor);
    }
  }

  void ask() {
    if (is_in_group_) return;
    const auto slot = static_cast<uint32_t>(random_.below(slots));
    switch (random_.below(16)) {
      case 0: client_->send(type_sync); break;
      case 1: client_->send(type_pull, random_.coin() ? Target{} : target()); break;
      case 2: client_->send(type_get, target()); break;
      case 3: return fetch();
      case 4: case 5: client_->send(type_change, spoiled(foreign_change(slot))); break;
      case 6: client_->send(type_place, spoiled(foreign_move({vector(random_), vector(random_)}, number(random_)))); break;
      case 7: client_->send(type_remove, remove_of(target().name)); break;
      case 8: client_->send(type_report, target()); break;
      case 9: client_->send(type_reports); break;
      case 10: client_->send(random_.coin() ? type_clients : type_views); break;
      case 11: client_->send(type_view, target()); break;
      case 12: client_->send(type_stats); break;
      case 13: {
        const Target whose = random_.coin() ? Target{} : target();
        if (random_.coin()) client_->send(type_motions, whose);
        else client_->send(type_motions_since, Since{whose, random_.coin() ? 0 : random_.bits()});
        break;
      }
      case 14: client_->send(type_record, After{random_.coin() ? 0 : random_.bits()}); break;
      default: client_->send(type_device);
    }
    if (random_.coin(0.5)) client_->reply_of(client_->serial, 1e-3);
  }

  // Requests the shape and the curve of an object, as an editor does, and then uses them for an object of its own.
  void fetch() {
    const auto reply = client_->reply_of(client_->send(type_get, target()), 0.1);
    if (!reply || reply->status != FS_OK) return;
    Object record = reply->as<Object>();
    for (const uint64_t wanted : {record.shape, record.front.curve}) {
      if (wanted & of_server) client_->send(type_fetch, Fetch{random_.coin(0.9) ? wanted : id()});
    }
    const auto slot = static_cast<uint32_t>(random_.below(slots));
    fs::put_text(record.name, object_name(slot));
    after_[slot] = client_->set(slot, record);
  }

  void nonsense() {
    std::vector<std::byte> bytes(random_.below(600));
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random_.bits());
    client_->send(static_cast<uint32_t>(random_.below(120)), bytes);
  }

  void write_inbox() {
    const auto slot = static_cast<uint32_t>(random_.below(slots));
    const uint64_t kind = random_.below(20);
    if (kind == 0) client_->inbox.begin_batch();
    else if (kind < 4) client_->inbox.end_batch();
    else if (kind == 4) static_cast<std::atomic<uint64_t>*>(client_->inbox_memory.get())[random_.below(client_->welcome.inbox_bytes / 8)].store(random_.bits());
    else client_->inbox.write(slot, {random_.coin(0.9) ? after_[slot] : random_.below(1000), motion()});
  }

  Rig& rig_;
  Random& random_;
  std::unique_ptr<RawClient> client_;
  bool is_in_group_ = false;
  uint64_t after_[slots]{};
  uint64_t next_id_ = 0;
};

START_TEST(random_clients) {
  fs_server_options options = server_options();
  options.max_clients = most_clients + 1;
  options.max_megabytes = 1;
  options.max_objects = slots;
  Rig rig(options);
  rig.others = 2 * (most_clients + 1);  // those that fade out too
  Random random(seed);
  // An object of the server's own scene that clients may change. It has no client's force limit, so it is not felt.
  fs_frame unfelt = fs_frame_init();
  unfelt.force_scale = 0;
  OK(fs_scene_set_frame(rig.scene(), &unfelt));
  for (uint32_t i = 0; i < 5; ++i) {
    fs_object object = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    OK(fs_object_set(rig.scene(), &object));
  }
  const size_t files = open_files();
  uint64_t acts = 0;
  {
    std::vector<Actor> actors;
    for (size_t i = 0; i < most_clients; ++i) actors.emplace_back(rig, random);
    const double start = fs::steady_now();
    while (fs::steady_now() - start < seconds) {
      const uint64_t run = 1 + random.below(20);
      Actor& actor = actors[random.below(actors.size())];
      for (uint64_t i = 0; i < run; ++i, ++acts) actor.act();
      rig.tick(static_cast<int>(random.below(3)));
      if (random.coin(0.02)) rig.check_honest();
    }
  }
  std::printf("  seed %lu: %lu acts\n", (unsigned long)seed, (unsigned long)acts);
  ck_assert(rig.until([&] { return rig.servo()->channels().count() == 1; }));
  ck_assert(is_near(rig.foreign_force(), {}));
  ck_assert(rig.until([&] { return open_files() == files; }));
  rig.check_honest();
}
END_TEST

int main(int count, char** arguments) {
  for (int i = 1; i + 1 < count; i += 2) {
    if (std::strcmp(arguments[i], "--seed") == 0) seed = std::strtoull(arguments[i + 1], nullptr, 10);
    if (std::strcmp(arguments[i], "--seconds") == 0) seconds = std::strtod(arguments[i + 1], nullptr);
  }
  Suite* suite = suite_create("random clients");
  TCase* test_case = scenes::new_case(suite, "random");
  tcase_set_timeout(test_case, 0);
  tcase_add_test(test_case, random_clients);
  return scenes::run_suite(suite);
}
