#include "device/fidel/udp/host.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <random>
#include <utility>

#include "device/support/address.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"
#include "math/pose.h"

namespace fs::udp {
namespace {

constexpr double wait_for_state = 0.02;  // s
constexpr double usual_model_rate = 500, usual_force_rate = 1000;  // Hz
constexpr double busy_within = 1;  // s, for which a controller may be in use: so long it waits for a host that was killed
constexpr int greetings = 5;  // round trips that are measured before the first state

uint64_t drawn_session() {
  std::random_device device;
  for (;;) {
    const uint64_t number = static_cast<uint64_t>(device()) << 32 | device();
    if (number != 0) return number;
  }
}

int64_t in_ns(double seconds) { return static_cast<int64_t>(1e9 * seconds); }

bool is_finite(const fs_model& m) {
  return fs::is_finite(m.x0) && fs::is_finite(m.f0) && fs::is_finite(m.dfdx) && fs::is_finite(m.dtdr);
}

}  // namespace

HostOptions parse_host_options(const char* text) {
  const Address address(text, {"render", "hz"});
  HostOptions out;
  const std::string way = "udp:";
  const std::string& place = address.place();
  out.peer = parse_host_port(place.compare(0, way.size(), way) == 0 ? place.substr(way.size()) : "", "address behind 'udp:'", 1);
  out.renders_models = address.choice("render", {"model", "force"}).value_or(0) == 0;
  out.rate =
      static_cast<float>(address.number("hz", 100, 1000).value_or(out.renders_models ? usual_model_rate : usual_force_rate));
  return out;
}

// ------------------------------------------------------------------------------------------------------- the connection

UdpConnection::UdpConnection(const HostOptions& options, Socket socket)
    : options_(options), socket_(std::move(socket)), session_(drawn_session()) {
  greet();
}

// Says HELLO until a WELCOME comes, and some times more, to know the clock and the round trip from the first state on.
void UdpConnection::greet() {
  Hello hello;
  hello.rate = options_.rate;
  char name[sizeof hello.name] = "";
  gethostname(name, sizeof name - 1);
  copy_text(hello.name, name);
  const int64_t first = steady_now_ns(), deadline = first + in_ns(connect_within);
  for (int welcomes = 0; welcomes < greetings;) {
    const int64_t begin = steady_now_ns();
    if (!holder_.empty() && begin >= first + in_ns(busy_within)) {
      refuse(FS_ERROR_DENIED, "the controller at %s is in use by %s", place().c_str(), holder_.c_str());
    }
    if (begin >= deadline) {
      if (welcomes > 0) break;  // the link loses much, but somebody is there
      refuse(FS_ERROR_TIMEOUT, "no controller answers at %s within %g s; is it switched on, and is that its address?",
             place().c_str(), connect_within);
    }
    const uint32_t number = ++hellos_;
    const bool is_sent = socket_.send(encode(header(Type::hello, number), hello));
    if (!is_sent)
      refuse(FS_ERROR_NOT_FOUND, "nobody listens at %s; start the controller there, such as fidel-controller", place().c_str());
    if (await_welcome(std::min(deadline, begin + in_ns(hello_interval)), number, to_seconds(begin))) ++welcomes;
  }
  heard_at_ = steady_now();
}

// True: the WELCOME has come that answers this HELLO.
bool UdpConnection::await_welcome(int64_t deadline, uint32_t hello, double hello_sent) {
  while (steady_now_ns() < deadline) {
    socket_.await(deadline);
    Datagram datagram;
    const Socket::Heard heard = socket_.receive(datagram);
    if (heard == Socket::Heard::refused) {
      refuse(FS_ERROR_NOT_FOUND, "nobody listens at %s; start the controller there, such as fidel-controller", place().c_str());
    }
    if (heard == Socket::Heard::nothing) continue;
    const double came = steady_now();
    Header header{};
    const Opened opened = open(datagram.bytes, datagram.size, header);
    if (opened == Opened::garbage || header.session != session_) {
      ignore();
      continue;
    }
    Busy busy;
    Bye bye;
    Welcome welcome;
    if (opened == Opened::other_version) {
      refuse(FS_ERROR_VERSION, "the controller at %s speaks another version of the protocol than %u", place().c_str(),
             protocol_version);
    } else if (header.type == Type::busy && decode(datagram.bytes, datagram.size, busy)) {
      holder_ = busy.holder;
    } else if (header.type == Type::bye && decode(datagram.bytes, datagram.size, bye)) {
      refuse(bye.reason == Reason::version ? FS_ERROR_VERSION : FS_ERROR_IO,
             bye.reason == Reason::version ? "the controller at %s speaks another version of the protocol than %u"
                                           : "the controller at %s has ended the connection (protocol version %u)",
             place().c_str(), protocol_version);
    } else if (header.type == Type::welcome && decode(datagram.bytes, datagram.size, welcome)) {
      holder_.clear();
      welcome_ = welcome;
      if (welcome.hello != hello) continue;  // an older one: it says nothing about the round trip
      clock_.note(welcome.time, came, came - hello_sent);
      return true;
    } else if (header.type != Type::state) {
      ignore();
    }
  }
  return false;
}

UdpConnection::~UdpConnection() {
  constexpr int most_tries = 5;
  for (int i = 0; i < most_tries; ++i) {
    if (!socket_.send(encode(header(Type::bye, static_cast<uint32_t>(i + 1)), Bye{Reason::ends}))) return;
    // The controller answers with BYE when its force is 0.
    const int64_t deadline = steady_now_ns() + in_ns(std::clamp(2 * clock_.round_trip(), 0.02, 0.1));
    while (steady_now_ns() < deadline) {
      socket_.await(deadline);
      Datagram datagram;
      Header header{};
      const Socket::Heard heard = socket_.receive(datagram);
      if (heard == Socket::Heard::refused) return;
      const bool is_bye = heard == Socket::Heard::something && open(datagram.bytes, datagram.size, header) == Opened::good &&
                          header.type == Type::bye && header.session == session_;
      if (is_bye) return;
    }
  }
}

void UdpConnection::get_info(fs_device_info& out) const {
  const Welcome& w = welcome_;
  copy_text(out.name, w.name);
  copy_text(out.serial, w.serial);
  out.force_axes = w.force_axes;
  out.torque_axes = w.torque_axes;
  const auto fill = [](double& field, float value) { field = static_cast<double>(value); };
  fill(out.workspace_radius, w.workspace_radius);
  fill(out.workspace_height, w.workspace_height);
  fill(out.workspace_angle, w.workspace_angle);
  fill(out.force_max, w.force_max);
  fill(out.torque_max, w.torque_max);
  fill(out.resolution, w.resolution);
  fill(out.damping, w.damping);
  fill(out.mass, w.mass);
  fill(out.rate, w.rate);  // a tick for each state
  out.watchdog = 0.1;
  fill(out.link_rate, w.rate);
  out.delay = clock_.round_trip();
  if (options_.renders_models) {
    fill(out.controller_rate, w.controller_rate);
    fill(out.controller_delay, w.controller_delay);
    fill(out.controller_damping, w.controller_damping);
  } else {
    out.delay += static_cast<double>(w.controller_delay);
  }
}

// ------------------------------------------------------------------------------------------------------------- receiving

fs_status UdpConnection::receive(fs_state& out) noexcept {
  const int64_t deadline = steady_now_ns() + in_ns(wait_for_state);
  constexpr int most_after = 100;  // datagrams that are looked at for a newer state: a flood must not keep this one back
  bool has_state = false;
  for (int after = 0;;) {
    Datagram datagram;
    const Socket::Heard heard = is_lost_ ? Socket::Heard::refused : socket_.receive(datagram);
    if (heard == Socket::Heard::refused) return fs_fail(FS_ERROR_DISCONNECTED, "nobody listens at the controller's address");
    const double time = steady_now();
    if (heard == Socket::Heard::something) {
      const Change change = take(datagram, out);
      if (change == Change::lost) return fs_fail(FS_ERROR_DISCONNECTED, "the controller has ended the connection");
      has_state |= change == Change::state;
      const bool is_enough = has_state && ++after > most_after;
      if (!is_enough && steady_now_ns() < deadline) continue;  // a newer one may be there already
    }
    if (has_state) return FS_OK;
    if (time - heard_at_ > lost_after) return fs_fail(FS_ERROR_DISCONNECTED, "nothing comes from the controller any more");
    if (steady_now_ns() >= deadline) return FS_ERROR_TIMEOUT;
    socket_.await(deadline);
  }
}

UdpConnection::Change UdpConnection::take(const Datagram& datagram, fs_state& out) noexcept {
  Header header{};
  const bool is_ours = open(datagram.bytes, datagram.size, header) == Opened::good && header.session == session_;
  if (is_ours) {
    State state;
    Answer answer;
    Bye bye;
    if (header.type == Type::state && decode(datagram.bytes, datagram.size, state)) {
      return take_state(header, state, out) ? Change::state : Change::none;
    }
    if (header.type == Type::answer && decode(datagram.bytes, datagram.size, answer)) {
      take_answer(answer);
      return Change::none;
    }
    if (header.type == Type::bye && decode(datagram.bytes, datagram.size, bye)) {
      is_lost_ = true;
      return Change::lost;
    }
    if (header.type == Type::welcome) return Change::none;  // of a HELLO that was said again
  }
  ignore();
  return Change::none;
}

// False: one of the same number or a newer one has come before, or the time of its pose cannot be.
bool UdpConnection::take_state(const Header& header, const State& state, fs_state& out) noexcept {
  constexpr uint64_t oldest = 1'000'000'000;  // ns, of a pose when it is sent; one of the future is older still, modulo 2^64
  if (state.sent - state.time > oldest) {
    ignore();
    return false;
  }
  if (states_.note(header.number) != Arrivals::newest) return false;
  const double came = steady_now();
  heard_at_ = came;
  take_echo(state, came);
  out.pose = state.pose;
  out.twist = state.twist;
  out.buttons = state.buttons;
  out.flags = state.flags;
  out.grip = static_cast<double>(state.grip);
  out.time = clock_.to_host(state.time, came);
  newest_ = {header.number, state.time, out.time};
  seen_[header.number % seen_.size()] = newest_;
  totals_ = {states_.count(), states_.newest_number() + state.command, states_.count() + state.came};
  told_offset_.store(clock_.offset(), std::memory_order_relaxed);
  told_round_trip_.store(clock_.round_trip(), std::memory_order_relaxed);
  told_jumps_.store(clock_.jumps(), std::memory_order_relaxed);
  told_controller_ignored_.store(state.ignored, std::memory_order_relaxed);
  return true;
}

// The controller tells in each state which command came last, and when: that closes a round trip.
void UdpConnection::take_echo(const State& state, double came) noexcept {
  const Sent& sent = sent_[state.command % sent_.size()];
  const bool is_new = state.command != 0 && state.command != echoed_ && sent.number == state.command;
  if (!is_new) return clock_.note(state.sent, came);
  echoed_ = state.command;
  const double kept = to_seconds(static_cast<int64_t>(state.sent - state.command_time));  // by the controller
  clock_.note(state.sent, came, came - sent.time - kept);
  const double delay = to_seconds(static_cast<int64_t>(state.command_time - sent.state_time));
  if (sent.state_time != 0 && delay >= 0 && delay <= 10) meter_.note_delay(delay);
}

fs_status UdpConnection::get_link(fs_link& out) noexcept {
  const fs_status status = meter_.tell(steady_now(), totals_, out);
  if (status != FS_OK || options_.renders_models) return status;
  out.delay = std::min(10.0, out.delay + static_cast<double>(welcome_.controller_delay));
  out.delay_p99 = std::min(10.0, out.delay_p99 + static_cast<double>(welcome_.controller_delay));
  return FS_OK;
}

// --------------------------------------------------------------------------------------------------------------- sending

fs_status UdpConnection::send(const fs_wrench& wrench) noexcept {
  Command command;
  command.force = wrench;
  return send(command, newest_);
}

fs_status UdpConnection::write_model(const fs_model& model) noexcept {
  if (!is_finite(model)) return FS_ERROR_INVALID;
  Command command;
  command.is_model = true;
  command.force = model.f0;
  command.hold = to_single(model.hold);
  command.pose = model.x0;
  command.dfdx = model.dfdx;
  command.dtdr = model.dtdr;
  Seen answered{};
  for (const Seen& each : seen_) {
    if (each.number != 0 && each.given == model.time) answered = each;
  }
  return send(command, answered);
}

fs_status UdpConnection::send(Command command, const Seen& answered) noexcept {
  if (is_lost_) return FS_ERROR_DISCONNECTED;
  command.state = answered.number;
  const uint32_t number = ++commands_;
  sent_[number % sent_.size()] = {number, steady_now(), answered.time};
  if (socket_.send(encode(header(Type::command, number), command))) return FS_OK;
  is_lost_ = true;
  return FS_ERROR_DISCONNECTED;
}

// -------------------------------------------------------------------------------------------------------------- requests

// Beside "link", which the host itself answers, requests go to the controller, and are said again until its answer comes.
std::string UdpConnection::control(const std::string& request) {
  if (request == "link") return link_text();
  Request message;
  if (request.size() >= sizeof message.text) {
    refuse(FS_ERROR_INVALID, "the request has %zu bytes, must be at most %zu", request.size(), sizeof message.text - 1);
  }
  copy_text(message.text, request.c_str());
  const std::lock_guard asks(asking_);
  const uint32_t number = ++requests_;
  const std::chrono::duration<double> interval(request_interval);
  std::unique_lock lock(answer_mutex_);
  asked_ = number;
  answer_ = {};
  const double begin = answered_at_ = steady_now();
  const auto is_done = [&] { return answer_.request == number && answer_.status != still_being_done; };
  do {
    if (steady_now() - answered_at_ > answer_within) {
      refuse(FS_ERROR_TIMEOUT, "the controller at %s did not answer '%s' within %g s", place().c_str(), message.text,
             answer_within);
    }
    if (steady_now() - begin > done_within) {
      refuse(FS_ERROR_TIMEOUT, "the device behind the controller at %s has not done '%s' within %g s", place().c_str(),
             message.text, done_within);
    }
    socket_.send(encode(header(Type::request, number), message));
  } while (!answered_.wait_for(lock, interval, is_done));
  if (answer_.status != FS_OK) {
    const bool is_known = answer_.status < FS_OK && answer_.status >= FS_ERROR_INTERNAL;
    refuse(is_known ? static_cast<fs_status>(answer_.status) : FS_ERROR_IO, "%s", answer_.text);
  }
  return answer_.text;
}

void UdpConnection::take_answer(const Answer& answer) noexcept {
  {
    const std::unique_lock lock(answer_mutex_, std::try_to_lock);
    if (!lock) return;  // it will come again, as the request is said again
    if (answer.request != asked_) return;
    if (answer_.request == asked_ && answer_.status != still_being_done) return;  // the final one has come
    answer_ = answer;
    answered_at_ = steady_now();
  }
  answered_.notify_all();
}

std::string UdpConnection::link_text() const {
  char text[400];
  std::snprintf(
      text, sizeof text,
      "round trip %.3f ms; host's clock less the controller's %.6f s, jumps of a clock: %u; datagrams ignored by the host: %llu, "
      "by the controller: %u",
      1e3 * told_round_trip_, told_offset_.load(), told_jumps_.load(), static_cast<unsigned long long>(ignored_.load()),
      told_controller_ignored_.load());
  return text;
}

}  // namespace fs::udp

namespace fs {

std::unique_ptr<FidelConnection> connect_fidel_udp(const char* text) {
  const udp::HostOptions options = udp::parse_host_options(text);
  // A name may have several addresses, and its controller listens at one. Of several that fail the one is told of that came
  // nearest to a controller: nobody listens there, then nobody answers, then there is no way there.
  const auto nearness = [](const Refusal& refusal) {
    return refusal.status == FS_ERROR_NOT_FOUND ? 3 : refusal.status == FS_ERROR_TIMEOUT ? 2 : 1;
  };
  std::optional<Refusal> nearest;
  const auto note = [&](const Refusal& refusal) {
    if (!nearest || nearness(refusal) > nearness(*nearest)) nearest = refusal;
  };
  for (const udp::Endpoint& address : udp::Socket::addresses(options.peer)) {
    std::optional<udp::Socket> socket;
    try {
      socket.emplace(udp::Socket::to(address, options.peer));
    } catch (const Refusal& refusal) {
      note(refusal);
      continue;
    }
    try {
      return std::make_unique<udp::UdpConnection>(options, std::move(*socket));
    } catch (const Refusal& refusal) {
      const bool is_there = refusal.status != FS_ERROR_NOT_FOUND && refusal.status != FS_ERROR_TIMEOUT;
      if (is_there) throw;  // a controller that is in use, of another version, or that ends
      note(refusal);
    }
  }
  throw *nearest;
}

}  // namespace fs
