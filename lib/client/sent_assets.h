// The shapes and curves that the server has from this client, and how many of its objects use each. An asset is sent before
// an object uses it. When no object uses it any more, the server is told to forget it; but only after the server has applied
// the change that ended the use, because if that is refused, the asset is used again.
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

  // Sends the asset if the server lacks it, or refused it and a retry may succeed. False: there is no room for it now, but the
  // server may have forgotten the refused one. It counts as unused until an object uses it.
  bool send(const Asset& asset);
  bool send(const Assets& assets) { return send(assets[0]) && send(assets[1]) && send(assets[2]); }
  void note_refused(uint64_t id);  // the server has refused it, and does not have it

  bool use(uint64_t id);                        // one more object uses it. False: it is not from this client
  void stop_using(uint64_t id);                 // one object less uses it
  void note_maybe_unused(uint64_t id, uint64_t after);  // after: serial of a message that may end its use
  // Tells the server to forget what is not used. is_current: the replica has what the server has; else it only forgets where
  // there are many.
  void forget_unused(bool is_current);

 private:
  enum class State { missing, there, refused };  // at the server
  struct Sent {
    Asset asset;
    uint32_t uses = 0;
    State state = State::missing;
  };
  size_t most() const { return wire::most_assets(connection_.welcome().max_objects); }

  Connection& connection_;
  std::unordered_map<uint64_t, Sent> sent_;    // by the asset's serial
  std::map<uint64_t, uint64_t> maybe_unused_;  // with the serial of the message after which they may be unused
};

}  // namespace fs
