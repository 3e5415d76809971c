#include "client/foreign_objects.h"

#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "transfer/records.h"

namespace fs {
namespace {

constexpr int most_gets = 4;  // of an object that others change again and again

// Leaves the object its own name without its client's, for checks.
void put_bare_name(fs_object& object) {
  const std::string name = text_of(object.name);
  put_text(object.name, name.substr(name.find('/') + 1));
}

// NOT_FOUND: it is too long.
void put_name(char (&field)[FS_NAME_SIZE], const char* name) { put_text(field, text_of(to_target(name, "name").name)); }

}  // namespace

Ref<const Object> ForeignObjects::get(Call& call, const char* name, fs_object& out) {
  if (const Group* const group = groups_.mine()) {
    if (const auto known = group->foreign.find(std::string_view(name)); known != group->foreign.end()) {
      if (!known->second.kept) fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object", shortened(name).c_str());
      out = known->second.object;
      return known->second.kept;
    }
  }
  const wire::Target target = to_target(name, "name");
  for (int i = 1;; ++i) {
    const auto record = line_.request(call, wire::type_get, target).as<wire::Object>();
    try {
      const LinkedObject received = fetched_.receive(call, record);
      Ref<const Object> object = parse_object(received.object, nullptr, false).object;
      out = received.object;
      put_text(out.name, name);
      return object;
    } catch (const Error& error) {  // the object was changed before all of it was fetched
      if (error.status != FS_ERROR_NOT_FOUND || i == most_gets) throw;
    }
  }
}

// Makes the object one that the group changes. May wait.
Group::Foreign& ForeignObjects::join_group(Call& call, Group& group, const char* name) {
  if (line_.connection.welcome().is_locked) {
    fail(FS_ERROR_DENIED, "name is '%s': this server lets a client change its own objects only", shortened(name).c_str());
  }
  Group::Foreign present;
  present.kept = get(call, name, present.object);
  group.require_room(0);
  return group.foreign.insert_or_assign(name, std::move(present)).first->second;
}

void ForeignObjects::change(Call& call, const fs_object& object, uint32_t parts, double now) {
  const std::string name = text_of(object.name);
  fs_object sent = merge_parts({}, object, parts);
  sent.struct_size = object.struct_size;
  put_text(sent.name, name);
  wire::Set change{wire::no_slot, parts, to_record(sent)};
  if (parts == 0) {  // only whether it is there
    fs_object present;
    get(call, name.c_str(), present);
    return;
  }
  if ((parts & FS_PART_POSE) && change.object.time == 0) change.object.time = now;
  if (Group* const group = groups_.mine()) return change_in_group(call, *group, object, change);
  // An asset that came from the server goes back by its number. Where the server offers it no longer, it is sent as new.
  const Assets assets = assets_of(object, parts);
  if (!try_change(call, assets, change, true)) try_change(call, assets, change, false);
}

void ForeignObjects::change_in_group(Call& call, Group& group, const fs_object& object, wire::Set& change) {
  const std::string name = text_of(object.name);
  Group::Foreign& present = join_group(call, group, name.c_str());
  fs_object whole = merge_parts(present.object, object, change.parts);
  put_bare_name(whole);
  const Ref<const Object> parsed = parse_object(whole, nullptr, false).object;
  Assets assets = assets_of(object, change.parts);
  put_ids(change.object, ids_of(assets));
  group.add_foreign(wire::type_change, bytes_of(&change, 1), std::move(assets));
  put_text(whole.name, name);
  present.object = whole;
  present.kept = parsed;
}

// may_refer: by the server's numbers. False: the server no longer offers one of these.
bool ForeignObjects::try_change(Call& call, const Assets& assets, wire::Set& change, bool may_refer) {
  bool refers = false;
  SendingAhead ahead(line_, sent_);  // also keeps them in use while the server answers
  AssetIds ids{};
  for (size_t i = 0; i < assets.size(); ++i) {
    if (!assets[i]) continue;
    ids[i] = may_refer ? fetched_.number_of(assets[i]) : 0;
    refers = refers || ids[i];
    if (ids[i]) continue;
    ahead.send(call, assets[i]);
    ids[i] = assets[i].serial();
  }
  put_ids(change.object, ids);
  try {
    line_.request(call, wire::type_change, change);
    return true;
  } catch (const NotOffered&) {
    if (!refers) throw;
    return false;
  }
}

void ForeignObjects::move(Call& call, const char* name, const Pose& pose, const fs_twist* twist, double time) {
  wire::Place place{{}, {pose, twist ? *twist : fs_twist{}, time, twist ? extrapolation_limit : wire::unknown_horizon}};
  put_name(place.name, name);
  Group* const group = groups_.mine();
  if (!group) {
    line_.request(call, wire::type_place, place);
    return;
  }
  Group::Foreign& present = join_group(call, *group, name);
  group->add_foreign(wire::type_place, bytes_of(&place, 1));
  present.object.pose = pose;
  present.object.twist = twist ? *twist : fs_twist{};
  present.object.time = time;
}

void ForeignObjects::remove(Call& call, const char* name) {
  wire::Remove removal{};
  put_name(removal.name, name);
  Group* const group = groups_.mine();
  if (!group) {
    line_.request(call, wire::type_remove, removal);
    return;
  }
  Group::Foreign& present = join_group(call, *group, name);
  group->add_foreign(wire::type_remove, bytes_of(&removal, 1));
  present.kept = nullptr;
}

}  // namespace fs
