#include "server/moves.h"

#include <utility>

#include "transfer/records.h"

namespace fs {

void Moves::open(const Inbox& inbox, uint32_t slots) {
  inbox_ = inbox;
  slots_.resize(slots);
  dirty_.resize((slots + 63) / 64);
}

uint32_t Moves::slot_of(std::string_view name) const {
  const auto found = objects_.find(name);
  return found == objects_.end() ? wire::no_slot : found->second;
}

void Moves::bind(const std::string& name, uint32_t slot, uint64_t after) {
  uint32_t& present = objects_[name];
  if (present != wire::no_slot && present != slot && slots_[present].name == name) slots_[present] = {};
  present = wire::no_slot;
  if (slot == wire::no_slot) return;
  // Another object may have got this slot since; the later change wins.
  if (Slot& other = slots_[slot]; !other.name.empty() && other.name != name) {
    if (other.after > after) return;
    objects_[other.name] = wire::no_slot;
  }
  present = slot;
  slots_[slot] = {name, after};
  mark(slot);  // a move after this change may have come already
}

void Moves::forget(const std::string& name) {
  const auto found = objects_.find(name);
  if (found == objects_.end()) return;
  if (found->second != wire::no_slot) slots_[found->second] = {};
  objects_.erase(found);
}

std::optional<Moves::Place> Moves::place_of(const std::string& name) const {
  const auto found = objects_.find(name);
  if (found == objects_.end()) return {};
  return Place{found->second, found->second == wire::no_slot ? 0 : slots_[found->second].after};
}

void Moves::put_back(const std::string& name, const Place& place) {
  add(name);
  bind(name, place.slot, place.after);
}

Moves::Taken Moves::take(LocalScene& scene) {
  const uint64_t batch = inbox_.batch();
  if (batch & 1) return {};
  inbox_.take_dirty([this](uint32_t slot) { mark(slot); });
  taken_.clear();
  for (size_t word = 0; word < dirty_.size(); ++word) {
    for (uint64_t bits = std::exchange(dirty_[word], 0); bits != 0; bits &= bits - 1) {
      const auto slot = static_cast<uint32_t>(64 * word) + static_cast<uint32_t>(__builtin_ctzll(bits));
      wire::Move move;
      // A move that is not whole is being written, and will be marked again. One after a change that has not come yet is
      // marked by that change.
      if (!slots_[slot].name.empty() && inbox_.read(slot, move) && move.after == slots_[slot].after) {
        taken_.emplace_back(slot, move);
      }
    }
  }
  if (inbox_.batch() != batch) {  // a group came meanwhile: it belongs together, so all is read once more
    for (const auto& [slot, move] : taken_) mark(slot);
    return {};
  }
  Taken out{true, taken_.size(), 0, 0};
  moves_.clear();
  for (const auto& [slot, move] : taken_) {
    Motion motion;
    if (!from_record(move.motion, motion)) {
      ++out.refused;
      continue;
    }
    moves_.push_back({&slots_[slot].name, motion});
  }
  if (!moves_.empty()) out.applied = scene.set_motions(moves_);
  allowance_.spend(taken_.size());
  return out;
}

}  // namespace fs
