// A group that is not sent yet, or one change alone: its changes as a batch, and the objects and assets that sending them
// needs. It also knows which names there will be, to count objects, and how the group has changed objects of others, which
// getters see before the server does.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/replica.h"
#include "scene/thread_groups.h"
#include "transfer/batch.h"

namespace fs {

class Group {
 public:
  explicit Group(const Replica& replica) : batch(replica.sizes), replica_(replica) {}

  // ---- To put it together. Each change is added after the replica has taken it.
  void require_room(size_t objects, size_t changes = 1) const;  // for so many more objects and changes. FULL
  void require_room(const std::vector<std::string>& names, size_t changes) const;  // to set objects of these names, too
  bool is_object(std::string_view name) const;  // once the group is applied, the server has such an object
  void add_object(wire::Type type, const char* name, uint32_t parts);  // set or change: the object as the replica has it
  void add_place(const char* name);                                    // the motion that the replica has
  void add_remove(const char* name);
  void add_clear();  // alone: of all that the server has
  void add_removes();  // of all objects that there are with the group
  void add_frame();  // the one that the replica has
  void add_tool();
  void add_tool_radius();
  void add_clutch(bool held) { batch.add(wire::type_clutch, wire::Clutch{held}); }
  void add_foreign(wire::Type type, std::span<const std::byte> record, Assets assets = {});

  // An object of another client, as the group has changed it.
  struct Foreign {
    fs_object object;
    Ref<const Object> kept;  // null: removed
  };
  NameMap<Foreign> foreign;

  // ---- To be sent.
  Batch batch;
  const Object* object(size_t i) const {  // that a set or change makes; null: any other change
    return i < objects_.size() ? objects_[i].get() : nullptr;
  }
  // That the change refers to: the server must have them before it.
  const Assets& assets(size_t i) const;

 private:
  bool has(std::string_view name) const;
  void note_name(const std::string& name, bool is_there);

  const Replica& replica_;
  // By the index of the change; the last changes may have no entry.
  std::vector<Ref<const Object>> objects_;
  std::vector<Assets> assets_;
  std::map<std::string, bool, std::less<>> names_;  // that the changes name; true: there is such an object then
  ptrdiff_t more_names_ = 0, more_objects_ = 0;     // than before the group; a refused object counts as a name only
};

}  // namespace fs
