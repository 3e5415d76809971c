#include "client/sent_assets.h"

#include <new>
#include <utility>

namespace fs {

Asset SentAssets::find(uint64_t id) const {
  const auto found = sent_.find(id);
  return found == sent_.end() ? Asset{} : found->second.asset;
}

bool SentAssets::is_there(const Asset& asset) const {
  const auto found = sent_.find(asset.serial());
  return !asset || (found != sent_.end() && found->second.state == State::there);
}

bool SentAssets::send(const Asset& asset) {
  if (is_there(asset)) return true;
  if (!connection_.has_room()) return false;  // else it is packed in vain
  return send(asset, pack(asset));
}

bool SentAssets::send(const Asset& asset, const PackedAsset& packed) {
  if (is_there(asset)) return true;
  const uint64_t id = asset.serial();
  if (!has(id) && sent_.size() >= most()) return false;
  maybe_unused_[id] = connection_.last_serial();
  Entry& sent = sent_.try_emplace(id, Entry{asset}).first->second;
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

// ------------------------------------------------------------------------------------------------------- sending ahead

SendingAhead::~SendingAhead() {
  for (const uint64_t id : in_use_) {
    try {
      sent_.stop_using(id);
    } catch (const std::bad_alloc&) {  // then the server keeps it longer than it must
    }
  }
}

bool SendingAhead::note(const Assets& assets) {
  constexpr uint64_t large = 65536;  // bytes; to pack as many takes some 20 us
  for (const Asset& asset : assets) {
    if (!sent_.is_there(asset) && asset.bytes() > large) noted_.push_back(asset);
  }
  return !noted_.empty();
}

void SendingAhead::send(Call& call, const Asset& asset) {
  in_use_.reserve(in_use_.size() + 1);
  if (note({asset, {}, {}})) {
    noted_.clear();
    const PackedAsset packed = line_.work(call, [&] { return pack(asset); });
    while (!sent_.send(asset, packed)) line_.pause(call, true);
  } else {
    while (!sent_.send(asset)) line_.pause(call, true);
  }
  if (sent_.use(asset.serial())) in_use_.push_back(asset.serial());
}

void SendingAhead::send_noted_or_wait(Call& call) {
  if (noted_.empty()) {
    sent_.forget_unused(false);  // makes room for more
    return line_.pause(call, true);
  }
  const std::vector<Asset> noted = std::exchange(noted_, {});
  for (const Asset& asset : noted) send(call, asset);
}

}  // namespace fs
