// What the numbers of shapes, curves and surfaces mean between the server and one client. The client's numbers mean uploads, which the
// client has sent; the server's numbers mean offers, assets of others that the client was told of and may fetch or use. The
// bytes of uploads are counted, and the client is told which uploads were refused.
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
  // An asset that the client has sent.
  struct Upload {
    bool is_ready = false;  // else it is being built
    Asset asset;
    fs_status status = FS_OK;  // why there is none
    std::string text;
  };

  // ---- Uploads.
  size_t count() const noexcept { return uploads_.size(); }
  uint64_t bytes() const noexcept { return bytes_->load(); }
  bool is_building(uint64_t id) const;
  bool is_refused(uint64_t id) const;
  bool begin(uint64_t id);  // false: the number is no good, or in use
  // Counts the bytes of an upload, for as long as what is returned lives. limit: bytes. FULL, INVALID.
  std::shared_ptr<const void> charge(const PackedAsset& packed, uint64_t limit);
  // False: the client has forgotten it meanwhile.
  bool finish(uint64_t id, Upload&& upload);
  void forget(uint64_t id);
  // The number of a refused upload that the client has not been told of; 0: none. From now on it has been told.
  uint64_t take_refused();
  bool has_refused() const noexcept { return !refused_.empty(); }

  // ---- Uploads and offers.
  // The object of a record, as far as `parts`, with the assets that its numbers mean: uploads, offers, or what the target
  // has. INVALID; STATE: it is offered no longer; or why the upload was refused.
  LinkedObject resolve(const wire::Object& record, uint64_t parts, const fs_object* target) const;
  // The record of an object. Assets that the client has not sent are offered to it; the oldest offers end.
  wire::Object offer(const fs_object& object);
  const Asset* find_offer(uint64_t number) const noexcept;  // null: it is offered no longer

 private:
  Asset find(uint64_t id, const fs_object* target) const;
  uint64_t id_of(const Asset& asset);

  std::map<uint64_t, Upload> uploads_;  // by the client's number
  std::map<uint64_t, uint64_t> upload_of_;  // by the serial of the asset
  std::set<uint64_t> refused_;  // that the client has not been told of
  std::deque<Asset> offered_;  // the oldest first
  const std::shared_ptr<std::atomic<uint64_t>> bytes_ = std::make_shared<std::atomic<uint64_t>>(0);
};

}  // namespace fs
