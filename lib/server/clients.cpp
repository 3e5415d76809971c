#include "server/clients.h"

#include <algorithm>
#include <new>

#include "base/error.h"

namespace fs {
namespace {

bool is_there(const std::shared_ptr<Client>& client) { return !client->is_gone && !client->name.empty(); }

}  // namespace

void Clients::remove_gone() noexcept {
  std::erase_if(all_, [](const std::shared_ptr<Client>& client) { return client->is_gone; });
}

std::shared_ptr<Client> Clients::find(std::string_view name) const {
  const auto found = std::find_if(all_.begin(), all_.end(), [name](const std::shared_ptr<Client>& client) {
    return is_there(client) && client->name == name;
  });
  return found == all_.end() ? nullptr : *found;
}

size_t Clients::count() const { return static_cast<size_t>(std::count_if(all_.begin(), all_.end(), is_there)); }

void Clients::for_each(const std::function<void(const std::shared_ptr<Client>&)>& f) const {
  for (const std::shared_ptr<Client>& client : all_) {
    if (is_there(client)) f(client);
  }
}

std::vector<fs_client> Clients::describe() const {
  std::vector<fs_client> out;
  for_each([&](const std::shared_ptr<Client>& client) { out.push_back(client->describe()); });
  return out;
}

void Clients::drop_dead(uid_t user) const noexcept {
  for (const std::shared_ptr<Client>& client : all_) {
    if (is_there(client) && client->peer.user == user && !client->is_alive()) client->drop();
  }
}

void Clients::require_room() {
  const size_t present = count();
  if (present >= most_)
    fail(FS_ERROR_FULL, "the server has %u client%s, its maximum (max_clients)", most_, most_ == 1 ? "" : "s");
  // Clients that are gone cost the servo as much as the others while they fade out.
  reap_leaving();
  if (present + leaving_.size() < most_ + std::max<size_t>(most_, 32)) return;
  for (const Ref<Channel>& channel : leaving_) channel->end_lease(servo_.scene()->now());
  fail(FS_ERROR_FULL, "too many clients came and went: there is room again when their objects have faded out");
}

void Clients::note_leaving(const Client& client) noexcept {
  try {
    if (client.channel) leaving_.push_back(client.channel);
  } catch (const std::bad_alloc&) {  // then it is not counted
  }
}

void Clients::reap_leaving() {
  servo_.channels().reap();
  std::erase_if(leaving_, [](const Ref<Channel>& channel) { return channel->is_gone(); });
}

}  // namespace fs
