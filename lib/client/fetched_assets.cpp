#include "client/fetched_assets.h"

#include <algorithm>

namespace fs {

constexpr size_t most_fetched = 16;

Asset FetchedAssets::find(uint64_t id) const {
  if (!(id & wire::of_server)) return sent_.find(id);
  const auto found = std::find_if(fetched_.begin(), fetched_.end(), [id](const auto& entry) { return entry.first == id; });
  return found == fetched_.end() ? Asset{} : found->second;
}

uint64_t FetchedAssets::number_of(const Asset& asset) const {
  const auto found = std::find_if(fetched_.begin(), fetched_.end(),
                                  [serial = asset.serial()](const auto& entry) { return entry.second.serial() == serial; });
  return found == fetched_.end() ? 0 : found->first;
}

bool FetchedAssets::is_here(const wire::Object& record) const {
  const AssetIds ids = ids_of(record);
  return std::all_of(ids.begin(), ids.end(), [this](uint64_t id) { return id == 0 || find(id); });
}

LinkedObject FetchedAssets::link(const wire::Object& record) const {
  const AssetIds ids = ids_of(record);
  Assets assets;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (ids[i]) assets[i] = find(ids[i]);
  }
  return {record, std::move(assets)};
}

LinkedObject FetchedAssets::receive(Call& call, const wire::Object& record) {
  const AssetIds ids = ids_of(record);
  Assets assets;
  for (size_t i = 0; i < ids.size(); ++i) {
    assets[i] = find(ids[i]);
    if (ids[i] && !assets[i]) assets[i] = fetch(call, ids[i], asset_types[i]);
  }
  return {record, std::move(assets)};
}

Asset FetchedAssets::fetch(Call& call, uint64_t id, wire::Type type) {
  if (!(id & wire::of_server)) fail(FS_ERROR_NOT_FOUND, "the shape, curve or surface no longer exists");
  Line::extend(call);  // each may be large
  Answer answer = line_.request(call, wire::type_fetch, wire::Fetch{id});
  PackedAsset packed{type, {}, {}, {}, std::move(answer.data)};
  if (type == wire::type_shape) {
    packed.shape = answer.as<wire::Shape>();
  } else if (type == wire::type_curve) {
    packed.curve = answer.as<wire::Curve>();
  } else {
    packed.surface = answer.as<wire::Surface>();
  }
  if (packed.has_content()) require_data(packed.content);
  const Asset asset = line_.work(call, [&] {
    StopToken stop;
    return unpack(std::move(packed), stop);
  });
  fetched_.emplace_back(id, asset);
  if (fetched_.size() > most_fetched) fetched_.pop_front();
  return asset;
}

}  // namespace fs
