// A socket for datagrams, which never waits unless it is asked to.
#pragma once

#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "device/fidel/udp/protocol.h"

namespace fs::udp {

// Where datagrams come from and go to.
struct Endpoint {
  sockaddr_storage address{};
  socklen_t size = 0;
  bool operator==(const Endpoint& other) const noexcept;
  std::string text() const;  // "127.0.0.1:47811"
};

struct HostPort {
  std::string host;
  uint16_t port;
};
// Of "HOST:PORT", "HOST" or "[IPv6]:PORT". lowest_port: 0 or 1. Throws a Refusal INVALID, which calls the text `what`.
HostPort parse_host_port(const std::string& text, const char* what, uint16_t lowest_port);

class Socket {
 public:
  // Throws a Refusal: NOT_FOUND for a name that nobody knows, IO.
  static std::vector<Endpoint> addresses(const HostPort& peer);      // all that its name has, at least one
  static Socket to(const Endpoint& address, const HostPort& peer);  // sends to and hears this peer only, at one of its addresses
  static Socket listening(const HostPort& place);  // port 0: any
  ~Socket();
  Socket(Socket&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  Socket& operator=(Socket&&) = delete;

  Endpoint own() const noexcept;

  enum class Heard { something, nothing, refused };  // refused: the peer's machine says that nobody listens there
  // The next datagram that has come. Longer ones are cut, which their checksum shows.
  Heard receive(Datagram& out, Endpoint* from = nullptr) noexcept;
  // Waits until something has come, at the latest until `deadline` (ns, monotonic clock).
  void await(int64_t deadline) const noexcept;

  // Gives the datagram to the system, which may lose it as the network may. False: the peer's machine says that nobody listens.
  bool send(const Datagram& datagram) noexcept;
  void send(const Datagram& datagram, const Endpoint& to) noexcept;

 private:
  explicit Socket(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace fs::udp
