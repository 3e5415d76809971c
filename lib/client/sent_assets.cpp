#include "client/sent_assets.h"

namespace fs {

Asset SentAssets::find(uint64_t id) const {
  const auto found = sent_.find(id);
  return found == sent_.end() ? Asset{} : found->second.asset;
}

bool SentAssets::send(const Asset& asset) {
  const uint64_t id = asset.serial();
  const auto found = sent_.find(id);
  if (!asset || (found != sent_.end() && found->second.state == State::there)) return true;
  const bool is_full = found == sent_.end() && sent_.size() >= most();
  if (is_full || !connection_.has_room()) return false;  // else it is packed in vain
  const PackedAsset packed = pack(asset);
  maybe_unused_[id] = connection_.last_serial();
  Sent& sent = sent_.try_emplace(id, Sent{asset}).first->second;
  if (sent.state == State::refused) {
    const wire::Forget forget{id};
    if (!connection_.send(wire::type_forget, bytes_of(&forget, 1))) return false;
    sent.state = State::missing;
  }
  if (!connection_.send(packed.type, packed.record(), packed.content.get())) return false;
  sent.state = State::there;
  return true;
}

void SentAssets::note_refused(uint64_t id) {
  if (const auto found = sent_.find(id); found != sent_.end()) found->second.state = State::refused;
}

bool SentAssets::use(uint64_t id) {
  const auto found = sent_.find(id);
  if (found == sent_.end()) return false;
  ++found->second.uses;
  return true;
}

void SentAssets::stop_using(uint64_t id) {
  const auto found = sent_.find(id);
  if (found != sent_.end() && --found->second.uses == 0) maybe_unused_[id] = connection_.last_serial();
}

void SentAssets::note_maybe_unused(uint64_t id, uint64_t after) {
  if (has(id)) maybe_unused_[id] = after;
}

void SentAssets::forget_unused(bool is_current) {
  const bool are_many = sent_.size() > most() / 2;
  if (maybe_unused_.empty() || !(is_current || are_many)) return;
  const uint64_t applied = connection_.outbox()->applied.load(std::memory_order_acquire);
  for (auto next = maybe_unused_.begin(); next != maybe_unused_.end();) {
    const auto [id, after] = *next;
    const auto found = sent_.find(id);
    if (found != sent_.end() && found->second.uses == 0) {
      const wire::Forget record{id};
      const bool is_missing = found->second.state == State::missing;
      if (!is_missing && (after > applied || !connection_.send(wire::type_forget, bytes_of(&record, 1)))) {
        ++next;
        continue;
      }
      sent_.erase(found);
    }
    next = maybe_unused_.erase(next);
  }
}

}  // namespace fs
