// Finds the shapes, curves and surfaces that records of the server refer to: those that this client has sent, and those of others, which
// are fetched from the server. The newest that were fetched are kept for the next record.
#pragma once

#include <deque>
#include <utility>

#include "client/line.h"
#include "client/sent_assets.h"

namespace fs {

class FetchedAssets {
 public:
  FetchedAssets(Line& line, const SentAssets& sent) : line_(line), sent_(sent) {}

  bool is_here(const wire::Object& record) const;  // nothing has to be fetched for the record
  LinkedObject link(const wire::Object& record) const;  // of a record that is_here
  // The same, but fetches what is not here. May wait. NOT_FOUND: the server offers it no longer.
  LinkedObject receive(Call& call, const wire::Object& record);
  // The server's number of an asset that was fetched; 0: it was not, or is not kept any more.
  uint64_t number_of(const Asset& asset) const;

 private:
  Asset find(uint64_t id) const;
  Asset fetch(Call& call, uint64_t id, wire::Type type);

  Line& line_;
  const SentAssets& sent_;
  std::deque<std::pair<uint64_t, Asset>> fetched_;  // by the server's number, the oldest first
};

}  // namespace fs
