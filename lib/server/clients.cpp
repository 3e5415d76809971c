#include "server/clients.h"

#include <algorithm>
#include <iterator>

#include "server/session.h"

namespace fs {
namespace {

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

}  // namespace fs
