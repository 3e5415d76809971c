// What viewers, editors and bridges ask for: where the tools are, and how all objects move.
#include <algorithm>
#include <deque>

#include "base/error.h"
#include "scene/moment.h"
#include "server/session.h"

namespace fs {

Session* Session::find_client(const std::string& name) const {
  Session* const found = server_.find(name);
  if (!found && name != "server") {
    fail(FS_ERROR_NOT_FOUND, "client is '%.80s': no client of that name is connected", name.c_str());
  }
  return found;
}

void Session::tell_view(const Message& message) {
  const Session* const owner = find_client(text_of(message.as<wire::Target>().name));
  fs_view out = (owner ? *owner->scene_ : *server_.servo().scene()).view(false);
  if (owner == this) {  // as it was said, where that waits for a shape still
    for (const Unit& unit : parked_) {
      for (const Message& waiting : unit.messages) {
        foresee(out, static_cast<wire::Type>(waiting.header.type), waiting.body);
      }
    }
  }
  reply(message.header.serial, bytes_of(&out, 1));
}

// All at one instant, for no other message is looked at meanwhile; then written piece by piece, between which all have
// their turns.
void Session::tell_motions(const Message& message) {
  struct Listed {
    Listed(std::string the_prefix, const Ref<LocalScene>& scene) : prefix(std::move(the_prefix)), moment(scene, false) {}
    const std::string prefix;
    const LocalScene::Moment moment;
  };
  constexpr size_t piece = 256;
  const std::string client = text_of(message.as<wire::Target>().name);
  const Session* const only = client.empty() ? nullptr : find_client(client);
  std::vector<Session*> owners;
  for (const std::shared_ptr<Session>& session : server_.sessions()) {
    const bool is_wanted = client.empty() ? session.get() != this : session.get() == only;
    if (is_wanted && !session->is_gone_ && session->scene_) owners.push_back(session.get());
  }
  for (Session* const owner : owners) owner->take_moves();  // what they have moved before
  std::deque<Listed> all;
  if (!only) all.emplace_back("server/", server_.servo().scene());
  for (const Session* const owner : owners) all.emplace_back(owner->name_ + "/", owner->scene_);

  BlobWriter blob;
  wire::Count count{0};
  std::vector<fs_motion> motions;
  motions.reserve(piece);
  const auto write = [&] {
    blob.write(bytes_of(motions.data(), motions.size()));
    count.count += motions.size();
    motions.clear();
  };
  for (const Listed& listed : all) {
    listed.moment.for_each_motion(listed.prefix, [&](const fs_motion& motion) {
      motions.push_back(motion);
      if (motions.size() < piece) return;
      write();
      server_.turn_if_due();
    });
  }
  write();
  const Descriptor data = blob.seal();
  reply(message.header.serial, bytes_of(&count, 1), data.get());
}

}  // namespace fs
