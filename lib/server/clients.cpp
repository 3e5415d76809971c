#include "server/clients.h"

#include <algorithm>
#include <iterator>
#include <new>

#include "base/error.h"
#include "server/session.h"

namespace fs {
namespace {

constexpr ptrdiff_t most_strangers = 64;  // that have not said who they are
constexpr ptrdiff_t most_refused = 16;

bool is_there(const std::shared_ptr<Session>& session) {
  return !session->client().is_gone && !session->client().name.empty();
}

}  // namespace

std::shared_ptr<Session> Clients::find(uint64_t id) const {
  const auto found = std::lower_bound(sessions_.begin(), sessions_.end(), id, [](const auto& session, uint64_t wanted) {
    return session->client().id < wanted;
  });
  const bool is_found = found != sessions_.end() && (*found)->client().id == id && !(*found)->client().is_gone;
  return is_found ? *found : nullptr;
}

Session* Clients::find_session(std::string_view name) const {
  const auto found = std::find_if(sessions_.begin(), sessions_.end(), [name](const auto& session) {
    return is_there(session) && session->client().name == name;
  });
  return found == sessions_.end() ? nullptr : found->get();
}

std::vector<std::shared_ptr<Session>> Clients::take_gone() {
  const auto is_gone = [](const auto& session) { return session->client().is_gone; };
  const auto count = static_cast<size_t>(std::count_if(sessions_.begin(), sessions_.end(), is_gone));
  std::vector<std::shared_ptr<Session>> out;
  if (count == 0) return out;
  out.reserve(count);  // before anything is changed
  const auto gone = std::stable_partition(sessions_.begin(), sessions_.end(), std::not_fn(is_gone));
  std::move(gone, sessions_.end(), std::back_inserter(out));
  sessions_.erase(gone, sessions_.end());
  return out;
}

Client* Clients::find(std::string_view name) const {
  Session* const session = find_session(name);
  return session ? &session->client() : nullptr;
}

std::shared_ptr<Client> Clients::share(std::string_view name) const {
  Session* const session = find_session(name);
  return session ? session->shared_client() : nullptr;
}

size_t Clients::count() const {
  return static_cast<size_t>(std::count_if(sessions_.begin(), sessions_.end(), is_there));
}

void Clients::for_each(const std::function<void(const std::shared_ptr<Client>&)>& f) const {
  for (const std::shared_ptr<Session>& session : sessions_) {
    if (is_there(session)) f(session->shared_client());
  }
}

std::vector<fs_client> Clients::describe() const {
  std::vector<fs_client> out;
  for_each([&](const std::shared_ptr<Client>& client) { out.push_back(client->describe()); });
  return out;
}

bool Clients::is_anybody_applying() const {
  return std::any_of(sessions_.begin(), sessions_.end(), [](const auto& session) { return session->client().is_applying; });
}

void Clients::drop_dead(uid_t user) const noexcept {
  for (const std::shared_ptr<Session>& session : sessions_) {
    if (is_there(session) && session->client().peer.user == user && !session->is_alive()) session->drop();
  }
}

void Clients::make_room(bool is_refused) {
  // Clients that will be refused have a few places of their own, so that they cannot take the places of others.
  const auto is_rival = [&](const std::shared_ptr<Session>& session) {
    return !session->client().is_gone && session->client().name.empty() && session->is_refused() == is_refused;
  };
  const ptrdiff_t most = is_refused ? most_refused : most_strangers;
  if (std::count_if(sessions_.begin(), sessions_.end(), is_rival) < most) return;
  const std::shared_ptr<Session> longest = *std::find_if(sessions_.begin(), sessions_.end(), is_rival);
  longest->receive(1);  // it may have said something by now
  if (longest->client().name.empty()) longest->drop(0);
}

void Clients::require_room() {
  const size_t present = count();
  if (present >= most_) fail(FS_ERROR_FULL, "the server has %u clients, its maximum", most_);
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
