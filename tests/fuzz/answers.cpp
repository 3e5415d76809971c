// What a server may say: the library connects to a server that answers whatever it likes, over the socket and in the shared memory
// of the outbox. A thread is that server: it answers each request with what comes next in the input, and hangs up at its end.
#include <array>
#include <thread>
#include <vector>

#include <forceserver/forceserver.hpp>

#include "base/clock.h"
#include "base/text.h"
#include "fuzz/fuzz.h"
#include "ipc/blob.h"
#include "ipc/region.h"
#include "ipc/socket.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"

using namespace fs::wire;
using fs::Descriptor;
using fuzz::Input;
using fuzz::require;

namespace {

constexpr uint32_t most_objects = 16;
constexpr std::array<const char*, 6> names = {"a", "b", "me/a", "other/x", "server/own", ""};

// ------------------------------------------------------------------------------------------------------------ the server

// Bytes that are a good record, but for some.
template <class T>
std::vector<std::byte> damaged(Input& input, const T& record) {
  std::vector<std::byte> out(sizeof record);
  std::memcpy(out.data(), &record, sizeof record);
  const uint8_t kind = input.byte();
  if (kind >= 128 && kind < 192) {
    const size_t at = input.take<uint16_t>() % out.size() / 8 * 8;
    const double number = input.number();
    if (at + sizeof number <= out.size()) std::memcpy(out.data() + at, &number, sizeof number);
  } else if (kind < 224 && kind >= 192) {
    const size_t at = input.take<uint16_t>() % out.size();
    input.fill(out.data() + at, std::min<size_t>(1 + kind % 16, out.size() - at));
  } else if (kind >= 240) {
    out.resize(input.take<uint16_t>() % (out.size() + 16));
  }
  return out;
}

void append(std::vector<std::byte>& out, const std::vector<std::byte>& part) { out.insert(out.end(), part.begin(), part.end()); }

Object object_record(Input& input) {
  fs_object object = fs_object_init(names[input.below(names.size())], static_cast<fs_primitive>(input.below(4)));
  object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 2);
  object.time = object.start = 1;
  Object out = fs::to_record(object);
  if (object.primitive == FS_PRIMITIVE_POLYLINE || object.primitive == FS_PRIMITIVE_MESH) out.shape = of_server | input.below(8);
  if (input.byte() < 32) out.front.kind = FS_PROFILE_CUSTOM, out.front.curve = of_server | input.below(8);
  if (input.byte() < 32) out.surface = of_server | input.below(8);
  return out;
}

class Server {
 public:
  Server()
      : endpoint_("shm:fuzz-answers-" + std::to_string(getpid())),
        listener_(fs::Listener::for_this_user(endpoint_.substr(endpoint_.find(':') + 1))),
        inbox_(fs::make_region("fuzz-inbox", fs::Inbox::bytes(most_objects))),
        outbox_(fs::make_region("fuzz-outbox", sizeof(fs::Outbox))),
        memory_(fs::map_region(outbox_, sizeof(fs::Outbox), true)) {}

  const std::string& endpoint() const { return endpoint_; }

  void serve(Input& input) {
    std::memset(memory_.get(), 0, sizeof(fs::Outbox));
    outbox().heartbeat.store(fs::steady_now());
    for (unsigned left = input.below(8); left > 0; --left) scribble(input);
    if (!fs::wait_for(listener_.socket(), false, 1)) return;
    socket_ = Descriptor(accept4(listener_.socket().get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket_ || !greet(input)) return hang_up();
    while (!input.is_empty()) {
      uint64_t serial = 0;
      uint32_t type = 0;
      if (!hear(serial, type)) break;
      if (input.byte() < 32) scribble(input);
      if (type < type_sync && type != type_group && type != type_place && type != type_remove && type != type_change) continue;
      answer(input, serial, type);
    }
    hang_up();
  }

 private:
  fs::Outbox& outbox() { return *static_cast<fs::Outbox*>(memory_.get()); }
  void hang_up() {
    outbox().is_closed.store(1);
    socket_.reset();
  }

  // Something in the outbox that should not be there.
  void scribble(Input& input) {
    const uint8_t kind = input.byte();
    if (kind < 64) {
      outbox().news.store(input.byte());
    } else if (kind < 128) {
      NumberedEvent event{};
      event.number = input.byte() % 4;
      event.event.kind = static_cast<fs_event_kind>(input.below(11));
      std::memset(event.event.text, 'x', sizeof event.event.text);  // without an end
      fs::put_text(event.event.name, names[input.below(names.size())]);
      const std::vector<std::byte> bytes = damaged(input, event);
      std::memcpy(&event, bytes.data(), std::min(bytes.size(), sizeof event));
      outbox().events[event.number % fs::kept_events].write(event);
      outbox().events_written.store(input.byte() % 8);
    } else {
      auto* const words = static_cast<uint64_t*>(memory_.get());
      const size_t at = input.take<uint16_t>() % (sizeof(fs::Outbox) / 8);
      const double number = input.number();
      uint64_t bits;
      std::memcpy(&bits, &number, sizeof bits);
      std::atomic_ref(words[at]).store(input.coin() ? bits : input.byte());
    }
  }

  bool receive(std::vector<std::byte>& out) {
    out.resize(fs::most_message);
    Descriptor data;
    size_t size = 0;
    bool is_cut = false;
    if (!fs::wait_for(socket_, false, 2)) return false;
    if (fs::receive_message(socket_, out, size, {&data, 1}, is_cut) != fs::Transfer::done) return false;
    out.resize(size);
    return true;
  }
  bool greet(Input& input) {
    std::vector<std::byte> hello;
    if (!receive(hello)) return false;
    HelloAnswer head{};
    head.magic = magic;
    head.wire = version;
    Welcome welcome{};
    welcome.inbox_bytes = fs::Inbox::bytes(most_objects);
    welcome.outbox_bytes = sizeof(fs::Outbox);
    welcome.max_objects = most_objects;
    welcome.is_virtual = true;
    welcome.rate = 1000;
    welcome.sizes = fs::own_sizes();
    const bool is_good = input.byte() < 224;
    std::vector<std::byte> bytes(sizeof head);
    std::memcpy(bytes.data(), &head, sizeof head);
    if (!is_good) bytes = damaged(input, head);
    std::vector<std::byte> rest(sizeof welcome);
    std::memcpy(rest.data(), &welcome, sizeof welcome);
    append(bytes, is_good ? rest : damaged(input, welcome));
    if (bytes.empty()) bytes.resize(1);  // who hears nothing at all tries again for two seconds
    const int regions[] = {inbox_.get(), outbox_.get()};
    const size_t sent = is_good ? 2 : input.below(3);
    const std::span<const std::byte> parts[] = {bytes};
    return fs::send_message(socket_, parts, std::span(regions).first(sent)) == fs::Transfer::done;
  }
  bool hear(uint64_t& serial, uint32_t& type) {
    std::vector<std::byte> message;
    if (!receive(message)) return false;
    Header header{};
    require(message.size() >= sizeof header, "a short message of the library");
    std::memcpy(&header, message.data(), sizeof header);
    require(header.serial > last_serial_ || header.serial == 1, "a serial that does not rise");
    serial = last_serial_ = header.serial;
    type = header.type;
    return true;
  }

  void answer(Input& input, uint64_t serial, uint32_t type) {
    // Answers that nobody asked for may come first.
    if (input.byte() < 16) reply(input, input.byte(), type);
    reply(input, serial, type);
  }
  void reply(Input& input, uint64_t serial, uint32_t type) {
    const Header header{type_reply, 0, serial};
    Reply head{};
    if (input.byte() < 32) {
      head.status = -static_cast<int32_t>(input.byte());
      head.reason = input.below(3);
      fs::put_text(head.text, "refused");
    }
    Descriptor data;
    std::vector<std::byte> bytes, body = body_of(input, type, data);
    const auto* const begin = reinterpret_cast<const std::byte*>(&header);
    bytes.assign(begin, begin + sizeof header);
    append(bytes, damaged(input, head));
    if (bytes.size() < sizeof header + sizeof head) bytes.resize(input.byte() < 128 ? sizeof header + sizeof head : bytes.size());
    append(bytes, body);
    const std::span<const std::byte> parts[] = {bytes};
    const int number = data.get();
    static_cast<void>(fs::send_message(socket_, parts, std::span(&number, data ? 1 : 0)));
  }

  template <class T>
  std::vector<std::byte> list(Input& input, Descriptor& data, const T& entry) {
    const uint64_t count = input.below(4);
    Count head{count, sizeof(T)};
    if (input.byte() < 24) head.stride = 8 * input.below(100);
    std::vector<std::byte> bytes;
    for (uint64_t i = 0; i < count; ++i) append(bytes, damaged(input, entry));
    if (input.byte() < 224) bytes.resize(head.count * head.stride);
    data = content(input, bytes);
    return damaged(input, head);
  }
  static Descriptor content(Input& input, const std::vector<std::byte>& bytes) {
    return input.byte() < 240 ? fs::make_blob({bytes}) : Descriptor();
  }

  std::vector<std::byte> body_of(Input& input, uint32_t type, Descriptor& data) {
    switch (type) {
      case type_pull: {
        PullAnswer pull{};
        pull.state = input.below(8);
        pull.slot = input.byte() < 128 ? input.below(20) : no_slot;
        pull.news = outbox().news.load();
        pull.motion = {{{}, {1, 0, 0, 0}}, {}, 1, 0};
        pull.frame.frame = fs_frame_init();
        pull.tool.count = 1;
        pull.object = object_record(input);
        return damaged(input, pull);
      }
      case type_get: return damaged(input, object_record(input));
      case type_fetch: return asset(input, data);
      case type_report:
      case type_reports: {
        fs_report report{};
        fs::put_text(report.name, names[input.below(names.size())]);
        return type == type_report ? damaged(input, report) : list(input, data, report);
      }
      case type_clients: return list(input, data, fs_client{});
      case type_views: return list(input, data, fs_client_view{});
      case type_view: return damaged(input, fs_view{});
      case type_motions:
      case type_motions_since: {
        fs_motion motion{};
        fs::put_text(motion.name, names[input.below(names.size())]);
        motion.motion_revision = input.byte();
        return list(input, data, motion);
      }
      case type_record: return list(input, data, fs_recorded_tick{});
      case type_stats: return damaged(input, fs_servo_stats_init());
      case type_device: return damaged(input, fs_device_info_init());
      default: return {};
    }
  }
  std::vector<std::byte> asset(Input& input, Descriptor& data) {
    std::vector<std::byte> bytes;
    const std::vector<fs_vec3> points = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
    const std::vector<uint32_t> triangle = {0, 1, 2};
    const unsigned kind = input.below(4);
    if (kind < 2) {
      Shape shape{of_server | input.below(8), kind ? FS_PRIMITIVE_MESH : FS_PRIMITIVE_POLYLINE, 0, 3, kind};
      bytes.resize(72 + 12 * kind);
      std::memcpy(bytes.data(), points.data(), 72);
      if (kind) std::memcpy(bytes.data() + 72, triangle.data(), 12);
      data = content(input, bytes);
      return damaged(input, shape);
    }
    if (kind == 2) {
      Curve curve{};
      curve.id = of_server | input.below(8);
      fs::put_text(curve.expression, "d*100");
      return damaged(input, curve);
    }
    Surface surface{};
    surface.id = of_server | input.below(8);
    const fs_surface_settings settings = fs_surface_settings_init();
    std::memcpy(surface.settings, &settings, sizeof settings);
    return damaged(input, surface);
  }

  const std::string endpoint_;
  const fs::Listener listener_;
  const Descriptor inbox_, outbox_;
  const std::shared_ptr<void> memory_;
  Descriptor socket_;
  uint64_t last_serial_ = 0;
};

// ------------------------------------------------------------------------------------------------------------ the client

void look_at(fs_status status) {  // a server may refuse with any of them, and without a sentence
  require(status <= FS_OK && status >= FS_ERROR_INTERNAL, "a status:", fs_status_name(status));
  require(std::strlen(fs_last_error()) < 1000, "a long sentence:", fs_last_error());
}

void call(Input& input, fs_scene* scene) {
  const char* const name = names[input.below(names.size())];
  size_t count = 0;
  switch (input.below(22)) {
    case 0:
    case 1: {
      fs_object object = fs_object_init(name, FS_PRIMITIVE_POINT);
      object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 1);
      return look_at(fs_object_set(scene, &object));
    }
    case 2:
    case 3: {
      fs_object object = fs_object_init(name, FS_PRIMITIVE_POINT);
      const fs_status status = fs_object_get(scene, name, &object);
      look_at(status);
      if (status == FS_OK) {
        require(strnlen(object.name, sizeof object.name) < sizeof object.name, "a name without an end");
        if (input.coin()) look_at(fs_object_change(scene, &object, 1u << input.below(5)));
      }
      return fs_object_release(&object);
    }
    case 4: {
      const fs_pose pose{{0.01, 0, 0}, {1, 0, 0, 0}};
      return look_at(fs_object_move(scene, name, &pose, nullptr, FS_NOW));
    }
    case 5: return look_at(fs_object_remove(scene, name));
    case 6: {
      fs_report report;
      return look_at(fs_scene_get_report(scene, name, &report));
    }
    case 7: {
      fs_report reports[4];
      return look_at(fs_scene_get_reports(scene, reports, 4, &count));
    }
    case 8: {
      fs_client clients[4];
      return look_at(fs_scene_get_clients(scene, clients, 4, &count));
    }
    case 9: {
      fs_client_view views[4];
      return look_at(fs_scene_get_views(scene, views, 4, &count));
    }
    case 10: {
      fs_motion motions[4];
      return look_at(fs_scene_get_motions(scene, input.coin() ? "other" : nullptr, motions, 4, &count));
    }
    case 11: {
      fs_motion motions[4];
      return look_at(fs_scene_get_motions_since(scene, input.coin() ? "other" : nullptr, input.byte(), motions, 4, &count));
    }
    case 12: {
      fs_view view;
      return look_at(fs_scene_get_view(scene, input.coin() ? "other" : nullptr, &view));
    }
    case 13: {
      fs_servo_stats stats = fs_servo_stats_init();
      return look_at(fs_scene_get_servo_stats(scene, &stats));
    }
    case 14: {
      fs_device_info info = fs_device_info_init();
      return look_at(fs_scene_get_device_info(scene, &info));
    }
    case 15: {
      fs_recorded_tick ticks[4];
      return look_at(fs_scene_get_record(scene, 0, ticks, 4, &count));
    }
    case 16:
    case 17: {
      fs_event event{};
      look_at(fs_scene_next_event(scene, 0, &event));
      require(strnlen(event.text, sizeof event.text) < sizeof event.text, "an event's text without an end");
      require(strnlen(event.name, sizeof event.name) < sizeof event.name, "an event's name without an end");
      return;
    }
    case 18: {
      fs_state state;
      fs_response response;
      fs_wrench sent;
      return look_at(fs_scene_get_hand(scene, &state, &response, &sent));
    }
    case 19: return look_at(fs_scene_sync(scene, 0.02));
    case 20: return look_at(input.coin() ? fs_scene_begin(scene) : fs_scene_commit(scene));
    default: return look_at(fs_scene_clear(scene));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Server& server = *new Server;
  // The first part is what the program calls, the rest what the server says.
  Input all(data, size);
  const std::span<const uint8_t> for_calls = all.bytes(all.byte());
  Input calls(for_calls.data(), for_calls.size());
  std::thread thread([&] { server.serve(all); });
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(server.endpoint().c_str(), "me", &scene);
  look_at(status);
  if (status == FS_OK) {
    while (!calls.is_empty()) call(calls, scene);
    fs_scene_destroy(scene);
  }
  thread.join();
  return 0;
}
