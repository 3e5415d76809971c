#include "device/fidel/udp/socket.h"

#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::udp {
namespace {

std::vector<Endpoint> addresses_of(const HostPort& place, int flags) {
  addrinfo hints{}, *raw = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  const int error = getaddrinfo(place.host.c_str(), std::to_string(place.port).c_str(), &hints, &raw);
  if (error) {
    refuse(FS_ERROR_NOT_FOUND, "host '%s' is not known: %s", place.host.c_str(),
           error == EAI_SYSTEM ? std::strerror(errno) : gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> all(raw, freeaddrinfo);
  std::vector<Endpoint> out;
  for (const addrinfo* each = raw; each; each = each->ai_next) {
    Endpoint& next = out.emplace_back();
    next.size = std::min(each->ai_addrlen, static_cast<socklen_t>(sizeof next.address));
    std::memcpy(&next.address, each->ai_addr, next.size);
  }
  return out;
}

// A socket that `use` (connect or bind) has given this address.
int open_socket(const Endpoint& address, int (*use)(int, const sockaddr*, socklen_t), const HostPort& place, const char* verb) {
  const int descriptor = socket(address.address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto* bytes = reinterpret_cast<const sockaddr*>(&address.address);
  if (descriptor >= 0 && use(descriptor, bytes, address.size) == 0) return descriptor;
  const int why = errno;
  if (descriptor >= 0) close(descriptor);
  refuse(FS_ERROR_IO, "%s %s, port %u: %s", verb, place.host.c_str(), place.port, std::strerror(why));
}

}  // namespace

bool Endpoint::operator==(const Endpoint& other) const noexcept {
  return size == other.size && std::memcmp(&address, &other.address, size) == 0;
}

std::string Endpoint::text() const {
  char host[NI_MAXHOST], port[NI_MAXSERV];
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), size, host, sizeof host, port, sizeof port,
                  NI_NUMERICHOST | NI_NUMERICSERV)) {
    return "an unknown address";
  }
  const bool has_colon = std::strchr(host, ':');
  return (has_colon ? "[" + std::string(host) + "]" : std::string(host)) + ":" + port;
}

HostPort parse_host_port(const std::string& text, const char* what, uint16_t lowest_port) {
  HostPort out{text, usual_port};
  std::string port;
  const bool is_bracketed = !text.empty() && text[0] == '[';
  const size_t closed = is_bracketed ? text.find(']') : 0;
  const size_t colon = closed == std::string::npos ? closed : text.find(':', closed);
  const bool has_port = colon != std::string::npos;
  if (has_port) port = text.substr(colon + 1);
  out.host = text.substr(0, colon);
  if (is_bracketed && closed != std::string::npos) {
    const bool follows = has_port ? colon == closed + 1 : closed + 1 == text.size();
    out.host = follows ? text.substr(1, closed - 1) : "";
  } else if (is_bracketed) {
    out.host = "";
  }
  bool is_good = !out.host.empty();
  if (has_port) {
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), out.port);
    is_good = is_good && error == std::errc() && end == port.data() + port.size() && out.port >= lowest_port;
  }
  if (!is_good) {
    refuse(FS_ERROR_INVALID,
           "%s is '%s', must be HOST:PORT with a port within %u..65535, or HOST for port %u; an IPv6 address stands in []", what,
           text.c_str(), lowest_port, usual_port);
  }
  return out;
}

std::vector<Endpoint> Socket::addresses(const HostPort& peer) { return addresses_of(peer, 0); }

Socket Socket::to(const Endpoint& address, const HostPort& peer) {
  return Socket(open_socket(address, connect, peer, "cannot send to"));
}

Socket Socket::listening(const HostPort& place) {
  return Socket(open_socket(addresses_of(place, AI_PASSIVE).front(), bind, place, "cannot listen at"));
}

Socket::~Socket() {
  if (descriptor_ >= 0) close(descriptor_);
}

Endpoint Socket::own() const noexcept {
  Endpoint out;
  out.size = sizeof out.address;
  getsockname(descriptor_, reinterpret_cast<sockaddr*>(&out.address), &out.size);
  return out;
}

Socket::Heard Socket::receive(Datagram& out, Endpoint* from) noexcept {
  Endpoint sender;
  for (;;) {
    sender.size = sizeof sender.address;
    const ssize_t size =
        recvfrom(descriptor_, out.bytes, sizeof out.bytes, 0, reinterpret_cast<sockaddr*>(&sender.address), &sender.size);
    if (size >= 0) {
      out.size = static_cast<size_t>(size);
      if (from) *from = sender;
      return Heard::something;
    }
    if (errno == EINTR) continue;
    return errno == ECONNREFUSED ? Heard::refused : Heard::nothing;
  }
}

void Socket::await(int64_t deadline) const noexcept {
  const int64_t left = std::max<int64_t>(0, deadline - steady_now_ns());
  const timespec time{static_cast<time_t>(left / 1'000'000'000), static_cast<long>(left % 1'000'000'000)};
  pollfd descriptor{descriptor_, POLLIN, 0};
  ppoll(&descriptor, 1, &time, nullptr);
}

bool Socket::send(const Datagram& datagram) noexcept {
  return ::send(descriptor_, datagram.bytes, datagram.size, MSG_NOSIGNAL) >= 0 || errno != ECONNREFUSED;
}

void Socket::send(const Datagram& datagram, const Endpoint& to) noexcept {
  sendto(descriptor_, datagram.bytes, datagram.size, MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to.address), to.size);
}

}  // namespace fs::udp
