// Applies the changes of a client: to its scene, to what is known of the names of its objects, and to objects of others.
// All changes of a group are applied, for the same tick, or none of them. When a batch is refused, the client is told so and
// asked to look at every name in it, because it believes that the changes were done.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "server/client.h"
#include "server/foreign.h"

namespace fs {

class Changes {
 public:
  explicit Changes(Client& client) : client_(client) {}

  void apply(const ReceivedBatch& received);

 private:
  // All that is known of a name, to restore it when a group is refused.
  struct Known {
    std::optional<Moves::Place> place;  // none: there was no such object
    std::optional<Client::Absent> absent;
    std::optional<std::string> editor;
    std::optional<uint64_t> awaited;
  };
  using ForeignEdits = std::map<const LocalScene*, ForeignEdit>;

  void apply_group(const ReceivedBatch& received);
  void apply(const Change& change, uint64_t serial);
  void apply_set(const wire::Set& set, uint64_t serial, bool is_change);
  void apply_clear();
  void apply_foreign(const Change& change, ForeignEdits& edits);
  std::map<std::string, Known> known_of(const Subjects& about);
  Known known_of(const std::string& name) const;
  void put_back(const std::map<std::string, Known>& known);
  void refuse(const ReceivedBatch& received, const Change& failed, const Error& error);
  void refuse(const Change& change, uint64_t serial);

  Client& client_;
};

}  // namespace fs
