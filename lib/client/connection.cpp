#include "client/connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "base/process.h"
#include "ipc/region.h"
#include "transfer/asset.h"

namespace fs {
namespace {

constexpr double retry_period = 0.02;     // s, between two tries to connect
constexpr double handshake_limit = 2;     // s, where the endpoint gives none
constexpr size_t most_answer = 4096;      // bytes
constexpr double heartbeat_limit = 0.1;   // s without a heartbeat, after which the system is asked for the server

constexpr const char* lost_text = "the server is gone; this scene stays disconnected: connect a new one";
constexpr const char* forked_text = "this process was forked from the one that connected: the scene belongs to that process";
constexpr const char* shut_text = "the scene was destroyed";

void sleep(double s) { std::this_thread::sleep_for(std::chrono::duration<double>(s)); }

fs_status to_status(int32_t status) {  // of a failure
  return status < 0 && status >= FS_ERROR_INTERNAL ? static_cast<fs_status>(status) : FS_ERROR_INTERNAL;
}

}  // namespace

// --------------------------------------------------------------------------------------------------------- connecting

Connection::Connection(const Endpoint& endpoint, const std::string& client) : process_number_(this_process()) {
  const double start = steady_now();
  for (;;) {
    connect(endpoint, start);
    if (greet(endpoint, client)) return;
    // The server was about to stop, or had no room for another stranger just now.
    if (steady_now() - start >= std::fmax(endpoint.timeout, handshake_limit)) {
      fail(FS_ERROR_FULL, "the server '%s' closes every connection: it has no room for another client", endpoint.name.c_str());
    }
    sleep(retry_period);
  }
}

void Connection::connect(const Endpoint& endpoint, double start) {
  const char* name = endpoint.name.c_str();
  for (;; sleep(retry_period)) {
    const auto is_nobody = [](int e) { return e == ENOENT || e == ECONNREFUSED; };
    int error =
        endpoint.is_own_user ? connect_to_own_server(endpoint.name, socket_) : connect_to(shared_address(endpoint.name), socket_);
    // Another user's server says that it refuses this one.
    if (!endpoint.is_own_user && is_nobody(error)) error = connect_to(user_address(endpoint.user, endpoint.name), socket_);
    const double waited = steady_now() - start;
    if (error == 0) break;
    if (is_nobody(error)) {
      if (waited < endpoint.timeout) continue;
      fail(FS_ERROR_NOT_FOUND, "no server of user %s listens at shm:%s", name_of_user(endpoint.user).c_str(), name);
    }
    if (error == EAGAIN) {  // too many wait to be accepted
      if (waited < std::fmax(endpoint.timeout, handshake_limit)) continue;
      fail(FS_ERROR_TIMEOUT, "the server '%s' has accepted no connection for %.3g s", name, waited);
    }
    fail(status_without_descriptor(error), "the server '%s' cannot be reached: %s", name, std::strerror(error));
  }
  const Peer peer = peer_of(socket_);
  if (peer.user != endpoint.user) {
    fail(FS_ERROR_DENIED, "the server '%s' belongs to user %u, must belong to user %u", name, peer.user, endpoint.user);
  }
  process_ = open_process(peer.process);
}

bool Connection::greet(const Endpoint& endpoint, const std::string& client) {
  const char* name = endpoint.name.c_str();
  wire::Hello hello{};
  hello.magic = wire::magic;
  hello.wire = wire::version;
  hello.sizes = own_sizes();
  put_text(hello.client, client);
  put_text(hello.version, fs_version());
  const std::span<const std::byte> parts[] = {bytes_of(&hello, 1)};
  if (send_message(socket_, parts, {}) != Transfer::done) return false;

  const double limit = endpoint.timeout > 0 ? endpoint.timeout : handshake_limit;
  if (!wait_for(socket_, false, limit)) {
    fail(FS_ERROR_TIMEOUT, "the server '%s' has not answered within %g s", name, limit);
  }
  std::vector<std::byte> message(most_message);
  std::array<Descriptor, 2> regions;
  size_t size;
  bool is_cut;
  if (receive_message(socket_, message, size, regions, is_cut) != Transfer::done) return false;

  wire::HelloAnswer answer{};
  if (size >= sizeof answer) std::memcpy(&answer, message.data(), sizeof answer);
  if (answer.magic != wire::magic) {
    fail(FS_ERROR_VERSION, "what answers at '%s' is not a server that this library (version %s) can talk to", name, fs_version());
  }
  const std::span<const std::byte> rest = std::span(message).subspan(sizeof answer, size - sizeof answer);
  if (answer.status != FS_OK) throw Error{to_status(answer.status), text_of(answer.text)};
  if (answer.wire != wire::version) {
    throw Error{FS_ERROR_VERSION, wire_difference(wire::version, fs_version(), answer.wire, text_of(answer.version))};
  }
  if (rest.size() != sizeof welcome_) fail(FS_ERROR_VERSION, "the server '%s' has sent a welcome of wrong size", name);
  std::memcpy(&welcome_, rest.data(), sizeof welcome_);
  const std::optional<RecordSizes> common = common_sizes(welcome_.sizes);
  if (!common) fail(FS_ERROR_VERSION, "the server '%s' has records of no known version", name);
  sizes_ = *common;
  if (welcome_.max_objects < 1 || welcome_.max_objects > most_slots || welcome_.outbox_bytes != sizeof(Outbox) ||
      welcome_.inbox_bytes != Inbox::bytes(welcome_.max_objects)) {
    fail(FS_ERROR_VERSION, "the server '%s' has another layout of shared memory", name);
  }
  if (is_cut || !regions[0] || !regions[1]) {
    fail(FS_ERROR_FULL, "no descriptor is left in this process for the memory of the server '%s'", name);
  }
  inbox_memory_ = map_region(regions[0], welcome_.inbox_bytes, true);
  inbox_ = Inbox(inbox_memory_.get(), welcome_.max_objects);
  const std::shared_ptr<void> memory = map_region(regions[1], sizeof(Outbox), false);
  outbox_ = std::shared_ptr<Outbox>(memory, static_cast<Outbox*>(memory.get()));
  return true;
}

// --------------------------------------------------------------------------------------------------------------- loss

bool Connection::is_forked() const noexcept { return this_process() != process_number_; }

const char* Connection::loss(double now) const noexcept {
  if (is_forked()) return forked_text;
  if (const char* known = loss_.load(std::memory_order_acquire)) return known;
  bool is_gone = outbox_->is_closed.load(std::memory_order_acquire) != 0;
  if (!is_gone && now - outbox_->heartbeat.load(std::memory_order_relaxed) > heartbeat_limit) {
    // A child forked by the server keeps the socket open, so the server's process is watched too.
    pollfd look[2] = {{socket_.get(), 0, 0}, {process_.get(), POLLIN, 0}};
    is_gone = poll(look, 2, 0) > 0 && ((look[0].revents & (POLLHUP | POLLERR)) || (look[1].revents & POLLIN));
  }
  if (!is_gone) return nullptr;
  lose(lost_text);
  return loss_.load(std::memory_order_acquire);
}

void Connection::lose(const char* why) const noexcept {
  const char* none = nullptr;
  loss_.compare_exchange_strong(none, why, std::memory_order_acq_rel);
}

void Connection::check(double now) const {
  if (const char* why = loss(now)) throw Error{FS_ERROR_DISCONNECTED, why};
}

void Connection::shut() noexcept {
  if (is_forked()) return;  // the connection of the parent process goes on
  inbox_.leave();
  lose(shut_text);
  shutdown(socket_.get(), SHUT_RDWR);
}

// ----------------------------------------------------------------------------------------------------------- messages

uint64_t Connection::send(wire::Type type, std::span<const std::byte> body, int descriptor, std::span<const std::byte> rest) {
  const wire::Header header{type, 0, serial_ + 1};
  const std::span<const std::byte> parts[] = {bytes_of(&header, 1), body, rest};
  const std::span<const int> descriptors(&descriptor, descriptor >= 0 ? 1 : 0);
  switch (send_message(socket_, parts, descriptors)) {
    case Transfer::done: return ++serial_;
    case Transfer::again: break;
    case Transfer::closed: lose(lost_text);
  }
  check();
  return 0;
}

void Connection::wake() noexcept {
  if (outbox_->is_asleep.load() == 0) return;
  const wire::Header header{wire::type_wake, 0, ++serial_};
  const std::span<const std::byte> parts[] = {bytes_of(&header, 1)};
  if (send_message(socket_, parts, {}) == Transfer::closed) lose(lost_text);  // where there is no room, the server is awake
}

uint64_t Connection::ask(wire::Type type, std::span<const std::byte> body) {
  const auto node = awaited_.try_emplace(serial_ + 1).first;
  uint64_t serial = 0;
  try {
    node->second.answer.body.reserve(most_answer);
    serial = send(type, body);
  } catch (...) {
    awaited_.erase(node);
    throw;
  }
  if (!serial) awaited_.erase(node);
  return serial;
}

bool Connection::has_answer(uint64_t serial) {
  receive();
  const auto found = awaited_.find(serial);
  if (found != awaited_.end() && found->second.is_there) return true;
  check();
  return false;
}

bool Connection::take_answer(uint64_t serial, Answer& out) {
  if (!has_answer(serial)) return false;
  const auto found = awaited_.find(serial);
  Reply reply = std::move(found->second);
  awaited_.erase(found);
  if (reply.head.status != FS_OK) {
    const Error error{to_status(reply.head.status), text_of(reply.head.text)};
    if (reply.head.reason == wire::reason_not_offered) throw NotOffered{error};
    throw error;
  }
  out = std::move(reply.answer);
  out.sizes = sizes_;
  return true;
}

// Takes in all that is there. Answers that nobody waits for any more are dropped.
void Connection::receive() {
  constexpr size_t head_size = sizeof(wire::Header) + sizeof(wire::Reply);
  std::array<std::byte, head_size + most_answer> buffer;
  for (;;) {
    Descriptor data;
    size_t size;
    bool is_cut;
    const Transfer transfer = receive_message(socket_, buffer, size, {&data, 1}, is_cut);
    if (transfer == Transfer::again) return;
    wire::Header header{};
    if (transfer == Transfer::done && size >= head_size) std::memcpy(&header, buffer.data(), sizeof header);
    if (header.type != wire::type_reply) return lose(lost_text);  // or it breaks the rules of the wire
    const auto found = awaited_.find(header.serial);
    if (found == awaited_.end()) continue;
    Reply& reply = found->second;
    std::memcpy(&reply.head, buffer.data() + sizeof header, sizeof reply.head);
    reply.answer.body.assign(buffer.data() + head_size, buffer.data() + size);
    reply.answer.data = std::move(data);
    reply.is_there = true;
  }
}

}  // namespace fs
