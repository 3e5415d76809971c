// A client's connection to its server: the socket, the shared memory, and whether the server is still there. A server that
// is lost stays lost for this connection.
#pragma once

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "ipc/blob.h"
#include "ipc/socket.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"

namespace fs {

// FULL: data that come with an answer are not there.
inline void require_data(const Descriptor& data) {
  if (!data) fail(FS_ERROR_FULL, "no descriptor is left in this process for the server's answer");
}

// The answer of a server to a request.
struct Answer {
  std::vector<std::byte> body;
  Descriptor data;
  RecordSizes sizes{};  // common with the server

  // What the server does not know of a record that grows is 0. INTERNAL: the answer has another size.
  template <class T>
  T as() const {
    T out{};
    const size_t size = sent_size(end_of<T>, sizes);
    if (body.size() != size) fail(FS_ERROR_INTERNAL, "the server's answer has %zu bytes, must be %zu", body.size(), size);
    std::memcpy(&out, body.data(), size);
    return out;
  }
  // The list that came with the answer. FULL, INTERNAL, IO.
  template <class T>
  std::vector<T> list() const {
    constexpr uint64_t most = 1 << 30, largest = 1 << 16;
    const auto [count, stride] = as<wire::Count>();
    if (count > most || (count > 0 && (stride == 0 || stride > largest))) {
      fail(FS_ERROR_INTERNAL, "the server's list has %llu entries of %llu bytes", static_cast<unsigned long long>(count),
           static_cast<unsigned long long>(stride));
    }
    require_data(data);
    check_blob(data, count * stride);
    std::vector<T> out(count);
    if (stride == sizeof(T)) {
      read_blob(data, 0, std::as_writable_bytes(std::span(out)));
      return out;
    }
    const size_t common = std::min<size_t>(stride, sizeof(T));
    for (size_t i = 0; i < count; ++i) read_blob(data, i * stride, std::as_writable_bytes(std::span(&out[i], 1)).first(common));
    return out;
  }
};

class Connection {
 public:
  // NOT_FOUND, EXISTS, VERSION, DENIED, FULL, TIMEOUT, IO, INVALID; or whatever status the server answers with.
  Connection(const Endpoint& endpoint, const std::string& client);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // ---- By any thread at any time.
  const wire::Welcome& welcome() const noexcept { return welcome_; }
  const RecordSizes& sizes() const noexcept { return sizes_; }  // common with the server
  const std::shared_ptr<Outbox>& outbox() const noexcept { return outbox_; }  // mapped to be read only
  bool is_forked() const noexcept;  // [rt] this process was forked since: the connection is the parent's
  // [rt] Null: the server is there; else the reason why not, a literal. No system call while the heartbeat goes on.
  const char* loss(double now = steady_now()) const noexcept;  // now: s, monotonic clock
  void check(double now = steady_now()) const;                 // DISCONNECTED
  // Ends it from this side, also for calls that wait.
  void shut() noexcept;
  // Waits until there may be an answer, for timeout s at most.
  void wait(double timeout) const noexcept { wait_for(socket_, false, timeout); }

  // Waits until there may be room to send, for timeout s at most.
  void wait_for_room(double timeout) const noexcept { wait_for(socket_, true, timeout); }

  bool has_room() const noexcept { return wait_for(socket_, true, 0); }

  // ---- By one thread at a time; none waits. All may throw DISCONNECTED.
  Inbox& inbox() noexcept { return inbox_; }
  void wake() noexcept;  // [rt] wakes the server if it sleeps; only then by a system call

  // Sends a message, of one or two parts, as a whole or not at all. Returns its serial; 0: there is no room now.
  uint64_t send(wire::Type type, std::span<const std::byte> body, int descriptor = -1, std::span<const std::byte> rest = {});
  uint64_t last_serial() const noexcept { return serial_; }
  // Sends a request, whose answer is then awaited. Returns its serial; 0: there is no room now.
  uint64_t ask(wire::Type type, std::span<const std::byte> body = {});
  bool take_answer(uint64_t serial, Answer& out);  // false: it is not there yet. Throws what the server refuses
  bool has_answer(uint64_t serial);                // it can be taken
  bool is_awaited(uint64_t serial) const { return awaited_.contains(serial); }  // it was asked for and not taken
  void give_up(uint64_t serial) noexcept { awaited_.erase(serial); }

  // From now on the server is lost for this connection.
  void lose(const char* why) const noexcept;

 private:
  struct Reply {
    bool is_there = false;
    wire::Reply head{};
    Answer answer;  // Reserved beforehand, so that no answer is lost when memory runs out.
  };

  void connect(const Endpoint& endpoint, double start);
  bool greet(const Endpoint& endpoint, const std::string& client);  // false: the server closed the connection without an answer
  void receive();

  Descriptor socket_, process_;  // process_: of the server, readable when it has ended; may be none
  wire::Welcome welcome_{};
  RecordSizes sizes_{};
  std::shared_ptr<void> inbox_memory_;
  Inbox inbox_;
  std::shared_ptr<Outbox> outbox_;
  const uint32_t process_number_;  // this_process() when it connected
  mutable std::atomic<const char*> loss_{nullptr};

  uint64_t serial_ = 0;  // of the last message
  std::map<uint64_t, Reply> awaited_;  // by serial
};

}  // namespace fs
