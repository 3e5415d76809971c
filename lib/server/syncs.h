// The syncs of a client that wait. A sync is answered once ticks have used every scene's changes up to now: the client may
// have changed objects of any of them. Where a change was refused, the next sync tells the first refusal instead.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/client.h"

namespace fs {

class Syncs {
 public:
  bool is_empty() const noexcept { return waiting_.empty(); }
  void add(uint64_t serial);  // FULL
  void note_refusal(fs_status status, const std::string& text) {
    if (!first_refusal_) first_refusal_ = {status, text};
  }
  // Called once a turn, after the scenes were posted, while no change of the client waits. are_moves_taken: this turn has
  // taken the client's moves. used: the sequence of the client's scene that the last tick used, as it was when the client
  // was told which of its objects are felt: a sync is not to be ahead of those events. May throw BadClient.
  void answer(const Client& client, bool are_moves_taken, uint64_t used);

 private:
  struct Sync {
    uint64_t serial;
    bool has_begun = false;  // all that came before it was posted
    uint64_t of_server = 0;  // the sequence that a tick has to use of the server's scene; uses: of each client's
    struct Use {
      std::weak_ptr<const Client> client;
      std::optional<uint64_t> sequence;  // none: its scene is being changed, and will be posted after that
    };
    std::vector<Use> uses;
  };
  static void begin(Sync& sync, const Client& client);
  static bool is_used(Sync& sync, const Client& client, uint64_t used);

  std::vector<Sync> waiting_;
  std::optional<std::pair<fs_status, std::string>> first_refusal_;
};

}  // namespace fs
