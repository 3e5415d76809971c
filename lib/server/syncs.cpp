#include "server/syncs.h"

#include "base/error.h"
#include "server/clients.h"

namespace fs {

void Syncs::add(uint64_t serial) {
  constexpr size_t most = 64;
  if (waiting_.size() >= most) fail(FS_ERROR_FULL, "%zu syncs of this client wait already", waiting_.size());
  waiting_.push_back({serial, false, 0, {}});
}

void Syncs::begin(Sync& sync, const Client& client) {
  sync.has_begun = true;
  sync.of_server = client.host.servo().scene()->sequence();
  client.host.clients().for_each([&](const std::shared_ptr<Client>& other) { sync.uses.push_back({other, {}}); });
}

bool Syncs::is_used(Sync& sync, const Client& client, uint64_t used) {
  const auto used_of = [](const LocalScene& scene) { return scene.output->used.load(std::memory_order_acquire); };
  std::erase_if(sync.uses, [&](Sync::Use& uses) {
    const std::shared_ptr<const Client> other = uses.client.lock();
    if (!other || other->is_gone) return true;
    if (!uses.sequence && other->is_claimed) return false;
    if (!uses.sequence) uses.sequence = other->scene->sequence();
    return (other.get() == &client ? used : used_of(*other->scene)) >= *uses.sequence;
  });
  return sync.uses.empty() && used_of(*client.host.servo().scene()) >= sync.of_server;
}

void Syncs::answer(const Client& client, bool are_moves_taken, uint64_t used) {
  std::vector<Sync> syncs = std::exchange(waiting_, {});
  for (Sync& sync : syncs) {
    if (first_refusal_) {
      const auto [status, text] = *std::exchange(first_refusal_, std::nullopt);
      client.answers.refuse(sync.serial, status, text);
      continue;
    }
    if (!sync.has_begun && are_moves_taken) begin(sync, client);
    if (sync.has_begun && is_used(sync, client, used)) {
      client.answers.send(sync.serial);
    } else {
      waiting_.push_back(std::move(sync));
    }
  }
}

}  // namespace fs
