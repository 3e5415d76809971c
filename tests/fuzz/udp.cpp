// Datagrams between a host and a FIDEL's controller: taken apart, and rendered as a controller does; a host that hears them from
// the controller that it has greeted; and a controller that hears them from anybody.
#include <memory>
#include <thread>

#include <sys/socket.h>

#include "device/fidel/controller/controller.h"
#include "device/fidel/controller/renderer.h"
#include "device/fidel/udp/clock_map.h"
#include "device/fidel/udp/host.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"
#include "fuzz/fuzz.h"

using namespace fs::udp;
using fuzz::Input;
using fuzz::require;

namespace {

bool is_finite(const fs_wrench& wrench) {
  return std::isfinite(wrench.force.x + wrench.force.y + wrench.force.z + wrench.torque.x + wrench.torque.y + wrench.torque.z);
}

// A datagram with the bytes of the input between its header and its checksum, which are right as a rule.
Datagram datagram_of(Input& input, uint64_t session, uint32_t number) {
  constexpr size_t sizes[] = {36, 232, 68, 216, 56, 200, 256, 520, 8};  // of the fields, about
  Datagram out;
  const uint8_t type = input.byte() % 11;
  const size_t usual = type >= 1 && type <= 9 ? sizes[type - 1] : 8;
  const size_t wanted = input.byte() < 200 ? usual : input.take<uint16_t>() % (largest_datagram - header_size - checksum_size);
  out = encode({Type::hello, session, number}, Hello{});
  out.bytes[5] = type;
  out.size = header_size + wanted + checksum_size;
  input.fill(out.bytes + header_size, wanted);
  const uint8_t damage = input.byte();
  if (damage == 1) input.fill(out.bytes, header_size);
  out.bytes[6] = static_cast<uint8_t>(out.size);
  out.bytes[7] = static_cast<uint8_t>(out.size >> 8);
  uint32_t sum = checksum(out.bytes, out.size - checksum_size);
  if (damage == 2) ++sum;
  std::memcpy(out.bytes + out.size - checksum_size, &sum, sizeof sum);
  return out;
}

template <class Message>
void check_again(const Datagram& datagram, const Header& header) {
  Message message;
  if (!decode(datagram.bytes, datagram.size, message)) return;
  const Datagram again = encode(header, message);
  Message same;
  require(again.size == datagram.size && decode(again.bytes, again.size, same), "a message that is encoded otherwise");
}

fs_device_info usual_device() {
  fs_device_info out = fs_device_info_init();
  out.force_axes = 3;
  out.force_max = 25;
  out.torque_max = 0.5;
  out.resolution = 1e-5;
  return out;
}

void render(Renderer& renderer, const Datagram& datagram, double time) {
  Command command;
  if (!decode(datagram.bytes, datagram.size, command)) return;
  renderer.take(command, time);
  fs_state state{};
  state.pose.orientation.w = 1;
  state.flags = FS_STATE_READY;
  for (int i = 0; i < 4; ++i) {
    state.pose.position.x = 0.01 * i;
    const fs_wrench out = renderer.render(state, time + 0.02 * i);
    require(is_finite(out), "a force that is not finite");
    require(std::hypot(out.force.x, out.force.y, out.force.z) <= 25 * (1 + 1e-9), "a force beyond the limit");
  }
}

void take_apart(Input& input) {
  Renderer renderer(usual_device());
  ClockMap clock;
  Arrivals arrivals;
  double now = 100;
  for (int i = 0; i < 50 && !input.is_empty(); ++i) {
    const Datagram datagram = datagram_of(input, 7, input.byte());
    now += 1e-3 * input.byte();
    Header header{};
    if (open(datagram.bytes, datagram.size, header) != Opened::good) continue;
    switch (header.type) {
      case Type::hello: check_again<Hello>(datagram, header); break;
      case Type::welcome: check_again<Welcome>(datagram, header); break;
      case Type::busy: check_again<Busy>(datagram, header); break;
      case Type::state: check_again<State>(datagram, header); break;
      case Type::request: check_again<Request>(datagram, header); break;
      case Type::answer: check_again<Answer>(datagram, header); break;
      case Type::bye: check_again<Bye>(datagram, header); break;
      case Type::command:
      case Type::model:
        check_again<Command>(datagram, header);
        render(renderer, datagram, now);
        break;
    }
    static_cast<void>(arrivals.note(header.number));
    State state;
    if (header.type != Type::state || !decode(datagram.bytes, datagram.size, state)) continue;
    if (input.coin()) clock.note(state.sent, now, input.number());
    else clock.note(state.sent, now);
    const double time = clock.to_host(state.time, now);
    require(time <= now, "a time in the future");
    require(!std::isnan(clock.offset()), "a clock that is not known");
  }
}

// ------------------------------------------------------------------------------------------------------------------ a host

// A host that is connected to this program, which is its controller.
class Connected {
 public:
  Connected() {
    std::thread greeter([this] {
      Datagram datagram;
      for (int welcomes = 0; !is_greeted_;) {
        socket_.await(fs::steady_now_ns() + 10'000'000);
        Header header{};
        if (socket_.receive(datagram, &from_) != Socket::Heard::something) continue;
        if (open(datagram.bytes, datagram.size, header) != Opened::good || header.type != Type::hello) continue;
        session_ = header.session;
        Welcome welcome;
        welcome.hello = header.number;
        welcome.time = static_cast<uint64_t>(fs::steady_now_ns());
        welcome.rate = 500;
        welcome.force_axes = 3;
        welcome.workspace_radius = 0.15f;
        welcome.workspace_height = 0.2f;
        welcome.force_max = 25;
        welcome.controller_rate = 1000;
        socket_.send(encode({Type::welcome, session_, static_cast<uint32_t>(++welcomes)}, welcome), from_);
      }
    });
    const HostPort place{"127.0.0.1", port()};
    HostOptions options = parse_host_options(("udp:" + place.host + ":" + std::to_string(place.port)).c_str());
    try {
      host_ = std::make_unique<UdpConnection>(options, Socket::to(Socket::addresses(place).front(), place));
    } catch (const fs::Refusal& refusal) {
      require(false, "no connection:", refusal.text.c_str());
    }
    is_greeted_ = true;
    greeter.join();
  }
  ~Connected() {
    is_greeted_ = false;
    std::thread answerer([this] {  // so that its last words are answered at once
      Datagram datagram;
      while (!is_greeted_) {
        socket_.await(fs::steady_now_ns() + 10'000'000);
        Header header{};
        if (socket_.receive(datagram) != Socket::Heard::something) continue;
        if (open(datagram.bytes, datagram.size, header) == Opened::good && header.type == Type::bye) {
          socket_.send(encode({Type::bye, session_, 1}, Bye{Reason::unknown_session}), from_);
        }
      }
    });
    host_.reset();
    is_greeted_ = true;
    answerer.join();
  }

  // False: the host takes the controller for lost.
  bool hear(Input& input) {
    for (int i = 0; i < 10 && !input.is_empty(); ++i) {
      ++number_;
      socket_.send(datagram_of(input, session_, number_ + input.byte() % 4), from_);
    }
    number_ += 4;
    // A good state at last, so that nobody waits.
    State last;
    last.time = last.sent = static_cast<uint64_t>(fs::steady_now_ns());
    last.flags = FS_STATE_READY;
    socket_.send(encode({Type::state, session_, ++number_}, last), from_);
    for (int i = 0; i < 12; ++i) {
      fs_state state{};
      const fs_status status = host_->receive(state);
      if (status == FS_ERROR_DISCONNECTED) return false;
      require(status == FS_OK || *fs_last_error() || status == FS_ERROR_TIMEOUT, "a state:", fs_status_name(status));
      if (status != FS_OK) break;
      require(std::isfinite(state.pose.position.x) && state.time <= fs::steady_now(), "a state");
      const fs_wrench push{{1, 0, 0}, {}};
      static_cast<void>(host_->send(push));
      fs_link link{};
      link.struct_size = sizeof link;
      const bool is_measured = host_->get_link(link) == FS_OK;
      require(!is_measured || (link.delay >= 0 && link.delay <= 10 && link.loss >= 0 && link.loss <= 1), "a link");
      if (state.flags == FS_STATE_READY && state.time > 0) break;
    }
    Datagram datagram;
    while (socket_.receive(datagram) == Socket::Heard::something) {
      Header header{};
      require(open(datagram.bytes, datagram.size, header) == Opened::good, "what the host says");
    }
    return true;
  }

 private:
  uint16_t port() const {
    const std::string text = socket_.own().text();
    return static_cast<uint16_t>(std::atoi(text.substr(text.rfind(':') + 1).c_str()));
  }

  Socket socket_ = Socket::listening({"127.0.0.1", 0});
  Endpoint from_;
  std::atomic<bool> is_greeted_{false};
  uint64_t session_ = 0;
  uint32_t number_ = 0;
  std::unique_ptr<UdpConnection> host_;
};

// ------------------------------------------------------------------------------------------------------------ a controller

void control(Input& input) {
  static fs_device* const device = [] {
    fs_device* out = nullptr;
    require(fs_device_open("sim:?encoder=ideal", &out) == FS_OK, "the simulator:", fs_last_error());
    return out;
  }();
  Socket socket = Socket::listening({"127.0.0.1", 0});
  const std::string text = socket.own().text();
  const HostPort place{"127.0.0.1", static_cast<uint16_t>(std::atoi(text.substr(text.rfind(':') + 1).c_str()))};
  const Endpoint address = Socket::addresses(place).front();
  Socket host = Socket::to(address, place), stranger = Socket::to(address, place);
  Controller controller(device, socket, [](const std::string& said) { require(!said.empty(), "it says nothing"); });
  uint32_t number = 0;
  for (int i = 0; i < 20 && !input.is_empty(); ++i) {
    const uint8_t kind = input.byte();
    if (kind < 32) host.send(encode({Type::hello, 7, ++number}, Hello{}));
    (kind % 8 ? host : stranger).send(datagram_of(input, kind % 16 ? 7 : 8, ++number));
  }
  int ticks = 0;
  controller.run([&] { return ++ticks > 2; });
  Datagram datagram;
  while (host.receive(datagram) == Socket::Heard::something) {
    Header header{};
    require(open(datagram.bytes, datagram.size, header) == Opened::good, "what the controller says");
    State state;
    if (header.type != Type::state) continue;
    require(decode(datagram.bytes, datagram.size, state) && is_finite(state.applied), "a state of the controller");
    const fs_vec3& force = state.applied.force;
    require(std::hypot(force.x, force.y, force.z) <= 25 * (1 + 1e-6), "a force beyond the limit");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Header header{};
  static_cast<void>(open(data, size, header));
  Input input(data, size);
  const unsigned kind = input.below(8);
  if (kind > 1) return take_apart(input), 0;
  if (kind == 1) return control(input), 0;
  static std::unique_ptr<Connected> connected;
  if (!connected) connected = std::make_unique<Connected>();
  if (!connected->hear(input)) connected.reset();
  return 0;
}
