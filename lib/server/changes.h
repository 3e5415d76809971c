// Applies the changes of a client: to its scene, to what is known of the names of its objects, and to objects of others.
// All changes of a group are applied, for the same tick, or none of them. When a batch is refused, the client is told so and
// asked to look at every name in it, because it believes that the changes were done.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "base/error.h"
#include "server/client.h"
#include "server/foreign.h"
#include "server/syncs.h"

namespace fs {

class Changes {
 public:
  Changes(Client& client, Syncs& syncs) : client_(client), syncs_(syncs) {}

  void apply(const ReceivedBatch& received);

 private:
  using ForeignEdits = std::map<const LocalScene*, ForeignEdit>;

  void apply_group(const ReceivedBatch& received);
  void apply(const Change& change, uint64_t serial);
  void apply_set(const wire::Set& set, uint64_t serial, bool is_change);
  void apply_clear();
  void apply_foreign(const Change& change, ForeignEdits& edits);
  using Records = std::map<std::string, NameRecord>;
  Records records_of(const Subjects& about);
  void put_back(const Records& records);
  void refuse(const ReceivedBatch& received, const Change& failed, const Error& error);
  void refuse(const Change& change, uint64_t serial);

  Client& client_;
  Syncs& syncs_;
};

}  // namespace fs
