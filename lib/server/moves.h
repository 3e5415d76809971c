// Takes the moves of a client from its inbox. The client writes the inbox at any time, so a move is copied, checked, and then
// given to the scene: once, so that it does not undo what others change later. A move names the change after which it was
// written, and counts only if that change is the last one that set the object's pose.
#pragma once

#include <utility>
#include <vector>

#include "server/allowance.h"
#include "server/names.h"
#include "transfer/shared_memory.h"

namespace fs {

class Moves {
 public:
  void open(const Inbox& inbox, uint32_t slots);

  bool has_left() const noexcept { return inbox_.has_left(); }  // the client has said so
  bool has_new() const noexcept { return !dirty_.empty() && inbox_.has_dirty(); }
  // The slot is to be looked at: a move after the change that has just been made may have come already.
  void mark(uint32_t slot) noexcept { dirty_[slot / 64] |= uint64_t{1} << (slot % 64); }
  // Called once a turn. False: the client's moves have to wait for a later turn.
  bool begin_turn() noexcept { return allowance_.begin_turn(); }
  struct Taken {
    bool is_whole = false;  // else a group of moves is being written, and all of them come later
    size_t seen = 0, applied = 0, refused = 0;
  };
  Taken take(Names& names, LocalScene& scene);

 private:
  Inbox inbox_;
  std::vector<uint64_t> dirty_;  // a bit for each slot: there is a move to look at
  struct Written {
    uint32_t slot;
    uint64_t number;
    wire::Move move;
  };
  std::vector<uint64_t> newest_;  // number of the write that was taken last from each slot: it is not taken once more
  std::vector<Written> taken_;    // these two are kept for their memory
  std::vector<LocalScene::Move> moves_;
  Allowance allowance_{256};                            // moves each turn, about 40 us
};

}  // namespace fs
