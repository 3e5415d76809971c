// The shapes and curves between the server and one client, by their numbers on the wire: those that the client has sent
// (its own numbers), and those of others that it was told of (the server's numbers), which it may fetch or give to an
// object. It counts the bytes of what the client has sent, and remembers what was refused until the client knows.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "transfer/asset.h"

namespace fs {

class ClientAssets {
 public:
  // What became of one that the client has sent.
  struct Upload {
    bool is_ready = false;  // else it is being built
    Asset asset;
    fs_status status = FS_OK;  // why there is none
    std::string text;
  };

  // ---- Those that the client has sent.
  size_t count() const noexcept { return uploads_.size(); }
  uint64_t bytes() const noexcept { return bytes_->load(); }
  bool is_building(uint64_t id) const;
  bool is_refused(uint64_t id) const;
  bool begin(uint64_t id);  // false: it is no good number, or is there already
  // Counts the bytes of one that begins, for as long as what is returned lives. limit: bytes. FULL, INVALID.
  std::shared_ptr<const void> charge(const PackedAsset& packed, uint64_t limit);
  // False: the client has forgotten it meanwhile.
  bool finish(uint64_t id, Upload&& upload);
  void forget(uint64_t id);
  // Of one that was refused and the client has not been told of; 0: none.
  uint64_t take_refused();
  bool has_refused() const noexcept { return !refused_.empty(); }

  // ---- Both.
  // The object of a record, as far as `parts`, with the handles that its numbers mean: the client's, or those that the
  // target has, or that were offered. INVALID; STATE (no such number of the server's); or why the asset was refused.
  LinkedObject resolve(const wire::Object& record, uint64_t parts, const fs_object* target) const;
  // The record of an object. What is not the client's own is offered to it: it can be fetched until some more were.
  wire::Object offer(const fs_object& object);
  const Asset* find_offer(uint64_t number) const noexcept;  // the server's number; null: it is not offered any more

 private:
  Asset find(uint64_t id, const fs_object* target) const;
  uint64_t id_of(const Asset& asset);

  std::map<uint64_t, Upload> uploads_;      // by the client's number
  std::map<uint64_t, uint64_t> upload_of_;  // by the serial of what was made of one
  std::set<uint64_t> refused_;              // that the client has not been told of
  std::deque<Asset> offered_;               // the oldest first
  const std::shared_ptr<std::atomic<uint64_t>> bytes_ = std::make_shared<std::atomic<uint64_t>>(0);
};

}  // namespace fs
