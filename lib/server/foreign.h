// Objects of others: which scene and object a client means by "client/object", and the changes that it makes there. They
// are collected in a draft of that scene, and taken all at once or not at all.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "server/client.h"

namespace fs {

// An object as a message names it.
struct TargetObject {
  std::shared_ptr<Client> owner;  // null: the server itself
  Ref<LocalScene> scene;          // of the owner
  std::string name;
  std::string full_name() const { return (owner ? owner->name : "server") + "/" + name; }
};
// NOT_FOUND: there is no such client. Whether there is such an object is not looked at.
TargetObject find_target(const Client& asking, const wire::Target& target);
// The same for one that is to be changed. Also INVALID: it is the client's own; DENIED.
TargetObject find_foreign(const Client& asking, const wire::Target& target);

// Changes of objects of one other scene, beside a group that may be open there.
class ForeignEdit {
 public:
  explicit ForeignEdit(const TargetObject& target)
      : owner_(target.owner), scene_(target.scene), draft_(scene_->draft()) {}
  ~ForeignEdit() { scene_->discard(draft_); }
  ForeignEdit(const ForeignEdit&) = delete;
  ForeignEdit& operator=(const ForeignEdit&) = delete;

  Ref<const Object> get(const std::string& name, fs_object& out) const { return scene_->get(draft_, name.c_str(), out); }
  void add(const Client& editor, const Change& change, const std::string& name);
  void take() { scene_->take(draft_); }
  void tell(Client& editor) const;  // the owner, once they are taken

 private:
  const std::shared_ptr<Client> owner_;
  const Ref<LocalScene> scene_;
  LocalScene::Draft draft_;
  std::map<std::string, bool> names_;  // of the objects; true: removed
};

}  // namespace fs
