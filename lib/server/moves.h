// Takes the moves of a client: knows its objects, and through which slot of the inbox each is moved. The client writes the
// inbox at any time, so a move is copied, checked, and then given to the scene. A move names the change after which it was
// written, and counts only if that change is the last one that set the object's pose.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/name_map.h"
#include "scene/local_scene.h"
#include "server/allowance.h"
#include "transfer/shared_memory.h"

namespace fs {

class Moves {
 public:
  void open(const Inbox& inbox, uint32_t slots);

  // ---- The objects that are in the scene, each with its slot or wire::no_slot.
  const NameMap<uint32_t>& objects() const noexcept { return objects_; }
  bool has(std::string_view name) const { return objects_.contains(name); }
  uint32_t slot_of(std::string_view name) const;  // no_slot: none, or no such object
  bool is_slot(uint32_t slot) const noexcept { return slot < slots_.size() || slot == wire::no_slot; }
  void add(const std::string& name) { objects_.try_emplace(name, wire::no_slot); }
  // From now on the object, which may be new, is moved through the slot. after: serial of the change that set its pose.
  void bind(const std::string& name, uint32_t slot, uint64_t after);
  void forget(const std::string& name);

  // The entry of a name, to restore it when a group is refused.
  struct Place {
    uint32_t slot;
    uint64_t after;
  };
  std::optional<Place> place_of(const std::string& name) const;
  void put_back(const std::string& name, const Place& place);

  // ---- The inbox.
  bool has_left() const noexcept { return inbox_.has_left(); }  // the client has said so
  bool has_new() const noexcept { return !slots_.empty() && inbox_.has_dirty(); }
  // Called once a turn. False: the client's moves have to wait for a later turn.
  bool begin_turn() noexcept { return allowance_.begin_turn(); }
  struct Taken {
    bool is_whole = false;  // else a group of moves is being written, and all of them come later
    size_t seen = 0, applied = 0, refused = 0;
  };
  Taken take(LocalScene& scene);

 private:
  struct Slot {
    std::string name;    // of the object that is moved through it; empty: none is
    uint64_t after = 0;  // serial of the change that last set the pose
  };
  void mark(uint32_t slot) noexcept { dirty_[slot / 64] |= uint64_t{1} << (slot % 64); }

  Inbox inbox_;
  NameMap<uint32_t> objects_;
  std::vector<Slot> slots_;
  std::vector<uint64_t> dirty_;  // a bit for each slot: there is a move to look at
  std::vector<std::pair<uint32_t, wire::Move>> taken_;  // these two are kept for their memory
  std::vector<LocalScene::Move> moves_;
  Allowance allowance_{256};                            // moves each turn, about 40 us
};

}  // namespace fs
