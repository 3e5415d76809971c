// The syncs that were asked for and are not answered yet. A call may stop waiting for its sync; but each answer may tell of a
// refused change, only once, so a later call takes that answer.
#pragma once

#include <deque>

#include "client/line.h"
#include "client/pulls.h"

namespace fs {

class OpenSyncs {
 public:
  OpenSyncs(Line& line, Pulls& pulls) : line_(line), pulls_(pulls) {}

  // Waits until ticks have used all changes so far; then the replica has what became of them, if the call may wait so long.
  // Throws the first refusal that is told; TIMEOUT. timeout: s, for the sentence.
  void wait(Call& call, double timeout);

 private:
  void take_answers();
  uint64_t ask();

  Line& line_;
  Pulls& pulls_;
  std::deque<uint64_t> serials_;  // the oldest first
};

}  // namespace fs
