// What the numbers of shapes and curves mean that come from the server: what this client has sent, or what the server offers
// of others. The latter are fetched once, and the newest are kept for the next who asks.
#pragma once

#include <deque>
#include <utility>

#include "client/line.h"
#include "client/sent_assets.h"

namespace fs {

class FetchedAssets {
 public:
  FetchedAssets(Line& line, const SentAssets& sent) : line_(line), sent_(sent) {}

  bool is_here(const wire::Object& record) const;         // nothing has to be fetched for it
  LinkedObject link(const wire::Object& record) const;    // one that is here
  // Fetches what is not here. May wait. NOT_FOUND: the server does not offer it any more.
  LinkedObject receive(Call& call, const wire::Object& record);
  // The server's number of one that came from it; 0: it did not, or is not kept any more.
  uint64_t number_of(const Asset& asset) const;

 private:
  Asset find(uint64_t id) const;
  Asset fetch(Call& call, uint64_t id, wire::Type type);

  Line& line_;
  const SentAssets& sent_;
  std::deque<std::pair<uint64_t, Asset>> fetched_;  // by the server's number, the oldest first
};

}  // namespace fs
