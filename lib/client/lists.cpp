// What viewers, editors and bridges ask for: where the tools are, and how all objects move.
#include "base/error.h"
#include "client/remote_scene.h"

namespace fs {

// The server's word, for a clutch may have moved the frame there; with what an open group has.
fs_view RemoteScene::own_view(Call& call) {
  const wire::Target target = to_target(client_.c_str(), "client");
  auto out = request(call, wire::type_view, bytes_of(&target, 1)).as<fs_view>();
  if (!group_) return out;
  for (const Change& change : group_->changes) foresee(out, fs::Change{change.type, change.record});
  return out;
}

fs_view RemoteScene::view(const char* client) {
  Call call = enter();
  if (!client || client_ == client) return own_view(call);
  const wire::Target target = to_target(client, "client");
  return request(call, wire::type_view, bytes_of(&target, 1)).as<fs_view>();
}

// What may wait comes first: the scene's own objects are looked at with the lock.
std::vector<fs_motion> RemoteScene::motions(const char* client) {
  Call call = enter();
  const bool is_own = client && client_ == client;
  if (client && !*client) fail(FS_ERROR_NOT_FOUND, "client is '': no client of that name is connected");
  std::vector<fs_motion> others;
  if (!is_own) {
    const wire::Target target = to_target(client ? client : "", "client");
    others = request(call, wire::type_motions, bytes_of(&target, 1)).list<fs_motion>();
    if (client) return others;
  }
  catch_up(call);
  flush_ahead();
  std::vector<fs_motion> out = replica_->motions(nullptr);
  if (out.empty()) return others;
  out.insert(out.end(), others.begin(), others.end());
  return out;
}

}  // namespace fs
