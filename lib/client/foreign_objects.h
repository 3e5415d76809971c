// Gets and changes objects of other clients. Each get is a request, and so is each change, which the server answers when it is
// done. In a thread that has a group open, changes become part of the group instead, and gets see them there.
#pragma once

#include <memory>

#include "client/fetched_assets.h"
#include "client/group.h"

namespace fs {

class ForeignObjects {
 public:
  ForeignObjects(Line& line, SentAssets& sent, FetchedAssets& fetched, const ThreadGroups<Group>& groups)
      : line_(line), sent_(sent), fetched_(fetched), groups_(groups) {}

  // The object as the thread's group has it, else as the server has it. Its name is the one that was asked for, ready for change.
  Ref<const Object> get(Call& call, const char* name, fs_object& out);
  // now: s, of the scene's clock.
  void change(Call& call, const fs_object& object, uint32_t parts, double now);
  void move(Call& call, const char* name, const Pose& pose, const fs_twist* twist, double time);
  void remove(Call& call, const char* name);

 private:
  Group::Foreign& join_group(Call& call, Group& group, const char* name);
  void change_in_group(Call& call, Group& group, const fs_object& object, wire::Set& change);
  bool try_change(Call& call, const Assets& assets, wire::Set& change, bool may_refer);

  Line& line_;
  SentAssets& sent_;
  FetchedAssets& fetched_;
  const ThreadGroups<Group>& groups_;
};

}  // namespace fs
