// The wire: two clients of a server that send whatever they like, over their sockets and in the shared memory of their inboxes. The
// sessions are those of the server; this program takes the place of its thread, so that a case is the same each time.
#include <fcntl.h>
#include <poll.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <set>
#include <vector>

#include <forceserver/servo.h>

#include "base/error.h"
#include "base/text.h"
#include "fuzz/fuzz.h"
#include "ipc/blob.h"
#include "server/claims.h"
#include "server/clients.h"
#include "server/sessions.h"
#include "transfer/records.h"

using namespace fs::wire;
using fs::Descriptor;
using fuzz::Input;
using fuzz::require;

namespace {

constexpr double client_limit = 3;  // N

// ------------------------------------------------------------------------------------------------------- the server's part

class Host final : public fs::Host {
 public:
  Host(fs::Servo& servo, const fs_server_options& options)
      : servo_(servo), settings_(fs::parse_options(options, servo.settings())), clients_(servo, settings_.max_clients) {}
  ~Host() {
    for (const auto& session : sessions_) session->client().drop(0);
    jobs_.clear();
    sessions_.clear();
    clients_.remove_gone();
  }

  fs::Session& let_in(Descriptor socket) {
    const fs::Peer peer{getpid(), geteuid()};
    const auto session = std::make_shared<fs::Session>(*this, ++last_id_, std::move(socket), peer, FS_OK);
    sessions_.add(session);
    clients_.add(session->shared_client());
    return *session;
  }

  // Until nobody has anything to do. period: of slices of time, 0: none ends.
  void serve(uint32_t period) {
    period_ = period;
    constexpr int too_many = 100'000;
    int rounds = 0;
    for (bool is_done = false; !is_done; ++rounds) {
      require(rounds < too_many, "work without an end");
      is_done = true;
      for (const auto& session : sessions_) {
        if (!may_go_on(*session)) continue;
        session->resume();
        is_done = false;
      }
    }
  }
  void turn() {
    for (const auto& session : sessions_) session->turn(servo_.time());
    for (const auto& session : sessions_) session->end_turn();
    for (const auto& session : sessions_) session->keep_house();
    clients_.reap_leaving();
  }
  void work() {  // what the threads of its workers do
    for (std::list<fs::Worker::Job> job; !jobs_.empty();) {
      job.splice(job.end(), jobs_, jobs_.begin());
      fs::StopToken stop;
      job.front().work(stop);
      job.front().work = nullptr;
      if (const auto session = sessions_.find(job.front().owner)) session->take_job(job);
      else job.clear();
    }
  }
  void require_limits() const {
    for (const fs_client& client : clients_.describe()) {
      const fs_vec3 force = client.wrench.force;
      require(std::hypot(force.x, force.y, force.z) <= client_limit * (1 + 1e-9), "a force beyond the limit of its client");
    }
  }
  void bury() {
    static_cast<void>(sessions_.take_gone());
    clients_.remove_gone();
  }

 private:
  const fs::ServerSettings& settings() const noexcept override { return settings_; }
  fs::Servo& servo() const noexcept override { return servo_; }
  const fs::Clients& clients() const noexcept override { return clients_; }
  fs::Claims& claims() noexcept override { return claims_; }
  void start_job(fs::Client& client, uint64_t, std::function<void(fs::StopToken&)> work, std::function<void()> done) override {
    jobs_.push_back({std::move(work), std::move(done), client.id});
    ++client.jobs;
  }
  void destroy(std::shared_ptr<void> what) override { what.reset(); }
  bool is_slice_over() const noexcept override { return period_ && ++steps_ % period_ == 0; }
  void resume_later(const fs::Client&) noexcept override {}
  void note_activity() noexcept override {}
  std::span<std::byte> message_buffer() noexcept override { return message_; }
  void set_reading(const fs::Client& client, bool is_reading) noexcept override {
    if (is_reading) deaf_.erase(client.id);
    else deaf_.insert(client.id);
  }
  void require_room() override { clients_.require_room(); }
  void let_go(fs::Client& client) noexcept override {
    if (client.claim) claims_.end(*client.claim);
    clients_.note_leaving(client);
    jobs_.remove_if([&](const fs::Worker::Job& job) { return job.owner == client.id; });
  }

  bool may_go_on(const fs::Session& session) const {
    const fs::Client& client = session.client();
    if (client.is_gone || client.work.state() == fs::Work::State::waiting) return false;
    if (session.has_more()) return true;
    pollfd look{client.socket.get(), POLLIN, 0};
    return !deaf_.count(client.id) && poll(&look, 1, 0) > 0;
  }

  fs::Servo& servo_;
  const fs::ServerSettings settings_;
  fs::Clients clients_;
  fs::Claims claims_;
  fs::Sessions sessions_;
  std::list<fs::Worker::Job> jobs_;
  std::set<uint64_t> deaf_;
  std::vector<std::byte> message_ = std::vector<std::byte>(fs::most_message);
  uint64_t last_id_ = 0;
  uint32_t period_ = 0;
  mutable uint32_t steps_ = 0;
};

// ------------------------------------------------------------------------------------------------------ the clients' part

constexpr std::array<const char*, 10> names = {"a", "b", "c", "one/a", "two/b", "server/own", "one", "server", "", "nobody/x"};

// A record that is good, and of which some bytes are then changed.
class Record {
 public:
  template <class T>
  void put(const T& record) {
    const auto* const begin = reinterpret_cast<const std::byte*>(&record);
    bytes.insert(bytes.end(), begin, begin + sizeof record);
  }
  std::vector<std::byte> bytes;
  Descriptor content;
};

template <size_t size>
void put_name(Input& input, char (&out)[size]) {
  fs::put_text(out, names[input.below(names.size())]);
}

uint64_t number_of_asset(Input& input) {
  const uint8_t kind = input.byte();
  return kind < 160 ? kind % 5 : kind < 224 ? of_server | kind % 32 : input.take<uint64_t>();
}

// A memory file with the content of an asset, as a rule; now and then one that is too short, not sealed, or no memory file.
Descriptor content_of(Input& input, std::span<const std::byte> good) {
  const uint8_t kind = input.byte();
  if (kind < 200) return fs::make_blob({good});
  if (kind < 220) {
    const auto raw = input.bytes(input.byte());
    return fs::make_blob({std::as_bytes(raw)});
  }
  if (kind < 235) {
    Descriptor open_file(memfd_create("fuzz", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    require(write(open_file.get(), good.data(), good.size()) == static_cast<ssize_t>(good.size()), "no memory for a file");
    if (kind & 1) fcntl(open_file.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW);
    return open_file;
  }
  return kind < 245 ? Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)) : Descriptor();
}

Object object_record(Input& input) {
  fs_object object = fs_object_init("a", static_cast<fs_primitive>(input.below(4)));
  object.front = fs_profile_init(input.coin() ? FS_PROFILE_CONSTANT : FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 2);
  if (object.primitive == FS_PRIMITIVE_PLANE || object.primitive == FS_PRIMITIVE_MESH) {
    object.contact.keep = static_cast<fs_keep>(input.below(4));
    object.contact.stiffness = 300;
    object.contact.limit = 2;
  }
  object.time = input.coin() ? 0 : 1;
  object.start = 1;
  Object out = fs::to_record(object);
  put_name(input, out.name);
  if (object.primitive == FS_PRIMITIVE_POLYLINE || object.primitive == FS_PRIMITIVE_MESH || input.byte() < 8) {
    out.shape = number_of_asset(input);
  }
  if (input.byte() < 64) {
    out.front.kind = FS_PROFILE_CUSTOM;
    out.front.gain = 1;
    out.front.curve = number_of_asset(input);
  }
  if (input.byte() < 64) out.surface = number_of_asset(input);
  return out;
}

Record asset_record(Input& input, uint32_t type) {
  Record out;
  if (type == type_shape) {
    const std::vector<fs_vec3> points = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
    const std::vector<uint32_t> triangles = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
    const bool is_mesh = input.coin();
    Shape shape{number_of_asset(input), is_mesh ? FS_PRIMITIVE_MESH : FS_PRIMITIVE_POLYLINE, input.coin(), 4, is_mesh ? 4u : 0u};
    std::vector<std::byte> bytes(96 + (is_mesh ? 48 : 0));
    std::memcpy(bytes.data(), points.data(), 96);
    if (is_mesh) std::memcpy(bytes.data() + 96, triangles.data(), 48);
    out.put(shape);
    out.content = content_of(input, bytes);
  } else if (type == type_curve) {
    Curve curve{};
    curve.id = number_of_asset(input);
    const std::vector<double> table = {0, 1, 2, 0};
    if (input.coin()) {
      curve.count = table.size();
      curve.step = 0.01;
      out.content = content_of(input, std::as_bytes(std::span(table)));
    } else {
      fs::put_text(curve.expression, "2*exp(-d/0.01)");
    }
    out.put(curve);
  } else {
    Surface surface{};
    surface.id = number_of_asset(input);
    fs_surface_settings settings = fs_surface_settings_init();
    settings.static_friction = 0.5;
    settings.dynamic_friction = 0.2;
    const std::vector<double> heights = {0, -1e-3, -1e-3, 0};
    if (input.coin()) {
      settings.columns = settings.rows = 2;
      settings.column_width = settings.row_width = 0.01;
      surface.count = heights.size();
      out.content = content_of(input, std::as_bytes(std::span(heights)));
    }
    std::memcpy(surface.settings, &settings, sizeof settings);
    out.put(surface);
  }
  return out;
}

fs::wire::Motion motion(Input& input) {
  fs::wire::Motion out{{{0.001 * input.byte(), 0, 0}, {1, 0, 0, 0}}, {}, input.coin() ? 1.0 : 0.0, input.coin() ? 0.1 : 0};
  if (input.byte() < 16) out.horizon = unknown_horizon;
  return out;
}

Record record_of(Input& input, uint32_t type) {
  if (fs::is_asset(type)) return asset_record(input, type);
  Record out;
  Target target{};
  switch (type) {
    case type_set:
    case type_change: {
      const uint8_t slot = input.byte();
      out.put(Set{slot < 200 ? slot % 20u : slot < 240 ? no_slot : input.take<uint32_t>(),
                  input.coin() ? fs::all_parts : input.byte(), object_record(input)});
      break;
    }
    case type_place: {
      Place place{{}, motion(input)};
      put_name(input, place.name);
      out.put(place);
      break;
    }
    case type_bind: {
      Bind bind{input.below(20), 0, {}};
      put_name(input, bind.name);
      out.put(bind);
      break;
    }
    case type_frame: out.put(Frame{fs_frame_init()}); break;
    case type_clutch: out.put(Clutch{input.coin()}); break;
    case type_accuracy: out.put(Accuracy{0.01}); break;
    case type_max_stiffness: out.put(MaxStiffness{1000}); break;
    case type_tool: {
      Tool tool{1 + input.below(3), {}};
      tool.points[1].x = 0.01;
      out.put(tool);
      break;
    }
    case type_tool_radius: out.put(ToolRadius{0.002}); break;
    case type_forget: out.put(Forget{number_of_asset(input)}); break;
    case type_fetch: out.put(Fetch{number_of_asset(input)}); break;
    case type_record: out.put(After{input.byte()}); break;
    case type_motions_since:
      put_name(input, target.name);
      out.put(Since{target, input.byte()});
      break;
    case type_remove:
    case type_pull:
    case type_get:
    case type_report:
    case type_view:
    case type_motions:
      put_name(input, target.name);
      out.put(target);
      break;
    default: break;
  }
  return out;
}

void damage(Input& input, std::vector<std::byte>& bytes) {
  const uint8_t kind = input.byte();
  if (kind < 128 || bytes.empty()) return;
  if (kind < 224) {
    const size_t at = input.take<uint16_t>() % bytes.size() / 8 * 8;
    if (kind < 176) {
      const double number = input.number();
      if (at + sizeof number <= bytes.size()) std::memcpy(bytes.data() + at, &number, sizeof number);
    } else {
      input.fill(bytes.data() + at, std::min<size_t>(1 + kind % 8, bytes.size() - at));
    }
  } else if (kind < 240) {
    bytes.resize(input.take<uint16_t>() % (bytes.size() + 16));
  } else {
    input.fill(bytes.data(), std::min<size_t>(bytes.size(), input.byte()));
  }
}

constexpr uint32_t types[] = {
    type_shape, type_curve, type_forget, type_set, type_set, type_change, type_place, type_remove, type_clear, type_frame,
    type_clutch, type_tool, type_wake, type_bind, type_accuracy, type_max_stiffness, type_surface, type_tool_radius,  // 18 changes
    type_sync, type_pull, type_get, type_fetch, type_report, type_reports, type_clients, type_view, type_stats, type_device,
    type_stop_force, type_motions, type_views, type_record, type_resume_force, type_motions_since};

class HostileClient {
 public:
  HostileClient(Host& host, const char* name, Input& input) {
    int ends[2];
    require(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) == 0, "no sockets");
    socket_ = Descriptor(ends[0]);
    client_ = host.let_in(Descriptor(ends[1])).shared_client();
    Hello hello{};
    hello.magic = magic;
    hello.wire = version;
    hello.sizes = fs::own_sizes();
    fs::put_text(hello.client, name);
    std::vector<std::byte> bytes(sizeof hello);
    std::memcpy(bytes.data(), &hello, sizeof hello);
    if (input.byte() >= 224) damage(input, bytes);
    send(bytes, -1);
  }

  void act(Input& input) {
    switch (input.below(8)) {
      default: {
        const uint32_t type = types[input.below(std::size(types))];
        Record record = record_of(input, type);
        damage(input, record.bytes);
        send_message(type, record.bytes, record.content.get());
        break;
      }
      case 4: group(input); break;
      case 5: inbox_word(input); break;
      case 6: move(input); break;
      case 7: raw(input); break;
    }
    drain();
  }

 private:
  void send(std::span<const std::byte> bytes, int descriptor) {
    const std::span<const std::byte> parts[] = {bytes};
    static_cast<void>(fs::send_message(socket_, parts, std::span(&descriptor, descriptor >= 0 ? 1 : 0)));
  }
  void send_message(uint32_t type, std::span<const std::byte> body, int descriptor) {
    const Header header{type, 0, ++serial_};
    std::vector<std::byte> bytes(sizeof header);
    std::memcpy(bytes.data(), &header, sizeof header);
    bytes.insert(bytes.end(), body.begin(), body.end());
    send(bytes, descriptor);
  }
  void group(Input& input) {
    std::vector<std::byte> changes;
    for (unsigned left = input.below(6); left > 0; --left) {
      const uint32_t type = input.byte() < 240 ? types[input.below(18)] : input.take<uint32_t>();
      const Header header{type, 0, 0};
      Record record = record_of(input, type);
      damage(input, record.bytes);
      const auto* const begin = reinterpret_cast<const std::byte*>(&header);
      changes.insert(changes.end(), begin, begin + sizeof header);
      changes.insert(changes.end(), record.bytes.begin(), record.bytes.end());
    }
    Group group{changes.size()};
    if (input.byte() >= 240) group.bytes = input.take<uint64_t>();
    std::vector<std::byte> bytes(sizeof group);
    std::memcpy(bytes.data(), &group, sizeof group);
    if (input.coin()) {
      bytes.insert(bytes.end(), changes.begin(), changes.end());
      send_message(type_group, bytes, -1);
    } else {
      send_message(type_group, bytes, content_of(input, changes).get());
    }
  }
  void inbox_word(Input& input) {  // anything anywhere in the shared memory
    if (!client_->inbox_memory) return;
    auto* const words = static_cast<uint64_t*>(client_->inbox_memory.get());
    const size_t count = fs::Inbox::bytes(client_->host.settings().max_objects) / sizeof *words;
    const uint16_t at = input.take<uint16_t>();
    const double number = input.number();
    uint64_t bits;
    std::memcpy(&bits, &number, sizeof bits);
    // Mostly in its head, where a word says much.
    const size_t place = (at & 1 ? at / 2 % 24 : at / 2) % count;
    std::atomic_ref(words[place]).store(input.coin() ? bits : input.byte());
  }
  void move(Input& input) {
    if (!client_->inbox_memory) return;
    fs::Inbox inbox(client_->inbox_memory.get(), client_->host.settings().max_objects);
    Move move{input.coin() ? serial_ : input.byte(), motion(input)};
    if (input.byte() < 64) move.motion.pose.position.y = input.number();
    if (input.byte() < 16) inbox.begin_batch();
    inbox.write(input.below(20), move);
    if (input.byte() < 128) inbox.end_batch();
    if (input.byte() == 1) inbox.leave();
  }
  void raw(Input& input) {
    const uint8_t kind = input.byte();
    if (kind < 16) return socket_.reset();
    if (kind < 32) serial_ = input.take<uint64_t>();
    const auto bytes = input.bytes(input.byte());
    if (kind < 128) return send(std::as_bytes(bytes), -1);
    send_message(kind < 192 ? types[kind % std::size(types)] : input.take<uint32_t>(), std::as_bytes(bytes), -1);
  }
  // Reads what the server answers, and looks whether that keeps to the rules.
  void drain() {
    std::vector<std::byte>& buffer = buffer_;
    Descriptor data;
    for (size_t size = 0;;) {
      bool is_cut = false;
      if (!socket_ || fs::receive_message(socket_, buffer, size, {&data, 1}, is_cut) != fs::Transfer::done) return;
      if (!is_greeted_) {
        HelloAnswer answer;
        require(size >= sizeof answer, "a short greeting");
        std::memcpy(&answer, buffer.data(), sizeof answer);
        require(answer.magic == magic && strnlen(answer.text, sizeof answer.text) < sizeof answer.text, "a greeting");
        is_greeted_ = true;
        continue;
      }
      Header header;
      Reply reply;
      require(size >= sizeof header + sizeof reply, "a short answer");
      std::memcpy(&header, buffer.data(), sizeof header);
      std::memcpy(&reply, buffer.data() + sizeof header, sizeof reply);
      require(header.type == type_reply && strnlen(reply.text, sizeof reply.text) < sizeof reply.text, "an answer");
      require(reply.status == FS_OK || reply.text[0], "a refusal without a sentence");
    }
  }

  Descriptor socket_;
  std::shared_ptr<fs::Client> client_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(fs::most_message);
  uint64_t serial_ = 0;
  bool is_greeted_ = false;
};

// ------------------------------------------------------------------------------------------------------------ a case

struct Rig {
  fs_scene* scene = nullptr;
  fs_device* device = nullptr;
  fs_servo* servo = nullptr;

  Rig() {
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.fade = options.ramp = options.speed_limit = -1;
    const bool is_done = fs_scene_create(&scene) == FS_OK && fs_device_open("sim:?encoder=ideal", &device) == FS_OK &&
                         fs_servo_start(scene, device, &options, &servo) == FS_OK;
    require(is_done, "no servo:", fs_last_error());
  }
  ~Rig() {
    fs_servo_stop(servo);
    fs_device_close(device);
    fs_scene_destroy(scene);
  }
  void begin() const {
    fs_object own = fs_object_init("own", FS_PRIMITIVE_POINT);
    own.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 1);
    const bool is_done = fs_scene_clear(scene) == FS_OK && fs_object_set(scene, &own) == FS_OK &&
                         fs_servo_set_enabled(servo, true) == FS_OK;
    require(is_done, "no scene:", fs_last_error());
  }
  void step(unsigned ticks) const {
    require(fs_servo_step(servo, ticks) == FS_OK, "a step:", fs_last_error());
    fs_response response{};
    fs_wrench sent{};
    require(fs_scene_get_hand(scene, nullptr, &response, &sent) == FS_OK, "the hand:", fs_last_error());
    const double force = std::hypot(response.wrench.force.x, response.wrench.force.y, response.wrench.force.z);
    require(std::isfinite(force), "a force that is not finite");
    require(std::hypot(sent.force.x, sent.force.y, sent.force.z) <= 25 * (1 + 1e-9), "a force beyond the limit of the device");
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Rig rig;
  Input input(data, size);
  rig.begin();
  {
    fs_server_options options = fs_server_options_init();
    options.max_objects = 20;
    options.max_megabytes = 1;
    options.lease = 1e-9;
    options.force_limit = client_limit;
    const uint8_t kind = input.byte();
    options.locked = kind >= 240;
    Host host(*rig.servo, options);
    HostileClient one(host, "one", input), two(host, "two", input);
    host.serve(0);
    constexpr int most_acts = 200;
    for (int i = 0; i < most_acts && !input.is_empty(); ++i) {
      const uint8_t what = input.byte();
      (what & 1 ? one : two).act(input);
      if (what & 2) host.serve(what >> 5);
      if (what & 4) host.work();
      if (what & 8) host.turn();
      if (what & 16) rig.step(1 + (what >> 6)), host.require_limits();
      if ((what & 26) == 26) host.bury();
    }
    host.work();
    host.serve(1);
    host.turn();
    rig.step(2);
    host.require_limits();
    host.work();
    host.serve(0);
    host.turn();
  }
  // What the clients have left is gone by then.
  for (int i = 0; i < 100 && rig.servo->channels().count() > 0; ++i) {
    rig.step(1);
    rig.servo->channels().reap();
  }
  require(rig.servo->channels().count() == 0, "a client is left");
  return 0;
}
