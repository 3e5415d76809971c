// The shapes and curves that the server has from this client, and how many of its objects use each. One is sent when an
// object is about to use it. One that is used no more is forgotten, but not before the server has applied the change that
// uses it no more: if that is refused, it is used again.
#pragma once

#include <map>
#include <unordered_map>

#include "client/connection.h"
#include "transfer/asset.h"

namespace fs {

class SentAssets {
 public:
  explicit SentAssets(Connection& connection) : connection_(connection) {}

  Asset find(uint64_t id) const;  // nothing: it was not sent, or was forgotten
  bool has(uint64_t id) const { return sent_.contains(id); }

  // Sends what the server lacks, or refused, as a retry may succeed. False: there is no room for it now. What is sent counts
  // as unused until it is used.
  bool send(const Asset& asset);
  bool send(const Assets& assets) { return send(assets[0]) && send(assets[1]) && send(assets[2]); }
  void note_refused(uint64_t id);  // so the server has it not

  bool use(uint64_t id);                        // false: the server has it not from this client
  void stop_using(uint64_t id);                 // one more that does no more
  void note_maybe_unused(uint64_t id, uint64_t after);  // once the message of this serial is applied
  // Tells the server to forget what is not used. Only where this client knows what the server has, or there are many.
  void forget_unused(bool is_current);

 private:
  struct Sent {
    Asset asset;
    uint32_t uses = 0;
    bool is_refused = false;
  };
  size_t most() const { return wire::most_data(connection_.welcome().max_objects); }

  Connection& connection_;
  std::unordered_map<uint64_t, Sent> sent_;    // by the asset's serial
  std::map<uint64_t, uint64_t> maybe_unused_;  // with the serial of the message after which they may be
};

}  // namespace fs
