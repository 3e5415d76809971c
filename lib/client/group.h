// The changes of a group that is not sent yet, or one change alone: as a batch, with what sending it needs, and with what
// the group has made of names and of objects of others, which getters see and the server does not know yet.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/replica.h"
#include "transfer/batch.h"

namespace fs {

class Group {
 public:
  // max_objects: that the server allows.
  Group(const Replica& replica, uint32_t max_objects) : replica_(replica), max_objects_(max_objects) {}

  // ---- Putting it together, after the replica has taken the change.
  void require_room(size_t objects, size_t changes = 1) const;  // for so many new objects, and changes. FULL
  bool is_object(std::string_view name) const;  // the server has one of this name, once the group is applied
  void add_object(wire::Type type, const char* name, uint32_t parts);  // set or change: as the replica has it
  void add_place(const char* name);                                    // as the replica has it
  void add_remove(const char* name);
  void add_clear();
  void add_frame();  // as the replica has it
  void add_tool();
  void add_clutch(bool held) { batch.add(wire::type_clutch, wire::Clutch{held}); }
  void add_foreign(wire::Type type, std::span<const std::byte> record, Assets assets = {});

  // An object of another client, as the group has it.
  struct Foreign {
    fs_object object;
    Ref<const Object> kept;  // null: removed
  };
  NameMap<Foreign> foreign;

  // ---- To be sent.
  Batch batch;
  const Object* object(size_t i) const {  // of a set or change; null: of none
    return i < objects_.size() ? objects_[i].get() : nullptr;
  }
  // Those that the change brings, which have to be at the server before it.
  const Assets& assets(size_t i) const;

 private:
  bool has(std::string_view name) const;
  void note_name(const std::string& name, bool is_there);

  const Replica& replica_;
  const uint32_t max_objects_;
  // By the number of the change; shorter where the last changes have none.
  std::vector<Ref<const Object>> objects_;
  std::vector<Assets> assets_;
  std::map<std::string, bool, std::less<>> names_;  // that the changes speak of; true: there is such an object then
  ptrdiff_t more_names_ = 0, more_objects_ = 0;     // than there were; what was refused is a name, but no object
};

}  // namespace fs
