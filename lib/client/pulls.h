// Keeps the replica what the server has. The server may refuse a change, and others may change this client's objects; then
// it counts up Outbox::edits, and the client asks (a pull), name by name, what there is now. Where the client has changed an
// object after it asked, the object is asked for again. Not while a group is open: it began without.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>

#include "client/fetched_assets.h"
#include "client/group.h"
#include "client/questions.h"

namespace fs {

class Pulls {
 public:
  // group: the one that is open; null: none.
  Pulls(Line& line, Replica& replica, SentAssets& sent, FetchedAssets& fetched, Questions& questions,
        const std::unique_ptr<Group>& group)
      : line_(line), connection_(line.connection), replica_(replica), sent_(sent), fetched_(fetched), questions_(questions),
        group_(group) {}

  // Takes in what has come, and asks for the next; never waits.
  void look();
  // Waits until the client knows what the server had when the call began; and fetches what an object consists of: of the one
  // of this name; of all (null); of none ("").
  void catch_up(Call& call, const char* name = nullptr);
  // The same without fetching, as far as the call's time suffices.
  void catch_up_in_time(Call& call);

 private:
  bool is_current() const noexcept;
  bool start_pull();
  void take_answer();
  void fetch_behind(Call& call, const std::string& name);
  void adopt(const wire::Pulled& pulled, uint64_t question);
  void take_over(const wire::Pulled& pulled, const LinkedObject& received, uint64_t question);

  Line& line_;
  Connection& connection_;
  Replica& replica_;
  SentAssets& sent_;
  FetchedAssets& fetched_;
  Questions& questions_;
  const std::unique_ptr<Group>& group_;

  std::set<std::string, std::less<>> behind_;  // names of which the server may have something else than the replica
  uint64_t edits_seen_ = 0;                    // Outbox::edits as far as it was told of
  std::optional<uint64_t> asked_;              // serial of the pull that was not answered: its answer comes only once
  std::optional<wire::Pulled> pulled_;         // the answer, until the replica has it
  uint64_t question_ = 0;                      // of both
};

}  // namespace fs
