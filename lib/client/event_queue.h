// The events of a connected scene: those that the server writes into the outbox, and at the end of a server the event that
// says so.
#pragma once

#include "client/line.h"
#include "client/pulls.h"
#include "transfer/shared_memory.h"

namespace fs {

class EventQueue {
 public:
  EventQueue(Line& line, const Replica& replica, Pulls& pulls) : line_(line), replica_(replica), pulls_(pulls) {}

  // The oldest event; one of kind NONE where none comes within the timeout (s). DISCONNECTED: the server's end has been told.
  fs_event next(double timeout);

 private:
  bool take(fs_event& out);

  Line& line_;
  const Replica& replica_;
  Pulls& pulls_;
  EventReader reader_;
  bool is_end_told_ = false;
};

}  // namespace fs
