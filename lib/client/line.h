// A connected scene's way to its server, for calls of many threads. A call has the lock while it works, and gives it back
// while it waits for the server, so that others go on meanwhile: after a wait anything may have changed. No call waits
// longer than its own time.
#pragma once

#include <mutex>
#include <span>

#include "client/connection.h"

namespace fs {

// A call that is under way.
struct Call {
  std::unique_lock<std::mutex> lock;
  double limit;  // s, that it waits at most
  double end;    // s, monotonic clock: then it waits no longer
};

class Line {
 public:
  Line(const Endpoint& endpoint, const std::string& client) : connection(endpoint, client) {}

  Connection connection;

  // DISCONNECTED. steady: s, monotonic clock.
  Call enter(double* steady = nullptr) const;
  std::unique_lock<std::mutex> enter_unchecked() const { return std::unique_lock(mutex_); }  // also after a loss

  // Waits for room to send or for an answer, without the lock. False: the call's time is over.
  bool try_pause(Call& call, bool is_for_room);
  void pause(Call& call, bool is_for_room);  // TIMEOUT
  // Asks and waits for the answer. TIMEOUT, or what the server says.
  Answer request(Call& call, wire::Type type, std::span<const std::byte> body = {});
  template <class Record>
  Answer request(Call& call, wire::Type type, const Record& record) {
    return request(call, type, std::as_bytes(std::span(&record, 1)));
  }
  // Gives the call a whole answer's time from now on.
  static void extend(Call& call) noexcept;

  // The server and this end have come apart, as there was no memory in the middle of a change.
  void lose_for_memory() const noexcept {
    connection.lose("there was no memory in the middle of a change: the server is given up");
  }

 private:
  mutable std::mutex mutex_;
};

// Of a name that a caller gave, for a request. NOT_FOUND: it is too long to be one. field: its name in the sentence.
wire::Target to_target(const char* name, const char* field);

}  // namespace fs
