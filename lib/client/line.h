// The line from a connected scene to its server, for calls of many threads. A call holds the lock while it works, and gives it
// back while it waits for the server, so that other calls can go on: after a wait anything may have changed. Each call has an
// end, after which it waits no longer.
#pragma once

#include <mutex>
#include <span>

#include "client/connection.h"

namespace fs {

// A call that is under way.
struct Call {
  std::unique_lock<std::mutex> lock;
  double limit;  // s, the longest wait, for the sentence
  double end;    // s, monotonic clock
};

class Line {
 public:
  Line(const Endpoint& endpoint, const std::string& client) : connection(endpoint, client) {}

  Connection connection;

  // Begins a call. steady: becomes the time, s, monotonic clock. DISCONNECTED.
  Call enter(double* steady = nullptr) const;
  std::unique_lock<std::mutex> enter_unchecked() const { return std::unique_lock(mutex_); }  // also after a loss

  // Waits a little for room to send or for an answer, without the lock. False: the call's end has come.
  bool try_pause(Call& call, bool is_for_room);
  void pause(Call& call, bool is_for_room);  // TIMEOUT
  // Calls f(), which takes long, without the lock. Returns what f returns. DISCONNECTED.
  template <class F>
  auto work(Call& call, F&& f) {
    call.lock.unlock();
    struct Relock {
      ~Relock() { lock.lock(); }
      std::unique_lock<std::mutex>& lock;
    };
    auto out = [&] {
      const Relock relock{call.lock};
      return f();
    }();
    connection.check();
    return out;
  }
  // Sends a request and waits for the answer. TIMEOUT, VERSION (the server does not know a part of it), or what the server
  // refuses.
  Answer request(Call& call, wire::Type type, std::span<const std::byte> body = {});
  template <class Record>
  Answer request(Call& call, wire::Type type, const Record& record) {
    return request(call, type, sent_change(type, std::as_bytes(std::span(&record, 1)), connection.sizes()));
  }
  // Moves the call's end: it may wait for one more whole answer.
  static void extend(Call& call) noexcept;

  // Gives the server up, because there was no memory in the middle of a change: both ends may differ.
  void lose_for_memory() const noexcept {
    connection.lose("memory ran out in the middle of a change, so this scene is disconnected");
  }

 private:
  mutable std::mutex mutex_;
};

// A name that a caller gave, for a request. field: the name of the argument, for the sentence. NOT_FOUND: it is too long.
wire::Target to_target(const char* name, const char* field);

}  // namespace fs
