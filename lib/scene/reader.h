// A thread that evaluates, as its scene knows it: a servo's channel or a tool.
#pragma once

#include "field/evaluate.h"
#include "field/mailbox.h"

namespace fs {

struct Reader {
  explicit Reader(Ref<Memory> the_memory) : memory(std::move(the_memory)) {}

  const Ref<Memory> memory;
  Mailbox<Posting> mailbox;
  Scratches scratches;  // the scene's, under its lock: those of the newest posting
};

}  // namespace fs
