// The shapes, curves and surfaces that the server has from this client, and how many of its objects use each. An asset is sent before
// an object uses it. When no object uses it any more, the server is told to forget it; but only after the server has applied
// the change that ended the use, because if that is refused, the asset is used again.
#pragma once

#include <map>
#include <unordered_map>
#include <vector>

#include "client/line.h"
#include "transfer/asset.h"

namespace fs {

class SentAssets {
 public:
  explicit SentAssets(Connection& connection) : connection_(connection) {}

  Asset find(uint64_t id) const;  // nothing: it was not sent, or was forgotten
  bool has(uint64_t id) const { return sent_.contains(id); }

  // Sends the asset if the server lacks it, or refused it and a retry may succeed. False: it could not be sent now; a
  // refused one may have been withdrawn already. It counts as unused until an object uses it.
  bool send(const Asset& asset);
  bool send(const Assets& assets) { return send(assets[0]) && send(assets[1]) && send(assets[2]) && send(assets[3]); }
  bool send(const Asset& asset, const PackedAsset& packed);
  bool is_there(const Asset& asset) const;  // nothing has to be sent
  void note_refused(uint64_t id);  // the server has refused it, and does not have it

  bool use(uint64_t id);  // one more object uses it. False: it is not from this client
  void stop_using(uint64_t id);  // one object less uses it
  void note_maybe_unused(uint64_t id, uint64_t after);  // after: serial of a message that may end its use
  // Tells the server to forget what is not used. is_current: the replica has what the server has; else it only forgets where
  // there are many.
  void forget_unused(bool is_current);

 private:
  enum class State { missing, there, refused };  // at the server
  struct Entry {
    Asset asset;
    uint32_t uses = 0;
    State state = State::missing;
  };
  size_t most() const { return wire::most_assets(connection_.welcome().max_objects); }

  Connection& connection_;
  std::unordered_map<uint64_t, Entry> sent_;  // by the asset's serial
  std::map<uint64_t, uint64_t> maybe_unused_;  // with the serial of the message after which they may be unused
};

// Sends assets for a call that may wait, ahead of what refers to them. A large one is packed without the lock, so that moves do
// not wait for it. All of them are in use as long as this lives, for which it needs the call's lock.
class SendingAhead {
 public:
  SendingAhead(Line& line, SentAssets& sent) : line_(line), sent_(sent) {}
  ~SendingAhead();
  SendingAhead(const SendingAhead&) = delete;
  SendingAhead& operator=(const SendingAhead&) = delete;

  void send(Call& call, const Asset& asset);  // IO, FULL, TIMEOUT
  // Notes the large ones of those that the server lacks. True: there are some.
  bool note(const Assets& assets);
  // Sends those that were noted. Where there are none, the call waits for room.
  void send_noted_or_wait(Call& call);

 private:
  Line& line_;
  SentAssets& sent_;
  std::vector<Asset> noted_;
  std::vector<uint64_t> in_use_;
};

}  // namespace fs
