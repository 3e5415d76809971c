// Syncs that this client has asked for and that are not answered. A call may stop waiting for its own; as each answer may
// tell of a refusal, which is told only once, the next call takes it.
#pragma once

#include <deque>

#include "client/connection.h"

namespace fs {

class OpenSyncs {
 public:
  explicit OpenSyncs(Connection& connection) : connection_(connection) {}

  // Throws the first refusal that is told.
  void take_answers() {
    while (!serials_.empty() && connection_.has_answer(serials_.front())) {
      const uint64_t serial = serials_.front();
      serials_.pop_front();
      Answer answer;
      connection_.take_answer(serial, answer);
    }
  }
  bool is_answered(uint64_t serial) const { return serials_.empty() || serials_.front() > serial; }
  uint64_t ask() {  // serial; 0: there is no room
    constexpr size_t most = 32;
    if (serials_.size() >= most) return 0;
    serials_.push_back(0);  // before it is asked for, so that its answer cannot be lost
    try {
      serials_.back() = connection_.ask(wire::type_sync);
    } catch (...) {
      serials_.pop_back();
      throw;
    }
    const uint64_t serial = serials_.back();
    if (!serial) serials_.pop_back();
    return serial;
  }

 private:
  Connection& connection_;
  std::deque<uint64_t> serials_;  // the oldest first
};

}  // namespace fs
