#include "server/parked_batches.h"

#include <algorithm>
#include <utility>

namespace fs {

bool Subjects::add(const Change& change) {
  using namespace wire;
  const auto need = [this](const AssetIds& wanted) {
    for (const uint64_t id : wanted) {
      if (id) ids.insert(id);
    }
  };
  switch (change.type) {
    case type_set:
    case type_change: need(ids_of(change.as<Set>().object, change.as<Set>().parts)); break;
    case type_place:
    case type_remove:
    case type_bind: break;
    case type_clear: is_about_all = true; return true;
    case type_frame:
    case type_accuracy:
    case type_max_stiffness:
    case type_clutch:
    case type_tool: is_about_view = true; return true;
    // A solid mesh and a radius exclude each other. So what sets the radius, to 0 too, must neither overtake what sets an object
    // nor be overtaken by it.
    case type_tool_radius: is_about_view = is_about_all = true; return true;
    case type_forget:
      is_forget = true;
      need({change.as<Forget>().id, 0, 0});
      return true;
    default: return false;
  }
  const std::string_view name = change.name();
  names.emplace(name);
  if (const std::string_view owner = name.substr(0, name.find('/')); change.is_foreign() && !owners.contains(owner)) {
    owners.emplace(owner);
  }
  return true;
}

void ParkedBatches::count(const ReceivedBatch& batch) {
  constexpr size_t map_cost = 256;  // in changes: a process can map only so many memory files
  names_.insert(batch.about.names.begin(), batch.about.names.end());
  (batch.is_request ? request_ids_ : ids_).insert(batch.about.ids.begin(), batch.about.ids.end());
  all_ += batch.about.is_about_all;
  view_ += batch.about.is_about_view;
  requests_ += batch.is_request;
  ++counted_;
  cost_ += std::max(batch.changes.size(), batch.changes.is_mapped() ? map_cost : 1);
}

void ParkedBatches::count_nothing() noexcept {
  names_.clear();
  ids_.clear();
  request_ids_.clear();
  all_ = view_ = cost_ = requests_ = counted_ = 0;
}

bool ParkedBatches::holds_up(const Subjects& about) const {
  if (cost_ == 0) return false;
  if (all_ || (view_ && about.is_about_view)) return true;
  if (about.is_about_all && requests_ < batches_.size()) return true;  // of the client's own objects: not after requests
  const auto is_in = [](const auto& keys) { return [&keys](const auto& key) { return keys.contains(key); }; };
  return std::any_of(about.names.begin(), about.names.end(), is_in(names_)) ||
         (about.is_forget && std::any_of(about.ids.begin(), about.ids.end(), is_in(ids_)));
}

void ParkedBatches::add(ReceivedBatch&& batch) {
  count(batch);
  batches_.push_back(std::move(batch));
}

bool ParkedBatches::take_forget(uint64_t id) {
  if (!needs(id)) return false;
  const auto found = std::find_if(batches_.begin(), batches_.end(), [id](const ReceivedBatch& batch) {
    return batch.about.is_forget && batch.about.ids.contains(id);
  });
  if (found == batches_.end()) return false;
  batches_.erase(found);
  count_nothing();
  return true;
}

bool ParkedBatches::count_next() {
  if (counted_ < batches_.size()) count(batches_[counted_]);
  return counted_ < batches_.size();
}

std::deque<ReceivedBatch> ParkedBatches::take_all() {
  is_retry_due_ = false;
  turns_until_retry_ = batches_.size() / few;
  count_nothing();
  return std::exchange(batches_, {});
}

}  // namespace fs
