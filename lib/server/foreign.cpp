#include "server/foreign.h"

#include "base/error.h"
#include "base/text.h"
#include "server/clients.h"

namespace fs {

TargetObject find_target(const Client& asking, std::string_view text) {
  const size_t slash = text.find('/');
  const std::string client(slash == std::string_view::npos ? asking.name : text.substr(0, slash));
  const std::string name(slash == std::string_view::npos ? text : text.substr(slash + 1));
  if (client == "server") return {nullptr, asking.host.servo().scene(), name};
  const std::shared_ptr<Client> owner = asking.host.clients().find(client);
  if (!owner) {
    fail(FS_ERROR_NOT_FOUND, "name is '%s': no client '%s' is connected", shortened(text).c_str(), shortened(client).c_str());
  }
  return {owner, owner->scene, name};
}

TargetObject find_foreign(const Client& asking, std::string_view name) {
  TargetObject out = find_target(asking, name);
  if (out.owner.get() == &asking) {  // both ends keep track of own objects
    fail(FS_ERROR_INVALID, "name is '%s', must be of another client's object: its own ones have bare names",
         shortened(name).c_str());
  }
  if (asking.host.settings().is_locked) {
    fail(FS_ERROR_DENIED, "name is '%s': this server lets a client change its own objects only", shortened(name).c_str());
  }
  return out;
}

void ForeignGroup::add(const Client& editor, const Change& change, const std::string& name) {
  if (change.type == wire::type_change) {
    const auto& set = change.as<wire::Set>();
    const uint32_t parts = parse_parts(set.parts);
    fs_object present;
    const Ref<const Object> kept = group_.get(name.c_str(), present);
    LinkedObject linked = editor.assets.resolve(set.object, parts, &present);
    put_text(linked.object.name, name);
    group_.change(linked.object, parts);
  } else if (change.type == wire::type_place) {
    const wire::Motion& motion = change.as<wire::Place>().motion;
    const bool has_twist = motion.horizon != wire::unknown_horizon;
    group_.move(name.c_str(), motion.pose, has_twist ? &motion.twist : nullptr, motion.time);
  } else {
    group_.remove(name.c_str());
  }
  names_[name] = change.type == wire::type_remove;
}

void ForeignGroup::tell(Client& editor) const {
  for (const auto& [name, is_removed] : names_) {
    ++editor.changed;
    if (owner_) {
      owner_->note_edit_by(editor.name, name, is_removed);
    } else {
      fs_event event{};
      event.kind = FS_EVENT_EDITED;
      put_text(event.name, name);
      put_text(event.text, editor.name);
      scene_->note(event);
    }
  }
  editor.host.note_activity();
}

}  // namespace fs
