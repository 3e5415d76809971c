// Reports of objects come from the server, which alone knows what became of them. While a group is open, the report of an own
// object also says what the group has made of it, which the server does not know yet. Motions of own objects come from the
// replica, those of others from the server.
#pragma once

#include <memory>
#include <vector>

#include "client/group.h"
#include "client/line.h"
#include "client/pulls.h"

namespace fs {

class Reports {
 public:
  Reports(Line& line, Replica& replica, Pulls& pulls, const ThreadGroups<Group>& groups)
      : line_(line), replica_(replica), pulls_(pulls), groups_(groups) {}

  fs_report of_own(Call& call, const char* name);      // NOT_FOUND
  fs_report of_foreign(Call& call, const char* name);  // "client/object". NOT_FOUND
  std::vector<fs_report> of_all(Call& call);           // the client's own objects first

  std::vector<fs_motion> own_motions(Call& call);
  std::vector<fs_motion> foreign_motions(Call& call, const char* client);  // of another client's objects. NOT_FOUND
  std::vector<fs_motion> all_motions(Call& call);                          // the client's own objects first

  // Those above `since`, by motion_revision.
  std::vector<fs_motion> own_motions_since(Call& call, uint64_t since);
  std::vector<fs_motion> foreign_motions_since(Call& call, const char* client, uint64_t since);  // null: of all others. NOT_FOUND

 private:
  fs_report in_group(const fs_report& ours, const fs_report* theirs) const;

  Line& line_;
  Replica& replica_;
  Pulls& pulls_;
  const ThreadGroups<Group>& groups_;
};

}  // namespace fs
