// Makes the replica what the server has. Where the server refuses a change, or others change this client's objects, the server
// counts up Outbox::news; then the client asks name by name what there is now: a pull. Where the client has changed an object
// after it asked, it asks again. A thread that has a group open leaves this alone: what it puts into the replica joins its group.
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
  Pulls(Line& line, Replica& replica, SentAssets& sent, FetchedAssets& fetched, Questions& questions,
        const ThreadGroups<Group>& groups)
      : line_(line), connection_(line.connection), replica_(replica), sent_(sent), fetched_(fetched), questions_(questions),
        groups_(groups) {}

  // Takes in the answers that have come, and asks for more; never waits.
  void look();
  // Waits until the replica has what the server had when the call began. Assets are fetched for the object of this name only;
  // null: for all objects; "": for none. TIMEOUT: the call's end has come first; what has come until then stays.
  void catch_up(Call& call, const char* name = nullptr);
  // The same without fetching, for as long as the call may wait.
  void catch_up_in_time(Call& call);

 private:
  bool is_current() const noexcept;
  bool start_pull();
  void take_answer();
  void fetch_behind(Call& call, const std::string& name);
  void adopt(const wire::PullAnswer& pulled, uint64_t question);
  void take_over(const wire::PullAnswer& pulled, LinkedObject received, uint64_t question);

  Line& line_;
  Connection& connection_;
  Replica& replica_;
  SentAssets& sent_;
  FetchedAssets& fetched_;
  Questions& questions_;
  const ThreadGroups<Group>& groups_;

  std::set<std::string, std::less<>> behind_;  // names whose object may differ between server and replica
  uint64_t news_seen_ = 0;  // Outbox::news as far as the server has told
  std::optional<uint64_t> asked_;  // serial of the pull that is not answered yet: its answer comes only once
  std::optional<wire::PullAnswer> pulled_;  // its answer, until the replica has taken it in
  uint64_t question_ = 0;  // the question of this pull
};

}  // namespace fs
