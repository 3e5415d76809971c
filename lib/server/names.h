// What the server knows of the names that a client has given: one record a name, also where there is no such object. Records
// of some kinds are listed as well: objects that are absent, names that the client has to be told of, objects that no tick has
// used yet. The client moves an object through a slot of its inbox: a slot leads to the record, and that to the object.
#pragma once

#include <algorithm>
#include <array>
#include <list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/name_map.h"
#include "scene/local_scene.h"
#include "server/parked_batches.h"
#include "transfer/wire.h"

namespace fs {

// An object that is not in the scene: it waits for a shape, or was refused.
struct Absence {
  fs_primitive primitive;
  fs_object_state state;
};

struct NameRecord {
  bool is_there = false;          // the scene has such an object
  uint32_t slot = wire::no_slot;  // through which it is moved; a slot is of one object at most
  uint64_t after = 0;             // serial of the change that last set its pose: only moves made after that count
  NameId id;                      // in the scene
  std::optional<Absence> absent;
  std::string editor;  // who changed what the client has to be told of; empty: it has to be told nothing
  // The sequence of the first snapshot that has the object, or its new shape; 0: not posted yet. None: a tick has used it.
  std::optional<uint64_t> awaited;
};

class Names {
 private:
  enum Kind { absent, untold, awaited, kind_count };
  struct Listed;
  using List = std::list<std::pair<const std::string, Listed>*>;
  struct Listed : NameRecord {
    std::array<std::optional<List::iterator>, kind_count> places;
  };

 public:
  using Named = std::pair<const std::string, Listed>;

  void open(uint32_t slots) { slots_.resize(slots); }

  const NameRecord* find(std::string_view name) const;    // null: nothing is known of it
  const NameRecord* object(std::string_view name) const;  // null: the scene has no such object
  bool has(std::string_view name) const { return object(name) != nullptr; }
  size_t objects() const noexcept { return objects_; }  // in the scene
  size_t absents() const noexcept { return lists_[absent].size(); }
  bool has_untold() const noexcept { return !lists_[untold].empty(); }
  bool has_awaited() const noexcept { return !lists_[awaited].empty(); }
  const std::string* first() const noexcept { return all_.empty() ? nullptr : &all_.begin()->first; }

  // ---- Objects.
  void add(const std::string& name);    // the scene has it now
  void await(const std::string& name);  // it is new, or has a new shape
  void forget(std::string_view name);   // everything, as there is no such object
  // From now on the object is moved through the slot, which may be no_slot. serial: of the change that set its pose. False: it
  // has no slot now, as none was given, or as another object has got this one by a later change.
  bool bind(std::string_view name, uint32_t slot, uint64_t serial);
  bool is_slot(uint32_t slot) const noexcept { return slot < slots_.size() || slot == wire::no_slot; }
  Named* moved_by(uint32_t slot) const noexcept { return slots_[slot]; }  // null: no object is

  void set_absent(const std::string& name, const Absence& why);
  void drop_absent(std::string_view name);
  void drop_absents();

  // ---- What the client has to be told.
  void set_untold(const std::string& name, const std::string& editor);
  void note_told(std::string_view name);
  size_t untold_count() const noexcept { return lists_[untold].size(); }
  const std::string* next_untold(const ParkedBatches& parked) const;  // that no parked change holds up; null: none

  // Called once a turn, after the scene was posted. newest: the sequence of the scene's newest change; used: the one that the
  // last tick used. Calls f(name) for each awaited object that is used by now, but looks at some of them only, so that no turn
  // takes long.
  template <class F>
  void take_used(uint64_t newest, uint64_t used, F&& f);

  const NameMap<Listed>& all() const noexcept { return all_; }
  template <class F>
  void for_each_absent(F&& f) const {
    for (const Named* named : lists_[absent]) f(named->first, *named->second.absent);
  }
  // ---- To put records back when a group is refused.
  NameRecord record_of(std::string_view name) const;
  bool put_back(const std::string& name, const NameRecord& record);  // as bind; the names that had its slot are forgotten

 private:
  Named& make(const std::string& name) { return *all_.try_emplace(name).first; }
  Named* find_named(std::string_view name);
  void list(Named& named, Kind kind, bool is_listed);
  void erase_if_empty(const Named& named);

  NameMap<Listed> all_;
  std::vector<Named*> slots_;
  std::array<List, kind_count> lists_;
  size_t objects_ = 0;
};

template <class F>
void Names::take_used(uint64_t newest, uint64_t used, F&& f) {
  constexpr size_t most_each_turn = 128;
  List& list_of_them = lists_[awaited];
  for (size_t i = std::min(most_each_turn, list_of_them.size()); i > 0; --i) {
    Named& named = *list_of_them.front();
    std::optional<uint64_t>& sequence = named.second.awaited;
    if (*sequence == 0) sequence = newest;
    if (used < *sequence) {  // the next turn begins with others
      list_of_them.splice(list_of_them.end(), list_of_them, list_of_them.begin());
      continue;
    }
    f(named.first);
    list(named, awaited, false);
    sequence.reset();
  }
}

}  // namespace fs
