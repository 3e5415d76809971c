#include "server/sessions.h"

#include <algorithm>
#include <functional>
#include <iterator>

namespace fs {

std::shared_ptr<Session> Sessions::find(uint64_t id) const {
  const auto found = std::lower_bound(all_.begin(), all_.end(), id,
                                      [](const auto& session, uint64_t wanted) { return session->client().id < wanted; });
  const bool is_found = found != all_.end() && (*found)->client().id == id && !(*found)->client().is_gone;
  return is_found ? *found : nullptr;
}

Sessions::List Sessions::take_gone() {
  const auto is_gone = [](const auto& session) { return session->client().is_gone; };
  const auto count = static_cast<size_t>(std::count_if(all_.begin(), all_.end(), is_gone));
  List out;
  if (count == 0) return out;
  out.reserve(count);  // before anything is changed
  const auto gone = std::stable_partition(all_.begin(), all_.end(), std::not_fn(is_gone));
  std::move(gone, all_.end(), std::back_inserter(out));
  all_.erase(gone, all_.end());
  return out;
}

void Sessions::make_room(bool is_refused) {
  constexpr ptrdiff_t most_strangers = 64, most_refused = 16;
  // Clients that will be refused have a few places of their own, so that they cannot take the places of others.
  const auto is_rival = [&](const std::shared_ptr<Session>& session) {
    return !session->client().is_gone && session->client().name.empty() && session->is_refused() == is_refused;
  };
  if (std::count_if(all_.begin(), all_.end(), is_rival) < (is_refused ? most_refused : most_strangers)) return;
  const std::shared_ptr<Session> longest = *std::find_if(all_.begin(), all_.end(), is_rival);
  longest->look_for_greeting();  // it may have said something by now
  if (longest->client().name.empty()) longest->client().drop(0);
}

}  // namespace fs
