#include "client/own_objects.h"

#include <string>

namespace fs {

OwnObject& OwnObjects::add(std::string_view name) {
  if (OwnObject* const present = find(name)) return *present;
  const auto added = objects_.emplace(name, OwnObject{}).first;
  added->second.name = &added->first;
  return added->second;
}

void OwnObjects::release(OwnObject& own) {
  if (own.is_ahead) {
    OwnObject** link = &ahead_;
    while (*link != &own) link = &(*link)->next_ahead;
    *link = own.next_ahead;
  }
  note_object(own, nullptr);
  note_refused(own, false);
}

void OwnObjects::drop(std::string_view name) {
  const auto found = objects_.find(name);
  if (found == objects_.end()) return;
  release(found->second);
  objects_.erase(found);
}

void OwnObjects::drop_all() {
  for (; ahead_; ahead_ = ahead_->next_ahead) ahead_->is_ahead = false;
  for (auto next = objects_.begin(); next != objects_.end(); next = objects_.erase(next)) release(next->second);
}

void OwnObjects::note_refused(OwnObject& own, bool is_refused) noexcept {
  refused_count_ += is_refused;
  refused_count_ -= own.is_refused;
  own.is_refused = is_refused;
}

void OwnObjects::note_object(OwnObject& own, const Object* object) {
  AssetIds used{};
  if (object) {
    own.has_lifetime = object->lifetime > 0;
    used = ids_of(assets_of(*object));
  }
  for (uint64_t& id : used) {
    if (!sent_.use(id)) id = 0;  // of another client
  }
  for (const uint64_t id : own.assets) sent_.stop_using(id);
  own.assets = used;
}

void OwnObjects::move_ahead(OwnObject& own, LocalScene& replica, const Pose& pose, const fs_twist* twist, double time) {
  if (!own.is_ahead) {
    own.movement = replica.movement(own.name->c_str());
    own.is_ahead = true;
    own.next_ahead = ahead_;
    ahead_ = &own;
  }
  own.movement.motion = own.movement.track.take(pose, twist, time);
}

void OwnObjects::move_replica(LocalScene& replica) {
  for (; ahead_; ahead_ = ahead_->next_ahead) {
    replica.set_movement(ahead_->name->c_str(), ahead_->movement);
    ahead_->is_ahead = false;
  }
}

}  // namespace fs
