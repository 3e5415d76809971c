// Finds the scene and object that a client means by "client/object", and changes objects of other scenes.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "scene/scene_group.h"
#include "server/client.h"

namespace fs {

// An object as a message names it.
struct TargetObject {
  std::shared_ptr<Client> owner;  // null: the server itself
  Ref<LocalScene> scene;          // the owner's
  std::string name;
  std::string full_name() const { return (owner ? owner->name : "server") + "/" + name; }
};
// NOT_FOUND: there is no such client. It does not look whether there is such an object.
TargetObject find_target(const Client& asking, std::string_view name);
// The same for an object that is to be changed. Also INVALID: it is the client's own; DENIED: the server is locked.
TargetObject find_foreign(const Client& asking, std::string_view name);

// Changes of objects of one other scene, all of which are made or none.
class ForeignGroup {
 public:
  explicit ForeignGroup(const TargetObject& target) : owner_(target.owner), scene_(target.scene), group_(scene_) {
    if (owner_) owner_->take_moves();  // that the owner made before this change
  }

  void add(const Client& editor, const Change& change, const std::string& name);
  void commit() { group_.commit(SIZE_MAX); }
  void tell(Client& editor) const;  // tells the owner of the changes that were made

 private:
  const std::shared_ptr<Client> owner_;
  const Ref<LocalScene> scene_;
  SceneGroup group_;
  std::map<std::string, bool> names_;  // of the objects; true: removed
};

}  // namespace fs
