// Sends groups to the server, each as a whole or not at all. A group of moves alone goes through the inbox; any other is one
// message, after the assets that it needs. Once a group is sent, OwnObjects is brought up to what the server will have.
#pragma once

#include "client/group.h"
#include "client/line.h"
#include "client/questions.h"

namespace fs {

class Sender {
 public:
  Sender(Line& line, Replica& replica, SentAssets& sent, Questions& questions)
      : line_(line), connection_(line.connection), replica_(replica), sent_(sent), questions_(questions) {}

  // False: there is no room at the server now, or large assets have to be sent ahead. Then nothing has changed, but some of the
  // assets may be there already.
  bool deliver(Group& group, SendingAhead& ahead);

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
