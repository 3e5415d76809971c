// A host of the protocol that does exactly what a test says.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <vector>

#include "device/fidel/udp/protocol.h"

namespace scenes {

class RawHost {
 public:
  fs::udp::Header header{};        // of the newest datagram that `heard` found
  fs::udp::State state;            // the newest
  fs::udp::Datagram datagram;      // the newest of another kind
  uint64_t session;

  RawHost(uint16_t port, uint64_t the_session) : session(the_session), socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(port);
    if (connect(socket_, reinterpret_cast<sockaddr*>(&to), sizeof to) != 0) std::abort();
  }
  ~RawHost() { close(socket_); }
  RawHost(const RawHost&) = delete;
  RawHost& operator=(const RawHost&) = delete;

  template <class Message>
  void say(fs::udp::Type type, const Message& message, uint32_t number = 0) {
    say(encode({type, session, number ? number : ++numbers_[static_cast<size_t>(type)]}, message));
  }
  void say(const fs::udp::Datagram& bytes) { send(socket_, bytes.bytes, bytes.size, 0); }
  void hello(float rate = 500) {
    fs::udp::Hello message;
    message.rate = rate;
    say(fs::udp::Type::hello, message);
  }
  // A datagram of this type comes within this time; states are kept, others between are skipped.
  bool heard(fs::udp::Type type, int ms = 5000) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point deadline = Clock::now() + std::chrono::milliseconds(ms);
    const auto left = [&] { return std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count(); };
    for (pollfd one{socket_, POLLIN, 0}; poll(&one, 1, static_cast<int>(std::max<int64_t>(0, left()))) == 1;) {
      if (left() <= 0) return false;
      fs::udp::Datagram next;
      const ssize_t size = recv(socket_, next.bytes, sizeof next.bytes, 0);
      if (size < 0) return false;
      next.size = static_cast<size_t>(size);
      if (fs::udp::open(next.bytes, next.size, header) == fs::udp::Opened::garbage) continue;
      if (header.type == fs::udp::Type::state) decode(next.bytes, next.size, state);
      else datagram = next;
      if (header.type == type) return true;
    }
    return false;
  }
  // Answers states with this command until is_done(state).
  template <class Done>
  bool commands(fs::udp::Command command, Done is_done, int most = 5000) {
    for (int i = 0; i < most && heard(fs::udp::Type::state); ++i) {
      if (is_done(state)) return true;
      command.state = header.number;
      say(fs::udp::Type::command, command);
    }
    return false;
  }

 private:
  int socket_;
  uint32_t numbers_[16]{};
};

}  // namespace scenes
