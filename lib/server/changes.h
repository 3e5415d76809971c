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

  // Whether the batch has to be applied step by step: a group, or one change that takes long.
  static bool is_long(const Batch& changes) noexcept {
    return changes.size() > 1 || changes[0].is_foreign() || changes[0].type == wire::type_clear;
  }
  void apply(const ReceivedBatch& received);              // one that is not long
  Task apply_step_by_step(const ReceivedBatch& received);  // needs a claim on all scenes that it is about

 private:
  using ForeignGroups = std::map<const LocalScene*, ForeignGroup>;
  using Records = std::map<std::string, NameRecord>;

  // scene: the client's, or a group of it.
  template <class Scene>
  void apply(Scene& scene, const Change& change, uint64_t serial);
  template <class Scene>
  void apply_set(Scene& scene, const wire::Set& set, uint64_t serial, bool is_change);
  Task clear();
  void apply_foreign(const Change& change, ForeignGroups& groups);
  Task take_records(const Subjects& about, Records& out);
  Task put_back(const Records& records);
  Task refuse(const ReceivedBatch& received, const Change& failed, const Error& error);
  void tell_refused(const Change& change, uint64_t serial, const Error& error, bool is_cause);
  void refuse(const Change& change, uint64_t serial);

  Client& client_;
  Syncs& syncs_;
};

}  // namespace fs
