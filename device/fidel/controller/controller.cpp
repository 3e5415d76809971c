#include "device/fidel/controller/controller.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::udp {
namespace {

constexpr int64_t period = static_cast<int64_t>(1e9 / Controller::rate);  // ns

}  // namespace

Controller::Controller(fs_device* device, Socket& socket, std::function<void(const std::string&)> say)
    : device_(device), socket_(socket), say_(std::move(say)), info_([&] {
        fs_device_info info = fs_device_info_init();
        if (const fs_status status = fs_device_get_info(device, &info)) refuse(status, "%s", fs_last_error());
        return info;
      }()),
      renderer_(info_), device_request_(device) {}

// ------------------------------------------------------------------------------------------------------------- the loop

void Controller::run(const std::function<bool()>& ends) {
  int64_t next = steady_now_ns() + period;
  while (!ends()) {
    listen(next);
    const int64_t missed = (steady_now_ns() - next) / period;  // ticks that are missed are skipped
    late_ticks_ += static_cast<uint64_t>(missed);
    next += (missed + 1) * period;
    tick();
  }
  end(Reason::controller_ends, "the controller ends");
  const fs_wrench none{};
  fs_device_write(device_, &none);
}

void Controller::listen(int64_t until) {
  while (steady_now_ns() < until) {
    Datagram datagram;
    Endpoint from;
    if (socket_.receive(datagram, &from) == Socket::Heard::something) take(datagram, from);
    else socket_.await(until);
  }
}

void Controller::tick() {
  ++ticks_;
  if (host_.session && steady_now() - host_.heard_at > host_lost_after) end(Reason::silent, "it has been silent for 0.5 s");
  render();
  answer_of_device();
  if (host_.session && ticks_ % static_cast<uint64_t>(host_.every) == 0) send_state();
}

void Controller::render() {
  if (fs_device_read(device_, &state_) != FS_OK) {
    state_ = {};
    state_.pose.orientation.w = 1;
    state_.flags = FS_STATE_CONNECTING;
  }
  applied_ = renderer_.render(state_, steady_now());
  if (fs_device_write(device_, &applied_) != FS_OK) applied_ = {};
}

void Controller::send_state() {
  State out;
  out.time = static_cast<uint64_t>(state_.time > 0 ? static_cast<int64_t>(1e9 * state_.time) : steady_now_ns());
  out.command_time = host_.command_time;
  out.command = host_.commands.newest_number();
  out.came = host_.commands.count();
  out.ignored = ignored_;
  out.flags = state_.flags;
  out.buttons = state_.buttons;
  out.grip = to_single(state_.grip);
  out.pose = state_.pose;
  out.twist = state_.twist;
  out.applied = applied_;
  out.sent = static_cast<uint64_t>(steady_now_ns());
  socket_.send(encode({Type::state, host_.session, ++host_.states}, out), host_.address);
}

// ------------------------------------------------------------------------------------------------------- what comes in

void Controller::take(const Datagram& datagram, const Endpoint& from) {
  Header header{};
  const Opened opened = open(datagram.bytes, datagram.size, header);
  if (opened == Opened::other_version) {
    ++ignored_;
    return reply(encode({Type::bye, header.session, 1}, Bye{Reason::version}), from);
  }
  if (opened == Opened::garbage) {
    ++ignored_;
  } else if (header.type == Type::hello) {
    take_hello(datagram, header, from);
  } else if (header.session == host_.session && from == host_.address) {
    take_of_host(datagram, header);
  } else {
    refuse_stranger(datagram, header, from);
  }
}

void Controller::take_hello(const Datagram& datagram, const Header& header, const Endpoint& from) {
  Hello hello;
  if (!decode(datagram.bytes, datagram.size, hello) || header.session == ended_session_) {
    ++ignored_;
  } else if (!host_.session) {
    begin(hello, header, from);
    welcome(header.number);
  } else if (host_.session == header.session && host_.address == from) {
    host_.heard_at = steady_now();
    welcome(header.number);
  } else {
    refuse_stranger(datagram, header, from);
  }
}

void Controller::take_of_host(const Datagram& datagram, const Header& header) {
  Command command;
  Request request;
  Bye bye;
  const auto* bytes = datagram.bytes;
  const size_t size = datagram.size;
  const bool is_command = header.type == Type::command || header.type == Type::model;
  if (is_command && decode(bytes, size, command)) {
    host_.heard_at = steady_now();
    if (host_.commands.note(header.number) != Arrivals::newest) return;  // a newer force is there already
    host_.command_time = static_cast<uint64_t>(steady_now_ns());
    if (is_stale(command)) return;
    renderer_.take(command, host_.heard_at);
    render();  // at once: delay is what limits stiffness
  } else if (header.type == Type::request && decode(bytes, size, request)) {
    host_.heard_at = steady_now();
    take_request(header, request);
  } else if (header.type == Type::bye && decode(bytes, size, bye)) {
    const bool is_answered = bye.reason == Reason::ends;  // no other reason, or two ends could answer each other for ever
    end(is_answered ? std::optional(Reason::unknown_session) : std::nullopt, "it has said goodbye");
  } else {
    ++ignored_;
  }
}

// It answers a state of long ago, as where a network has kept it back.
bool Controller::is_stale(const Command& command) const {
  const double behind = static_cast<double>(host_.states - command.state) * host_.every;  // ticks
  return command.state != 0 && behind > stale_after * rate;
}

void Controller::take_request(const Header& header, const Request& request) {
  const int32_t ahead = static_cast<int32_t>(header.number - host_.answered);  // the numbers go round
  if (ahead < 0) return;  // late: a newer one has been done
  if (ahead == 0) return socket_.send(host_.answer, host_.address);
  host_.answered = header.number;
  if (std::strcmp(request.text, "status") == 0) {
    answer(FS_OK, status());
  } else if (device_request_.begin(host_.session, header.number, request.text)) {
    answer(still_being_done, "the device behind the controller is doing it");
  } else {
    answer(FS_ERROR_STATE, "busy: the device behind the controller is still doing '" + device_request_.text() + "'");
  }
}

// What the device behind has answered meanwhile goes to the host that asked, unless that has gone or asked something else.
void Controller::answer_of_device() {
  DeviceRequest::Done done;
  if (!device_request_.end(done) || done.session != host_.session || done.number != host_.answered) return;
  if (done.status == FS_ERROR_UNSUPPORTED) done.text += "; the requests are: link, status, and those of the device behind it";
  answer(done.status, done.text);
}

void Controller::answer(int32_t status, const std::string& text) {
  Answer answer;
  answer.request = host_.answered;
  answer.status = status;
  copy_text(answer.text, text.c_str());
  host_.answer = encode({Type::answer, host_.session, ++host_.answers}, answer);
  socket_.send(host_.answer, host_.address);
}

std::string Controller::status() const {
  char text[500];
  std::snprintf(text, sizeof text, "%s, serial '%s'; host %s; %llu ticks, %llu late; %u commands; %u datagrams ignored",
                info_.name, info_.serial, who().c_str(), static_cast<unsigned long long>(ticks_),
                static_cast<unsigned long long>(late_ticks_), host_.commands.count(), ignored_);
  return text;
}

// Somebody with another number, or from another place, than the host that is here.
void Controller::refuse_stranger(const Datagram& datagram, const Header& header, const Endpoint& from) {
  if (header.type != Type::hello) ++ignored_;
  if (header.type == Type::bye) {
    // The host says goodbye again, as the first answer may have been lost.
    Bye bye;
    const bool is_hosts = decode(datagram.bytes, datagram.size, bye) && bye.reason == Reason::ends;
    if (is_hosts && header.session == ended_session_) {
      reply(encode({Type::bye, header.session, 1}, Bye{Reason::unknown_session}), from);
    }
    return;
  }
  const bool is_of_host =
      header.type == Type::hello || header.type == Type::command || header.type == Type::model || header.type == Type::request;
  if (!is_of_host) return;
  if (!host_.session) return reply(encode({Type::bye, header.session, 1}, Bye{Reason::unknown_session}), from);
  Busy busy;
  busy.answers = header.number;
  copy_text(busy.holder, who().c_str());
  reply(encode({Type::busy, header.session, 1}, busy), from);
  if (steady_now() - refused_at_ < 1) return;
  refused_at_ = steady_now();
  say_("refused: " + from.text() + ", as " + who() + " is connected");
}

void Controller::begin(const Hello& hello, const Header& header, const Endpoint& from) {
  host_ = {};
  host_.session = header.session;
  host_.address = from;
  host_.name = *hello.name ? hello.name : "a host without a name";
  host_.every = static_cast<int>(std::clamp(std::round(rate / std::max(1.0, static_cast<double>(hello.rate))), 1.0, 10.0));
  host_.heard_at = steady_now();
  char text[200];
  std::snprintf(text, sizeof text, "connected: %s, session %016llx, %g states a second", who().c_str(),
                static_cast<unsigned long long>(host_.session), rate / host_.every);
  say_(text);
}

void Controller::end(std::optional<Reason> reason, const std::string& why) {
  if (!host_.session) return;
  renderer_.drop();
  render();
  if (reason) socket_.send(encode({Type::bye, host_.session, 1}, Bye{*reason}), host_.address);
  say_("gone: " + who() + ": " + why);
  ended_session_ = host_.session;
  host_ = {};
}

void Controller::welcome(uint32_t hello) {
  Welcome out;
  out.hello = hello;
  out.rate = static_cast<float>(rate / host_.every);
  out.force_axes = info_.force_axes;
  out.torque_axes = info_.torque_axes;
  const auto fill = [](float& field, double value) { field = to_single(value); };
  fill(out.workspace_radius, info_.workspace_radius);
  fill(out.workspace_height, info_.workspace_height);
  fill(out.workspace_angle, info_.workspace_angle);
  fill(out.force_max, info_.force_max);
  fill(out.torque_max, info_.torque_max);
  fill(out.resolution, info_.resolution);
  fill(out.damping, info_.damping);
  fill(out.mass, info_.mass);
  fill(out.controller_rate, rate);
  fill(out.controller_delay, info_.delay);
  fill(out.controller_damping, Renderer::damping);
  copy_text(out.name, info_.name);
  copy_text(out.serial, info_.serial);
  out.time = static_cast<uint64_t>(steady_now_ns());
  socket_.send(encode({Type::welcome, host_.session, ++host_.welcomes}, out), host_.address);
}

// Whoever forges the address of another must not make this a source of many datagrams for it.
void Controller::reply(const Datagram& datagram, const Endpoint& to) {
  constexpr double most = 20, each_second = 50;
  const double time = steady_now();
  replies_left_ = std::min(most, replies_left_ + each_second * (time - replied_at_));
  replied_at_ = time;
  if (replies_left_ < 1) return;
  replies_left_ -= 1;
  socket_.send(datagram, to);
}

}  // namespace fs::udp
