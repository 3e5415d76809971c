// A thread that evaluates, as its scene knows it: a servo's channel or a tool.
#pragma once

#include "field/evaluate.h"
#include "field/mailbox.h"

namespace fs {

struct Reader {
  explicit Reader(Ref<Memory> the_memory) : memory(std::move(the_memory)) {}

  const Ref<Memory> memory;
  Mailbox<Posting> mailbox;

  // Called with the scene's lock held.
  void post(const Ref<const Snapshot>& snapshot) {
    const bool was_fetched = !mailbox.post({snapshot, scratches}) && !is_taken_back_;
    if (was_fetched) first_unfetched_ = snapshot->sequence;
    is_taken_back_ = false;
  }
  // True: the reader never had a snapshot of this sequence or a later one, nor can it get one before the next post.
  bool take_back(uint64_t sequence) {
    is_taken_back_ = mailbox.take_back() || is_taken_back_;
    return is_taken_back_ && sequence >= first_unfetched_;
  }
  Scratches scratches;  // the scene's, under its lock: for the next posting

 private:
  uint64_t first_unfetched_ = 0;  // sequence of the oldest posting that may not have been fetched yet, while take_back succeeds
  bool is_taken_back_ = false;  // the newest
};

}  // namespace fs
