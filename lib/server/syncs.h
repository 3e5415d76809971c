// Syncs of a client that wait: each is answered when ticks have used all that the client had changed before it. As a client
// may have changed objects of any scene, every scene's changes count. Where a change was refused, the next sync tells of
// the first refusal instead.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <forceserver/base.h>

namespace fs {

struct Client;

class Syncs {
 public:
  bool is_empty() const noexcept { return waiting_.empty(); }
  void add(uint64_t serial);  // FULL
  void note_refusal(fs_status status, const std::string& text) {
    if (!first_refusal_) first_refusal_ = {status, text};
  }
  // Once a turn, after the scenes were posted, while none of the client's changes waits. are_moves_taken: those of this
  // client, in this turn. May throw BadClient.
  void answer(const Client& client, bool are_moves_taken);

 private:
  struct Sync {
    uint64_t serial;
    bool has_begun = false;  // its sequences are sampled when all that came before it has been posted
    uint64_t own = 0;        // sequence wanted of the server's own scene, then those of the clients
    std::vector<std::pair<std::weak_ptr<const Client>, uint64_t>> wanted;
  };
  static void begin(Sync& sync, const Client& client);
  static bool is_used(Sync& sync, const Client& client);

  std::vector<Sync> waiting_;
  std::optional<std::pair<fs_status, std::string>> first_refusal_;
};

}  // namespace fs
