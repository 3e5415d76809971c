// The objects of a scene by their names, as they are evaluated. All of it under the scene's lock.
#pragma once

#include <deque>
#include <memory>
#include <set>

#include "base/name_map.h"
#include "scene/object_rows.h"

namespace fs {

// A shortcut to a name that was found before. It stays good until the object has been removed and has faded out.
struct NameId {
  uint32_t index = ~0u;
  uint32_t number = 0;
};

// What a name has beside its rows.
struct Item {
  uint32_t row;                  // the newest
  uint32_t number;               // of the name: they are saved in this order
  uint32_t index;                // of the name in Objects::by_index_
  std::unique_ptr<Track> track;  // null: not moved since it was set
  bool start_is_given = false;
  bool is_removed = false;       // it fades out
  bool is_listed = false;        // in Objects::fading_
};
using Named = NameMap<Item>::value_type;
using NewName = NameMap<Item>::node_type;

// An object with all that its scene knows of it, or what a group wants to make of it.
struct ObjectState : Entry {
  Track track;                  // for the next worked-out twist
  bool start_is_given = false;  // by the caller; else it is when the name was first set

  // Of a group only:
  bool is_removed = false;
  bool is_more_than_moved = false;
  bool is_change = false;  // of an object that was there; else it is set, whatever was there
  uint32_t parts = 0;   // fs_part bits that are changed
  Ref<const Object> base;  // the object that they were changed of; null: the name was new
  uint32_t number = 0;  // of a new name, where it is not the next
  NameId id;            // of the name, where it was found
};

[[noreturn]] void fail_unknown(std::string_view name);  // NOT_FOUND

// s: when the lifetime of an object that is set, changed or moved now is over.
inline double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

fs_object to_c(const ObjectState& known);  // its handles live as long as known.object

class Objects {
 public:
  Objects(const ServoOutput& output, const Clock& clock) : rows(output, clock) {}

  ObjectRows rows;

  bool find(std::string_view name, ObjectState& out);  // false: there is none of this name
  ObjectState require(std::string_view name);           // NOT_FOUND
  bool has(std::string_view name) const noexcept { return find_item(name) != nullptr; }
  bool has_name(std::string_view name) const noexcept { return names_.contains(name); }  // also one that fades out
  bool has_room(size_t more) const noexcept { return names_.size() + more <= capacity_; }
  // The newest row of a name; no_row: it is not there. known: what was found of it before, if anything was.
  uint32_t row_of(std::string_view name, const ObjectState& known = {}) noexcept;

  // Makes an object what is wanted: set, moved or removed. Its revisions grow, also where it has been changed since wanted
  // was made, and its motion_revision is a new number: whoever has looked before finds it among those that came since. Throws before anything is changed: no memory.
  // new_name: what make_name has made of the name, or empty. Names that are made in a row lie together in memory, so that
  // they are found fast in that order.
  void take(std::string_view name, ObjectState& wanted, NewName new_name = {});
  static NewName make_name(std::string_view name);
  // For less: an object that is there is only moved. False: there is none.
  bool move(std::string_view name, const Pose& pose, const Twist* twist, double time, double now);
  // The same where its twist has been worked out. id: of the name, as far as it is known; it is known then.
  bool move_to(std::string_view name, NameId& id, const Motion& motion, double now);

  // Enters bounds that were worked out for `object` when it stood in `row`. The name may have another object or row by now: then
  // they are entered for that one.
  struct Bound {
    bool has_changed = false;
    const Object* object = nullptr;  // as it is now; null: there is none
    double slope = 0;                // N/m, the steepest, as it is felt
    double texture_part = 1;         // of the heights of its texture, as it is felt
    bool is_rising = false;          // more is due to it
  };
  Bound bound(uint32_t row, const Object& object, const Bounds& bounds, const Pace& pace);

  void set_capacity(uint32_t capacity) noexcept { capacity_ = capacity; }
  void require_room(size_t more, const char* verb) const;  // FULL
  size_t count() const noexcept { return names_.size() - removed_; }
  bool is_empty() const noexcept { return names_.empty(); }  // nothing fades out either

  uint32_t last_number() const noexcept { return last_number_; }
  // Names in the order in which they first came.
  std::vector<std::string_view> in_order() const;
  // Calls f(name, ObjectState) for each, in the order of their rows.
  template <class F>
  void for_each(F&& f) {
    rows.chunks().for_each([&](uint32_t, const Chunk& chunk) {
      for_each_bit(chunk.used, [&](uint32_t i) {
        if (!chunk.row(i).is_named) return;
        ObjectState known;
        const std::string& name = chunk.row(i).object->name;
        find(name, known);
        f(name, known);
      });
    });
  }

  // Lets go of what has faded out, some at a time. True when it changed something.
  bool tidy();
  static constexpr size_t tidied_at_once = 256;
  size_t fading_count() const noexcept { return fading_.size(); }
  // The next name whose lifetime has ended by `time`, once; null: none.
  const std::string* next_expired(double time, double& expiry);

  // Every stored time shifted, s, and nothing fading; to be made in two steps, of which the second cannot throw.
  struct TimeShift {
    ObjectRows::TimeShift rows;
    std::set<std::pair<double, std::string>> expiries;
  };
  TimeShift shifted(double shift) const;
  void take(TimeShift& shifted, double shift) noexcept;

 private:
  const Item* find_item(std::string_view name) const noexcept;  // null also for one that fades out
  Named* find_named(std::string_view name, NameId id) noexcept;
  static NameId id_of(const Item& item) noexcept { return {item.index, item.number}; }
  void erase(const Named& named) noexcept;
  void free_index(const Item& item) noexcept;
  bool list(Named& named);
  void unlist(Item& item, bool is_newly_listed) noexcept;
  void add(NewName name, const ObjectState& wanted);
  void move(Named& named, const Track& track, const Motion& motion, double expiry, uint64_t motion_revision);
  template <class F>
  bool move(Named* named, double now, F&& take);
  void note_expiry(const std::string& name, double before, double after);
  void drop_expiry(const std::string& name, double old, double kept);

  NameMap<Item> names_;
  std::vector<Named*> by_index_;      // null: that index is free
  std::vector<uint32_t> free_indices_;  // with room for all of them
  uint32_t last_number_ = 0;
  size_t removed_ = 0;
  uint32_t capacity_ = 1u << 20;
  std::deque<std::string> fading_;  // names behind which something fades out, or that do so themselves
  std::set<std::pair<double, std::string>> expiries_;  // to be announced
};

}  // namespace fs
