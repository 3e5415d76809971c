// The two regions that a client and its server share. The server makes and seals both. Every word in them is atomic, and
// what is read is copied before it is looked at.
//
//   inbox   client to server: where the client's objects are, a slot for each object that is moved through it
//   outbox  server to client, which can only read it: the hand, what the client must know at once, events
#pragma once

#include <atomic>

#include "base/seqlock.h"
#include "field/servo_output.h"
#include "ipc/inbox.h"
#include "transfer/wire.h"

namespace fs {

using Inbox = InboxOf<wire::Move>;

inline constexpr uint64_t kept_events = 1024;  // the newest, in an outbox

struct Outbox {
  ServoOutput servo;                             // written by the tick; all else by the server's thread
  alignas(64) std::atomic<double> heartbeat{0};  // s, monotonic clock: when the server last came by
  std::atomic<uint32_t> is_closed{0};            // the server has let go of this client
  std::atomic<uint32_t> is_asleep{0};            // the server looks at the inbox only when it is woken
  std::atomic<uint64_t> news{0};                 // grows when there is something new to tell the client
  std::atomic<uint64_t> applied{0};              // serial: all of the client's messages up to it have been applied
  std::atomic<uint64_t> events_written{0};
  Seqlock<wire::NumberedEvent> events[kept_events];  // by number, modulo kept_events
};

// Called by the server: adds an event; of an OVERFLOW, counts the events that were lost. Events that are not read in time are
// overwritten.
void push_event(Outbox& outbox, const fs_event& event) noexcept;

// Used by the client: reads the events of an outbox one by one.
class EventReader {
 public:
  // Where events were lost, an OVERFLOW without a time tells so first. False: there is no event.
  bool read(const Outbox& outbox, fs_event& out) noexcept;

 private:
  uint64_t read_ = 0;  // events, lost ones included
};

}  // namespace fs
