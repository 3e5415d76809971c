#include "server/client_assets.h"

#include <algorithm>

#include "base/error.h"
#include "transfer/records.h"

namespace fs {
namespace {

constexpr uint64_t expression_size = 40'000;  // bytes, about as much as two parsers of a long expression take
constexpr uint64_t surface_size = 512;         // bytes
constexpr size_t most_offered = 8;

// Adds its bytes to a total, and takes them away again when it is destroyed.
struct Charge {
  Charge(std::shared_ptr<std::atomic<uint64_t>> the_total, uint64_t the_bytes) : total(std::move(the_total)), bytes(the_bytes) {
    total->fetch_add(bytes);
  }
  ~Charge() { total->fetch_sub(bytes); }
  const std::shared_ptr<std::atomic<uint64_t>> total;
  const uint64_t bytes;
};

}  // namespace

bool ClientAssets::is_building(uint64_t id) const {
  const auto found = uploads_.find(id);
  return found != uploads_.end() && !found->second.is_ready;
}

bool ClientAssets::is_refused(uint64_t id) const {
  const auto found = uploads_.find(id);
  return found != uploads_.end() && found->second.is_ready && found->second.status != FS_OK;
}

bool ClientAssets::begin(uint64_t id) { return id != 0 && !(id & wire::of_server) && uploads_.emplace(id, Upload{}).second; }

std::shared_ptr<const void> ClientAssets::charge(const PackedAsset& packed, uint64_t limit) {
  const uint64_t bytes = packed.has_content()                ? packed.content_bytes()
                         : packed.type == wire::type_surface ? surface_size
                                                             : expression_size;
  const uint64_t used = bytes_->load();
  if (bytes > limit || used > limit - bytes) {
    const auto megabytes = [](uint64_t size) { return 1e-6 * static_cast<double>(size); };
    fail(FS_ERROR_FULL,
         "this shape, curve or surface of %.1f MB would bring the client to %.1f MB; the server allows %g MB "
         "(max_megabytes)",
         megabytes(bytes), megabytes(used + bytes), megabytes(limit));
  }
  return std::make_shared<Charge>(bytes_, bytes);
}

bool ClientAssets::finish(uint64_t id, Upload&& upload) {
  const auto found = uploads_.find(id);
  if (found == uploads_.end() || found->second.is_ready) return false;
  if (upload.status != FS_OK) refused_.insert(id);
  if (upload.asset) upload_of_[upload.asset.serial()] = id;
  found->second = std::move(upload);
  found->second.is_ready = true;
  return true;
}

void ClientAssets::forget(uint64_t id) {
  if (const auto found = uploads_.find(id); found != uploads_.end()) {
    upload_of_.erase(found->second.asset.serial());
    uploads_.erase(found);
  }
  refused_.erase(id);
}

uint64_t ClientAssets::take_refused() {
  if (refused_.empty()) return 0;
  const uint64_t id = *refused_.begin();
  refused_.erase(refused_.begin());
  return id;
}

// --------------------------------------------------------------------------------------------------------------- both

const Asset* ClientAssets::find_offer(uint64_t number) const noexcept {
  const auto found =
      std::find_if(offered_.begin(), offered_.end(), [number](const Asset& asset) { return asset.serial() == number; });
  return found == offered_.end() ? nullptr : &*found;
}

Asset ClientAssets::find(uint64_t id, const fs_object* target) const {
  if (id & wire::of_server) {
    const uint64_t serial = id & ~wire::of_server;
    if (target) {
      for (const Asset& asset : assets_of(*target)) {
        if (asset && asset.serial() == serial) return asset;
      }
    }
    const Asset* const offer = find_offer(serial);
    if (!offer) throw NotOffered{{FS_ERROR_STATE, "the server no longer offers this shape or curve"}};
    return *offer;
  }
  const auto upload = uploads_.find(id);
  if (upload == uploads_.end()) fail(FS_ERROR_INVALID, "its shape or curve was not sent");
  if (upload->second.status != FS_OK) fail(upload->second.status, "%s", upload->second.text.c_str());
  return upload->second.asset;
}

LinkedObject ClientAssets::resolve(const wire::Object& record, uint64_t parts, const fs_object* target) const {
  const AssetIds ids = ids_of(record, parts);
  Assets assets;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (ids[i]) assets[i] = find(ids[i], target);
  }
  return {record, std::move(assets)};
}

uint64_t ClientAssets::id_of(const Asset& asset) {
  const uint64_t serial = asset.serial();
  if (serial == 0) return 0;
  if (const auto own = upload_of_.find(serial); own != upload_of_.end()) return own->second;
  if (!find_offer(serial)) {
    if (offered_.size() == most_offered) offered_.pop_front();
    offered_.push_back(asset);
  }
  return serial | wire::of_server;
}

wire::Object ClientAssets::offer(const fs_object& object) {
  wire::Object out = to_record(object);
  AssetIds ids{};
  const Assets assets = assets_of(object);
  for (size_t i = 0; i < ids.size(); ++i) ids[i] = id_of(assets[i]);
  put_ids(out, ids);
  return out;
}

}  // namespace fs
