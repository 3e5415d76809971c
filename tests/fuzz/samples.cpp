// Samples of a stranger in the room of a bridge, as the bridge gets them from DDS: sites, clients, objects, motions, contents,
// edits and answers. They are written and read in this process, and what comes of them is set at a server of this process.
#include <array>
#include <deque>
#include <functional>
#include <vector>

#include "edits.h"
#include "fuzz/fuzz.h"
#include "incoming.h"

using namespace bridge;
using fuzz::Input;
using fuzz::require;

namespace {

constexpr std::array<const char*, 6> sites = {"there", "here", "far.site", "x", "", "UPPER"};
constexpr std::array<const char*, 6> clients = {"rover", "arm", "server", "with@at", "", "a/b"};
constexpr std::array<const char*, 5> names = {"wall", "guide", "", "two words", "c/d"};
constexpr std::array<const char*, 4> keys = {"there-1", "there-2", "0123456789abcdef0123456789abcdef", ""};

// A writer of a participant of its own, as a reader of the bridge ignores what its own participant writes.
template <class T>
class Pen {
 public:
  Pen(dds_entity_t participant, dds_entity_t publisher) {
    const Entity topic(dds_create_topic(participant, &TopicOf<T>::type, TopicOf<T>::name, nullptr, nullptr), "a topic");
    const Qos qos = make_qos();
    constexpr Service service = TopicOf<T>::service;
    dds_qset_reliability(qos.get(), service == Service::stream ? DDS_RELIABILITY_BEST_EFFORT : DDS_RELIABILITY_RELIABLE, 0);
    dds_qset_durability(qos.get(), service == Service::state ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    writer_ = Entity(dds_create_writer(publisher, topic.get(), qos.get(), nullptr), "a writer");
  }
  void write(const T& sample) const { dds_write(writer_.get(), &sample); }
  void dispose(const T& sample) const {
    dds_writedispose(writer_.get(), &sample);
    dds_unregister_instance(writer_.get(), &sample);
  }

 private:
  Entity writer_;
};

struct Pens {
  explicit Pens(uint32_t domain, const char* partition)
      : participant(dds_create_participant(domain, nullptr, nullptr), "a stranger"), publisher([&] {
          const Qos qos = make_qos();
          dds_qset_partition(qos.get(), 1, &partition);
          return Entity(dds_create_publisher(participant.get(), qos.get(), nullptr), "a publisher");
        }()) {}
  Entity participant, publisher;
  Pen<forceserver_Status> status{participant.get(), publisher.get()};
  Pen<forceserver_ForceObject> objects{participant.get(), publisher.get()};
  Pen<forceserver_ClientView> clients{participant.get(), publisher.get()};
  Pen<forceserver_Motions> motions{participant.get(), publisher.get()};
  Pen<forceserver_Shape> shapes{participant.get(), publisher.get()};
  Pen<forceserver_Curve> curves{participant.get(), publisher.get()};
  Pen<forceserver_Surface> surfaces{participant.get(), publisher.get()};
  Pen<forceserver_Edit> edits{participant.get(), publisher.get()};
  Pen<forceserver_Answer> answers{participant.get(), publisher.get()};
};

// Writes samples, and takes all of them back in the end.
class Stranger {
 public:
  Stranger(const Pens& room, Input& input) : room_(room), input_(input) {}
  ~Stranger() {
    for (const auto& take_back : written_) take_back();
  }

  void write() {
    switch (input_.below(12)) {
      case 0: return status();
      case 1: return view();
      case 2: return motions();
      case 3: return shape();
      case 4: return curve();
      case 5: return surface();
      case 6: return edit();
      case 7: return answer();
      case 8: return forget();
      default: return object();
    }
  }

 private:
  template <class T>
  void publish(const Pen<T>& pen, const T& sample, T key) {
    pen.write(sample);
    written_.push_back([&pen, key] { pen.dispose(key); });
  }
  void forget() {
    if (written_.empty()) return;
    written_.back()();
    written_.pop_back();
  }

  template <size_t size, size_t count>
  void put(char (&out)[size], const std::array<const char*, count>& usual) {
    const uint8_t kind = input_.byte();
    if (kind < 224) {
      put_text(out, usual[kind < 112 ? 0 : kind % count]);
    } else {
      put_text(out, input_.text(size));
    }
  }
  double some(double usual) { return input_.byte() < 208 ? usual : input_.number(); }
  uint64_t revision() { return input_.byte() < 208 ? ++revision_ : input_.take<uint64_t>(); }

  forceserver_Pose pose() {
    return {{some(0.001 * input_.byte()), some(0), some(0)}, {some(1), some(0), some(0), some(0)}};
  }
  forceserver_Twist twist() { return {{some(0), some(0), some(0)}, {some(0), some(0), some(0)}}; }
  forceserver_Profile profile() {
    forceserver_Profile out{};
    out.kind = input_.choice(FS_PROFILE_CUSTOM);
    out.sense = input_.choice(FS_SENSE_REPULSIVE);
    out.gain = some(out.kind == FS_PROFILE_NONE ? 0 : 2);
    out.width = some(out.kind == FS_PROFILE_GAUSSIAN ? 0.01 : 0);
    out.limit = some(out.kind == FS_PROFILE_NONE ? 0 : 3);
    out.reach = some(0);
    out.shift = some(0);
    if (out.kind == FS_PROFILE_CUSTOM || input_.byte() == 1) put(out.curve, keys);
    return out;
  }
  forceserver_Contact contact() {
    return {input_.choice(FS_KEEP_EITHER), some(300), some(3), some(0), some(0)};
  }
  // What an object and an edit have in common.
  template <class T>
  void describe(T& out) {
    out.primitive = input_.choice(FS_PRIMITIVE_MESH);
    out.place = pose();
    out.motion = twist();
    out.time = some(0);
    out.start = some(0);
    out.horizon = some(0);
    out.front = profile();
    const bool has_surface = out.primitive == FS_PRIMITIVE_PLANE || out.primitive == FS_PRIMITIVE_MESH;
    if (has_surface) out.back = profile();
    out.damping = some(0);
    if (has_surface) out.solid = contact();
    if (out.primitive == FS_PRIMITIVE_POLYLINE || out.primitive == FS_PRIMITIVE_MESH) put(out.form, keys);
    if (has_surface && input_.byte() < 64) put(out.finish, keys);
    out.tool_points = input_.byte() < 224 ? 0 : input_.take<uint32_t>();
    out.enabled = input_.byte() < 224;
  }

  void object() {
    forceserver_ForceObject out{};
    put(out.site, sites);
    put(out.client, clients);
    put(out.name, names);
    out.session = input_.byte() / 200;
    out.revision = revision();
    out.change = input_.byte() < 128 ? out.revision : 1;
    out.change_size = input_.byte() < 200 ? 1 : input_.below(5);
    describe(out);
    publish(room_.objects, out, out);
  }
  void status() {
    forceserver_Status out{};
    put(out.site, sites);
    out.session = input_.byte() / 200;
    put_text(out.version, input_.text(40));
    out.has_server = out.enabled = true;
    put_text(out.device, input_.text(80));
    for (double* const field : {&out.workspace_radius, &out.workspace_height, &out.workspace_angle, &out.force_max, &out.torque_max,
                                &out.device_damping, &out.mass, &out.rate, &out.max_stiffness, &out.damping, &out.delay,
                                &out.motion_rate}) {
      *field = some(0.2);
    }
    out.digest = input_.byte();
    std::vector<forceserver_HeldObjects> held(input_.below(4));
    for (auto& entry : held) put(entry.site, sites);
    std::vector<std::array<char, 33>> wanted(input_.below(4));
    for (auto& key : wanted) put_text(reinterpret_cast<char(&)[33]>(*key.data()), keys[input_.below(keys.size())]);
    const forceserver_Status key = out;
    lend(out.held, held);
    out.wanted._buffer = reinterpret_cast<char(*)[33]>(wanted.data());
    out.wanted._length = out.wanted._maximum = static_cast<uint32_t>(wanted.size());
    publish(room_.status, out, key);
  }
  void view() {
    forceserver_ClientView out{};
    put(out.site, sites);
    put(out.client, clients);
    out.frame = pose();
    out.scale = some(1);
    out.force_scale = some(1);
    out.clutch_held = input_.byte() < 32;
    out.tool_radius = some(0);
    std::vector<forceserver_Vec3> tool(input_.byte() < 200 ? 1 : input_.below(33));
    for (auto& point : tool) point = {some(0), some(0), some(0)};
    const forceserver_ClientView key = out;
    lend(out.tool, tool);
    publish(room_.clients, out, key);
  }
  void motions() {
    forceserver_Motions out{};
    put(out.site, sites);
    out.session = input_.byte() / 200;
    out.sent = some(input_.byte());
    std::vector<forceserver_Moved> moves(input_.below(5));
    for (auto& moved : moves) {
      put(moved.client, clients);
      put(moved.name, names);
      moved.revision = revision();
      moved.place = pose();
      for (float& value : moved.twist) value = input_.byte() < 240 ? 0 : static_cast<float>(input_.take<uint32_t>());
      moved.horizon = input_.byte() < 128 ? 0 : 0.1f;
      moved.time = some(input_.byte());
    }
    const forceserver_Motions key = out;
    lend(out.moves, moves);
    publish(room_.motions, out, key);
  }
  template <class T>
  void name_piece(T& out) {
    put(out.content, keys);
    out.pieces = input_.byte() < 200 ? 1 : input_.byte() < 128 ? input_.below(4) : input_.take<uint32_t>();
    out.piece = input_.byte() < 200 ? 0 : input_.below(5);
  }
  void shape() {
    forceserver_Shape out{};
    name_piece(out);
    out.primitive = input_.choice(FS_PRIMITIVE_MESH);
    out.is_closed = input_.coin();
    std::vector<forceserver_Vec3> points(input_.byte() < 200 ? 3 : input_.below(20));
    for (size_t i = 0; i < points.size(); ++i) points[i] = {some(i % 2 ? 0.1 : 0), some(i / 2 ? 0.1 : 0), some(0)};
    std::vector<uint32_t> triangles{0, 1, 2};
    if (input_.byte() >= 200) {
      triangles.resize(input_.below(20));
      for (uint32_t& index : triangles) index = input_.byte();
    }
    const forceserver_Shape key = out;
    lend(out.points, points);
    lend(out.triangles, triangles);
    publish(room_.shapes, out, key);
  }
  std::vector<double> numbers(double sign) {
    std::vector<double> out(input_.byte() < 200 ? 4 : input_.below(20));
    for (double& number : out) number = some(sign * 0.001 * input_.byte());
    return out;
  }
  void curve() {
    forceserver_Curve out{};
    name_piece(out);
    if (input_.coin()) put_text(out.expression, input_.coin() ? "3*exp(-d)" : input_.text(40));
    out.step = some(0.01);
    std::vector<double> forces = numbers(1);
    const forceserver_Curve key = out;
    lend(out.forces, forces);
    publish(room_.curves, out, key);
  }
  void surface() {
    forceserver_Surface out{};
    name_piece(out);
    out.static_friction = some(0.5);
    out.dynamic_friction = some(0.3);
    const bool has_texture = input_.coin();
    out.columns = out.rows = has_texture ? 2 : 0;
    if (input_.byte() >= 224) out.columns = input_.take<uint32_t>();
    out.axis = input_.choice(FS_AXIS_Y);
    out.repeats = input_.coin();
    if (has_texture) out.column_width = out.row_width = some(0.01);
    out.impact_gain = some(0);
    std::vector<double> heights;
    if (has_texture) heights = numbers(-1);
    const forceserver_Surface key = out;
    lend(out.heights, heights);
    publish(room_.surfaces, out, key);
  }
  void edit() {
    forceserver_Edit out{};
    put_text(out.site, "here");
    put(out.client, clients);
    put(out.name, names);
    put(out.asker, sites);
    put(out.editor, clients);
    out.number = input_.byte();
    out.removes = input_.byte() < 32;
    out.parts = input_.byte() < 200 ? 1u << input_.below(5) : input_.take<uint32_t>();
    describe(out.wanted);
    publish(room_.edits, out, out);
  }
  void answer() {
    forceserver_Answer out{};
    put_text(out.site, "here");
    put(out.answerer, sites);
    out.number = input_.byte();
    out.result = -static_cast<int32_t>(input_.below(20));
    put_text(out.text, input_.text(100));
    publish(room_.answers, out, out);
  }

  const Pens& room_;
  Input& input_;
  std::deque<std::function<void()>> written_;
  uint64_t revision_ = 0;
};

// What all cases share: the room and a server.
struct Rig {
  forceserver::Scene scene = forceserver::Scene::create();
  forceserver::Device device = forceserver::Device::open("sim:?encoder=ideal");
  forceserver::Servo servo = start_servo();
  const std::string endpoint = "shm:fuzz-samples-" + std::to_string(getpid());
  forceserver::Server server = start_server();
  forceserver::Scene own = forceserver::Scene::connect(endpoint, "bridge");
  Participant participant{[] {
    Participant::Settings settings;
    settings.domain = 77;
    settings.partition = "fuzz-" + std::to_string(getpid());  // other rooms do not meet this one
    settings.network = "lo";
    return settings;
  }()};
  Room room{participant};
  Pens pens{77, ("fuzz-" + std::to_string(getpid())).c_str()};
  Worker worker{[] {}};

  forceserver::Servo start_servo() const {
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.fade = options.ramp = options.speed_limit = -1;
    return forceserver::Servo::start(scene, device, &options);
  }
  forceserver::Server start_server() const {
    fs_server_options options = fs_server_options_init();
    options.lease = 1e-9;
    options.max_clients = 1000;
    options.max_objects = 100;
    return forceserver::Server::start(servo, endpoint, &options);
  }
  void work() {  // until the worker has done all that it was given
    bool is_done = false;
    worker.start([&is_done]() -> Worker::Done { return [&is_done] { is_done = true; }; });
    while (!is_done) worker.run_done();
  }
};

class Site {
 public:
  explicit Site(Rig& rig) : rig_(rig) {
    fs_device_info device = fs_device_info_init();
    device.workspace_radius = 0.15;
    incoming_.set_device(device);
  }
  void go_on(double seconds) {
    now_ += seconds;
    incoming_.take(now_);
    rig_.work();
    incoming_.apply(now_);
    edits_.take(rig_.own, now_);
    rig_.room.answers.reader.take([&](const forceserver_Answer& sample, const dds_sample_info_t& info) {
      if (info.valid_data) edits_.take_answer(sample, now_);
    });
    edits_.ask(now_);
    writer_.write(now_);
    reader_.drop_unused(now_);
    require(reader_.wanted(now_).size() <= 16, "more contents are wanted than fit");
    require(!incoming_.has_lost_server(), "the server is lost");
    rig_.servo.step(1);
  }
  void edit_here(Input& input) {  // as somebody at this server does with another site's object
    const char* const names[] = {"rover@there/wall", "arm@there/wall", "rover@x/guide"};
    const char* const name = names[input.below(3)];
    const fs_pose pose{{0.01, 0, 0}, {1, 0, 0, 0}};
    if (input.coin()) static_cast<void>(fs_object_move(rig_.own.get(), name, &pose, nullptr, FS_NOW));
    else static_cast<void>(fs_object_remove(rig_.own.get(), name));
  }

 private:
  Rig& rig_;
  ContentReader reader_{rig_.room, rig_.worker};
  ContentWriter writer_{rig_.room};
  Incoming incoming_{rig_.room, reader_, {rig_.endpoint, "here", {}}};
  Edits edits_{rig_.room, incoming_, reader_, writer_, "here", 1};
  double now_ = 1000;  // s
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Rig rig;
  Input input(data, size);
  Site site(rig);
  {
    Stranger stranger(rig.pens, input);
    constexpr int most = 60;
    for (int i = 0; i < most && !input.is_empty(); ++i) {
      const uint8_t what = input.byte();
      if (what < 16) site.edit_here(input);
      else if (what < 176) stranger.write();
      else site.go_on(0.02 * (what - 175));
    }
    site.go_on(1);
    site.go_on(1);
  }
  site.go_on(1);
  rig.servo.step(3);
  return 0;
}
