// What is known of this client's own objects, by name: through which slot of the inbox each is moved and after which change,
// whether the server has refused it, which shapes and curves it uses. A move may reach the inbox before the replica: the
// objects that are ahead of it are known here too.
#pragma once

#include <string_view>

#include "base/name_map.h"
#include "client/sent_assets.h"
#include "client/slot_numbers.h"
#include "scene/local_scene.h"

namespace fs {

struct OwnObject {
  const std::string* name = nullptr;  // its key
  uint32_t slot = wire::no_slot;  // no_slot: there is none for it, so it is moved by messages
  uint64_t after = 0;             // serial of the change that last set its pose
  bool has_lifetime = false;
  bool is_refused = false;        // the server has it not: it is here alone
  AssetIds assets{};              // that it uses, of those that the server has from this client
  uint64_t moved_in = 0;          // the newest question at its last move
  // Moved, and the replica does not know yet.
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

  OwnObject& add(std::string_view name);  // or the one that is there
  // The object is no more; whoever calls has given its slot back.
  void drop(std::string_view name);
  void drop_all();
  void note_object(OwnObject& own, const Object* object);  // what it is now; null: nothing any more
  void note_refused(OwnObject& own, bool is_refused) noexcept;

  // Moves it as the inbox will have it; the replica comes later.
  void move_ahead(OwnObject& own, const LocalScene& replica, const Pose& pose, const fs_twist* twist, double time);
  void move_replica(LocalScene& replica);  // to where the objects are

  SlotNumbers numbers;

 private:
  void release(OwnObject& own);

  SentAssets& sent_;
  NameMap<OwnObject> objects_;
  size_t refused_count_ = 0;
  OwnObject* ahead_ = nullptr;  // the first of those that are
};

}  // namespace fs
