#include "device/udp/relay.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace scenes {
namespace {

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

int local_socket(uint16_t connected_to, uint16_t& own) {
  const int out = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(connected_to);
  auto* const raw = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  if (out < 0 || (connected_to ? connect(out, raw, size) : bind(out, raw, size)) != 0 || getsockname(out, raw, &size) != 0) {
    std::perror("relay");
    std::abort();
  }
  own = ntohs(address.sin_port);
  return out;
}

}  // namespace

Relay::Relay(uint16_t controller, uint64_t seed) : random_(seed) {
  uint16_t unused;
  front_ = local_socket(0, port_);
  back_ = local_socket(controller, unused);
  thread_ = std::thread([this] { run(); });
}

Relay::~Relay() {
  is_ending_ = true;
  thread_.join();
  close(front_);
  close(back_);
}

void Relay::set(const Way& to_host, const Way& to_controller) {
  const std::lock_guard lock(mutex_);
  ways_[host] = to_host;
  ways_[controller] = to_controller;
}

void Relay::on_way_to_host(std::function<void(Bytes&)> f) {
  const std::lock_guard lock(mutex_);
  hook_ = std::move(f);
}

void Relay::run() {
  while (!is_ending_) {
    double wait = 0.01;  // s
    if (!flying_.empty()) wait = std::clamp(flying_.top().due - now_s(), 0.0, wait);
    if (floods_ > 0) wait = std::min(wait, 2e-4);
    const timespec time{0, static_cast<long>(1e9 * wait)};
    pollfd ends[]{{front_, POLLIN, 0}, {back_, POLLIN, 0}};
    ppoll(ends, 2, &time, nullptr);
    take(controller);
    take(host);
    send_garbage();
    send_due();
  }
}

// What came from the other end.
void Relay::take(End to) {
  for (;;) {
    Bytes bytes(2000);
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t got = recvfrom(to == controller ? front_ : back_, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
    if (got < 0) return;
    bytes.resize(static_cast<size_t>(got));
    if (to == controller) host_ = from;
    const std::lock_guard lock(mutex_);
    if (to == host && hook_) hook_(bytes);
    const Way& way = ways_[to];
    if (random_.coin(way.loss)) continue;
    if (random_.coin(way.again)) launch(bytes, to, way);
    launch(std::move(bytes), to, way);
  }
}

void Relay::launch(Bytes bytes, End to, const Way& way) {
  if (random_.coin(way.damage) && !bytes.empty()) bytes[random_.below(bytes.size())] ^= static_cast<uint8_t>(1 << random_.below(8));
  double due = std::fmax(newest_due_[to], now_s() + way.delay + way.jitter * random_.unit_interval());
  if (random_.coin(way.reorder)) due += 5e-3;
  else newest_due_[to] = due;
  flying_.push({due, order_++, to, std::move(bytes)});
}

void Relay::send_due() {
  for (const double time = now_s(); !flying_.empty() && flying_.top().due <= time; flying_.pop()) {
    send(flying_.top().to, flying_.top().bytes);
    ++passed_;
  }
}

void Relay::send_garbage() {
  for (int i = 0; i < 20 && floods_ > 0; ++i, --floods_) {
    Bytes bytes(random_.below(700));
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random_.bits());
    if (bytes.size() > 8 && random_.coin()) {  // it begins as a datagram of the protocol does
      const uint8_t begin[]{'F', 'I', 'D', 'L', 1, static_cast<uint8_t>(1 + random_.below(9)), static_cast<uint8_t>(bytes.size()),
                            static_cast<uint8_t>(bytes.size() >> 8)};
      std::copy(std::begin(begin), std::end(begin), bytes.begin());
    }
    send(host, bytes);
    send(controller, bytes);
  }
}

void Relay::send(End to, const Bytes& bytes) {
  if (to == controller) {
    ::send(back_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  } else if (host_.sin_port) {
    sendto(front_, bytes.data(), bytes.size(), MSG_NOSIGNAL, reinterpret_cast<sockaddr*>(&host_), sizeof host_);
  }
}

}  // namespace scenes
