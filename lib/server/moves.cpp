#include "server/moves.h"

#include "transfer/records.h"

namespace fs {

void Moves::open(const Inbox& inbox, uint32_t slots) {
  inbox_ = inbox;
  dirty_.resize((slots + 63) / 64);
  newest_.resize(slots);
}

Moves::Taken Moves::take(Names& names, LocalScene& scene) {
  const uint64_t batch = inbox_.batch();
  if (batch & 1) return {};
  inbox_.take_dirty([this](uint32_t slot) { mark(slot); });
  taken_.clear();
  for (size_t word = 0; word < dirty_.size(); ++word) {
    for (uint64_t bits = std::exchange(dirty_[word], 0); bits != 0; bits &= bits - 1) {
      const auto slot = static_cast<uint32_t>(64 * word) + static_cast<uint32_t>(__builtin_ctzll(bits));
      const Names::Named* const named = names.moved_by(slot);
      Written written{slot, 0, {}};
      // A move that is not whole is being written, and will be marked again. One after a change that has not come yet is
      // marked by that change.
      if (!named) continue;
      written.number = inbox_.read(slot, written.move);
      if (written.number == 0 || written.number == newest_[slot] || written.move.after != named->second.after) continue;
      taken_.push_back(written);
    }
  }
  if (inbox_.batch() != batch) {  // a group came meanwhile: it belongs together, so all is read once more
    for (const Written& written : taken_) mark(written.slot);
    return {};
  }
  Taken out{true, taken_.size(), 0, 0};
  moves_.clear();
  for (const auto& [slot, number, move] : taken_) {
    newest_[slot] = number;
    Motion motion;
    if (!from_record(move.motion, motion)) {
      ++out.refused;
      continue;
    }
    auto& [name, record] = *names.moved_by(slot);
    moves_.push_back({&name, &record.id, motion});
  }
  if (!moves_.empty()) out.applied = scene.set_motions(moves_);
  allowance_.spend(taken_.size());
  return out;
}

}  // namespace fs
