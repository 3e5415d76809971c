#include "client/group.h"

#include <algorithm>
#include <limits>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "transfer/records.h"

namespace fs {

const Assets& Group::assets(size_t i) const {
  static const Assets none;
  return i < assets_.size() ? assets_[i] : none;
}

bool Group::has(std::string_view name) const {
  const auto known = names_.find(name);
  return known != names_.end() ? known->second : replica_.objects.find(name) != nullptr;
}

bool Group::is_object(std::string_view name) const {
  const OwnObject* const own = replica_.objects.find(name);
  return has(name) && (names_.contains(name) || !(own && own->is_refused));
}

void Group::note_name(const std::string& name, bool is_there) {
  more_names_ += is_there - has(name);
  more_objects_ += is_there - is_object(name);
  names_[name] = is_there;
}

// Refused objects are not at the server: they have room of their own.
void Group::require_room(size_t objects, size_t changes) const {
  const OwnObjects& own = replica_.objects;
  const size_t most = replica_.max_objects, most_changes = wire::most_changes(replica_.max_objects);
  const size_t names = own.size() + static_cast<size_t>(more_names_) + objects;
  const size_t present = own.size() - own.refused_count() + static_cast<size_t>(more_objects_) + objects;
  if (objects && present > most) {
    fail(FS_ERROR_FULL, "this would be object %zu; the server allows a client %zu (max_objects)", present, most);
  }
  if (objects && names > 2 * most) {
    fail(FS_ERROR_FULL, "the scene would hold %zu objects, %zu of them refused: remove these", names, own.refused_count());
  }
  if (batch.size() + changes > most_changes) {
    fail(FS_ERROR_FULL, "the group would have %zu changes, must be at most %zu", batch.size() + changes, most_changes);
  }
}

void Group::require_room(const std::vector<std::string>& names, size_t changes) const {
  const std::set<std::string_view> distinct(names.begin(), names.end());
  const auto is_new = [&](std::string_view name) { return !is_object(name); };
  require_room(static_cast<size_t>(std::count_if(distinct.begin(), distinct.end(), is_new)), names.size() + changes);
}

void Group::add_object(wire::Type type, const char* name, uint32_t parts) {
  fs_object object;
  Ref<const Object> kept = replica_.scene->get(name, object);
  Assets assets = assets_of(*kept, parts);
  wire::Set set{0, parts, to_record(object)};
  for (double* time : {&set.object.time, &set.object.start}) {
    // The first instant of a virtual clock is 0, which in an object means "now": at the server that would be later.
    if (*time == 0) *time = std::numeric_limits<double>::min();
  }
  put_ids(set.object, ids_of(assets));
  if (type == wire::type_set) note_name(name, true);
  objects_.resize(batch.size() + 1);
  assets_.resize(batch.size() + 1);
  objects_.back() = std::move(kept);
  assets_.back() = std::move(assets);
  batch.add(type, set);
}

void Group::add_place(const char* name) {
  wire::Place place{{}, to_record(replica_.scene->movement(name).motion)};
  put_text(place.name, name);
  batch.add(wire::type_place, place);
}

void Group::add_remove(const char* name) {
  wire::Remove removal{};
  put_text(removal.name, name);
  note_name(name, false);
  batch.add(wire::type_remove, removal);
}

void Group::add_clear() { batch.add(wire::type_clear, {}); }

void Group::add_removes() {
  std::vector<std::string> present;
  for (const auto& [name, is_there] : names_) {
    if (is_there) present.push_back(name);
  }
  for (const auto& [name, object] : replica_.objects.all()) {
    if (!names_.contains(name)) present.push_back(name);
  }
  require_room(0, present.size());
  for (const std::string& name : present) add_remove(name.c_str());
}

void Group::add_frame() { batch.add(wire::type_frame, wire::Frame{replica_.scene->get_frame(nullptr)}); }

void Group::add_tool() {
  const std::vector<Vec3> points = replica_.scene->get_tool();
  wire::Tool tool{points.size(), {}};
  std::copy(points.begin(), points.end(), tool.points);
  batch.add(wire::type_tool, tool);
}

void Group::add_tool_radius() { batch.add(wire::type_tool_radius, wire::ToolRadius{replica_.scene->get_tool_radius()}); }

void Group::add_foreign(wire::Type type, std::span<const std::byte> record, Assets assets) {
  assets_.resize(batch.size() + 1);
  assets_.back() = std::move(assets);
  batch.add(type, record);
}

}  // namespace fs
