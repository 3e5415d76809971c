// Objects of other clients, as a connected scene reaches them: each get is a request. A change is one, too, which is
// answered when it is done; in an open group it is added to that instead, which then has the object as it will be.
#pragma once

#include <memory>

#include "client/fetched_assets.h"
#include "client/group.h"

namespace fs {

class ForeignObjects {
 public:
  // group: the one that is open; null: none.
  ForeignObjects(Line& line, SentAssets& sent, FetchedAssets& fetched, const std::unique_ptr<Group>& group)
      : line_(line), sent_(sent), fetched_(fetched), group_(group) {}

  // As an open group has it, else as the server has it. Returns the name that was asked for, ready for change.
  Ref<const Object> get(Call& call, const char* name, fs_object& out);
  // now: s, of the scene's clock.
  void change(Call& call, const fs_object& object, uint32_t parts, double now);
  void move(Call& call, const char* name, const Pose& pose, const fs_twist* twist, double time);
  void remove(Call& call, const char* name);

 private:
  class Pins;
  Group::Foreign& join_group(Call& call, const char* name);
  void change_in_group(Call& call, const fs_object& object, wire::Edit& edit);
  bool try_change(Call& call, const Assets& assets, wire::Edit& edit, bool may_refer);

  Line& line_;
  SentAssets& sent_;
  FetchedAssets& fetched_;
  const std::unique_ptr<Group>& group_;
};

}  // namespace fs
