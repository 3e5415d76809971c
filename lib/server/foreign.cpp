#include "server/foreign.h"

#include "base/error.h"
#include "base/text.h"
#include "server/clients.h"

namespace fs {

TargetObject find_target(const Client& asking, const wire::Target& target) {
  const std::string text = text_of(target.name);
  const size_t slash = text.find('/');
  const std::string client = slash == std::string::npos ? asking.name : text.substr(0, slash);
  const std::string name = slash == std::string::npos ? text : text.substr(slash + 1);
  if (client == "server") return {nullptr, asking.host.servo().scene(), name};
  const std::shared_ptr<Client> owner = asking.host.clients().share(client);
  if (!owner) {
    fail(FS_ERROR_NOT_FOUND, "name is '%s': no client '%s' is connected", shortened(text).c_str(), shortened(client).c_str());
  }
  return {owner, owner->scene, name};
}

TargetObject find_foreign(const Client& asking, const wire::Target& target) {
  TargetObject out = find_target(asking, target);
  if (out.owner.get() == &asking) {  // both ends keep track of own objects
    fail(FS_ERROR_INVALID, "name is '%s', must be of another client's object: its own ones have bare names",
         shortened(text_of(target.name)).c_str());
  }
  if (asking.host.settings().is_locked) {
    fail(FS_ERROR_DENIED, "name is '%s': this server lets a client change its own objects only",
         shortened(text_of(target.name)).c_str());
  }
  return out;
}

void ForeignGroup::add(const Client& editor, const Change& change, const std::string& name) {
  if (change.type == wire::type_edit) {
    const wire::Edit& edit = change.as<wire::Edit>();
    const uint32_t parts = parse_parts(edit.parts);
    fs_object present;
    const Ref<const Object> kept = group_.get(name.c_str(), present);
    LinkedObject linked = editor.assets.resolve(edit.object, parts, &present);
    put_text(linked.object.name, name);
    group_.change(linked.object, parts);
  } else if (change.type == wire::type_move_other) {
    const wire::MoveOther& move = change.as<wire::MoveOther>();
    group_.move(name.c_str(), move.pose, move.has_twist ? &move.twist : nullptr, move.time);
  } else {
    group_.remove(name.c_str());
  }
  names_[name] = change.type == wire::type_remove_other;
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
