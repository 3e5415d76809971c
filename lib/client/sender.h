// Brings groups to the server, each as a whole or not at all. Moves alone go through the inbox; all else is one message,
// after the shapes and curves that it needs. When it is on its way, what is known of this client's objects is what the
// server will have.
#pragma once

#include "client/group.h"
#include "client/line.h"
#include "client/questions.h"

namespace fs {

class Sender {
 public:
  Sender(Line& line, Replica& replica, SentAssets& sent, Questions& questions)
      : line_(line), connection_(line.connection), replica_(replica), sent_(sent), questions_(questions) {}

  // False: there is no room at the server now, and nothing has changed but that some of its assets are there already.
  bool deliver(Group& group);

 private:
  bool may_be_written(const Batch& batch) const;
  void write_moves(const Batch& batch) noexcept;
  uint64_t send(Batch& batch);
  void note_sent(const Group& group, uint64_t serial) noexcept;
  void note_sent(const Group& group, size_t i, uint64_t serial);
  class SlotPlan;

  Line& line_;
  Connection& connection_;
  Replica& replica_;
  SentAssets& sent_;
  Questions& questions_;
};

}  // namespace fs
