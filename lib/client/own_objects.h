// What the client knows of its own objects beside the replica, by name: the slot of the inbox through which each is moved,
// whether the server has refused it, and which assets it uses. Moves go to the inbox at once and to the replica only when
// somebody looks at it; until then the objects are ahead of the replica.
#pragma once

#include <string_view>

#include "base/name_map.h"
#include "client/sent_assets.h"
#include "client/slot_numbers.h"
#include "scene/local_scene.h"

namespace fs {

struct OwnObject {
  const std::string* name = nullptr;  // the key in OwnObjects
  uint32_t slot = wire::no_slot;  // no_slot: none was free, so it is moved by messages
  uint64_t after = 0;             // serial of the change that last set its pose
  bool has_lifetime = false;
  bool is_refused = false;        // the server does not have it: it is in the replica alone
  AssetIds assets{};              // that it uses, of those in SentAssets
  uint64_t moved_in = 0;          // newest question (questions.h) when it was last moved
  // Where it is, while it is ahead of the replica.
  bool is_ahead = false;
  Movement movement;
  OwnObject* next_ahead = nullptr;
};

class OwnObjects {
 public:
  OwnObjects(SentAssets& sent, uint32_t slots) : numbers(slots), sent_(sent) {}

  size_t size() const noexcept { return objects_.size(); }
  size_t refused_count() const noexcept { return refused_count_; }
  const NameMap<OwnObject>& all() const noexcept { return objects_; }
  OwnObject* find(std::string_view name) {  // null: there is none
    const auto found = objects_.find(name);
    return found == objects_.end() ? nullptr : &found->second;
  }
  const OwnObject* find(std::string_view name) const { return const_cast<OwnObjects*>(this)->find(name); }

  OwnObject& add(std::string_view name);  // or gives the one that is there
  // There is no such object any more. The caller has given its slot back.
  void drop(std::string_view name);
  void drop_all();
  void note_object(OwnObject& own, const Object* object);  // as it is now; null: it is gone
  void note_refused(OwnObject& own, bool is_refused) noexcept;

  // Moves the object ahead of the replica.
  void move_ahead(OwnObject& own, LocalScene& replica, const Pose& pose, const fs_twist* twist, double time);
  void move_replica(LocalScene& replica);  // moves all that are ahead there, too

  SlotNumbers numbers;

 private:
  void release(OwnObject& own);

  SentAssets& sent_;
  NameMap<OwnObject> objects_;
  size_t refused_count_ = 0;
  OwnObject* ahead_ = nullptr;  // the first object that is ahead; it links the others
};

}  // namespace fs
